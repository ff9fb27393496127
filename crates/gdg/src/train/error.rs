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
    /// The settings need more memory than is available.
    #[error("{0}")]
    Memory(String),
    /// The learner is not registered, or the networks are not finite.
    #[error("{0}")]
    Other(String),
}
