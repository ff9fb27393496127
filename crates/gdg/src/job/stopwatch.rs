//! The time in which this program runs.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

/// The time between two looks at the clock, and the longest that counts: between two that are farther
/// apart, this program was stopped.
const LOOK: Duration = Duration::from_millis(200);
const LONGEST: Duration = Duration::from_secs(1);

/// Measures time. Of a stop of this program, as by Ctrl-Z, a second counts at most.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch(pub(crate) Duration);

impl Stopwatch {
    pub fn start() -> Self {
        static CLOCK: OnceLock<Mutex<Clock>> = OnceLock::new();
        let clock = || {
            let look = || loop {
                std::thread::sleep(LOOK);
                Self::start();
            };
            let looks = std::thread::Builder::new().name("clock".to_owned()).spawn(look).is_ok();
            let longest = if looks { LONGEST } else { Duration::MAX };
            Mutex::new(Clock { longest, seen: Instant::now(), ran: Duration::ZERO })
        };
        let mut clock = CLOCK.get_or_init(clock).lock();
        Self(clock.look(Instant::now()))
    }

    pub fn elapsed(self) -> Duration {
        Self::start().since(self)
    }

    pub fn since(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
}

struct Clock {
    longest: Duration,
    /// When it was looked at last, and for how long the program had run then.
    seen: Instant,
    ran: Duration,
}

impl Clock {
    fn look(&mut self, now: Instant) -> Duration {
        self.ran += (now - self.seen).min(self.longest);
        self.seen = now;
        self.ran
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_the_time_in_which_the_program_is_stopped_a_second_counts() {
        let began = Instant::now();
        let mut clock = Clock { longest: LONGEST, seen: began, ran: Duration::ZERO };
        // It is looked at while something takes a minute, then the program is stopped for an hour.
        let mut at = |seconds: f64| clock.look(began + Duration::from_secs_f64(seconds));
        let looks = (0..=300).map(|i| at(f64::from(i) / 5.0));
        assert_eq!(looks.last(), Some(Duration::from_mins(1)));
        assert_eq!(at(3_660.0), Duration::from_mins(1) + LONGEST);
    }

    #[test]
    fn what_takes_long_counts_as_a_whole() {
        let watch = Stopwatch::start();
        std::thread::sleep(LONGEST + LOOK);
        assert!(watch.elapsed() > LONGEST);
    }
}
