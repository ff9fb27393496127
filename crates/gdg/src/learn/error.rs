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
