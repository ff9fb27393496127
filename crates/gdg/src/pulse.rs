//! What a run is doing, that it moves, and the wish that it stops: shared by its thread and by those that wait for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use parking_lot::Mutex;

/// Shared by all clones.
#[derive(Clone, Debug, Default)]
pub struct Pulse(Arc<State>);

#[derive(Debug)]
struct State {
    beats: AtomicU64,
    /// Parts of updates are left out from this beat on.
    stop_at: AtomicU64,
    /// Whether any have been left out.
    has_left_out: AtomicBool,
    activity: Mutex<&'static str>,
}

impl Default for State {
    fn default() -> Self {
        Self {
            beats: AtomicU64::new(0),
            stop_at: AtomicU64::new(u64::MAX),
            has_left_out: AtomicBool::new(false),
            activity: Mutex::new("training"),
        }
    }
}

impl Pulse {
    /// Shows that something moves.
    pub fn beat(&self) {
        self.0.beats.fetch_add(1, Ordering::Relaxed);
    }

    /// Returns the number of beats so far.
    pub fn beats(&self) -> u64 {
        self.0.beats.load(Ordering::Relaxed)
    }

    /// Says what is being done, as in "waiting for ACTIVITY".
    pub fn begin(&self, activity: &'static str) {
        self.beat();
        *self.0.activity.lock() = activity;
    }

    /// Returns what is being done.
    pub fn activity(&self) -> &'static str {
        *self.0.activity.lock()
    }

    /// Wishes that training stops: an update in progress may be left unfinished.
    pub fn stop(&self) {
        self.stop_at(0);
    }

    /// Like [`Self::stop`], from this beat on.
    pub fn stop_at(&self, beat: u64) {
        self.0.stop_at.store(beat, Ordering::Relaxed);
    }

    /// Returns whether the next part of an update is to be left out.
    pub fn leaves_out(&self) -> bool {
        let stops = self.beats() >= self.0.stop_at.load(Ordering::Relaxed);
        if stops {
            self.0.has_left_out.store(true, Ordering::Relaxed);
        }
        stops
    }

    /// Returns whether parts have been left out since the last call.
    pub fn take_left_out(&self) -> bool {
        self.0.has_left_out.swap(false, Ordering::Relaxed)
    }
}
