//! What becomes of a run whose numbers are no longer finite, or that a panic has stopped in the middle.

use candle_core::{Result, bail};
use serde::Serialize;

use super::Trainer;
use crate::learn::{LearnerState, Losses, Scratch};
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
    learner: LearnerState,
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
    pub fn of(updates: u64, losses: [f64; 3], learner: LearnerState) -> Self {
        Self { updates, losses, learner }
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
    /// See [`Self::check_update`].
    pub fn ensure_finite(&mut self) -> Result<()> {
        if self.learner.state()?.is_finite() { Ok(()) } else { self.go_back() }
    }

    /// Keeps the networks to go back to, if they are good.
    fn keep_good(&mut self) -> Result<()> {
        let state = self.learner.state()?;
        if !state.is_finite() || !self.distances_are_finite()? {
            return self.go_back();
        }
        self.last_good = LastGood::of(self.counters.updates, self.counters.losses, state);
        Ok(())
    }

    /// Whether D of the latest batch's pairs is finite.
    fn distances_are_finite(&self) -> Result<bool> {
        let (states, goals) = (&self.batch.states, &self.batch.goals);
        let mut distances = vec![0.0; self.batch.len()];
        self.learner.with_nets(true, |nets| nets.distances(states, goals, &mut distances, &mut Scratch::default()))?;
        Ok(distances.iter().all(|d| d.is_finite()))
    }

    /// Goes on with the networks that were good last, in smaller steps; replay and agents stay.
    pub(super) fn go_back(&mut self) -> Result<()> {
        self.restore_last_good()?;
        if self.counters.recoveries >= MOST_RECOVERIES {
            bail!(
                "training diverged again at update {} after going back {MOST_RECOVERIES} times: set a smaller \
                 learning_rate (it is {} now); the networks are those of update {}, and can be saved",
                self.counters.updates,
                self.run.settings.learn.learning_rate,
                self.last_good.updates
            );
        }
        self.counters.recoveries += 1;
        let learn = &mut self.run.settings.learn;
        learn.learning_rate *= SLOWER;
        learn.grid_learning_rate *= SLOWER;
        self.learner.set_rates(learn);
        let recovery = Recovery {
            updates: self.counters.updates,
            back_to: self.last_good.updates,
            times: self.counters.recoveries,
            learning_rate: learn.learning_rate,
        };
        tracing::warn!("{recovery}");
        self.recovery = Some(recovery);
        Ok(())
    }

    fn restore_last_good(&mut self) -> Result<()> {
        let LastGood { losses, learner, .. } = &self.last_good;
        let find = |network: &str, part: &str| {
            let (_, parts) = learner.networks.iter().find(|(name, _)| name == network)?;
            parts.iter().find(|(name, _)| *name == part).map(|(_, values)| values.clone())
        };
        self.learner.restore(learner.updates, find)?;
        self.counters.losses = *losses;
        // Graphs and plans may be those of networks that were no longer good.
        self.graphs = Graphs::default();
        self.rollout.drop_plans();
        Ok(())
    }

    /// Mends what a panic in the middle of a tick may have left half done, so that the run can be saved.
    ///
    /// # Errors
    /// What candle reports.
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
