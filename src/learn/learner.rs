//! The learner interface: updates from the replay, D and mu for acting and planning, and a state that can be saved.

use std::error::Error;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::goal_index::GoalIndex;
use crate::learn::data::replay::Replay;
use crate::learn::networks::export::ActorExport;
use crate::learn::networks::policy::Policy;
use crate::learn::settings::LearnSettings;
use crate::learn::update::losses::Losses;
use crate::learn::update::profile::Profile;
use crate::store::{Store, StoreError};

/// Registry entry of a kind of learner.
#[derive(Clone, Copy, Debug)]
pub struct LearnerKind {
    /// Its name on the command line, in records and in checkpoints.
    pub name: &'static str,
    /// Short description.
    pub about: &'static str,
    /// Whether it learns from a reward. Runs of such a learner have settings tuned for it, unless others are given.
    pub is_rewarded: bool,
    /// Creates a new learner. Checks the [`Spec`] and returns an error for a world that the learner cannot handle, such
    /// as one with more state components than it supports.
    pub create: CreateLearner,
    /// Number of trainable parameters, for estimating memory.
    pub parameters: fn(&Spec, &LearnSettings) -> u64,
}

/// Creates a learner whose updates run on this many threads, with parameters drawn from the random stream. Returns an
/// error for a [`Spec`] or settings that the learner cannot handle.
pub type CreateLearner = fn(&Spec, &LearnSettings, usize, &mut ChaCha8Rng) -> Result<Box<dyn Learner>, LearnError>;

/// What an update learns from.
pub struct TrainingData<'a> {
    /// The replay buffer; contains at least one transition.
    pub replay: &'a Replay,
    /// Distances from the bridge graph, if there is one.
    pub known: Option<KnownDistances<'a>>,
    /// Set for some time after distances may have changed, so that the learned ones are too short or too long.
    pub relearning: Option<Relearning>,
    /// Random stream for drawing batches.
    pub rng: &'a mut ChaCha8Rng,
}

/// How to relearn distances that may have changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Relearning {
    /// Slots that each agent has filled in the replay buffer since the change, about.
    pub recent_slots: u64,
    /// Whether a bridge graph finds out which distances have changed (see [`KnownDistances::changed`]), as soon as there
    /// is one. Otherwise all distances have to be doubted.
    pub graph_finds_changed: bool,
}

/// Distances known from a source other than transitions.
#[derive(Clone, Copy)]
pub struct KnownDistances<'a> {
    /// `(places, state_dim)`.
    pub states: &'a [f32],
    /// The same places as goals.
    pub goals: &'a GoalIndex,
    /// Pairs of places whose distance is known.
    pub pairs: &'a [KnownPair],
    /// Distances along the same paths by goal, for looking up.
    pub by_goal: Option<&'a DistancesByGoal>,
    /// Distances that have changed, while they are relearned.
    pub changed: Option<&'a ChangedDistances>,
}

/// A pair of places whose distance is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPair {
    /// The place where the path starts.
    pub from: u32,
    /// The place where it ends.
    pub to: u32,
    /// Its length.
    pub steps: f32,
    /// The first place on it that is at least `WAYPOINT_STEPS` from the start, or its end.
    pub waypoint: u32,
}

/// Least distance of the waypoints that lead the actor, in steps: near enough that D is right, far enough that the way there
/// shows the direction.
pub(crate) const WAYPOINT_STEPS: f32 = 4.0;

/// Steps from all places to some of them.
#[derive(Clone, Debug)]
pub struct DistancesByGoal {
    /// The places that are goals.
    pub places: Vec<u32>,
    /// The same places as goals.
    pub goals: GoalIndex,
    /// Steps from each place to each goal, `(goals, places)`, with the overhead of each hop, the first as well; infinite
    /// if unknown.
    pub steps: Vec<f32>,
    /// For each of these, the first place on the path that is at least `WAYPOINT_STEPS` from its start, or its end.
    pub waypoints: Vec<u32>,
}

