//! A run as named arrays and texts, for checkpoints.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::recovery::LastGood;
use super::{Result, Trainer};
use crate::bridge::CandidatesState;
use crate::job::Job;
use crate::learn::Threads;
use crate::settings::Setting;
use crate::store::{Store, StoreError};
use crate::train::error::TrainError;
use crate::train::film::Film;
use crate::train::graphs::{Graphs, StoredGraph};
use crate::train::history::History;
use crate::train::memory;
use crate::train::registry::Registry;
use crate::train::rollout::RolloutState;
use crate::train::run::{Counters, Run};
use crate::train::settings::OutOfRange;
use crate::train::visits::Visits;

/// Names in the store: bridge candidates, and the current and the next bridge graph.
const CANDIDATES: &str = "bridge";
const GRAPHS: [&str; 2] = ["graph", "next_graph"];

/// Where the history is kept.
pub(in crate::train) const HISTORY: &str = "history";

/// Where what tells its world apart is kept.
pub(in crate::train) const FINGERPRINT: &str = "fingerprint";

/// Name in the store of the updates done by a learner, if fewer than those counted.
pub(in crate::train) const LEARNED: &str = "learned_updates";

/// Checkpointed state of a trainer besides networks, replay buffer and candidates.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrainerState {
    /// Progress of the run.
    pub counters: Counters,
    /// Training time so far, in seconds.
    pub seconds: f64,
    /// The agents and their RNG state.
    pub rollout: RolloutState,
    /// RNG state for batches.
    pub batch_rng: ChaCha8Rng,
}

impl Trainer {
    /// Returns everything needed to resume the run exactly where it stopped.
    ///
    /// # Errors
    /// The learner fails, or numbers are not finite.
    pub fn save(&self) -> Result<Store> {
        let mut store = Store::default();
        self.learner.save(&mut store)?;
        if !store.is_finite() {
            return Err(TrainError::NotFinite);
        }
        self.save_replay(&mut store)?;
        self.candidates.state().write(&mut store, CANDIDATES);
        self.rollout.excursions().write(&mut store)?;
        for (name, graph) in GRAPHS.iter().zip(self.graphs.state()) {
            if let Some(graph) = graph {
                graph.write(&mut store, name);
            }
        }
        store.put_text("world", self.world().kind());
        store.put_text("title", self.world().title());
        if let Some(fingerprint) = self.world().fingerprint() {
            store.put_text(FINGERPRINT, fingerprint);
        }
        if let Some(recorded) = self.world().abilities().recorded {
            recorded.save(&mut store);
        }
        self.visits.write(&mut store);
        store.put_json("run", &self.run)?;
        store.put_json("trainer", &self.state())?;
        store.put_json("success", &self.history.success())?;
        if self.learned_updates() != self.counters.updates {
            // For lists of checkpoints.
            store.put_json(LEARNED, &self.learned_updates())?;
        }
        store.put_json(HISTORY, &self.history)?;
        self.film.write(&mut store)?;
        Ok(store)
    }

    /// Restores the run that [`Self::save`] saved.
    ///
    /// # Errors
    /// The store is incomplete or inconsistent, or the run does not fit into memory.
    pub fn load(
        store: &Store,
        registry: &Arc<Registry>,
        threads: impl Into<Threads>,
    ) -> Result<Self> {
        Self::load_with(store, registry, threads, &Job::default())
    }

    /// Like [`Self::load`], and says how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// See [`Self::load`].
    pub fn load_with(
        store: &Store,
        registry: &Arc<Registry>,
        threads: impl Into<Threads>,
        progress: &Job,
    ) -> Result<Self> {
        let run: Run = store.json("run")?;
        let range = |OutOfRange(Setting { name, values, .. }): OutOfRange| {
            StoreError::inconsistent(format!("its setting {name} must be {values}"))
        };
        run.settings.validate().map_err(range)?;
        let world = registry.load_world(store)?;
        let state: TrainerState = store.json("trainer")?;
        memory::check(&run, &*world, registry)?;
        let mut trainer = Self::new(run, &*world, registry, threads)?;
        trainer.learner.load(store)?;
        trainer.load_replay(store, progress)?;
        trainer.candidates.restore(&CandidatesState::read(store, CANDIDATES)?)?;
        trainer.visits = Visits::read(store, trainer.world())?;
        trainer.rollout.excursions_mut().restore(world.spec(), store)?;
        let [current, next] = GRAPHS.map(|name| StoredGraph::read(store, name));
        let graphs = [current?, next?];
        // Format 1 has no history.
        let history = if store.texts().contains_key(HISTORY) {
            store.json(HISTORY)?
        } else {
            History::default()
        };
        trainer.restore(state, &graphs, history)?;
        trainer.film = Film::read(store, trainer.spec())?.fitting(trainer.world());
        Ok(trainer)
    }

    fn state(&self) -> TrainerState {
        TrainerState {
            counters: self.counters,
            seconds: self.seconds,
            rollout: self.rollout.state(),
            batch_rng: self.batch_rng.clone(),
        }
    }

    fn restore(
        &mut self,
        state: TrainerState,
        graphs: &[Option<StoredGraph>; 2],
        history: History,
    ) -> Result<()> {
        history.check(self.spec())?;
        state.counters.check()?;
        if !(0.0..1e12).contains(&state.seconds) {
            return Err(StoreError::inconsistent("the stored training time is out of range").into());
        }
        let mut restored = Graphs::default();
        restored.restore(self.spec(), &self.run.bridge(), graphs, |at| self.graph_rng(at))?;
        self.graphs = restored;
        let graph = self.graphs.current().map(|built| &*built.graph);
        self.rollout.restore(state.rollout, graph, &mut self.replay, &mut self.candidates)?;
        self.counters = state.counters;
        self.seconds = state.seconds;
        self.batch_rng = state.batch_rng;
        self.history = history;
        self.last_good =
            LastGood::capture(self.counters.updates, self.counters.losses, &*self.learner)?;
        if !self.last_good.is_finite() {
            let problem = "its networks contain non-finite values: the run had diverged";
            return Err(StoreError::inconsistent(problem).into());
        }
        Ok(())
    }
}
