//! What a checkpoint keeps of a run.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Result, Trainer};
use crate::job::Job;
use crate::learn::Threads;
use crate::settings::Setting;
use crate::store::{Store, StoreError};
use crate::train::error::TrainError;
use crate::train::history::History;
use crate::train::memory;
use crate::train::registry::Registry;
use crate::train::run::Run;
use crate::train::score::Success;
use crate::train::settings::OutOfRange;

/// A saved run.
#[derive(Clone, Debug)]
pub struct Saved {
    /// What lists of checkpoints show.
    pub about: About,
    /// What curves are drawn from.
    pub history: History,
    /// The rest.
    pub state: Store,
}

/// What lists of checkpoints show of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Kind of its world.
    pub world: String,
    /// Title of its world: the map's name.
    pub title: String,
    /// What tells its world apart from others of its title.
    pub fingerprint: Option<String>,
    /// Method, preset, seed and settings.
    pub run: Run,
    /// Updates done by a learner.
    pub updates: u64,
    /// Latest evaluation result, if the run was evaluated before saving.
    pub success: Option<Success>,
}

impl Trainer {
    /// Returns everything needed to resume the run exactly where it stopped.
    pub fn save(&self) -> Result<Saved> {
        let mut state = Store::default();
        self.learner.save(&mut state)?;
        if !state.is_finite() {
            return Err(TrainError::NotFinite);
        }
        if let Some(recorded) = self.world().abilities().recorded {
            recorded.save(&mut state);
        }
        self.save_replay(&mut state)?;
        self.rollout.save(&mut state)?;
        state.put("candidates", &self.candidates)?;
        state.put("graphs", &self.graphs.stored())?;
        state.put("visits", &self.visits)?;
        state.put("film", &self.film)?;
        state.put("counters", &self.counters)?;
        state.put("seconds", &self.seconds)?;
        state.put("batch_rng", &self.batch_rng)?;
        let about = About {
            world: self.world().kind().to_owned(),
            title: self.world().title().to_owned(),
            fingerprint: self.world().fingerprint(),
            run: self.run.clone(),
            updates: self.learned_updates(),
            success: self.history.success(),
        };
        Ok(Saved { about, history: self.history.clone(), state })
    }

    /// Restores the run that [`Self::save`] saved, and says how far it is, as one stage of
    /// `progress`.
    pub fn load(
        saved: Saved,
        registry: &Arc<Registry>,
        threads: impl Into<Threads>,
        progress: &Job,
    ) -> Result<Self> {
        let Saved { about: About { world, run, .. }, history, state } = saved;
        let range = |OutOfRange(Setting { name, values, .. }): OutOfRange| {
            StoreError::inconsistent(format!("its setting {name} must be {values}"))
        };
        run.settings.validate().map_err(range)?;
        let world = registry.load_world(&world, &state)?;
        memory::check(&run, &*world, registry)?;
        let mut trainer = Self::new(run, &*world, registry, threads)?;
        history.check(trainer.spec())?;
        trainer.history = history;
        trainer.counters = state.get("counters")?;
        trainer.counters.check()?;
        trainer.seconds = state.get("seconds")?;
        let is_time = (0.0..1e12).contains(&trainer.seconds);
        StoreError::unless(is_time, "the stored training time is out of range")?;
        trainer.learner.load(&state)?;
        trainer.last_good = trainer.networks()?;
        let diverged = "its networks contain non-finite values: the run had diverged";
        StoreError::unless(trainer.last_good.is_finite(), diverged)?;
        trainer.load_replay(&state, progress)?;
        trainer.candidates.restore(state.get("candidates")?)?;
        trainer.restore_graphs(state.get("graphs")?)?;
        let graph = trainer.graphs.current.as_ref().map(|built| &*built.graph);
        trainer.rollout.load(&state, graph, &mut trainer.replay, &mut trainer.candidates)?;
        trainer.visits = state.get("visits")?;
        trainer.visits.check(trainer.world())?;
        trainer.film = state.get("film")?;
        trainer.film.check(trainer.spec())?;
        trainer.batch_rng = state.get("batch_rng")?;
        Ok(trainer)
    }
}
