//! How fast a run trains, and how long it takes to its limits.

use super::Trainer;
use crate::train::graphs::ACTIVATION_DIVISOR;
use crate::train::run::{Counters, Limits};

/// How much longer an update takes once there is a bridge graph: 1.4 to 1.9 times, measured on the
/// four rooms, the city and the arm.
const SLOWDOWN: f64 = 1.6;

/// Counters and seconds at the first update in this process, or with these settings, or the first one
/// with a bridge graph if the run needs one.
#[derive(Clone, Copy, Debug)]
pub(super) struct PacedFrom {
    counters: Counters,
    seconds: f64,
    /// Whether no graph is still to come.
    is_steady: bool,
}

/// The mean pace of a run in this process.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Counters and seconds of training at the first update that counts, and now.
    from: (Counters, f64),
    now: (Counters, f64),
    /// Updates until there is a bridge graph, if one is still to come: those after it are slower.
    quick_updates: Option<u64>,
}

impl Pace {
    /// Returns how much of what `count` returns has come per second, if any has.
    pub fn per_second(&self, count: impl Fn(&Counters) -> u64) -> Option<f64> {
        let ((before, from), (after, now)) = (&self.from, &self.now);
        let done = count(after).saturating_sub(count(before)) as f64;
        let seconds = now - from;
        (done > 0.0 && seconds > 0.0).then(|| done / seconds)
    }

    /// Converts `seconds` at the pace so far to seconds with the slower updates that a bridge graph
    /// brings.
    fn slowed(&self, seconds: f64) -> f64 {
        let rate = self.per_second(|counters| counters.updates);
        match (self.quick_updates, rate) {
            (Some(updates), Some(rate)) => {
                seconds + (SLOWDOWN - 1.0) * (seconds - updates as f64 / rate).max(0.0)
            }
            _ => seconds,
        }
    }

    /// Returns the seconds of training until the first of `limits`, if that can be told: of
    /// episodes it cannot, as they become shorter the more is learned.
    pub fn seconds_left(&self, limits: &Limits) -> Option<f64> {
        let (counters, seconds) = &self.now;
        let until = |limit: Option<u64>, count: fn(&Counters) -> u64| {
            let left = limit?.saturating_sub(count(counters)) as f64;
            if left > 0.0 { Some(self.slowed(left / self.per_second(count)?)) } else { Some(0.0) }
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
    pub(super) fn note_pace(&mut self) {
        let is_steady = self.graph().is_some() || !self.needs_graph();
        if self.paced_from.is_none_or(|from| is_steady && !from.is_steady) {
            let (counters, seconds) = (self.counters, self.seconds);
            self.paced_from = Some(PacedFrom { counters, seconds, is_steady });
        }
    }

    /// Returns the pace of the run so far.
    pub fn pace(&self) -> Pace {
        let now = (self.counters, self.seconds);
        let Some(PacedFrom { counters, seconds, is_steady }) = self.paced_from else {
            return Pace { from: now, now, quick_updates: None };
        };
        let (updates, every) =
            (self.counters.updates, self.run.settings.bridge.graph_every_updates);
        let first = updates.next_multiple_of(every) + every / ACTIVATION_DIVISOR;
        let quick = self.graphs.next_at().unwrap_or(first).saturating_sub(updates);
        Pace { from: (counters, seconds), now, quick_updates: (!is_steady).then_some(quick) }
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
        let pace = Pace { from: at(1, 50, 60.0), now: at(1_000, 70, 70.0), quick_updates: None };
        let updates = Limits { updates: Some(8_000), ..Limits::default() };
        assert_eq!(pace.seconds_left(&updates), Some(7_000.0 / 99.9));
        let left = |limits| pace.seconds_left(&limits);
        assert_eq!(left(Limits { seconds: Some(100.0), ..updates }), Some(30.0), "whichever first");
        assert_eq!(left(Limits { episodes: Some(80), ..Limits::default() }), None);
        assert_eq!(left(Limits { updates: Some(500), ..updates }), Some(0.0));
        assert_eq!(left(Limits::default()), None);
        // A run that was resumed half-way, at its first update.
        let resumed = Pace { from: at(4_001, 70, 300.0), now: at(4_001, 70, 300.0), ..pace };
        assert_eq!(resumed.seconds_left(&updates), None, "nothing is known yet");
        let resumed = Pace { now: at(4_101, 70, 302.0), ..resumed };
        assert_eq!(resumed.seconds_left(&updates), Some(3_899.0 / 50.0));
        assert_eq!(
            resumed.seconds_left(&Limits { seconds: Some(400.0), ..updates }),
            Some(3_899.0 / 50.0)
        );
        // A tenth of the run is done, and the first graph comes at update 1250.
        let early = Pace { from: at(1, 1, 9.0), now: at(801, 9, 10.0), quick_updates: Some(449) };
        let left = early.seconds_left(&updates).expect("it is known");
        assert!((left - (449.0 + SLOWDOWN * 6750.0) / 800.0).abs() < 1e-9, "{left}");
        let soon = Limits { updates: Some(1_201), ..updates };
        assert_eq!(early.seconds_left(&soon), Some(0.5), "before that");
    }
}
