//! The progress bar on standard error, if that is a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::updates_per_second;
use crate::host::progress_bar;
use gdg::train::{Limits, Trainer};

/// Shows training progress towards the limit.
pub struct Progress {
    bar: ProgressBar,
    /// Where the position is the training time in milliseconds instead of updates: the seconds
    /// trained before.
    from_seconds: Option<f64>,
    started: bool,
}

impl Progress {
    /// Creates a bar towards the limit of updates, else of seconds, else without an end, for a run
    /// that has been trained for `seconds` before.
    pub fn new(limits: &Limits, seconds: f64) -> Self {
        let from_seconds =
            (limits.updates.is_none() && limits.seconds.is_some()).then_some(seconds);
        let left = limits.seconds.map(|until| ((until - seconds) * 1000.0).round() as u64);
        let length = limits.updates.or(left);
        let bar = ProgressBar::with_draw_target(length, progress_bar::target());
        let template = match length {
            Some(_) => "{bar:32} {percent:>3} %  {msg}  {eta_precise} left",
            None => "{spinner} {msg}  {elapsed_precise}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, from_seconds, started: false }
    }

    /// Updates the bar to the trainer's state.
    pub fn show(&mut self, trainer: &Trainer) {
        let updates = trainer.counters().updates;
        self.bar.set_message(format!("{updates} updates, {:.0}/s", updates_per_second(trainer)));
        let position =
            self.from_seconds.map_or(updates, |from| ((trainer.seconds() - from) * 1000.0) as u64);
        self.bar.set_position(position);
        if !self.started {
            // A resumed run's earlier progress says nothing about the remaining time.
            self.started = true;
            self.bar.reset_eta();
            // Ticks need a thread, which may fail to start.
            if !self.bar.is_hidden() {
                self.bar.enable_steady_tick(Duration::from_millis(250));
            }
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
