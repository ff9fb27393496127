//! Why answers to questions are not accepted.

use gdg::map::size_limits;
use gdg::text::NumberError;
use gdg::train::ConfigError;

/// Why an answer is not accepted.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// An existing file: confirming replaces it.
    #[error("{0} exists: Enter again replaces it")]
    Exists(String),
    /// A format without something that the map has: confirming writes the rest.
    #[error("{lost}{also}; Enter again writes it without them")]
    Loses {
        /// The format and what it lacks.
        lost: String,
        /// What else to consider.
        also: String,
    },
    /// A checkpoint, which no map replaces.
    #[error("this file is a checkpoint: enter another name")]
    IsCheckpoint,
    /// An empty name of a checkpoint.
    #[error("enter a name, e.g. rooms-at-95-percent")]
    NoName,
    /// An empty name of a map file.
    #[error("enter a file name, e.g. rooms.txt or rooms.map")]
    NoFileName,
    /// A file that cannot be written.
    #[error("{0} cannot be written: {1}")]
    Unwritable(String, std::io::Error),
    /// A text that is not two numbers.
    #[error("enter two numbers, e.g. 40 x 30")]
    NoSize,
    /// A size that no map can have.
    #[error("{}", size_limits())]
    NoMapSize,
    /// A size that leaves walls only.
    #[error("the map would have no free cell")]
    NoFreeCell,
    /// A text that is not the number asked for.
    #[error("{0}")]
    Number(#[from] NumberError),
    /// A text that is not a number of minutes.
    #[error("enter a number of minutes, 0 for none")]
    NoMinutes,
    /// A setting that cannot have this value.
    #[error("{}", .0.one_line())]
    Setting(#[from] Box<ConfigError>),
}

impl AnswerError {
    /// Returns whether confirming accepts the answer all the same.
    pub fn is_warning(&self) -> bool {
        matches!(self, Self::Exists(_) | Self::Loses { .. })
    }
}
