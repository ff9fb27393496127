//! Training: agents that explore, updates in step with them, evaluation, checkpoints, and the engine that runs all
//! this for the front ends.

mod checkpoint;
mod config;
mod engine;
mod evaluate;
mod graphs;
mod history;
pub mod memory;
mod method;
mod rollout;
mod run;
mod score;
mod settings;
mod tasks;
mod trainer;

pub use checkpoint::{CheckpointError, Description, Loaded, SaveTo, describe, from_bytes, load, resealed, save};
pub use config::{
    ConfigError, Effect, Overrides, effect_of, list_settings, settings_from, settings_from_text, with_setting,
};
pub use engine::{Command, Engine, Followed, Phase, Snapshot, Step};
pub use evaluate::{BridgeFacts, ComposedError, DistanceError, Evaluation, EvaluationJob, Journey, MarkedTask};
pub use history::{History, LogEntry, LossPoint, MOST_ENTRIES};
pub use method::{Method, Preset};
pub use run::{Counters, EndReason, Limits, Run, Tick};
pub use score::{DistanceScore, Score, Success};
pub use settings::{Restart, Settings, TrainSettings, UpdateWhen};
pub use tasks::{Task, TaskSet};
pub use trainer::{Kept, MapChange, Recovery, Trainer};
