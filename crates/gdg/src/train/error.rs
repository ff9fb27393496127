//! Errors from starting, continuing or saving a run.

use std::sync::Arc;

use crate::env::EnvError;
use crate::learn::LearnError;
use crate::store::StoreError;

impl From<candle_core::Error> for TrainError {
    fn from(error: candle_core::Error) -> Self {
        Self::Learn(error.into())
    }
}

/// Why a file of data cannot be learned from.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// It cannot be read.
    #[error("{file}: the data cannot be read: {error}: give --data FILE if they are elsewhere")]
    Unread {
        /// The file.
        file: String,
        /// Why.
        error: std::io::Error,
    },
    /// It is no such file, or does not fit the world.
    #[error("{file}: {problem}")]
    Unfit {
        /// The file.
        file: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
}

impl From<DataError> for TrainError {
    fn from(error: DataError) -> Self {
        Self::Data(error.into())
    }
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
    Data(Arc<DataError>),
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
        "these settings need about {:.1} GB of memory, but {:.1} GB are available: reduce hidden, \
         layers, batch_size, candidates or buffer_size",
        *needed as f64 / 1e9,
        *available as f64 / 1e9
    )]
    Memory {
        /// Estimated need in bytes.
        needed: u64,
        /// Available memory in bytes.
        available: u64,
    },
    /// The settings need more address space than this process may have.
    #[error(
        "these settings need about {:.1} GB of memory and {:.1} GB of address space, but a limit \
         allows {:.1} GB of the latter: raise it (ulimit -v shows it, in KiB), or reduce hidden, \
         layers, batch_size, candidates or buffer_size",
        *needed as f64 / 1e9,
        *space as f64 / 1e9,
        *limit as f64 / 1e9
    )]
    AddressSpace {
        /// Estimated need of memory in bytes.
        needed: u64,
        /// Estimated need of address space in bytes.
        space: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// The networks are not finite and must not overwrite a good checkpoint.
    #[error("the networks contain non-finite values")]
    NotFinite,
}
