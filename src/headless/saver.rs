//! Periodic and final checkpoints of runs without the interface.

use std::path::{Path, PathBuf};
use std::time::Duration;

use miette::Report;

use crate::host::report::from_checkpoint_error;
use gdg::printing::eprint_line;
use gdg::text::sanitized;
use gdg::train::{self, SaveTo, Trainer};

/// Default time between checkpoints.
const DEFAULT_INTERVAL_MINUTES: f64 = 5.0;

/// Returns the time between checkpoints: `minutes`, otherwise the default; `None` for 0, which
/// saves only at the end.
pub fn save_interval(minutes: Option<f64>) -> Option<Duration> {
    let minutes = minutes.unwrap_or(DEFAULT_INTERVAL_MINUTES);
    (minutes > 0.0).then(|| Duration::from_secs_f64(60.0 * minutes))
}

pub struct Saver {
    to: SaveTo,
    /// The state saved last: updates, steps and evaluations.
    last_saved_state: Option<(u64, u64, usize)>,
}

impl Saver {
    pub fn new(to: SaveTo) -> Self {
        Self { to, last_saved_state: None }
    }

    pub fn path(&self) -> &Path {
        self.to.path()
    }

    /// Saves unless this state is already saved; returns the path it took. Rolls a diverged run
    /// back first.
    pub fn save(&mut self, trainer: &mut Trainer) -> Result<Option<PathBuf>, Report> {
        if self.has_saved(trainer) {
            return Ok(None);
        }
        if let Err(error) = trainer.ensure_finite() {
            // The networks are good even then, and can be saved; the next update fails again.
            eprint_line(&error.to_string());
        }
        let path: PathBuf = train::save(trainer, &self.to).map_err(from_checkpoint_error)?;
        trainer.world().take_warnings().iter().for_each(|warning| eprint_line(warning));
        let requested = self.to.path();
        if path != requested {
            let may_replace =
                train::is_checkpoint(requested) && matches!(self.to, SaveTo::CreateNew(_));
            let help = if may_replace { " (--overwrite replaces it)" } else { "" };
            let (requested, path) =
                (sanitized(&requested.to_string_lossy()), sanitized(&path.to_string_lossy()));
            eprint_line(&format!("{requested} {}{help}: saving to {path}", self.to.obstacle()));
        }
        self.to = SaveTo::Replace(path.clone());
        self.last_saved_state = Some(state(trainer));
        Ok(Some(path))
    }

    pub fn has_saved(&self, trainer: &Trainer) -> bool {
        self.last_saved_state == Some(state(trainer))
    }
}

/// Returns the counters that identify a state of `trainer`: updates, environment steps,
/// evaluations.
fn state(trainer: &Trainer) -> (u64, u64, usize) {
    let counters = trainer.counters();
    (counters.updates, counters.env_steps, trainer.history().evaluations().len())
}
