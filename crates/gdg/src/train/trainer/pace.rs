//! How fast a run trains, and how long it takes to its limits.

use super::Trainer;
use crate::train::run::{Counters, Limits};

/// The mean pace of a run in this process, from its first update on, or the first one with a bridge
/// graph if it needs one: what came before says nothing about how fast the next updates are.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Counters and seconds of training at that update, and now.
    from: (Counters, f64),
    now: (Counters, f64),
}

impl Pace {
    /// Returns how much of what `count` returns has come per second, if any has.
    pub fn per_second(&self, count: impl Fn(&Counters) -> u64) -> Option<f64> {
        let ((before, from), (after, now)) = (&self.from, &self.now);
        let done = count(after).saturating_sub(count(before)) as f64;
        let seconds = now - from;
        (done > 0.0 && seconds > 0.0).then(|| done / seconds)
    }

    /// Returns the seconds of training until the first of `limits`, if that can be told: of
    /// episodes it cannot, as they become shorter the more is learned.
    pub fn seconds_left(&self, limits: &Limits) -> Option<f64> {
        let (counters, seconds) = &self.now;
        let until = |limit: Option<u64>, count: fn(&Counters) -> u64| {
            let left = limit?.saturating_sub(count(counters)) as f64;
            if left > 0.0 { Some(left / self.per_second(count)?) } else { Some(0.0) }
        };
        let all = [
            limits.seconds.map(|limit| (limit - seconds).max(0.0)),
            until(limits.updates, |counters| counters.updates),
            until(limits.env_steps, |counters| counters.env_steps),
        ];
        all.into_iter().flatten().min_by(f64::total_cmp)
    }
}

impl Trainer {
    /// Returns the pace of the run so far.
    pub fn pace(&self) -> Pace {
        let now = (self.counters, self.seconds);
        Pace { from: self.paced_from.unwrap_or(now), now }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(updates: u64, episodes: u64, seconds: f64) -> (Counters, f64) {
        (Counters { updates, episodes, ..Counters::default() }, seconds)
    }

    #[test]
    fn the_time_left_follows_from_the_mean_pace_since_the_first_update() {
        // The warm-up took 60 s, and then 999 updates 10 s.
        let pace = Pace { from: at(1, 50, 60.0), now: at(1_000, 70, 70.0) };
        let updates = Limits { updates: Some(8_000), ..Limits::default() };
        assert_eq!(pace.seconds_left(&updates), Some(7_000.0 / 99.9));
        let left = |limits| pace.seconds_left(&limits);
        assert_eq!(left(Limits { seconds: Some(100.0), ..updates }), Some(30.0), "whichever first");
        assert_eq!(left(Limits { episodes: Some(80), ..Limits::default() }), None);
        assert_eq!(left(Limits { updates: Some(500), ..updates }), Some(0.0));
        assert_eq!(left(Limits::default()), None);
        // A run that was resumed half-way, at its first update.
        let resumed = Pace { from: at(4_001, 70, 300.0), now: at(4_001, 70, 300.0) };
        assert_eq!(resumed.seconds_left(&updates), None, "nothing is known yet");
        let resumed = Pace { now: at(4_101, 70, 302.0), ..resumed };
        assert_eq!(resumed.seconds_left(&updates), Some(3_899.0 / 50.0));
        assert_eq!(
            resumed.seconds_left(&Limits { seconds: Some(400.0), ..updates }),
            Some(3_899.0 / 50.0)
        );
    }
}
