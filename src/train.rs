//! Training: agents that explore, updates in step with them, evaluation, checkpoints, and the engine that runs all
//! this for the front ends.

mod checkpoint;
mod config;
mod engine;
mod evaluate;
mod graphs;
mod method;
mod rollout;
mod run;
mod score;
mod settings;
mod tasks;
mod trainer;

pub use checkpoint::{CheckpointError, load, save};
pub use config::{ConfigError, Overrides, settings_from};
pub use engine::{Command, Engine, Phase, Snapshot};
pub use evaluate::{BridgeFacts, ComposedError, DistanceError, Evaluation, EvaluationJob, Journey, MarkedTask};
pub use method::{Method, Preset};
pub use run::{Counters, EndReason, Limits, Run, Tick};
pub use score::{DistanceScore, Score};
pub use settings::{Restart, Settings, TrainSettings, UpdateWhen};
pub use tasks::{Task, TaskSet};
pub use trainer::{MapChange, Trainer};
