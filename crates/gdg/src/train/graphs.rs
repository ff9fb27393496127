//! The bridge graph for exploration and distillation: built on its own thread, swapped in at a
//! fixed update.
//!
//! Building is too slow to block the learner. A build starts at one update, from copies of the
//! networks and candidates at that time, and takes effect at a fixed later update, no matter when
//! it finishes in between: the same seed gives the same run.

use std::sync::Arc;
use std::thread::JoinHandle;

use rand_chacha::ChaCha8Rng;

use crate::bridge::{BridgeGraph, BridgeSettings, Candidates, DistilledDistances, GraphState};
use crate::env::Spec;
use crate::learn::{ChangedDistances, Policy, Scratch};
use crate::store::{Store, StoreError};

/// Number of pairs of candidates per build whose graph distances are distilled, ...
pub(crate) const DISTILLED_PAIRS: usize = 300_000;

/// ... by following about this many edges: graphs of open maps have hundreds for each candidate,
/// ...
pub(crate) const DISTILLED_EDGES: usize = 8_000_000;

/// ... to at most as many goals as this, ...
pub(crate) const MAX_DISTILLED_GOALS: usize = 256;

/// ... and to at least as many as this.
pub(crate) const MIN_DISTILLED_GOALS: usize = 32;

/// A build takes effect after the interval between builds divided by this.
pub(crate) const ACTIVATION_DIVISOR: u64 = 4;

/// The same after an edit: plans and what has to be relearned depend on the graph, so training
/// waits for it.
pub(crate) const EDIT_ACTIVATION_DIVISOR: u64 = 20;

/// Inputs of a build.
pub struct GraphJob {
    pub spec: Spec,
    pub settings: BridgeSettings,
    pub policy: Arc<dyn Policy>,
    pub candidates: Arc<Candidates>,
    /// Whether to find the distances that have changed.
    pub finds_changed: bool,
    /// RNG for the distilled distances.
    pub rng: ChaCha8Rng,
}

/// A graph and its distilled distances.
#[derive(Clone)]
pub struct BuiltGraph {
    /// Update at which the build began.
    pub at: u64,
    /// The graph.
    pub graph: Arc<BridgeGraph>,
    /// Sample of its distances to distil.
    pub distilled: Arc<DistilledDistances>,
    /// The longest of these distances.
    pub longest_steps: f32,
    /// The distances that have changed, if requested.
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
    Building { at: u64, job: Arc<GraphJob>, result: JoinHandle<BuiltGraph> },
    Ready(BuiltGraph),
}

/// A graph in a checkpoint, with the updates at which its build began and it takes effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredGraph {
    /// Update at which the build began.
    pub at: u64,
    /// Update at which it takes effect.
    pub due: u64,
    /// The graph.
    pub state: GraphState,
    /// The distances that have changed, if requested.
    pub changed: Option<ChangedDistances>,
}

impl StoredGraph {
    /// Writes the graph to `store` under names starting with `prefix`.
    pub fn write(self, store: &mut Store, prefix: &str) {
        store.put(format!("{prefix}.when"), vec![self.at, self.due]);
        self.state.write(store, prefix);
        if let Some(ChangedDistances { goals, lower, upper }) = self.changed {
            store.put(format!("{prefix}.changed.goals"), goals);
            store.put(format!("{prefix}.changed.lower"), lower);
            store.put(format!("{prefix}.changed.upper"), upper);
        }
    }

    /// Reads the graph written by [`Self::write`], if there is one.
    ///
    /// # Errors
    /// A part is missing or has the wrong type or length.
    pub fn read(store: &Store, prefix: &str) -> Result<Option<Self>, StoreError> {
        let when = format!("{prefix}.when");
        if !store.has(&when) {
            return Ok(None);
        }
        let [at, due] = store.u64(&when)? else {
            return Err(StoreError::inconsistent(format!("its {when} does not have length 2")));
        };
        let names = ["goals", "lower", "upper"].map(|part| format!("{prefix}.changed.{part}"));
        let changed = store.has(&names[0]).then(|| {
            Ok::<_, StoreError>(ChangedDistances {
                goals: store.u32(&names[0])?.to_vec(),
                lower: store.f32(&names[1])?.to_vec(),
                upper: store.f32(&names[2])?.to_vec(),
            })
        });
        let changed = changed.transpose()?;
        Ok(Some(Self { at: *at, due: *due, state: GraphState::read(store, prefix)?, changed }))
    }
}

