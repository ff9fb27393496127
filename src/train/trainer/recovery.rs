//! What becomes of a run whose numbers are no longer finite, or that a panic has stopped in the middle.

use serde::Serialize;

use super::{Result, Trainer, learner_of};
use crate::learn::{Learner, Losses};
use crate::store::Store;
use crate::train::error::TrainError;
use crate::train::graphs::Graphs;

/// Updates between two looks at all weights; the networks are kept then, to go back to.
const KEEP_EVERY_UPDATES: u64 = 2_000;

/// How often a run goes back before it gives up.
const MOST_RECOVERIES: u32 = 3;

/// The part of the step sizes that a run goes on with.
const SLOWER: f32 = 0.5;

/// Networks that were good.
pub(super) struct LastGood {
    updates: u64,
    losses: [f64; 3],
    learner: Store,
}

/// A run's way back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Recovery {
    /// The update after which numbers were not finite.
    pub updates: u64,
    /// The update whose networks it went on with.
    pub back_to: u64,
    /// How often it has gone back.
    pub times: u32,
    /// The step size that it went on with.
    pub learning_rate: f32,
}

impl std::fmt::Display for Recovery {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { updates, back_to, times, learning_rate } = self;
        write!(
            f,
            "training diverged at update {updates}: back to the networks of update {back_to} with half the learning \
             rate, {learning_rate} ({times} of {MOST_RECOVERIES})"
        )
    }
}

impl LastGood {
    /// A copy of what has been learned.
    pub fn of(updates: u64, losses: [f64; 3], learner: &dyn Learner) -> Result<Self> {
        let mut store = Store::default();
        learner.save(&mut store)?;
        Ok(Self { updates, losses, learner: store })
    }

    pub fn is_finite(&self) -> bool {
        self.learner.is_finite()
    }
}

impl Trainer {
    /// The latest way back since this was last asked.
    pub fn take_recovery(&mut self) -> Option<Recovery> {
        self.recovery.take()
    }

    /// Goes back to good networks if an update's losses, or the weights after it, are not finite.
    ///
    /// # Errors
    /// When it has gone back often enough; the networks are good ones then as well.
    pub(super) fn check_update(&mut self, losses: &Losses) -> Result<()> {
        let finite = [losses.critic, losses.model, losses.actor].iter().all(|loss| loss.is_finite());
        if !finite || crate::faults::point("loss") {
            return self.go_back();
        }
        if self.counters.updates.is_multiple_of(KEEP_EVERY_UPDATES) { self.keep_good() } else { Ok(()) }
    }

    /// Makes sure that every number of the networks is finite, by going back if need be: before they are saved.
    ///
    /// # Errors
    /// When the run has gone back as often as it may; the networks are good ones then as well.
    pub fn ensure_finite(&mut self) -> Result<()> {
        if self.networks()?.is_finite() { Ok(()) } else { self.go_back() }
    }

    /// Keeps the networks to go back to, if they are good.
    fn keep_good(&mut self) -> Result<()> {
        let good = self.networks()?;
        if !good.is_finite() || !self.learner.is_finite()? {
            return self.go_back();
        }
        self.last_good = good;
        Ok(())
    }

    /// The networks as they are now.
    fn networks(&self) -> Result<LastGood> {
        LastGood::of(self.counters.updates, self.counters.losses, &*self.learner)
    }

    /// Goes on with the networks that were good last, in smaller steps; replay and agents stay.
    pub(super) fn go_back(&mut self) -> Result<()> {
        self.restore_last_good()?;
        if self.counters.recoveries >= MOST_RECOVERIES {
            return Err(TrainError::Diverged {
                updates: self.counters.updates,
                times: MOST_RECOVERIES,
                learning_rate: self.run.settings.learn.learning_rate,
                back_to: self.last_good.updates,
            });
        }
        self.counters.recoveries += 1;
        let learn = &mut self.run.settings.learn;
        learn.learning_rate *= SLOWER;
        learn.grid_learning_rate *= SLOWER;
        self.take_last_good()?;
        let recovery = Recovery {
            updates: self.counters.updates,
            back_to: self.last_good.updates,
            times: self.counters.recoveries,
            learning_rate: self.run.settings.learn.learning_rate,
        };
        tracing::warn!("{recovery}");
        self.recovery = Some(recovery);
        Ok(())
    }

    fn restore_last_good(&mut self) -> Result<()> {
        self.take_last_good()?;
        self.counters.losses = self.last_good.losses;
        // Graphs and plans may be those of networks that were no longer good.
        self.graphs = Graphs::default();
        self.rollout.drop_plans();
        Ok(())
    }

    /// A learner with the settings as they are now, and the networks that were good last.
    fn take_last_good(&mut self) -> Result<()> {
        let mut learner = learner_of(&self.run, self.spec(), &self.registry, self.threads)?;
        learner.load(&self.last_good.learner)?;
        self.learner = learner;
        Ok(())
    }

    /// Mends what a panic in the middle of a tick may have left half done, so that the run can be saved.
    ///
    /// # Errors
    /// What the learner reports.
    pub fn mend_after_panic(&mut self) -> Result<()> {
        if std::mem::take(&mut self.in_update) {
            return self.restore_last_good();
        }
        // A graph whose build panicked would do so again when it is saved.
        self.graphs = Graphs::default();
        self.rollout.drop_plans();
        Ok(())
    }
}
