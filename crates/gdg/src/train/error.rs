//! Errors from starting, continuing or saving a run.

use crate::env::EnvError;
use crate::learn::LearnError;
use crate::store::StoreError;

impl From<candle_core::Error> for TrainError {
    fn from(error: candle_core::Error) -> Self {
        Self::Learn(error.into())
    }
}

/// Why a file of data cannot be learned from.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{file}: {problem}")]
pub struct DataError {
    /// The file.
    pub file: String,
    /// What is wrong, and what would be right.
    pub problem: String,
}

/// An error that stops training or prevents it from starting.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// An error from the learner.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A thread cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    /// Saved state cannot be restored, or current state cannot be saved.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The data that a run learns from cannot be used.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A world cannot replace the current one.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// The learner is not registered.
    #[error("unknown learner {name:?}; {known}")]
    UnknownLearner {
        /// The requested name.
        name: String,
        /// The methods with the registered learners.
        known: String,
    },
    /// The run diverged again after the maximum number of rollbacks.
    #[error(
        "training diverged again at update {updates} after {times} rollbacks: set a smaller \
         learning_rate (now {learning_rate}); the networks of update {back_to} are restored and \
         can be saved"
    )]
    Diverged {
        /// The update after which numbers were not finite.
        updates: u64,
        /// Number of earlier rollbacks.
        times: u32,
        /// The current learning rate.
        learning_rate: f32,
        /// The update whose networks were restored.
        back_to: u64,
    },
    /// The settings need more memory than is available.
    #[error(
        "these settings need about {:.1} GB of memory, but {:.1} GB are available{by}: reduce \
         hidden, layers, batch_size, candidates or buffer_size",
        *needed as f64 / 1e9,
        *available as f64 / 1e9
    )]
    Memory {
        /// Estimated need in bytes.
        needed: u64,
        /// Available memory in bytes.
        available: u64,
        /// What limits it, if not the machine.
        by: &'static str,
    },
    /// The networks are not finite and must not overwrite a good checkpoint.
    #[error("the networks contain non-finite values")]
    NotFinite,
}
