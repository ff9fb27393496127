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

use super::{RandomStream, Result, Trainer, stream};
use crate::bridge::{BridgeGraph, Candidates, StoredGraph};
use crate::env::Region;
use crate::job::{Job, Running};
use crate::learn::{ChangedDistances, DistancesByGoal, Policy, Scratch, TrainingPhase, phase_time};
use crate::store::StoreError;
use crate::train::settings::Settings;

/// Candidates per build to which graph distances are found: the more, the more far pairs of a batch
/// have a waypoint for the actor. (With 32, 4 to 33 % of them had one on a map of 48,000 cells.)
pub(crate) const DISTILLED_GOALS: usize = 256;

/// Pairs of candidates whose distances a build checks for changes.
pub(crate) const CHECKED_PAIRS: usize = 300_000;

/// Least number of goals among the pairs that a build checks.
pub(crate) const MIN_CHECKED_GOALS: usize = 32;

/// A build takes effect after the interval between builds divided by this.
pub(crate) const ACTIVATION_DIVISOR: u64 = 4;

/// The same after an edit, when distances that have changed must be found as well.
pub(crate) const EDIT_ACTIVATION_DIVISOR: u64 = 2;

/// A build updates D of the edges from one in this many candidates.
pub(crate) const RENEWAL_ROUNDS: u64 = 2;

pub struct GraphJob {
    pub policy: Arc<dyn Policy>,
    pub candidates: Arc<Candidates>,
    pub before: Arc<BridgeGraph>,
    /// Which edges of it are due; without one, it exists, and only its distances are wanted.
    pub round: Option<u64>,
    pub finds_changed: bool,
    pub rng: ChaCha8Rng,
}

#[derive(Clone)]
pub struct BuiltGraph {
    pub at: u64,
    pub graph: Arc<BridgeGraph>,
    /// Sample of its distances to distil; none if it found no paths, or after an edit.
    pub distilled: Option<Arc<DistancesByGoal>>,
    pub longest_steps: f32,
    /// Whether an edit of the world has changed the graph since it was built: its distances are
    /// not known again until the next one.
    pub edited: bool,
    pub changed: Option<Arc<ChangedDistances>>,
    /// Time that building it took, until it is in a profile.
    pub took: Duration,
}

#[derive(Default)]
pub struct Graphs {
    pub current: Option<BuiltGraph>,
    /// The update at which the next graph takes effect, and that graph.
    next: Option<(u64, PendingGraph)>,
}