/// Bounds on distances of which D is far too short or too long.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChangedDistances {
    /// The places that are goals.
    pub goals: Vec<u32>,
    /// Fewest steps from each place to each goal, `(goals, places)`; 0 where D is long enough.
    pub lower: Vec<f32>,
    /// Most steps from each place to each goal, `(goals, places)`; `f32::MAX` where D is short enough.
    pub upper: Vec<f32>,
}

/// How agents act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acting {
    /// With mu.
    Policy,
    /// In random directions, each held for a while.
    AtRandom,
}

/// Learns the distance D(s,g) in steps, and a policy that follows it.
///
/// For a reward of -1 per step without discount, a learner with a Q function offers D(s,g) = -Q(s, mu(s,g), g). Other
/// rewards and discounts give other numbers: convert them to steps (as `ddpg` does). D must be finite and at least 0. If a world hides part
/// of its full state, D(s,g) is an average over what is hidden.
///
/// The same data and random numbers give bit-identical results for any number of threads.
pub trait Learner: Send {
    /// Returns the name of its [`LearnerKind`].
    fn kind(&self) -> &'static str;

    /// Performs one update and adds its time to `profile`.
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn update(&mut self, data: TrainingData, profile: &mut Profile) -> Result<Losses, LearnError>;

    /// Returns a frozen copy of the current policy, or of its running average if `averaged` and there is one.
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError>;

    /// Calls `use_policy` with the current policy, without copying it.
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn with_policy(&self, averaged: bool, use_policy: &mut dyn FnMut(&dyn Policy)) -> Result<(), LearnError>;

    /// Returns the actor, or its running average if `averaged` and there is one, for other programs; `None` if the
    /// learner has no such network.
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn export_actor(&self, _averaged: bool) -> Result<Option<ActorExport>, LearnError> {
        Ok(None)
    }

    /// Returns how agents act during training.
    fn acting(&self) -> Acting {
        Acting::Policy
    }

    /// Returns whether D is finite on the latest batch. (The state itself is checked on what [`Self::save`] writes.)
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn is_finite(&self) -> Result<bool, LearnError> {
        Ok(true)
    }

    /// Writes the full training state.
    ///
    /// # Errors
    /// Returns an error if the learner's computation fails.
    fn save(&self, store: &mut Store) -> Result<(), LearnError>;

    /// Restores the state that [`Self::save`] wrote.
    ///
    /// # Errors
    /// Returns an error if the state is missing or does not fit these settings; the learner is then unusable.
    fn load(&mut self, store: &Store) -> Result<(), LearnError>;
}

/// Why learning cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// A candle operation failed, with this message.
    #[error("{0}")]
    Candle(String),
    /// The saved state cannot be restored.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Anything else.
    #[error(transparent)]
    Other(#[from] Box<dyn Error + Send + Sync>),
}

impl From<candle_core::Error> for LearnError {
    fn from(error: candle_core::Error) -> Self {
        Self::Candle(candle_message(error))
    }
}

/// Returns the message of an error without the backtrace that candle adds if `RUST_BACKTRACE` is set.
pub(in crate::learn) fn candle_message(error: candle_core::Error) -> String {
    use candle_core::Error;
    match error {
        Error::WithBacktrace { inner, .. } => candle_message(*inner),
        Error::WithPath { inner, path } => format!("{}: {}", path.display(), candle_message(*inner)),
        Error::Context { inner, context } => format!("{context}: {}", candle_message(*inner)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::backtrace::Backtrace;

    use super::*;

    #[test]
    fn errors_of_candle_have_no_backtrace() {
        let backtrace = Box::new(Backtrace::force_capture());
        let inner = Box::new(candle_core::Error::Msg("no such device".to_owned()));
        let error = candle_core::Error::WithBacktrace { inner, backtrace }.context("update");
        assert_eq!(LearnError::from(error).to_string(), "update: no such device");
    }
}
