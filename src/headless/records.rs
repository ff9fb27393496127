//! The records on standard output, one JSON object per line.

use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use super::{HeadlessOptions, save_interval, updates_per_second};
use crate::setup::Setup;
use gdg::learn::{Losses, Threads};
use gdg::train::{
    BridgeFacts, DataSource, DistanceError, Edit, EndReason, Evaluation, MarkedTask, Moment,
    Recovery, Score, Trainer, WorldChange,
};

#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Record {
    Start {
        version: &'static str,
        world: &'static str,
        #[serde(skip_serializing_if = "Option::is_none")]
        fingerprint: Option<String>,
        #[serde(flatten)]
        facts: Map<String, Value>,
        #[serde(skip_serializing_if = "Option::is_none")]
        data: Option<DataSource>,
        method: String,
        preset: &'static str,
        /// Settings that differ from the preset's.
        settings: Map<String, Value>,
        seed: u64,
        eval_tasks: usize,
        /// Edits to come.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        edit_at: Vec<String>,
        /// A number, or "auto".
        threads: Value,
        updates: u64,
        #[serde(skip_serializing_if = "Option::is_none")]
        resumed: Option<String>,
        #[serde(skip_serializing_if = "Option::is_none")]
        save: Option<String>,
        save_every: Option<f64>,
    },
    Progress {
        seconds: f64,
        updates: u64,
        env_steps: u64,
        episodes: u64,
        updates_per_second: f64,
        left: Option<f64>,
        /// Share of the latest steps that have moved the achieved goal.
        #[serde(skip_serializing_if = "Option::is_none")]
        goal_moved: Option<f64>,
        losses: LossRecord,
    },
    Evaluation {
        seconds: f64,
        updates: u64,
        env_steps: u64,
        greedy: Score,
        planned: Option<Score>,
        #[serde(skip_serializing_if = "Option::is_none")]
        // Boxed, as it would make this variant far larger than the others.
        straight: Option<Box<Score>>,
        distance_error: Option<DistanceError>,
        bridges: Option<BridgeFacts>,
        coverage: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        marked: Option<MarkedTask>,
    },
    Edit {
        seconds: f64,
        updates: u64,
        #[serde(skip_serializing_if = "Option::is_none")]
        fingerprint: Option<String>,
        #[serde(flatten)]
        change: WorldChange,
    },
    Saved {
        updates: u64,
        path: String,
    },
    Recovery(Recovery),
    /// What the user is told, and when.
    Warning(Value),
    End {
        reason: EndReason,
        seconds: f64,
        updates: u64,
        updates_per_second: f64,
    },
}

#[derive(Debug, Serialize)]
pub struct LossRecord {
    critic: Option<f32>,
    model: Option<f32>,
    actor: Option<f32>,
}

impl Record {
    pub fn start(setup: &Setup, options: &HeadlessOptions, facts: Map<String, Value>) -> Self {
        let (run, text) = (setup.trainer.run(), |path: &Path| path.to_string_lossy().into_owned());
        let edit = |edit: &Edit| Some(format!("{}:{}", edit.updates, edit.world.fingerprint()?));
        Self::Start {
            version: env!("CARGO_PKG_VERSION"),
            world: setup.trainer.world().kind(),
            fingerprint: setup.trainer.world().fingerprint(),
            facts,
            data: setup.trainer.data().cloned(),
            method: run.method.name(),
            preset: run.preset.name(),
            settings: run.changed_settings(),
            seed: run.seed,
            eval_tasks: options.eval_tasks,
            edit_at: setup.trainer.edits.iter().filter_map(edit).collect(),
            threads: match setup.threads {
                Threads::Fixed(number) => number.into(),
                Threads::Auto { .. } => "auto".into(),
            },
            updates: setup.trainer.counters().updates,
            resumed: setup.resumed.as_deref().map(text),
            save: setup.save.as_ref().map(|to| text(to.path())),
            save_every: save_interval(options.save_every_minutes).map(|every| every.as_secs_f64()),
        }
    }

    /// Creates the record of the trainer's state, with the estimated seconds `left`.
    pub fn progress(trainer: &Trainer, left: Option<f64>) -> Self {
        let (counters, losses) = (trainer.counters(), trainer.losses());
        Self::Progress {
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
        }
    }

    pub fn evaluation(trainer: &Trainer, evaluation: &Evaluation) -> Self {
        let Moment { updates, env_steps, seconds } = trainer.moment();
        let Evaluation { greedy, planned, straight, distance_error, bridges, coverage, marked } =
            evaluation.clone();
        Self::Evaluation {
            seconds: round(seconds),
            updates,
            env_steps,
            greedy,
            planned,
            straight: straight.map(Box::new),
            distance_error,
            bridges,
            coverage,
            marked,
        }
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