enum PendingGraph {
    Building(Building),
    Ready(BuiltGraph),
}

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
        // The place is this thread's alone.
        let build = move |building: &Job| drop(place.set(own.run(at, building)));
        let running = Running::start("bridge graph", Job::new("building the graph"), build);
        Self { at, job, result, running }
    }

    /// Waits for the graph; builds it if its thread has panicked.
    fn wait(&self) -> BuiltGraph {
        self.running.wait(Duration::MAX);
        self.result.get().cloned().unwrap_or_else(|| self.job.run(self.at, &Job::default()))
    }

    fn join(self) -> BuiltGraph {
        let Self { at, job, result, running } = self;
        running.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        result.get().cloned().unwrap_or_else(|| job.run(at, &Job::default()))
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StoredBuild {
    at: u64,
    due: u64,
    graph: StoredGraph,
    changed: Option<ChangedDistances>,
    /// The longest distance along the graph before the edit that has changed it since, if any.
    edited: Option<f32>,
}

impl GraphJob {
    /// Builds the graph; ends early once `job` is cancelled.
    fn run(&self, at: u64, job: &Job) -> BuiltGraph {
        crate::faults::point("graph");
        let began = phase_time();
        let (mut scratch, policy, candidates) =
            (Scratch::default(), &*self.policy, &self.candidates);
        let stages = 1 + usize::from(self.finds_changed);
        job.begin(0, stages);
        let graph = match self.round {
            None => self.before.clone(),
            Some(round) => {
                let is_due =
                    |i| (u64::from(candidates.id(i)) + round).is_multiple_of(RENEWAL_ROUNDS);
                Arc::new(self.before.renewed(job, candidates, is_due, policy, &mut scratch))
            }
        };
        let mut built = BuiltGraph::new(at, graph, &mut self.rng.clone());
        if let Some(by_goal) = built.distilled.as_ref().filter(|_| self.finds_changed) {
            job.begin(1, stages);
            let changed = built.graph.changed_distances(by_goal, policy, &mut scratch, job);
            built.changed = Some(Arc::new(changed));
        }
        BuiltGraph { took: phase_time().saturating_sub(began), ..built }
    }
}

impl BuiltGraph {
    fn new(at: u64, graph: Arc<BridgeGraph>, rng: &mut ChaCha8Rng) -> Self {
        let checked = (CHECKED_PAIRS / graph.candidates().len().max(1)).max(MIN_CHECKED_GOALS);
        let distilled = graph.distil(DISTILLED_GOALS, checked, rng);
        let longest_steps = distilled.as_ref().map_or(0.0, DistancesByGoal::longest_steps);
        let distilled = distilled.map(Arc::new);
        Self { distilled, edited: false, ..Self::edited(at, graph, longest_steps) }
    }

    /// Returns a graph whose distances are not known since an edit.
    fn edited(at: u64, graph: Arc<BridgeGraph>, longest_steps: f32) -> Self {
        let (distilled, changed, took) = (None, None, Duration::ZERO);
        Self { at, graph, distilled, longest_steps, edited: true, changed, took }
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
}

impl Graphs {
    pub fn building(&self) -> Option<&Job> {
        match &self.next {
            Some((_, PendingGraph::Building(building))) => Some(building.running.job()),
            _ => None,
        }
    }

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
}

impl Trainer {
    pub(super) fn relearns(&self) -> bool {
        self.counters.updates <= self.counters.relearns_until
    }

    pub(super) fn needs_graph(&self) -> bool {
        let Settings { learn, bridge, .. } = &self.run.settings;
        let wanted = learn.distillation > 0.0 || bridge.planned_episodes > 0.0;
        wanted && self.run.method.bridges()
    }

    /// Returns the update at which the first graph takes effect, if that is still to come.
    pub(super) fn first_graph_at(&self) -> Option<u64> {
        let every = self.run.settings.bridge.graph_every_updates;
        let next = every.saturating_mul(self.counters.updates / every + 1);
        let next = next.saturating_add(every / ACTIVATION_DIVISOR);
        let at = self.graphs.next.as_ref().map_or(next, |(due, _)| *due);
        (self.needs_graph() && self.graph().is_none()).then_some(at)
    }

    pub(super) fn refresh_graph(&mut self) -> Result<()> {
        if !self.needs_graph() {
            return Ok(());
        }
        let now = self.counters.updates;
        let is_due = self.graphs.next.as_ref().is_some_and(|(due, _)| *due <= now);
        let building = self.graphs.building().filter(|_| is_due);
        let _waiting = building.map(|job| self.job.add(job.clone()));
        if self.graphs.activate_due(now) {
            let took = self.graphs.current.as_ref().map_or(Duration::ZERO, |built| built.took);
            self.profile.add(TrainingPhase::GraphThread, took);
            self.with_step_context(|rollout, context| rollout.replan(context))?;
        }
        let is_time = now.is_multiple_of(self.run.settings.bridge.graph_every_updates);
        if is_time && self.graphs.next.is_none() {
            self.candidates.adapt_spacing();
            let round = now / self.run.settings.bridge.graph_every_updates;
            let before = self.graphs.current.as_ref().map(|built| built.graph.clone());
            let before = before.unwrap_or_else(|| self.empty_graph());
            self.start_graph(ACTIVATION_DIVISOR, before, Some(round))?;
        }
        Ok(())
    }

    /// Adapts the bridge graph to an edit of the world in `region`: at once what depends on that
    /// alone, and in the background its distances and those that have changed.
    pub(super) fn edit_graph(&mut self, region: &Region) -> Result<()> {
        let Some(current) = self.graphs.current.as_ref() else { return self.replace_graph() };
        let (candidates, policy) = (self.candidates.frozen(), self.policy()?);
        let near = candidates.near(region);
        let mut scratch = Scratch::default();
        let never = Job::default();
        let graph = current.graph.renewed(&never, &candidates, |i| near[i], &*policy, &mut scratch);
        let graph = Arc::new(graph);
        // Its distances are not known yet. Episodes stay as long as they were.
        let (at, longest_steps) = (self.counters.updates, current.longest_steps);
        self.graphs.current = Some(BuiltGraph::edited(at, graph.clone(), longest_steps));
        self.start_graph(EDIT_ACTIVATION_DIVISOR, graph, None)
    }

    pub(super) fn restore_graphs(&mut self, stored: [Option<StoredBuild>; 2]) -> Result<()> {
        let [current, next] = stored;
        self.graphs.current = current.map(|stored| self.restored_graph(stored)).transpose()?;
        if let Some(stored) = next {
            let due = stored.due;
            let ready = PendingGraph::Ready(self.restored_graph(stored)?);
            self.graphs.next = Some((due, ready));
        }
        Ok(())
    }

    fn restored_graph(&self, stored: StoredBuild) -> Result<BuiltGraph> {
        let misfit = "the stored distances do not fit their bridge graph";
        let StoredBuild { at, graph, changed, edited, .. } = stored;
        let graph = Arc::new(BridgeGraph::restored(self.spec(), &self.run.bridge(), graph)?);
        if let Some(longest_steps) = edited {
            StoreError::unless((0.0..f32::INFINITY).contains(&longest_steps), misfit)?;
            return Ok(BuiltGraph::edited(at, graph, longest_steps));
        }
        let count = graph.candidates().len();
        let built = BuiltGraph::new(at, graph, &mut self.graph_rng(at));
        let places = built.distilled.as_ref().map_or(&[][..], |by_goal| by_goal.checked_places());
        let fits = |ChangedDistances { goals, lower, upper }: &ChangedDistances| {
            goals == places
                && [lower.len(), upper.len()] == [goals.len() * count; 2]
                && lower.iter().all(|steps| steps.is_finite())
                && upper.iter().all(|steps| steps.is_finite() && *steps >= 0.0)
        };
        StoreError::unless(changed.as_ref().is_none_or(fits), misfit)?;
        Ok(BuiltGraph { changed: changed.map(Arc::new), ..built })
    }

    pub(super) fn replace_graph(&mut self) -> Result<()> {
        self.graphs = Graphs::default();
        if self.needs_graph() {
            let before = self.empty_graph();
            self.start_graph(ACTIVATION_DIVISOR, before, Some(0))?;
        }
        Ok(())
    }

    fn empty_graph(&self) -> Arc<BridgeGraph> {
        Arc::new(BridgeGraph::empty(self.spec(), &self.run.bridge()))
    }

    /// Starts building a bridge graph and finding the distances along it, which take effect after
    /// the interval between builds divided by `activation_divisor`.
    fn start_graph(
        &mut self,
        activation_divisor: u64,
        before: Arc<BridgeGraph>,
        round: Option<u64>,
    ) -> Result<()> {
        let now = self.counters.updates;
        let job = GraphJob {
            policy: self.policy()?,
            candidates: self.candidates.frozen(),
            before,
            round,
            finds_changed: self.relearns(),
            rng: self.graph_rng(now),
        };
        let delay = self.run.settings.bridge.graph_every_updates / activation_divisor;
        let next = PendingGraph::Building(Building::start(now, job));
        self.graphs.next = Some((now + delay.max(1), next));
        Ok(())
    }

    fn graph_rng(&self, at: u64) -> ChaCha8Rng {
        let mut rng = stream(self.run.seed, RandomStream::Graph);
        rng.set_word_pos(u128::from(at) << 34);
        rng
    }
}
