//! Periodic and final checkpoints of a run without the interface.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use miette::Report;

use super::records::Record;
use crate::report::of_checkpoint;
use crate::text::{plain, tell};
use crate::train::{self, SaveTo, Trainer};

/// Default time between checkpoints.
const EVERY_MINUTES: f64 = 5.0;

/// Where and when to save checkpoints.
pub struct Saver {
    to: SaveTo,
    /// Time between checkpoints; `None` to save only at the end.
    every: Option<Duration>,
    saved: Instant,
    /// The state saved last: updates, steps and evaluations.
    state: Option<(u64, u64, usize)>,
}

impl Saver {
    /// Creates a saver to `to`, every `every_minutes` (default 5; 0 saves only at the end).
    pub fn new(to: SaveTo, every_minutes: Option<f64>) -> Self {
        let minutes = every_minutes.unwrap_or(EVERY_MINUTES);
        let every = (minutes > 0.0).then(|| Duration::from_secs_f64(60.0 * minutes));
        Self { to, every, saved: Instant::now(), state: None }
    }

    /// Returns the path of the checkpoints.
    pub fn path(&self) -> &Path {
        self.to.path()
    }

    /// Whether the next checkpoint is due.
    pub fn is_due(&self) -> bool {
        self.every.is_some_and(|every| self.saved.elapsed() >= every)
    }

    /// Saves unless this state is already saved; returns the record to print.
    ///
    /// # Errors
    /// The checkpoint cannot be saved.
    pub fn save(&mut self, trainer: &mut Trainer) -> Result<Option<Record>, Report> {
        self.saved = Instant::now();
        let counters = trainer.counters();
        let state = Some((counters.updates, counters.env_steps, trainer.history().evaluations().len()));
        if self.state == state {
            return Ok(None);
        }
        // Even when no rollbacks are left, the networks are good and can be saved; the next update fails again.
        let _ = trainer.ensure_finite();
        let path: PathBuf = train::save(trainer, &self.to).map_err(of_checkpoint)?;
        let asked = self.to.path();
        if path != asked {
            let (asked, path) = (plain(&asked.to_string_lossy()), plain(&path.to_string_lossy()));
            tell(&format!("{asked} belongs to another run (--overwrite replaces it): saving to {path}"));
        }
        self.to = SaveTo::Own(path.clone());
        self.state = state;
        Ok(Some(Record::Saved { updates: trainer.counters().updates, path: path.to_string_lossy().into_owned() }))
    }
}
