//! How far a run is: a progress bar on standard error, if that is a terminal, and the time left.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::updates_per_second;
use crate::host::waiting::{duration, progress_bar};
use gdg::train::{Limits, Trainer};

/// Parts that the bar is divided into.
const BAR_PARTS: f64 = 1000.0;

/// Minimum time between two changes of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(250);

/// Progress of training towards its limits.
pub struct Progress {
    bar: ProgressBar,
    limits: Limits,
    /// Updates between evaluations, if there are any but that at the end.
    eval_every_updates: Option<u64>,
    /// Evaluations made by this process, and the time they took.
    evaluations: (u32, Duration),
    shown: Option<Instant>,
}

impl Progress {
    pub fn new(limits: &Limits, eval_every_updates: Option<u64>) -> Self {
        let ends = *limits != Limits::default();
        let template = if ends {
            "{bar:32} {percent:>3} %  {msg}"
        } else {
            "{spinner} {msg}  {elapsed_precise}"
        };
        let bar = progress_bar(ends.then_some(BAR_PARTS as u64), template);
        Self {
            bar,
            limits: *limits,
            eval_every_updates,
            evaluations: (0, Duration::ZERO),
            shown: None,
        }
    }

    /// Returns the estimated seconds until training ends and the run is evaluated, if that can be
    /// told. Evaluations count once there has been one.
    pub fn seconds_left(&self, trainer: &Trainer) -> Option<f64> {
        let (pace, updates) = (trainer.pace(), trainer.counters().updates);
        let left = pace.seconds_left(&self.limits)?;
        let (made, took) = self.evaluations;
        let updates_left = left * pace.per_second(|counters| counters.updates).unwrap_or(0.0);
        let end = updates + updates_left.round() as u64;
        let is_made = trainer.history().evaluations().last().is_some_and(|(at, _)| *at == updates);
        let from = if is_made { updates + 1 } else { updates };
        let due = evaluations_due(from, end, self.eval_every_updates);
        Some(left + due as f64 * took.as_secs_f64() / f64::from(made.max(1)))
    }

    pub fn evaluated(&mut self, took: Duration) {
        self.evaluations = (self.evaluations.0 + 1, self.evaluations.1 + took);
    }

    /// Updates the bar to the trainer's state, but not too often.
    pub fn show(&mut self, trainer: &Trainer) {
        if self.shown.is_some_and(|at| at.elapsed() < BAR_INTERVAL) {
            return;
        }
        let is_first = self.shown.replace(Instant::now()).is_none();
        if self.bar.is_hidden() {
            return;
        }
        if is_first {
            // Ticks need a thread, which may fail to start.
            self.bar.enable_steady_tick(BAR_INTERVAL);
        }
        let (updates, seconds) = (trainer.counters().updates, trainer.seconds());
        let left = self.seconds_left(trainer);
        let share = left.map_or(0.0, |left| seconds / (seconds + left));
        let left = left.map_or(String::new(), |left| format!("  {} left", duration(left)));
        let rate = updates_per_second(trainer);
        self.bar.set_message(format!("{updates} updates, {rate:.0}/s{left}"));
        self.bar.set_position((BAR_PARTS * share) as u64);
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Returns how many evaluations there are from an update to the end of training: some every so many
/// updates, and one at the end.
fn evaluations_due(from: u64, end: u64, every: Option<u64>) -> u64 {
    let before = |updates: u64| every.map_or(0, |every| updates.saturating_sub(1) / every);
    before(end).saturating_sub(before(from)) + 1
}

#[cfg(test)]
mod tests {
    use super::evaluations_due;

    #[test]
    fn evaluations_are_counted_to_the_one_at_the_end() {
        for (from, end, every, due) in [
            // That at 1,000 is still to come.
            (1_000, 8_000, Some(1_000), 8),
            (1_001, 8_000, Some(1_000), 7),
            (7_001, 8_500, Some(1_000), 2),
            (1_000, 8_000, None, 1),
            (8_000, 8_000, Some(1_000), 1),
        ] {
            assert_eq!(evaluations_due(from, end, every), due, "{from} to {end}");
        }
    }
}
