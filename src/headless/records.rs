//! The records on standard output, one JSON object per line.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{HeadlessOptions, save_interval, updates_per_second};
use crate::setup::Setup;
use gdg::learn::{Losses, Threads};
use gdg::train::{DataSource, Edit, EndReason, Evaluation, Moment, Recovery, Trainer, WorldChange};

#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Record {
    Start(Box<Start>),
    Progress(Progress),
    Evaluation(Box<EvaluationAt>),
    Edit {
        #[serde(default)]
        seconds: f64,
        updates: u64,
        #[serde(skip_serializing_if = "Option::is_none")]
        fingerprint: Option<String>,
        #[serde(flatten)]
        change: WorldChange,
    },
    Saved {
        #[serde(default)]
        updates: u64,
        path: String,
    },
    Recovery(Recovery),
    /// A warning for the user, and when it came.
    Warning(Value),
    End {
        reason: EndReason,
        #[serde(default)]
        seconds: f64,
        updates: u64,
        #[serde(default)]
        updates_per_second: f64,
    },
    /// Of another version.
    #[serde(other)]
    Other,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct Start {
    /// The program's, and in what follows: older records do not say everything.
    pub version: Option<String>,
    pub world: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
    #[serde(flatten)]
    pub facts: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<DataSource>,
    pub method: String,
    pub preset: String,
    /// Settings that differ from the preset's.
    pub settings: Map<String, Value>,
    pub seed: u64,
    #[serde(default)]
    pub eval_tasks: usize,
    /// Edits to come.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edit_at: Vec<String>,
    /// A number, or "auto".
    #[serde(default)]
    pub threads: Value,
    #[serde(default)]
    pub updates: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resumed: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub save: Option<String>,
    pub save_every: Option<f64>,
}

/// How far a run is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Progress {
    pub seconds: f64,
    pub updates: u64,
    pub env_steps: u64,
    pub episodes: u64,
    pub updates_per_second: f64,
    /// Estimated seconds until the run ends.
    pub left: Option<f64>,
    /// Share of the latest steps that have moved the achieved goal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_moved: Option<f64>,
    pub losses: LossRecord,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossRecord {
    critic: Option<f32>,
    model: Option<f32>,
    actor: Option<f32>,
}

/// An evaluation, as records and results of jobs have it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationAt {
    /// Training time before it.
    pub seconds: f64,
    pub updates: u64,
    /// Environment steps before it, summed over all agents.
    pub env_steps: u64,
    #[serde(flatten)]
    pub evaluation: Evaluation,
}

impl EvaluationAt {
    /// Whether its numbers can be: somebody may have edited the file.
    pub fn is_possible(&self) -> bool {
        let Evaluation { alone, planned, explored, error, .. } = &self.evaluation;
        let mut rates = [alone].into_iter().chain(planned).filter_map(|score| score.success);
        rates.all(|rate| (0.0..=1.0).contains(&rate))
            && explored.is_none_or(|share| (0.0..=1.0).contains(&share))
            && error.as_ref().is_none_or(|error| error.mape >= 0.0)
            && self.seconds >= 0.0
    }
}

impl Record {
    pub fn start(setup: &Setup, options: &HeadlessOptions, facts: Map<String, Value>) -> Self {
        let (run, text) = (setup.trainer.run(), |path: &Path| path.to_string_lossy().into_owned());
        let edit = |edit: &Edit| Some(format!("{}:{}", edit.updates, edit.world.fingerprint()?));
        Self::Start(Box::new(Start {
            version: Some(env!("CARGO_PKG_VERSION").to_owned()),
            world: setup.trainer.world().kind().to_owned(),
            fingerprint: setup.trainer.world().fingerprint(),
            facts,
            data: setup.trainer.data().cloned(),
            method: run.method.name(),
            preset: run.preset.name().to_owned(),
            settings: run.changed_settings(),
            seed: run.seed,
            eval_tasks: options.tasks(),
            edit_at: setup.trainer.edits.iter().filter_map(edit).collect(),
            threads: match setup.threads {
                Threads::Fixed(number) => number.into(),
                Threads::Auto { .. } => "auto".into(),
            },
            updates: setup.trainer.counters().updates,
            resumed: setup.resumed.as_deref().map(text),
            save: setup.save.as_ref().map(|to| text(to.path())),
            save_every: save_interval(options.save_every).map(|every| every.as_secs_f64()),
        }))
    }

    /// Creates the record of the trainer's state, with the estimated seconds `left`.
    pub fn progress(trainer: &Trainer, left: Option<f64>) -> Self {
        let (counters, losses) = (trainer.counters(), trainer.losses());
        Self::Progress(Progress {
            seconds: round(trainer.seconds()),
            updates: counters.updates,
            env_steps: counters.env_steps,
            episodes: counters.episodes,
            updates_per_second: round(updates_per_second(trainer)),
            left: left.map(round),
            goal_moved: trainer.goal_moved().map(round),
            losses: LossRecord {
                critic: Losses::known(losses.critic),
                model: Losses::known(losses.model),
                actor: Losses::known(losses.actor),
            },
        })
    }

    pub fn evaluation(trainer: &Trainer, evaluation: &Evaluation) -> Self {
        let Moment { updates, env_steps, seconds } = trainer.moment();
        let (seconds, evaluation) = (round(seconds), evaluation.clone());
        Self::Evaluation(Box::new(EvaluationAt { seconds, updates, env_steps, evaluation }))
    }

    pub fn edit(trainer: &Trainer, change: WorldChange) -> Self {
        let (seconds, updates) = (round(trainer.seconds()), trainer.counters().updates);
        let fingerprint = trainer.world().fingerprint();
        Self::Edit { seconds, updates, fingerprint, change }
    }

    pub fn saved(trainer: &Trainer, path: &Path) -> Self {
        let path = path.to_string_lossy().into_owned();
        Self::Saved { updates: trainer.counters().updates, path }
    }

    pub fn end(reason: EndReason, trainer: &Trainer) -> Self {
        Self::End {
            reason,
            seconds: round(trainer.seconds()),
            updates: trainer.counters().updates,
            updates_per_second: round(updates_per_second(trainer)),
        }
    }
}

fn round(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}
