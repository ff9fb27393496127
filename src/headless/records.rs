//! The records of standard output, one JSON object a line.

use serde::Serialize;

use super::updates_per_second;
use crate::map::Diameter;
use crate::setup::Setup;
use crate::train::{
    BridgeFacts, DistanceError, EndReason, Evaluation, MapChange, MarkedTask, Recovery, Score, Trainer,
};

/// One line.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Record {
    Start {
        version: &'static str,
        map: MapRecord,
        method: &'static str,
        preset: &'static str,
        seed: u64,
        threads: usize,
        updates: u64,
    },
    Progress {
        seconds: f64,
        updates: u64,
        env_steps: u64,
        episodes: u64,
        updates_per_second: f64,
        losses: LossRecord,
    },
    Evaluation {
        seconds: f64,
        updates: u64,
        env_steps: u64,
        greedy: Score,
        planned: Option<Score>,
        distance_error: DistanceError,
        bridges: Option<BridgeFacts>,
        coverage: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        marked: Option<MarkedTask>,
    },
    Edit {
        seconds: f64,
        updates: u64,
        map: String,
        #[serde(flatten)]
        change: MapChange,
    },
    Saved {
        updates: u64,
        path: String,
    },
    Recovery(Recovery),
    End {
        reason: EndReason,
        seconds: f64,
        updates: u64,
        updates_per_second: f64,
    },
}

/// The map of a run.
#[derive(Debug, Serialize)]
pub struct MapRecord {
    name: String,
    width: usize,
    height: usize,
    free_cells: usize,
    diameter_steps: u32,
    /// Whether no two cells are farther apart than `diameter_steps`, or that is only the farthest pair found.
    diameter_exact: bool,
}

/// Running means of the losses.
#[derive(Debug, Serialize)]
pub struct LossRecord {
    critic: f32,
    model: f32,
    actor: f32,
}

impl Record {
    pub fn start(setup: &Setup, diameter: Diameter) -> Self {
        let (map, run) = (setup.trainer.map(), setup.trainer.run());
        Self::Start {
            version: env!("CARGO_PKG_VERSION"),
            map: MapRecord {
                name: map.name().to_owned(),
                width: map.width(),
                height: map.height(),
                free_cells: map.free_count(),
                diameter_steps: diameter.steps,
                diameter_exact: diameter.exact,
            },
            method: run.method.name(),
            preset: run.preset.name(),
            seed: run.seed,
            threads: setup.threads,
            updates: setup.trainer.counters().updates,
        }
    }

    pub fn progress(trainer: &Trainer) -> Self {
        let (counters, losses) = (trainer.counters(), trainer.losses());
        Self::Progress {
            seconds: round(trainer.seconds()),
            updates: counters.updates,
            env_steps: counters.env_steps,
            episodes: counters.episodes,
            updates_per_second: round(updates_per_second(trainer)),
            losses: LossRecord { critic: losses.critic, model: losses.model, actor: losses.actor },
        }
    }

    pub fn evaluation(trainer: &Trainer, evaluation: &Evaluation) -> Self {
        let counters = trainer.counters();
        let Evaluation { greedy, planned, distance_error, bridges, coverage, marked } = evaluation.clone();
        let (updates, env_steps) = (counters.updates, counters.env_steps);
        Self::Evaluation {
            seconds: round(trainer.seconds()),
            updates,
            env_steps,
            greedy,
            planned,
            distance_error,
            bridges,
            coverage,
            marked,
        }
    }

    pub fn edit(trainer: &Trainer, change: MapChange) -> Self {
        Self::Edit {
            seconds: round(trainer.seconds()),
            updates: trainer.counters().updates,
            map: trainer.map().name().to_owned(),
            change,
        }
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

/// Times and rates to the millisecond.
fn round(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}
