//! Checkpoints of a run without the interface: now and then, and at its end.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use miette::Report;

use super::records::Record;
use crate::report::of_checkpoint;
use crate::text::{plain, tell};
use crate::train::{self, SaveTo, Trainer};

/// Time between two checkpoints unless something else is asked for.
const EVERY_MINUTES: f64 = 5.0;

/// Where checkpoints go, and when.
pub struct Saver {
    to: SaveTo,
    /// Time between two; `None` for the end alone.
    every: Option<Duration>,
    saved: Instant,
    /// The state that was saved last: updates, steps and evaluations.
    state: Option<(u64, u64, usize)>,
}

impl Saver {
    /// Saves to `to`, every `every_minutes` (default 5; 0 saves at the end alone).
    pub fn new(to: SaveTo, every_minutes: Option<f64>) -> Self {
        let minutes = every_minutes.unwrap_or(EVERY_MINUTES);
        let every = (minutes > 0.0).then(|| Duration::from_secs_f64(60.0 * minutes));
        Self { to, every, saved: Instant::now(), state: None }
    }

    /// The file that checkpoints go to.
    pub fn path(&self) -> &Path {
        self.to.path()
    }

    /// Whether the next one is due.
    pub fn is_due(&self) -> bool {
        self.every.is_some_and(|every| self.saved.elapsed() >= every)
    }

    /// Saves, unless exactly this is saved already; what is to be recorded.
    ///
    /// # Errors
    /// Why it could not be saved.
    pub fn save(&mut self, trainer: &mut Trainer) -> Result<Option<Record>, Report> {
        self.saved = Instant::now();
        let counters = trainer.counters();
        let state = Some((counters.updates, counters.env_steps, trainer.history().evaluations().len()));
        if self.state == state {
            return Ok(None);
        }
        // Having gone back for the last time, it has good networks all the same; the next update fails again.
        let _ = trainer.ensure_finite();
        let path: PathBuf = train::save(trainer, &self.to).map_err(of_checkpoint)?;
        let asked = self.to.path();
        if path != asked {
            let (asked, path) = (plain(&asked.to_string_lossy()), plain(&path.to_string_lossy()));
            tell(&format!("{asked} is another run's (--overwrite replaces it): saving to {path}"));
        }
        self.to = SaveTo::Own(path.clone());
        self.state = state;
        Ok(Some(Record::Saved { updates: trainer.counters().updates, path: path.to_string_lossy().into_owned() }))
    }
}
