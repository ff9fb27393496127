//! The bridge graph that training explores and distils by: built on a thread of its own, taken up at a fixed update.
//!
//! Building takes too long to hold the learner up for. A build begins at one update, from copies of what is known
//! then, and its result counts from a later one on, whenever it is done in between: so that the same seed gives the
//! same run.

use std::sync::Arc;
use std::thread::JoinHandle;

use rand_chacha::ChaCha8Rng;

use crate::bridge::{BridgeGraph, BridgeSettings, Candidates, Distilled, GraphState};
use crate::env::Spec;
use crate::learn::{Policy, Scratch};
use crate::store::{Store, StoreError};

/// Candidates whose graph distances are distilled between two builds.
const DISTILLED_GOALS: usize = 32;

/// The part of the updates between two builds after which a build counts.
const JOIN_AFTER: u64 = 4;

/// All that a build needs.
pub struct GraphJob {
    pub spec: Spec,
    pub settings: BridgeSettings,
    pub policy: Arc<dyn Policy>,
    pub candidates: Arc<Candidates>,
    /// Draws what is distilled.
    pub rng: ChaCha8Rng,
}

/// A graph and what follows from it.
#[derive(Clone)]
pub struct Built {
    /// Update at which the build began.
    pub at: u64,
    /// The graph.
    pub graph: Arc<BridgeGraph>,
    /// Some of its distances, to be distilled.
    pub distilled: Arc<Distilled>,
}

/// The graph in use and the one to come.
#[derive(Default)]
pub struct Graphs {
    current: Option<Built>,
    /// The update from which on the next one counts, and the next one.
    next: Option<(u64, Next)>,
}

enum Next {
    Building { at: u64, job: Arc<GraphJob>, result: JoinHandle<Built> },
    Ready(Built),
}

/// A graph for a checkpoint: when its build began, from when it counts, and the graph itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredGraph {
    /// Update at which the build began.
    pub at: u64,
    /// Update from which on it counts.
    pub due: u64,
    /// The graph.
    pub state: GraphState,
}

impl StoredGraph {
    /// Writes the graph to `store`, its names beginning with `prefix`.
    pub fn write(self, store: &mut Store, prefix: &str) {
        store.put(format!("{prefix}.when"), vec![self.at, self.due]);
        self.state.write(store, prefix);
    }

    /// Reads what [`Self::write`] wrote, if it wrote anything.
    ///
    /// # Errors
    /// That a part is missing, of another type or length.
    pub fn read(store: &Store, prefix: &str) -> Result<Option<Self>, StoreError> {
        let when = format!("{prefix}.when");
        if !store.has(&when) {
            return Ok(None);
        }
        let [at, due] = store.u64(&when)? else {
            return Err(StoreError::misfit(format!("its {when} is of another length than 2")));
        };
        Ok(Some(Self { at: *at, due: *due, state: GraphState::read(store, prefix)? }))
    }
}

impl GraphJob {
    fn carry_out(&self, at: u64) -> Built {
        crate::faults::point("graph");
        let graph =
            BridgeGraph::build(&self.spec, &self.settings, &self.candidates, &*self.policy, &mut Scratch::default());
        Built::of(at, graph, self.rng.clone())
    }
}

impl Built {
    fn of(at: u64, graph: BridgeGraph, mut rng: ChaCha8Rng) -> Self {
        let distilled = graph.distil(DISTILLED_GOALS, &mut rng);
        Self { at, graph: Arc::new(graph), distilled: Arc::new(distilled) }
    }
}

impl Graphs {
    /// The graph in use.
    pub fn current(&self) -> Option<&Built> {
        self.current.as_ref()
    }

    /// Begins a build at update `at`, of `every` so many.
    ///
    /// # Errors
    /// That a thread cannot be started.
    pub fn begin(&mut self, at: u64, every: u64, job: GraphJob) -> std::io::Result<()> {
        let job = Arc::new(job);
        let own = job.clone();
        let result = std::thread::Builder::new().name("bridge graph".to_owned()).spawn(move || own.carry_out(at))?;
        self.next = Some((at + (every / JOIN_AFTER).max(1), Next::Building { at, job, result }));
        Ok(())
    }

    /// Takes the next graph up where it counts from update `now` on; whether it did.
    pub fn take_up(&mut self, now: u64) -> bool {
        let Some((_, next)) = self.next.take_if(|(due, _)| *due <= now) else { return false };
        self.current = Some(match next {
            Next::Ready(built) => built,
            Next::Building { result, .. } => result.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
        });
        true
    }

    /// The graph in use and the one to come, for a checkpoint.
    pub fn state(&self) -> [Option<StoredGraph>; 2] {
        let stored = |due: u64, built: &Built| StoredGraph { at: built.at, due, state: built.graph.state() };
        let next = self.next.as_ref().map(|(due, next)| match next {
            Next::Ready(built) => stored(*due, built),
            // A second time, and with the same result: whoever saves can wait longer than training.
            Next::Building { at, job, .. } => stored(*due, &job.carry_out(*at)),
        });
        [self.current.as_ref().map(|built| stored(built.at, built)), next]
    }

    /// Takes up what [`Self::state`] gave; `rng` draws what a build at an update distils.
    ///
    /// # Errors
    /// Where the graphs were not saved from such a run.
    pub fn restore(
        &mut self,
        spec: &Spec,
        settings: &BridgeSettings,
        state: &[Option<StoredGraph>; 2],
        rng: impl Fn(u64) -> ChaCha8Rng,
    ) -> Result<(), StoreError> {
        let built = |stored: &StoredGraph| {
            Ok::<_, StoreError>(Built::of(
                stored.at,
                BridgeGraph::from_state(spec, settings, &stored.state)?,
                rng(stored.at),
            ))
        };
        let [current, next] = state;
        self.current = current.as_ref().map(built).transpose()?;
        self.next = match next {
            Some(stored) => Some((stored.due, Next::Ready(built(stored)?))),
            None => None,
        };
        Ok(())
    }
}
