//! The progress bar on standard error, if that is a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::updates_per_second;
use crate::cli::TrainArgs;
use crate::progress_bar;
use gdg::train::Trainer;

/// Shows training progress towards the limit.
pub struct Progress {
    bar: ProgressBar,
    /// Where the position is the training time in milliseconds instead of updates: the seconds
    /// trained before.
    from_seconds: Option<f64>,
    started: bool,
}

impl Progress {
    /// Creates a bar towards `--max-updates`, else `--max-seconds`, else without an end, for a run
    /// that has been trained for `seconds` before.
    pub fn new(args: &TrainArgs, seconds: f64) -> Self {
        let from_seconds =
            (args.max_updates.is_none() && args.max_seconds.is_some()).then_some(seconds);
        let length = args.max_updates.or(args.max_seconds.map(|s| (s * 1000.0) as u64));
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
            // Ticks need a thread, which may not be had.
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
