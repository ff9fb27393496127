//! What a learner is: updates from the replay, D and mu to act and plan by, a state that can be saved.

use std::error::Error;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::losses::Losses;
use super::policy::Policy;
use super::profile::Profile;
use super::replay::Replay;
use super::settings::LearnSettings;
use crate::env::Spec;
use crate::store::{Store, StoreError};

/// A kind of learner, as it is registered.
#[derive(Clone, Copy, Debug)]
pub struct LearnerKind {
    /// Its name on the command line, in records and in checkpoints.
    pub name: &'static str,
    /// What it is, in a few words.
    pub about: &'static str,
    /// Makes a fresh one.
    pub create: CreateLearner,
    /// Numbers that training changes: what its memory is estimated by.
    pub parameters: fn(&Spec, &LearnSettings) -> u64,
}

/// Makes a fresh learner whose updates so many threads share, drawing its parameters from the random stream.
pub type CreateLearner = fn(&Spec, &LearnSettings, usize, &mut ChaCha8Rng) -> Result<Box<dyn Learner>, LearnError>;

/// What an update learns from.
pub struct TrainingData<'a> {
    /// What the agents did; it holds at least one transition.
    pub replay: &'a Replay,
    /// Distances that the bridge graph knows, if there is one.
    pub known: Option<KnownDistances<'a>>,
    /// Whether distances may have grown a short while ago, so that what was learned is too short.
    pub relearning: bool,
    /// Draws batches.
    pub rng: &'a mut ChaCha8Rng,
}

/// Distances known from elsewhere than transitions.
#[derive(Clone, Copy)]
pub struct KnownDistances<'a> {
    /// `(places, state_dim)`.
    pub states: &'a [f32],
    /// The same places as goals, `(places, goal_dim)`.
    pub goals: &'a [f32],
    /// From, to, and the steps between them.
    pub pairs: &'a [(u32, u32, f32)],
}

/// How agents act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acting {
    /// By mu.
    Policy,
    /// In random directions, each held for a while.
    AtRandom,
}

/// Learns the distance D(s,g) in steps, and to act by it.
///
/// Same data and random numbers, same bits: whatever the number of threads.
pub trait Learner: Send {
    /// The name of its [`LearnerKind`].
    fn kind(&self) -> &'static str;

    /// One update; its time is booked on `profile`.
    ///
    /// # Errors
    /// What the learner's means of computation report.
    fn update(&mut self, data: TrainingData, profile: &mut Profile) -> Result<Losses, LearnError>;

    /// A frozen copy of what has been learned: of its running average, where there is one and it is asked for.
    ///
    /// # Errors
    /// What the learner's means of computation report.
    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError>;

    /// Uses what has been learned without copying it.
    ///
    /// # Errors
    /// What the learner's means of computation report.
    fn with_policy(&self, averaged: bool, use_policy: &mut dyn FnMut(&dyn Policy)) -> Result<(), LearnError>;

    /// How agents act while this learns.
    fn acting(&self) -> Acting {
        Acting::Policy
    }

    /// Whether D is finite where it was last learned. (Whether the state is, is found out from what [`Self::save`] writes.)
    ///
    /// # Errors
    /// What the learner's means of computation report.
    fn is_sound(&self) -> Result<bool, LearnError> {
        Ok(true)
    }

    /// Writes everything that training changed.
    ///
    /// # Errors
    /// What the learner's means of computation report.
    fn save(&self, store: &mut Store) -> Result<(), LearnError>;

    /// Restores what [`Self::save`] wrote.
    ///
    /// # Errors
    /// That it is missing or does not fit these settings; the learner is then of no use any more.
    fn load(&mut self, store: &Store) -> Result<(), LearnError>;
}

/// Why learning cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// Candle reports an error.
    #[error(transparent)]
    Candle(#[from] candle_core::Error),
    /// What was saved cannot be restored.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Anything else.
    #[error(transparent)]
    Other(#[from] Box<dyn Error + Send + Sync>),
}
