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
        Self::Candle(candle_message(error))
    }
}

/// Returns the message of an error without the backtrace that candle adds if `RUST_BACKTRACE` is
/// set.
pub(in crate::learn) fn candle_message(error: candle_core::Error) -> String {
    use candle_core::Error;
    match error {
        Error::WithBacktrace { inner, .. } => candle_message(*inner),
        Error::WithPath { inner, path } => {
            format!("{}: {}", path.display(), candle_message(*inner))
        }
        Error::Context { inner, context } => format!("{context}: {}", candle_message(*inner)),
        other => other.to_string(),
    }
}
