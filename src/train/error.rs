//! Why a run cannot begin, go on, or be saved.

use crate::env::EnvError;
use crate::learn::LearnError;
use crate::store::StoreError;

impl From<candle_core::Error> for TrainError {
    fn from(error: candle_core::Error) -> Self {
        Self::Learn(error.into())
    }
}

/// What ends training, or keeps it from beginning.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The learner reports an error.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A thread cannot be started.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// What was saved cannot be restored, or what is to be saved cannot be written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A world cannot take another's place.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// A learner that is not registered.
    #[error("there is no learner {name:?}: there are {known}")]
    UnknownLearner {
        /// The name asked for.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A run that has diverged as often as it may.
    #[error(
        "training diverged again at update {updates} after going back {times} times: set a smaller learning_rate (it is \
         {learning_rate} now); the networks are those of update {back_to}, and can be saved"
    )]
    Diverged {
        /// The update after which numbers were not finite.
        updates: u64,
        /// How often the run had gone back before.
        times: u32,
        /// The step size.
        learning_rate: f32,
        /// The update whose networks there are now.
        back_to: u64,
    },
    /// Settings that take more memory than there is.
    #[error(
        "these settings need about {:.1} GB of memory, and there are {:.1} GB: make hidden, layers, batch, candidates, \
         buffer_size or grid_channels smaller",
        *needed as f64 / 1e9,
        *available as f64 / 1e9
    )]
    Memory {
        /// Estimated need in bytes.
        needed: u64,
        /// What can be had, in bytes.
        available: u64,
    },
    /// A state that is not finite, which must not replace a good one.
    #[error("the networks hold numbers that are not finite")]
    NotFinite,
}