impl GraphJob {
    fn run(&self, at: u64) -> BuiltGraph {
        crate::faults::point("graph");
        let (mut scratch, mut rng) = (Scratch::default(), self.rng.clone());
        let graph = BridgeGraph::build(
            &self.spec,
            &self.settings,
            &self.candidates,
            &*self.policy,
            &mut scratch,
        );
        let built = BuiltGraph::new(at, graph, &mut rng);
        let changed =
            || Arc::new(built.graph.changed_distances(&*self.policy, &mut rng, &mut scratch));
        BuiltGraph { changed: self.finds_changed.then(changed), ..built }
    }
}

impl BuiltGraph {
    fn new(at: u64, graph: BridgeGraph, rng: &mut ChaCha8Rng) -> Self {
        let goals = DISTILLED_PAIRS / graph.candidates().len().max(1);
        let goals = goals.min(DISTILLED_EDGES / graph.edges().len().max(1));
        let distilled = graph.distil(goals.clamp(MIN_DISTILLED_GOALS, MAX_DISTILLED_GOALS), rng);
        let longest_steps = distilled.longest_steps();
        Self {
            at,
            graph: Arc::new(graph),
            longest_steps,
            distilled: Arc::new(distilled),
            changed: None,
        }
    }

    fn stored(&self, due: u64) -> StoredGraph {
        StoredGraph {
            at: self.at,
            due,
            state: self.graph.state(),
            changed: self.changed.as_deref().cloned(),
        }
    }

    /// # Errors
    /// `stored` was not saved from a matching run.
    fn restore(
        spec: &Spec,
        settings: &BridgeSettings,
        stored: &StoredGraph,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, StoreError> {
        let graph = BridgeGraph::from_state(spec, settings, &stored.state)?;
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
        Ok(Self {
            changed: stored.changed.clone().map(Arc::new),
            ..Self::new(stored.at, graph, &mut rng)
        })
    }
}

impl Graphs {
    /// Returns the current graph.
    pub fn current(&self) -> Option<&BuiltGraph> {
        self.current.as_ref()
    }

    /// Starts a build at update `at` that takes effect `delay` updates later: on a thread of its
    /// own or, where none can be started, at once.
    pub fn start_build(&mut self, at: u64, delay: u64, job: GraphJob) {
        let job = Arc::new(job);
        let own = job.clone();
        let result =
            std::thread::Builder::new().name("bridge graph".to_owned()).spawn(move || own.run(at));
        let next = match result {
            Ok(result) => PendingGraph::Building { at, job, result },
            Err(error) => {
                tracing::warn!("the bridge graph is built without a thread of its own: {error}");
                PendingGraph::Ready(job.run(at))
            }
        };
        self.next = Some((at + delay.max(1), next));
    }

    /// Returns whether the next graph is due at update `now`.
    pub fn is_due(&self, now: u64) -> bool {
        self.next.as_ref().is_some_and(|(due, _)| *due <= now)
    }

    /// Swaps in the next graph if it is due at update `now`; returns whether it was.
    pub fn activate_due(&mut self, now: u64) -> bool {
        let Some((_, next)) = self.next.take_if(|(due, _)| *due <= now) else { return false };
        self.current = Some(match next {
            PendingGraph::Ready(built) => built,
            PendingGraph::Building { result, .. } => {
                result.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            }
        });
        true
    }

    /// Returns the current and the next graph, for a checkpoint.
    pub fn state(&self) -> [Option<StoredGraph>; 2] {
        let next = self.next.as_ref().map(|(due, next)| match next {
            PendingGraph::Ready(built) => built.stored(*due),
            // Repeats the build, with the same result: saving can wait for it, training cannot.
            PendingGraph::Building { at, job, .. } => job.run(*at).stored(*due),
        });
        [self.current.as_ref().map(|built| built.stored(built.at)), next]
    }

    /// Restores the graphs that [`Self::state`] returned; `rng` gives the RNG for the distilled
    /// distances of a build at an update.
    ///
    /// # Errors
    /// The graphs were not saved from a matching run.
    pub fn restore(
        &mut self,
        spec: &Spec,
        settings: &BridgeSettings,
        state: &[Option<StoredGraph>; 2],
        rng: impl Fn(u64) -> ChaCha8Rng,
    ) -> Result<(), StoreError> {
        let built =
            |stored: &StoredGraph| BuiltGraph::restore(spec, settings, stored, rng(stored.at));
        let [current, next] = state;
        self.current = current.as_ref().map(built).transpose()?;
        self.next = match next {
            Some(stored) => Some((stored.due, PendingGraph::Ready(built(stored)?))),
            None => None,
        };
        Ok(())
    }
}
