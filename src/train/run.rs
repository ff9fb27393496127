//! A run's definition, progress and limits.

use serde::{Deserialize, Serialize};

use super::method::{Method, Preset};
use super::settings::Settings;
use crate::bridge::BridgeSettings;
use crate::store::StoreError;

/// Definition of a run: everything that its result depends on besides the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// How agents act and what is learned.
    pub method: Method,
    /// The preset that the settings are based on.
    pub preset: Preset,
    /// Seed of all random streams.
    pub seed: u64,
    /// The settings.
    pub settings: Settings,
}

impl Run {
    /// Returns the bridge settings, adjusted to the method's planner.
    pub fn bridge(&self) -> BridgeSettings {
        self.settings.bridge.for_planner(self.method.planner)
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Network updates (for the learner `random`: updates that would have been due).
    pub updates: u64,
    /// Environment steps, summed over all agents.
    pub env_steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Goals reached while exploring.
    pub goals_reached: u64,
    /// Environment steps whose updates are due but not done.
    #[serde(rename = "owed")]
    pub(super) owed_steps: u64,
    /// Environment steps whose updates become due when an episode ends.
    #[serde(rename = "waiting")]
    pub(super) deferred_steps: u64,
    /// The last update at which changed distances are relearned.
    pub(super) relearns_until: u64,
    /// Environment steps at the latest change of the world.
    #[serde(default)]
    pub(super) changed_at_step: u64,
    /// Running means of the losses.
    pub(super) losses: [f64; 3],
    /// Number of rollbacks to earlier networks.
    #[serde(default)]
    pub recoveries: u32,
}

impl Counters {
    /// Exclusive upper bound of plausible counts.
    const MAX_COUNT: u64 = 1 << 53;

    /// Checks counters read from a file.
    ///
    /// # Errors
    /// A number is out of range.
    pub(super) fn check(&self) -> Result<(), StoreError> {
        let counts =
            [self.updates, self.env_steps, self.episodes, self.goals_reached, self.owed_steps, self.deferred_steps];
        let sound = counts.iter().all(|n| *n < Self::MAX_COUNT) && self.losses.iter().all(|loss| loss.is_finite());
        if sound { Ok(()) } else { Err(StoreError::inconsistent("the stored counters are out of range")) }
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

/// Limits of a run, counted from the start of training, resumed or not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Maximum number of updates.
    pub updates: Option<u64>,
    /// Maximum training time in seconds.
    pub seconds: Option<f64>,
    /// Maximum number of episodes.
    pub episodes: Option<u64>,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    /// The update limit was reached.
    MaxUpdates,
    /// The limit of training time was reached.
    MaxSeconds,
    /// The episode limit was reached.
    MaxEpisodes,
    /// A signal arrived.
    Interrupted,
}
