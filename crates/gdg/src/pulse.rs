//! What a run is doing, that it moves, and the wish that it stops: shared by its thread and by
//! those that wait for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use parking_lot::Mutex;

use crate::faults;

/// What a run does unless it says otherwise.
const TRAINING: &str = "training";

/// How far some work is. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<Work>);

#[derive(Debug, Default)]
struct Work {
    /// The present stage, and the number of stages.
    stage: AtomicUsize,
    stages: AtomicUsize,
    /// What is done of the stage, and all of it.
    done: AtomicUsize,
    all: AtomicUsize,
}

impl Progress {
    /// Begins a stage, counted from 0, of the whole work.
    pub fn begin(&self, stage: usize, stages: usize) {
        self.set(0, 0);
        self.0.stages.store(stages, Ordering::Relaxed);
        self.0.stage.store(stage, Ordering::Relaxed);
    }

    /// Says how much of the present stage is done.
    pub fn set(&self, done: usize, all: usize) {
        self.0.done.store(done, Ordering::Relaxed);
        self.0.all.store(all, Ordering::Relaxed);
        faults::point("progress");
    }

    /// Returns the share of the whole work that is done, from 0 to 1; `None` unless it says so.
    pub fn share(&self) -> Option<f64> {
        let [stage, stages, done, all] = [&self.0.stage, &self.0.stages, &self.0.done, &self.0.all]
            .map(|number| number.load(Ordering::Relaxed) as f64);
        let of_stage = if all > 0.0 { done / all } else { 0.0 };
        (stages > 0.0).then(|| ((stage + of_stage) / stages).clamp(0.0, 1.0))
    }
}

/// Tells work in the background that its result is no longer wanted, and others how far it is.
/// Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Cancelled {
    is_set: Arc<AtomicBool>,
    progress: Progress,
}

impl From<&Progress> for Cancelled {
    /// Returns what nobody cancels and says to `progress` how far it is.
    fn from(progress: &Progress) -> Self {
        Self { is_set: Arc::default(), progress: progress.clone() }
    }
}

impl Cancelled {
    /// Returns whether the work should end.
    pub fn is_set(&self) -> bool {
        self.is_set.load(Ordering::Relaxed)
    }

    /// Returns how far the work is.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }
}

/// A claim on the result of background work: dropping it cancels the work.
#[derive(Debug)]
pub struct Wanted(Cancelled);

impl From<&Cancelled> for Wanted {
    fn from(cancelled: &Cancelled) -> Self {
        Self(cancelled.clone())
    }
}

impl Wanted {
    /// Returns how far the work is.
    pub fn progress(&self) -> &Progress {
        self.0.progress()
    }
}

impl Drop for Wanted {
    fn drop(&mut self) {
        self.0.is_set.store(true, Ordering::Relaxed);
    }
}

/// Shared by all clones.
#[derive(Clone, Debug)]
pub struct Pulse(Arc<State>);

#[derive(Debug)]
struct State {
    beats: AtomicU64,
    /// Whether training is to stop.
    stops: AtomicBool,
    /// What is being done besides training, by any of the runs, and since when.
    activities: Mutex<Vec<Doing>>,
}

/// What is being done besides training.
#[derive(Clone, Debug)]
pub struct Doing {
    /// Its name.
    pub name: &'static str,
    /// Since when.
    pub since: Instant,
    /// How far it is.
    pub progress: Progress,
}

impl Default for Pulse {
    fn default() -> Self {
        let (beats, stops) = (AtomicU64::new(0), AtomicBool::new(false));
        Self(Arc::new(State { beats, stops, activities: Mutex::default() }))
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

    /// Says what is being done until the result is dropped, as in "waiting for ACTIVITY".
    pub fn begin(&self, activity: &'static str) -> Activity {
        self.begin_with(activity, Progress::default())
    }

    /// Like [`Self::begin`], with how far it is.
    pub fn begin_with(&self, activity: &'static str, progress: Progress) -> Activity {
        self.beat();
        self.0.activities.lock().push(Doing { name: activity, since: Instant::now(), progress });
        Activity { pulse: self.clone(), name: activity }
    }

    /// Returns what is being done.
    pub fn activity(&self) -> &'static str {
        self.0.activities.lock().last().map_or(TRAINING, |doing| doing.name)
    }

    /// Returns what is being done besides training.
    pub fn busy(&self) -> Option<Doing> {
        self.0.activities.lock().last().cloned()
    }

    /// Wishes that training stops, after the update in progress.
    pub fn stop(&self) {
        self.0.stops.store(true, Ordering::Relaxed);
    }

    /// Returns whether training is to stop.
    pub fn stops(&self) -> bool {
        self.0.stops.load(Ordering::Relaxed)
    }
}

/// Something that is being done besides training.
#[derive(Debug)]
#[must_use]
pub struct Activity {
    pulse: Pulse,
    name: &'static str,
}

impl Drop for Activity {
    fn drop(&mut self) {
        let mut activities = self.pulse.0.activities.lock();
        if let Some(own) = activities.iter().rposition(|doing| doing.name == self.name) {
            activities.remove(own);
        }
        drop(activities);
        self.pulse.beat();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_is_being_done_ends_with_it() {
        let pulse = Pulse::default();
        assert_eq!(pulse.activity(), "training");
        let edit = pulse.begin("the edit");
        let graph = pulse.begin("the graph");
        assert_eq!(pulse.activity(), "the graph");
        drop(edit);
        assert_eq!(pulse.activity(), "the graph", "of another run");
        std::thread::sleep(Duration::from_millis(2));
        let busy = pulse.busy().expect("something");
        let time = busy.since.elapsed();
        assert!(busy.name == "the graph" && time >= Duration::from_millis(2), "{busy:?}");
        assert_eq!(busy.progress.share(), None, "it does not say");
        drop(graph);
        assert!(pulse.activity() == "training" && pulse.busy().is_none());
    }

    #[test]
    fn progress_is_that_of_all_stages() {
        let (work, mut shares) = (Cancelled::default(), Vec::new());
        let pulse = Pulse::default();
        let _graph = pulse.begin_with("the graph", Wanted::from(&work).progress().clone());
        for (stage, done) in [(0, 0), (0, 5), (0, 10), (1, 0), (1, 10)] {
            work.progress().begin(stage, 2);
            work.progress().set(done, 10);
            shares.push(pulse.busy().and_then(|doing| doing.progress.share()).unwrap_or(-1.0));
        }
        assert_eq!(shares, [0.0, 0.25, 0.5, 0.5, 1.0]);
    }
}
