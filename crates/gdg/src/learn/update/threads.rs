//! How many threads share an update: a fixed number, or as many as pay at the moment.
//!
//! A further thread helps if its core is idle. On a core that others use, it may be suspended in
//! the middle of a task while all others wait for it. Only the time that updates take shows which
//! is the case.

use std::time::Duration;

/// How many threads share the work of an update. The results do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threads {
    /// Always this number.
    Fixed(usize),
    /// The number that makes updates fastest, found again and again by trying others.
    Auto {
        /// The largest number to use.
        most: usize,
    },
}

impl Threads {
    /// Returns the best number of threads on this machine: at most one a core.
    pub fn auto() -> Self {
        Self::Auto { most: std::thread::available_parallelism().map_or(1, usize::from) }
    }

    /// Returns the number of threads of one of `parts` runs that share the machine: a fixed number
    /// is for each of them.
    #[must_use]
    pub fn share(self, parts: usize) -> Self {
        match self {
            Self::Auto { most } => Self::Auto { most: (most / parts).max(1) },
            Self::Fixed(_) => self,
        }
    }

    /// Returns the largest number of threads that may be used.
    pub fn most(self) -> usize {
        match self {
            Self::Fixed(number) | Self::Auto { most: number } => number,
        }
    }
}

impl From<usize> for Threads {
    fn from(number: usize) -> Self {
        Self::Fixed(number)
    }
}

/// Time over which the pace of the number in use is averaged: a few suspensions of a thread fit in.
const WINDOW: Duration = Duration::from_millis(50);

/// Minimum weight of earlier updates after one that takes longer than [`WINDOW`].
const MIN_KEPT: f64 = 0.75;

/// Updates before a trial may fail, if they are slower by [`FAR_SLOWER`], and before it may end.
const FIRST_LOOK: f64 = 2.0;
const SECOND_LOOK: f64 = 6.0;
const FAR_SLOWER: f64 = 1.5;

/// Minimum duration of a successful trial.
const TRIAL: Duration = Duration::from_millis(20);

/// Another number is better only if its updates take less than this share of the time.
const GAIN: f64 = 0.97;

/// A trial without success is followed by a pause of this many times what it has cost, so that
/// trials cost at most 1/40 of the time.
const PAUSE_PER_LOSS: f64 = 40.0;

/// The shortest pause after a trial without success.
const MIN_PAUSE: Duration = Duration::from_millis(50);

/// Time after which another number is tried though nothing has changed.
const TRIAL_EVERY: Duration = Duration::from_millis(200);

/// Seconds per update, averaged.
#[derive(Clone, Copy, Debug, Default)]
struct UpdateTime {
    seconds: f64,
    updates: f64,
}

impl UpdateTime {
    fn add(&mut self, seconds: f64, kept: f64) {
        self.seconds = self.seconds * kept + seconds;
        self.updates = self.updates * kept + 1.0;
    }

    /// Returns the mean time of an update; `None` before the first.
    fn mean(&self) -> Option<f64> {
        (self.updates > 0.0).then(|| self.seconds / self.updates)
    }
}

/// Updates with another number of threads than usual.
#[derive(Clone, Copy, Debug)]
struct Trial {
    /// Index of the number.
    at: usize,
    /// All but the first update, which wakes threads and fills their caches.
    pace: UpdateTime,
    /// Time of the first update.
    first: Option<f64>,
}

/// Chooses the number of threads from the time that updates take.
#[derive(Debug)]
pub struct Chooser {
    /// The numbers that are tried, ascending.
    numbers: Vec<usize>,
    /// What is known of each.
    paces: Vec<UpdateTime>,
    /// Index of the number in use, but for trials.
    usual: usize,
    trial: Option<Trial>,
    /// Whether the next trial without a reason is one of more threads, if there are any.
    goes_up: bool,
    /// Earliest time of the next trial.
    may_try_at: Duration,
    /// Time of the next trial without a reason.
    tries_at: Duration,
}

impl Chooser {
    /// Creates a chooser among 1, 2, 4 ... and `most` threads. It begins with `most`.
    pub fn new(most: usize) -> Self {
        let doubled = std::iter::successors(Some(1), |n| Some(2 * n));
        let numbers: Vec<usize> =
            doubled.take_while(|n| *n < most).chain(std::iter::once(most)).collect();
        Self {
            paces: vec![UpdateTime::default(); numbers.len()],
            usual: numbers.len() - 1,
            numbers,
            trial: None,
            goes_up: false,
            may_try_at: Duration::ZERO,
            tries_at: Duration::ZERO,
        }
    }

    pub fn threads(&self) -> usize {
        self.numbers[self.trial.map_or(self.usual, |trial| trial.at)]
    }

    /// Takes in that an update, which ended at time `now`, has taken `took` on
    /// [`Self::threads`].
    pub fn record(&mut self, now: Duration, took: Duration) {
        let took = took.as_secs_f64();
        if let Some(trial) = self.trial {
            self.record_trial(trial, now, took);
        } else {
            let kept = (1.0 - took / WINDOW.as_secs_f64()).max(MIN_KEPT);
            self.paces[self.usual].add(took, kept);
            self.trial = self.next_trial(now);
        }
    }

