//! The bridge graph for exploration and distillation: built on its own thread, swapped in at a
//! fixed update.
//!
//! Building is too slow to block the learner. A build starts at one update, from copies of the
//! networks and candidates at that time, and takes effect at a fixed later update, no matter when
//! it finishes in between: the same seed gives the same run.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::bridge::{BridgeGraph, BridgeSettings, Candidates, StoredGraph};
use crate::env::Spec;
use crate::job::{Job, Running};
use crate::learn::{ChangedDistances, DistancesByGoal, Policy, Scratch};
use crate::store::StoreError;

/// Candidates per build to which graph distances are found: the more, the more far pairs of a batch
/// have a waypoint for the actor. (With 32, 4 to 33 % of them had one on a map of 48,000 cells.)
pub(crate) const DISTILLED_GOALS: usize = 256;

/// Number of pairs of candidates of which a build finds out whether their distance has changed, ...
pub(crate) const CHECKED_PAIRS: usize = 300_000;

/// ... to at least as many goals as this.
pub(crate) const MIN_CHECKED_GOALS: usize = 32;

/// A build takes effect after the interval between builds divided by this.
pub(crate) const ACTIVATION_DIVISOR: u64 = 4;

/// The same after an edit, when distances that have changed must be found as well.
pub(crate) const EDIT_ACTIVATION_DIVISOR: u64 = 2;

/// A build updates D of the edges from one in this many candidates.
pub(crate) const RENEWAL_ROUNDS: u64 = 2;

/// Where the graph of a build comes from.
pub enum GraphSource {
    /// From the graph before, or an empty one; the round says whose edges are due.
    Renewed { before: Arc<BridgeGraph>, round: u64 },
    /// It exists, and only its distances are wanted.
    Edited(Arc<BridgeGraph>),
}

pub struct GraphJob {
    pub policy: Arc<dyn Policy>,
    pub candidates: Arc<Candidates>,
    pub source: GraphSource,
    /// Whether to find the distances that have changed.
    pub finds_changed: bool,
    /// RNG for the distilled distances.
    pub rng: ChaCha8Rng,
}

#[derive(Clone)]
pub struct BuiltGraph {
    /// Update at which the build began.
    pub at: u64,
    /// The graph.
    pub graph: Arc<BridgeGraph>,
    /// Sample of its distances to distil; none if it found no paths, or after an edit.
    pub distilled: Option<Arc<DistancesByGoal>>,
    /// The longest of these distances, or of those of the graph before an edit.
    pub longest_steps: f32,
    /// Whether an edit of the world has changed the graph since it was built: its distances are
    /// not known again until the next one.
    pub edited: bool,
    /// The distances that have changed, if requested and any are known.
    pub changed: Option<Arc<ChangedDistances>>,
}

/// The current graph and the next one.
#[derive(Default)]
pub struct Graphs {
    current: Option<BuiltGraph>,
    /// The update at which the next graph takes effect, and that graph.
    next: Option<(u64, PendingGraph)>,
}

enum PendingGraph {
    Building(Building),
    Ready(BuiltGraph),
}

/// A build in the background; dropping it ends the build.
struct Building {
    at: u64,
    job: Arc<GraphJob>,
    result: Arc<OnceLock<BuiltGraph>>,
    running: Running<()>,
}

impl Building {
    fn start(at: u64, job: GraphJob) -> Self {
        let job = Arc::new(job);
        let result = Arc::new(OnceLock::new());
        let (own, place) = (job.clone(), result.clone());
        let build = move |building: &Job| {
            if let Some(built) = own.run(at, building) {
                // The place is this thread's alone.
                let _ = place.set(built);
            }
        };
        let running = Running::start("bridge graph", Job::new("building the graph"), build);
        Self { at, job, result, running }
    }

    /// Waits for the graph; builds it if its thread has panicked.
    fn wait(&self) -> BuiltGraph {
        self.running.wait(Duration::MAX);
        self.result.get().cloned().unwrap_or_else(|| self.job.finish(self.at))
    }

