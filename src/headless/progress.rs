//! How far a run is: a progress bar on standard error, if that is a terminal, and the time left.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::updates_per_second;
use crate::process::waiting::{duration, progress_bar};
use gdg::job::Stopwatch;
use gdg::text::counted;
use gdg::train::{Limits, Trainer};

/// Parts that the bar is divided into.
const BAR_PARTS: f64 = 1000.0;

/// Minimum time between two changes of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(250);

/// Progress of training towards its limits.
pub struct RunProgress {
    bar: ProgressBar,
    limits: Limits,
    /// When this process began to train, and the seconds trained before.
    began: (Stopwatch, f64),
    shown: Option<Instant>,
}

impl RunProgress {
    /// Creates the progress of a run that has been trained for `seconds` before.
    pub fn new(limits: &Limits, seconds: f64) -> Self {
        let ends = *limits != Limits::default();
        let template = if ends {
            "{bar:32} {percent:>3} %  {msg}"
        } else {
            "{spinner} {msg}  {elapsed_precise}"
        };
        let bar = progress_bar(ends.then_some(BAR_PARTS as u64), template);
        Self { bar, limits: *limits, began: (Stopwatch::start(), seconds), shown: None }
    }

    /// Returns the estimated seconds until training ends, if that can be estimated. What is not
    /// training, above all evaluations, is assumed to keep its share of the time.
    pub fn seconds_left(&self, trainer: &Trainer) -> Option<f64> {
        let (began, before) = self.began;
        let share = (trainer.seconds() - before) / began.elapsed().as_secs_f64();
        Some(trainer.pace().seconds_left(&self.limits)? / share.clamp(0.1, 1.0))
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
        let (done, rate) = (counted(updates, "update"), updates_per_second(trainer));
        self.bar.set_message(format!("{done}, {rate:.0}/s{left}"));
        self.bar.set_position((BAR_PARTS * share) as u64);
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
