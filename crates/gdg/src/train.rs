//! Training: exploring agents, updates interleaved with their steps, evaluation and checkpoints.

mod checkpoint;
mod dataset;
mod doubts;
mod evaluate;
mod film;
mod history;
mod leaps;
pub mod memory;
mod policy_file;
mod registry;
mod rollout;
mod run;
mod score;
mod settings;
mod settings_file;
mod trainer;
mod training_loop;
mod visits;

use crate::env::EnvError;
use crate::learn::LearnError;
pub use crate::settings::{Effect, Preset, Setting, USUAL};
use crate::store::StoreError;
pub use checkpoint::{
    CheckpointError, RunDescription, SaveTo, describe, from_bytes, is_checkpoint, is_own, load,
    load_with, read_history, read_saved, remove_own, save, save_or_else, to_bytes,
    with_changed_state,
};
pub use dataset::{DataSource, Dataset, data_file};
pub use evaluate::{EvaluationJob, TaskWalk};
pub use film::{Film, FilmFrame};
pub use history::{CurvePoint, History, LogEntry, MAX_LOG_ENTRIES, Methods, Moment, Notes};
pub use policy_file::policy_file;
pub use registry::{METHODS, Method, NamedMethod, Registry};
#[cfg(test)]
pub(crate) use run::tests::small_run;
pub use run::{Counters, EndReason, Limits, Pace, Run, Tick};
pub use score::{
    BridgeFacts, DistanceError, DistanceScore, Evaluation, MarkedTask, Score, SuccessSummary,
    TaskOutcome,
};
pub use settings::{SETTINGS, Settings, TrainSettings};
pub use settings_file::{
    ConfigError, Overrides, about_setting, changed_from, list_settings, print_settings,
    reference_page, setting_page, settings_from, settings_in_world, with_setting,
};
pub use trainer::{About, Edit, LeftOut, Recovery, Saved, Trainer, WorldChange, resets_networks};
pub use training_loop::{EvaluateAt, FIRST_SAVE, Schedule, TrainingEvent, TrainingLoop};

type Result<T, E = TrainError> = std::result::Result<T, E>;

impl From<candle_core::Error> for TrainError {
    fn from(error: candle_core::Error) -> Self {
        Self::Learn(error.into())
    }
}

#[derive(Clone, Debug, thiserror::Error)]
#[error("{file}: {problem}")]
pub struct DataError {
    pub file: String,
    /// What is wrong, and what would be right.
    pub problem: String,
}

#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error(transparent)]
    Learn(#[from] LearnError),
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Data(#[from] DataError),
    /// A world cannot replace the current one.
    #[error(transparent)]
    Env(#[from] EnvError),
    #[error("{0}")]
    Memory(String),
    /// The learner is not registered, or the networks are not finite.
    #[error("{0}")]
    Other(String),
}
