//! Why a world fails, or cannot be what it is asked to be.

use crate::store::StoreError;

/// Why a world fails, or cannot replace another in a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnvError {
    /// The world cannot be edited.
    #[error("the world {0} cannot be edited")]
    NotEditable(&'static str),
    /// The world is of another kind.
    #[error("the run uses a world of kind {run}, not {other}")]
    KindMismatch {
        /// Kind of the run's world.
        run: &'static str,
        /// Kind of the other world.
        other: &'static str,
    },
    /// It has no task of its own.
    #[error("{0} has no start S from which a goal G can be reached, which goals=map requires")]
    NoOwnTask(String),
    /// What is stored of the world cannot be loaded.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It is computed by another program, which has failed.
    #[error("{world}: {problem}{}", .details.iter().map(|line| format!("\n  {line}")).collect::<String>())]
    Failed {
        /// Title of the world, safe to display.
        world: String,
        /// What has happened, safe to display.
        problem: String,
        /// The last lines that the other program has written, safe to display.
        details: Vec<String>,
    },
    /// It took long although training was to stop.
    #[error("the environment was given up, as training was to stop")]
    Stopped,
    /// The map has another size.
    #[error("the map is {} x {}, but the run's map is {} x {}", map.0, map.1, run.0, run.1)]
    SizeMismatch {
        /// Columns and rows of the map.
        map: (usize, usize),
        /// Columns and rows of the run's map.
        run: (usize, usize),
    },
}
