//! What a run is of, how far it has come, and when it ends.

use serde::{Deserialize, Serialize};

use super::method::{Method, Preset};
use super::settings::Settings;
use crate::bridge::BridgeSettings;
use crate::store::StoreError;

/// What a run is of: everything that its result depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// How agents act and what is learned.
    pub method: Method,
    /// Where the settings started from.
    pub preset: Preset,
    /// Seed of all random streams.
    pub seed: u64,
    /// The settings.
    pub settings: Settings,
}

impl Run {
    /// Settings of bridges as the method has them.
    pub fn bridge(&self) -> BridgeSettings {
        self.settings.bridge.of(self.method.planner)
    }
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Updates of the networks (of the learner `random`: that would have been due).
    pub updates: u64,
    /// Environment steps of all agents together.
    pub env_steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Goals reached while exploring.
    pub goals_reached: u64,
    /// Environment steps not yet paid for by updates.
    pub(super) owed: u64,
    /// The part of these that waits for an episode to end.
    pub(super) waiting: u64,
    /// The update up to which targets go by behaviour alone.
    pub(super) relearns_until: u64,
    /// Running means of the losses.
    pub(super) losses: [f64; 3],
    /// How often the run has gone back to earlier networks.
    #[serde(default)]
    pub recoveries: u32,
}

impl Counters {
    /// Counts beyond this come from no run.
    const MOST: u64 = 1 << 53;

    /// Checks what came from a file.
    ///
    /// # Errors
    /// That a number is out of range.
    pub(super) fn check(&self) -> Result<(), StoreError> {
        let counts = [self.updates, self.env_steps, self.episodes, self.goals_reached, self.owed, self.waiting];
        let sound = counts.iter().all(|n| *n < Self::MOST) && self.losses.iter().all(|loss| loss.is_finite());
        if sound { Ok(()) } else { Err(StoreError::misfit("the stored counters are out of range")) }
    }
}

/// What one tick did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tick {
    /// One update.
    Update,
    /// One step of every agent.
    Step,
}

/// When a run ends; counted from the beginning of training, resumed or not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// After so many updates.
    pub updates: Option<u64>,
    /// After so many seconds of training.
    pub seconds: Option<f64>,
    /// After so many episodes.
    pub episodes: Option<u64>,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    /// The limit of updates.
    MaxUpdates,
    /// The limit of training time.
    MaxSeconds,
    /// The limit of episodes.
    MaxEpisodes,
    /// A signal.
    Interrupted,
}
