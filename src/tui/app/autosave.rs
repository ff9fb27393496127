//! When the run is saved automatically.

use std::sync::Arc;
use std::time::Instant;

use gdg::map::Grid;
use gdg::train::Run;

/// What an autosave keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Content {
    /// Method, preset, seed and settings.
    pub run: Arc<Run>,
    /// The updates done.
    pub updates: u64,
    /// The map, if the world has one.
    pub map: Option<Arc<Grid>>,
}

/// The interval of autosaves, and what they have saved.
pub struct Autosave {
    /// Minutes between them; 0 for none.
    pub minutes: f64,
    since: Instant,
    /// What is being saved, and what was saved last.
    writing: Option<Content>,
    written: Option<Content>,
}

impl Autosave {
    /// Creates autosaves at an interval in minutes, the first one interval from now.
    pub fn every(minutes: f64) -> Self {
        Self { minutes, since: Instant::now(), writing: None, written: None }
    }

    /// Changes the interval, which begins now.
    pub fn set_interval(&mut self, minutes: f64) {
        (self.minutes, self.since) = (minutes, Instant::now());
    }

    /// Returns whether an interval is over, and begins the next one.
    pub fn is_due(&mut self) -> bool {
        let due = self.minutes > 0.0 && self.since.elapsed().as_secs_f64() > 60.0 * self.minutes;
        if due {
            self.since = Instant::now();
        }
        due
    }

    /// Returns whether `content` is worth a file: what has been saved already would take the place
    /// of an older one.
    pub fn wants(&self, content: &Content) -> bool {
        self.writing.is_none() && self.written.as_ref() != Some(content)
    }

    /// Begins to save something.
    pub fn begin(&mut self, content: Content) {
        self.writing = Some(content);
    }

    /// Handles a written file.
    pub fn done(&mut self) {
        self.written = self.writing.take();
    }

    /// Handles an error: perhaps it was the autosave that failed; then it is tried again.
    pub fn failed(&mut self) {
        self.writing = None;
    }
}
