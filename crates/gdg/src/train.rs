//! Training: exploring agents, updates interleaved with their steps, evaluation and checkpoints.

mod checkpoint;
mod config;
mod dataset;
mod error;
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
mod session;
mod settings;
mod trainer;
mod visits;

pub use crate::settings::{Effect, Preset, Setting};
pub use checkpoint::{
    CheckpointError, Description, SaveTo, describe, from_bytes, is_checkpoint, is_own, load,
    load_with, read_history, read_saved, remove_own, save, to_bytes, with_changed_state,
};
pub use config::{
    ConfigError, Overrides, changed_from, list_settings, print_settings, reference_page,
    settings_from, settings_from_text, settings_in_world, with_setting,
};
pub use dataset::{DataSource, Dataset, data_file};
pub use error::TrainError;
pub use evaluate::{EvaluationJob, TaskWalk};
pub use film::{Film, FilmFrame};
pub use history::{CurvePoint, History, LogEntry, MAX_LOG_ENTRIES, Methods, Moment, Notes};
pub use policy_file::policy_file;
pub use registry::{METHODS, Method, NamedMethod, Registry};
#[cfg(test)]
pub(crate) use run::tests::small_run;
pub use run::{Counters, EndReason, Limits, Pace, Run, Tick};
pub use score::{
    BridgeFacts, DistanceError, DistanceScore, Evaluation, MarkedTask, Score, Success, TaskOutcome,
};
pub use session::{Due, EvaluateAt, Schedule, Session};
pub use settings::{SETTINGS, Settings, TrainSettings};
pub use trainer::{About, LeftOut, Recovery, Saved, Trainer, WorldChange, resets_networks};