    fn record_trial(&mut self, mut trial: Trial, now: Duration, took: f64) {
        let Some(first) = trial.first else {
            self.trial = Some(Trial { first: Some(took), ..trial });
            return;
        };
        trial.pace.add(took, 1.0);
        self.trial = Some(trial);
        let UpdateTime { seconds, updates } = trial.pace;
        let slowness = seconds / updates / self.paces[self.usual].mean().unwrap_or(f64::INFINITY);
        let fails = updates >= FIRST_LOOK && slowness > FAR_SLOWER
            || updates >= SECOND_LOOK && slowness > 1.0;
        if !fails && (updates < SECOND_LOOK || seconds < TRIAL.as_secs_f64()) {
            return;
        }
        let lost = first + seconds - (updates + 1.0) * seconds / updates / slowness;
        let pause = Duration::try_from_secs_f64(PAUSE_PER_LOSS * lost.max(0.0));
        self.may_try_at = now + pause.unwrap_or(Duration::MAX / 2).max(MIN_PAUSE);
        self.trial = None;
        self.paces[trial.at] = trial.pace;
        self.goes_up = trial.at > self.usual;
        if slowness < GAIN {
            // The next number in this direction may be better still.
            self.usual = trial.at;
            self.tries_at = self.may_try_at;
        } else {
            self.goes_up = !self.goes_up;
            self.tries_at = now + TRIAL_EVERY;
        }
    }

    /// Returns the next trial if one is due: of a number that was better than the usual one is now,
    /// or, from time to time, of any.
    fn next_trial(&mut self, now: Duration) -> Option<Trial> {
        let usual = self.paces[self.usual];
        let pace =
            usual.mean().filter(|_| usual.updates >= FIRST_LOOK && now >= self.may_try_at)?;
        let up = Some(self.usual + 1).filter(|up| *up < self.numbers.len());
        let down = self.usual.checked_sub(1);
        let was_better = |at: &usize| self.paces[*at].mean().is_some_and(|p| p < GAIN * pace);
        let at = [down, up].into_iter().flatten().find(was_better).or_else(|| {
            if now < self.tries_at {
                return None;
            }
            if self.goes_up { up.or(down) } else { down.or(up) }
        })?;
        Some(Trial { at, pace: UpdateTime::default(), first: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type IsBusy = fn(Duration) -> bool;

    /// How long a busy core suspends a helper, and how long it lets one run.
    const SUSPENDED: Duration = Duration::from_millis(6);

    /// Returns the updates per second within 20 s of simulated time beside another program that
    /// `is_busy` at times: then updates wait for suspended helpers. An update takes `alone` on one
    /// thread and, on idle cores, is nearly as many times faster as there are threads; all vary by a
    /// tenth. Exploring takes a fifth of the time of an update.
    fn rate(is_busy: IsBusy, alone: Duration, mut chooser: Chooser) -> f64 {
        let (mut now, mut updates) = (Duration::ZERO, 0_u32);
        while now < Duration::from_secs(20) {
            let drawn = |salt: u32| {
                let mixed = (updates ^ salt).wrapping_mul(0x9E37_79B1);
                f64::from((mixed ^ mixed >> 15).wrapping_mul(0x85EB_CA77)) / f64::from(u32::MAX)
            };
            let threads = chooser.threads() as f64;
            let mut took = alone.mul_f64((0.95 + 0.1 * drawn(1)) * (0.2 + 0.8 / threads));
            let suspensions = (threads - 1.0) * took.div_duration_f64(SUSPENDED);
            if is_busy(now) && drawn(2) < suspensions {
                took += SUSPENDED.mul_f64(suspensions.max(1.0));
            }
            now += took;
            chooser.record(now, took);
            now += alone / 5;
            updates += 1;
        }
        f64::from(updates) / now.as_secs_f64()
    }

    #[test]
    fn it_is_nearly_as_fast_as_the_best_number_whatever_the_other_cores_do() {
        let loads: [(IsBusy, &[u64]); 3] = [
            (|_| false, &[400, 1_000, 15_000]),
            (|_| true, &[400, 1_000, 15_000]),
            (|now| now.as_secs() % 2 == 1, &[400, 1_000]),
        ];
        let fixed = |number| {
            let paces = vec![UpdateTime::default()];
            Chooser { numbers: vec![number], paces, usual: 0, ..Chooser::new(1) }
        };
        for most in [1, 2, 3, 4, 6] {
            for (load, (is_busy, durations)) in loads.into_iter().enumerate() {
                for alone in durations.iter().copied().map(Duration::from_micros) {
                    let rate = |chooser| rate(is_busy, alone, chooser);
                    let best = (1..=most).map(|number| rate(fixed(number))).fold(0.0, f64::max);
                    let ratio = rate(Chooser::new(most)) / best;
                    assert!(ratio > 0.95, "{alone:?}, load {load}, up to {most}: {ratio:.3}");
                }
            }
        }
    }

    #[test]
    fn a_number_that_is_far_slower_is_given_up_after_three_updates_and_not_tried_again_soon() {
        let mut chooser = Chooser::new(2);
        let (mut now, mut slow, mut on_one) = (Duration::ZERO, 0, 0);
        while now < Duration::from_secs(10) {
            let is_slow = chooser.threads() == 1;
            let took = Duration::from_millis(if is_slow { 100 } else { 1 });
            now += took;
            chooser.record(now, took);
            on_one = if is_slow { on_one + 1 } else { 0 };
            slow += u32::from(is_slow);
            assert!(on_one <= 3, "{on_one} updates in a row");
        }
        // 3 x 99 ms lost, at most 1/40 of the time.
        assert_eq!(slow, 3);
    }
}
