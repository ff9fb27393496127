//! The state of a run: saved in checkpoints, and kept to recover from non-finite numbers or a panic
//! in the middle of a tick.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::graphs::Graphs;
use super::{Edit, Result, Trainer, new_learner};
use crate::env::Recorded;
use crate::job::Job;
use crate::learn::{Learner, Losses, Threads};
use crate::settings::Setting;
use crate::store::{Store, StoreError};
use crate::train::TrainError;
use crate::train::dataset::DataSource;
use crate::train::history::History;
use crate::train::memory;
use crate::train::registry::Registry;
use crate::train::run::Run;
use crate::train::score::SuccessSummary;
use crate::train::settings::OutOfRange;

/// Updates between checks of all weights; networks that pass are kept for rollback.
pub(crate) const KEEP_EVERY_UPDATES: u64 = 2_000;

pub(crate) const MAX_RECOVERIES: u32 = 3;

pub(crate) const LEARNING_RATE_FACTOR: f32 = 0.5;

pub(super) struct LastGood {
    updates: u64,
    losses: [f64; 3],
    learner: Store,
}

/// A rollback to earlier networks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recovery {
    /// The update after which numbers were not finite.
    pub updates: u64,
    /// The update whose networks were restored.
    pub back_to: u64,
    /// Number of rollbacks so far.
    pub times: u32,
    /// The learning rate after the rollback.
    pub learning_rate: f32,
}

impl std::fmt::Display for Recovery {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { updates, back_to, times, learning_rate } = self;
        write!(
            f,
            "training diverged at update {updates}: rolled back to update {back_to} with half the \
             learning rate, {learning_rate} ({times} of {MAX_RECOVERIES})"
        )
    }
}

impl LastGood {
    pub fn capture(updates: u64, losses: [f64; 3], learner: &dyn Learner) -> Result<Self> {
        let mut store = Store::default();
        learner.save(&mut store)?;
        Ok(Self { updates, losses, learner: store })
    }

    pub fn is_finite(&self) -> bool {
        self.learner.is_finite()
    }
}

impl Trainer {
    pub fn take_recovery(&mut self) -> Option<Recovery> {
        self.recovery.take()
    }

    /// Rolls back to good networks if an update's losses, or the weights after it, are not finite.
    /// Fails where no rollbacks are left; the networks are good even then.
    pub(super) fn check_update(&mut self, losses: &Losses) -> Result<()> {
        let finite =
            [losses.critic, losses.model, losses.actor].iter().all(|loss| loss.is_finite());
        if !finite || crate::faults::point("loss") {
            return self.roll_back();
        }
        if self.counters.updates.is_multiple_of(KEEP_EVERY_UPDATES) {
            let good = self.networks()?;
            if !good.is_finite() || !self.learner.is_finite()? {
                return self.roll_back();
            }
            self.last_good = good;
        }
        Ok(())
    }

    /// Ensures before saving that the networks are finite, rolling back if necessary.
    /// Fails where no rollbacks are left; the networks are good even then.
    pub fn ensure_finite(&mut self) -> Result<()> {
        if self.is_finite()? { Ok(()) } else { self.roll_back() }
    }

    pub fn is_finite(&self) -> Result<bool> {
        Ok(self.networks()?.is_finite())
    }

    pub(super) fn networks(&self) -> Result<LastGood> {
        LastGood::capture(self.counters.updates, self.counters.losses, &*self.learner)
    }

    /// Rolls back to the last good networks with smaller learning rates; keeps replay buffer and
    /// agents.
    pub(super) fn roll_back(&mut self) -> Result<()> {
        let gives_up = self.counters.recoveries >= MAX_RECOVERIES;
        let learn = &mut self.run.settings.learn;
        if !gives_up {
            self.counters.recoveries += 1;
            learn.learning_rate *= LEARNING_RATE_FACTOR;
            learn.grid_learning_rate *= LEARNING_RATE_FACTOR;
        }
        let (updates, back_to) = (self.counters.updates, self.last_good.updates);
        let (times, learning_rate) = (self.counters.recoveries, learn.learning_rate);
        self.restore_last_good()?;
        if gives_up {
            return Err(TrainError::Other(format!(
                "training diverged again at update {updates} after {times} rollbacks: set a smaller \
                 learning_rate (now {learning_rate}); the networks of update {back_to} are restored \
                 and can be saved"
            )));
        }
        let recovery = Recovery { updates, back_to, times, learning_rate };
        self.replace_graph()?;
        log::warn!("{recovery}");
        self.recovery = Some(recovery);
        Ok(())
    }

    fn restore_last_good(&mut self) -> Result<()> {
        let mut learner = new_learner(&self.run, self.spec(), &self.registry, self.threads)?;
        learner.load(&self.last_good.learner)?;
        self.learner = learner;
        self.counters.losses = self.last_good.losses;
        // Graphs and plans may come from networks that had already diverged.
        self.graphs = Graphs::default();
        self.rollout.discard_plans();
        Ok(())
    }

    /// Repairs what a panic in the middle of a tick may have left half done, so that the run can be
    /// saved.
    pub fn repair_after_panic(&mut self) -> Result<()> {
        if std::mem::take(&mut self.in_update) {
            return self.restore_last_good();
        }
        // Saving repeats a pending graph build: one that panicked would panic again.
        self.graphs = Graphs::default();
        self.rollout.discard_plans();
        Ok(())
    }
}

#[derive(Clone, Debug)]
pub struct Saved {
    pub about: About,
    pub history: History,
    pub state: Store,
}

/// What lists of checkpoints show of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    pub world: String,
    /// Title of its world: the map's name.
    pub title: String,
    /// What tells its world apart from others of its title.
    pub fingerprint: Option<String>,
    /// What it learns from besides acting, or instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data: Option<DataSource>,
    /// Identifies the given evaluation tasks; `None` for random ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    pub run: Run,
    pub updates: u64,
    /// Latest evaluation result, if the run was evaluated before saving.
    pub success: Option<SuccessSummary>,
}

impl Trainer {
    /// Returns everything needed to resume the run exactly where it stopped.
    pub fn save(&self) -> Result<Saved> {
        let mut state = Store::default();
        self.learner.save(&mut state)?;
        if !state.is_finite() {
            let problem = "the networks contain non-finite values";
            return Err(TrainError::Other(problem.to_owned()));
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
        let saved = |Edit { updates, world }: &Edit| {
            let mut store = Store::default();
            world.abilities().recorded.iter().for_each(|recorded| recorded.save(&mut store));
            (*updates, store)
        };
        state.put("edits", &self.edits.iter().map(saved).collect::<Vec<_>>())?;
        state.put("batch_rng", &self.batch_rng)?;
        let about = About {
            world: self.world().kind().to_owned(),
            title: self.world().title().to_owned(),
            fingerprint: self.world().fingerprint(),
            data: self.data().cloned(),
            scenario: self.world().abilities().recorded.and_then(Recorded::scenario),
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
        // Those of earlier versions have none.
        let edits: Vec<(u64, Store)> = state.get("edits").unwrap_or_default();
        let edits = edits.into_iter().map(|(updates, saved)| {
            Ok(Edit { updates, world: registry.load_world(&world, &saved)? })
        });
        let edits = edits.collect::<Result<_>>()?;
        let world = registry.load_world(&world, &state)?;
        memory::check(&run, &*world, registry)?;
        let mut trainer = Self::new(run, &*world, registry, threads)?;
        trainer.edits = edits;
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
