//! The learner interface: updates from the replay, D and mu for acting and planning, and a state
//! that can be saved.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::job::Job;
use crate::learn::data::known::{KnownDistances, Relearning};
use crate::learn::data::replay::Replay;
use crate::learn::error::LearnError;
use crate::learn::networks::named_arrays::{ActorExport, CriticsExport};
use crate::learn::networks::policy::Policy;
use crate::learn::settings::LearnSettings;
use crate::learn::update::profile::{Losses, Profile};
use crate::learn::update::threads::Threads;
use crate::store::Store;

/// Registry entry of a kind of learner.
#[derive(Clone, Copy, Debug)]
pub struct LearnerKind {
    /// Its name on the command line, in records and in checkpoints.
    pub name: &'static str,
    /// Short description.
    pub about: &'static str,
    /// Whether it learns from a reward. Runs of such a learner have settings tuned for it, unless
    /// others are given.
    pub is_rewarded: bool,
    /// Creates a new learner. Checks the [`Spec`] and returns an error for a world that the learner
    /// cannot handle, such as one with more state components than it supports.
    pub create: CreateLearner,
    /// Number of trainable parameters, for estimating memory.
    pub parameters: fn(&Spec, &LearnSettings) -> u64,
}

/// Creates a learner whose updates these threads share, with parameters drawn from the random
/// stream. Returns an error for a [`Spec`] or settings that the learner cannot handle.
pub type CreateLearner =
    fn(&Spec, &LearnSettings, Threads, &mut ChaCha8Rng) -> Result<Box<dyn Learner>, LearnError>;

/// What an update learns from.
pub struct TrainingData<'a> {
    /// The replay buffer; contains at least one transition.
    pub replay: &'a Replay,
    /// Distances from the bridge graph, if there is one.
    pub known: Option<KnownDistances<'a>>,
    /// Set for some time after distances may have changed, so that the learned ones are too short
    /// or too long.
    pub relearning: Option<Relearning>,
    /// Random stream for drawing batches.
    pub rng: &'a mut ChaCha8Rng,
    /// Beats before each part of the update, which shows that a long one moves.
    pub job: &'a Job,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acting {
    /// With mu.
    Policy,
    /// In random directions, each held for a while.
    AtRandom,
}

/// Learns the distance D(s,g) in steps, and a policy that follows it.
///
/// For a reward of -1 per step without discount, a learner with a Q function offers D(s,g) = -Q(s,
/// mu(s,g), g). Other rewards and discounts give other numbers: convert them to steps (as `ddpg`
/// does). D must be finite and at least 0. If a world hides part of its full state, D(s,g) is an
/// average over what is hidden.
///
/// The same data and random numbers give bit-identical results for any number of threads.
#[allow(clippy::missing_errors_doc, reason = "each fails if the learner's computation does")]
pub trait Learner: Send {
    /// Returns the name of its [`LearnerKind`].
    fn kind(&self) -> &'static str;

    /// Performs one update and adds its time to `profile`.
    fn update(&mut self, data: TrainingData, profile: &mut Profile) -> Result<Losses, LearnError>;

    /// Returns a frozen copy of the current policy, or of its running average if `averaged` and
    /// there is one.
    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError>;

    /// Calls `use_policy` with the current policy, without copying it.
    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> Result<(), LearnError>;

    /// Returns the actor, or its running average if `averaged` and there is one, for other
    /// programs; `None` if the learner has no such network.
    fn export_actor(&self, _averaged: bool) -> Result<Option<ActorExport>, LearnError> {
        Ok(None)
    }

    /// Returns critics and dynamics model, or their running averages if `averaged` and there are
    /// any, for other programs that plan; `None` if the learner has no such networks.
    fn export_critics(&self, _averaged: bool) -> Result<Option<CriticsExport>, LearnError> {
        Ok(None)
    }

    /// Returns how agents act during training.
    fn acting(&self) -> Acting {
        Acting::Policy
    }

    /// Returns whether D is finite on the latest batch. (The state itself is checked on what
    /// [`Self::save`] writes.)
    fn is_finite(&self) -> Result<bool, LearnError> {
        Ok(true)
    }

    /// Writes the full training state.
    fn save(&self, store: &mut Store) -> Result<(), LearnError>;

    /// Writes what [`Self::save`] does, for a learner of `spec`, which has other scales of what is not
    /// the goal. The default is right where networks do not see the scales.
    fn save_in_scales_of(&self, _spec: &Spec, store: &mut Store) -> Result<(), LearnError> {
        self.save(store)
    }

    /// Restores the state that [`Self::save`] wrote. If that is missing or does not fit these
    /// settings, the learner is unusable.
    fn load(&mut self, store: &Store) -> Result<(), LearnError>;
}
