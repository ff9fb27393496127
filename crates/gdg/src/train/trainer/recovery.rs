//! Recovery of a run from non-finite numbers or from a panic in the middle of a tick.

use serde::Serialize;

use super::graphs::Graphs;
use super::{Result, Trainer, new_learner};
use crate::learn::{Learner, Losses};
use crate::store::Store;
use crate::train::error::TrainError;

/// Updates between checks of all weights; networks that pass are kept for rollback.
pub(crate) const KEEP_EVERY_UPDATES: u64 = 2_000;

/// Maximum number of rollbacks before the run fails.
pub(crate) const MAX_RECOVERIES: u32 = 3;

/// Factor applied to the learning rates at each rollback.
pub(crate) const LEARNING_RATE_FACTOR: f32 = 0.5;

pub(super) struct LastGood {
    updates: u64,
    losses: [f64; 3],
    learner: Store,
}

/// A rollback to earlier networks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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
    /// Returns the latest rollback since the previous call.
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
            self.check_and_keep()
        } else {
            Ok(())
        }
    }

    /// Ensures before saving that the networks are finite, rolling back if necessary.
    /// Fails where no rollbacks are left; the networks are good even then.
    pub fn ensure_finite(&mut self) -> Result<()> {
        if self.is_finite()? { Ok(()) } else { self.roll_back() }
    }

    /// Returns whether all numbers of the networks are finite.
    pub fn is_finite(&self) -> Result<bool> {
        Ok(self.networks()?.is_finite())
    }

    /// Keeps the networks for rollback if they are good, else rolls back.
    fn check_and_keep(&mut self) -> Result<()> {
        let good = self.networks()?;
        if !good.is_finite() || !self.learner.is_finite()? {
            return self.roll_back();
        }
        self.last_good = good;
        Ok(())
    }

    pub(super) fn networks(&self) -> Result<LastGood> {
        LastGood::capture(self.counters.updates, self.counters.losses, &*self.learner)
    }

    /// Rolls back to the last good networks with smaller learning rates; keeps replay buffer and
    /// agents.
    pub(super) fn roll_back(&mut self) -> Result<()> {
        let gives_up = self.counters.recoveries >= MAX_RECOVERIES;
        if !gives_up {
            self.counters.recoveries += 1;
            let learn = &mut self.run.settings.learn;
            learn.learning_rate *= LEARNING_RATE_FACTOR;
            learn.grid_learning_rate *= LEARNING_RATE_FACTOR;
        }
        self.restore_last_good()?;
        if gives_up {
            return Err(TrainError::Diverged {
                updates: self.counters.updates,
                times: MAX_RECOVERIES,
                learning_rate: self.run.settings.learn.learning_rate,
                back_to: self.last_good.updates,
            });
        }
        let recovery = Recovery {
            updates: self.counters.updates,
            back_to: self.last_good.updates,
            times: self.counters.recoveries,
            learning_rate: self.run.settings.learn.learning_rate,
        };
        self.replace_graph()?;
        log::warn!("{recovery}");
        self.recovery = Some(recovery);
        Ok(())
    }

    /// Replaces the learner by one with the current settings and the last good networks.
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