    /// Waits for the graph. If its thread panics, so does this one.
    fn join(self) -> BuiltGraph {
        let Self { at, job, result, running } = self;
        running.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        result.get().cloned().unwrap_or_else(|| job.finish(at))
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredBuild {
    /// Updates at which the build began and it takes effect.
    at: u64,
    due: u64,
    graph: StoredGraph,
    changed: Option<ChangedDistances>,
    /// The longest distance along the graph before the edit that has changed it since, if any.
    edited: Option<f32>,
}

impl GraphJob {
    /// Builds the graph; returns `None` once `job` is cancelled.
    fn run(&self, at: u64, job: &Job) -> Option<BuiltGraph> {
        crate::faults::point("graph");
        let (mut scratch, policy) = (Scratch::default(), &*self.policy);
        let candidates = &self.candidates;
        let stages = 1 + usize::from(self.finds_changed);
        job.begin(0, stages);
        let graph = match &self.source {
            GraphSource::Edited(graph) => graph.clone(),
            GraphSource::Renewed { before, round } => {
                let is_due =
                    |i| (u64::from(candidates.id(i)) + round).is_multiple_of(RENEWAL_ROUNDS);
                let s = &mut scratch;
                Arc::new(before.renewed(job, candidates, is_due, policy, s)?)
            }
        };
        let mut built = BuiltGraph::new(at, graph, &mut self.rng.clone());
        if self.finds_changed {
            job.begin(1, stages);
            if let Some(by_goal) = &built.distilled {
                let graph = &built.graph;
                let changed = graph.changed_distances(by_goal, policy, &mut scratch, job)?;
                built.changed = Some(Arc::new(changed));
            }
        }
        Some(built)
    }

    /// Builds the graph even if the job has been cancelled.
    fn finish(&self, at: u64) -> BuiltGraph {
        self.run(at, &Job::default()).unwrap_or_else(|| unreachable!("nobody cancels it"))
    }
}

impl BuiltGraph {
    fn new(at: u64, graph: Arc<BridgeGraph>, rng: &mut ChaCha8Rng) -> Self {
        let checked = (CHECKED_PAIRS / graph.candidates().len().max(1)).max(MIN_CHECKED_GOALS);
        let distilled = graph.distil(DISTILLED_GOALS, checked, rng);
        let longest_steps = distilled.as_ref().map_or(0.0, DistancesByGoal::longest_steps);
        Self {
            at,
            graph,
            longest_steps,
            edited: false,
            distilled: distilled.map(Arc::new),
            changed: None,
        }
    }

    /// Returns the `graph` that an edit has changed, without its distances. Episodes stay as long
    /// as they were.
    fn edited(at: u64, graph: Arc<BridgeGraph>, longest_steps: f32) -> Self {
        Self { at, graph, distilled: None, longest_steps, edited: true, changed: None }
    }

    fn stored(&self, due: u64) -> StoredBuild {
        StoredBuild {
            at: self.at,
            due,
            graph: self.graph.stored(),
            changed: self.changed.as_deref().cloned(),
            edited: self.edited.then_some(self.longest_steps),
        }
    }

    fn restore(
        spec: &Spec,
        settings: &BridgeSettings,
        stored: StoredBuild,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, StoreError> {
        let graph = Arc::new(BridgeGraph::restored(spec, settings, stored.graph)?);
        if let Some(longest_steps) = stored.edited {
            if !(0.0..f32::INFINITY).contains(&longest_steps) {
                return Err(StoreError::inconsistent(
                    "the longest distance of the stored bridge graph is out of range",
                ));
            }
            return Ok(Self::edited(stored.at, graph, longest_steps));
        }
        let count = graph.candidates().len();
        if let Some(ChangedDistances { goals, lower, upper }) = &stored.changed
            && (lower.len() != goals.len() * count
                || upper.len() != lower.len()
                || goals.iter().any(|goal| *goal as usize >= count)
                || lower.iter().any(|steps| !steps.is_finite())
                || upper.iter().any(|steps| !steps.is_finite() || *steps < 0.0))
        {
            return Err(StoreError::inconsistent(
                "the stored changes of distances do not fit their bridge graph",
            ));
        }
        let built = Self::new(stored.at, graph, &mut rng);
        let places = built.distilled.as_ref().map_or(&[][..], |by_goal| by_goal.checked_places());
        if stored.changed.as_ref().is_some_and(|changed| changed.goals != places) {
            return Err(StoreError::inconsistent(
                "the stored changes of distances are to other places than the bridge graph's",
            ));
        }
        Ok(Self { changed: stored.changed.map(Arc::new), ..built })
    }
}

impl Graphs {
    pub fn current(&self) -> Option<&BuiltGraph> {
        self.current.as_ref()
    }

    /// Starts a build at update `at` that takes effect `delay` updates later: on a thread of its
    /// own or, where none can be started, at once.
    pub fn start_build(&mut self, at: u64, delay: u64, job: GraphJob) {
        let next = PendingGraph::Building(Building::start(at, job));
        self.next = Some((at + delay.max(1), next));
    }

    /// Replaces the current graph with `graph`, the same one after an edit at update `at`.
    pub fn edit(&mut self, at: u64, graph: Arc<BridgeGraph>) {
        let longest_steps = self.current.as_ref().map_or(0.0, |built| built.longest_steps);
        self.current = Some(BuiltGraph::edited(at, graph, longest_steps));
    }

    pub fn has_next(&self) -> bool {
        self.next.is_some()
    }

    pub fn is_due(&self, now: u64) -> bool {
        self.next.as_ref().is_some_and(|(due, _)| *due <= now)
    }

    /// Returns the build of the next graph, if it goes on.
    pub fn building(&self) -> Option<&Job> {
        match &self.next {
            Some((_, PendingGraph::Building(building))) => Some(building.running.job()),
            _ => None,
        }
    }

    /// Swaps in the next graph if it is due at update `now`; returns whether it was.
    pub fn activate_due(&mut self, now: u64) -> bool {
        let Some((_, next)) = self.next.take_if(|(due, _)| *due <= now) else { return false };
        self.current = Some(match next {
            PendingGraph::Ready(built) => built,
            PendingGraph::Building(building) => building.join(),
        });
        true
    }

    pub fn stored(&self) -> [Option<StoredBuild>; 2] {
        let next = self.next.as_ref().map(|(due, next)| match next {
            PendingGraph::Ready(built) => built.stored(*due),
            PendingGraph::Building(building) => building.wait().stored(*due),
        });
        [self.current.as_ref().map(|built| built.stored(built.at)), next]
    }

    /// Restores the graphs that [`Self::stored`] returned; `rng` gives the RNG for the distilled
    /// distances of a build at an update.
    pub fn restored(
        spec: &Spec,
        settings: &BridgeSettings,
        [current, next]: [Option<StoredBuild>; 2],
        rng: impl Fn(u64) -> ChaCha8Rng,
    ) -> Result<Self, StoreError> {
        let built = |stored: StoredBuild| {
            let rng = rng(stored.at);
            BuiltGraph::restore(spec, settings, stored, rng)
        };
        let ready = |stored: StoredBuild| {
            let due = stored.due;
            Ok::<_, StoreError>((due, PendingGraph::Ready(built(stored)?)))
        };
        Ok(Self { current: current.map(built).transpose()?, next: next.map(ready).transpose()? })
    }
}
