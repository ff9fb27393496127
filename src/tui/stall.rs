//! Notices that the trainer does not move, and what it waits for, such as an environment in another
//! process.

use std::time::{Duration, Instant};

use gdg::pulse::Pulse;

/// Time without a beat after which the screen says what is waited for.
const PATIENCE: Duration = Duration::from_secs(1);

/// How long the trainer has not moved, and why.
#[derive(Debug)]
pub struct Stall {
    beats: u64,
    moved: Instant,
    /// What it waits for, and for how many seconds so far.
    shown: Option<(&'static str, u64)>,
}

impl Default for Stall {
    fn default() -> Self {
        Self { beats: 0, moved: Instant::now(), shown: None }
    }
}

impl Stall {
    /// Looks at the trainer's pulse; returns whether there is something else to show.
    pub fn look(&mut self, pulse: &Pulse) -> bool {
        let beats = pulse.beats();
        if beats != self.beats {
            (self.beats, self.moved) = (beats, Instant::now());
        }
        let waits = Some(self.moved.elapsed()).filter(|time| *time >= PATIENCE);
        let shown =
            waits.and_then(|time| Some((pulse.activity_besides_training()?, time.as_secs())));
        std::mem::replace(&mut self.shown, shown) != shown
    }

    /// Returns what is waited for and for how long, if that is worth saying.
    pub fn text(&self) -> Option<String> {
        self.shown.map(|(what, seconds)| format!("waiting for {what} ({seconds} s)"))
    }
}
