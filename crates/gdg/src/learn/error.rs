//! Why learning cannot continue.

use std::error::Error;

use crate::store::StoreError;

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
        // Candle adds a backtrace where one is asked for.
        Self::Candle(error.to_string().lines().next().unwrap_or_default().to_owned())
    }
}
