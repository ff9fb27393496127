//! What is trained, and from which settings it starts.

use serde::{Deserialize, Serialize};

use super::settings::{Settings, TrainSettings};
use crate::bridge::BridgeSettings;
use crate::learn::LearnSettings;

/// How agents act and what is learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Goal-distance gradient: the actor alone.
    Gdg,
    /// The same with bridge points: searched in exploration, planned through at execution.
    GdgBridge,
    /// Search on the replay buffer (Eysenbach et al. 2019) on the same learned D: unverified edges, one plan.
    Sorb,
    /// Random actions, nothing learned: the floor.
    Random,
}

impl Method {
    /// Its name on the command line and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gdg => "gdg",
            Self::GdgBridge => "gdg-bridge",
            Self::Sorb => "sorb",
            Self::Random => "random",
        }
    }

    /// Whether it plans over a graph at execution.
    pub fn plans(self) -> bool {
        matches!(self, Self::GdgBridge | Self::Sorb)
    }

    /// Whether it also explores and learns by bridges.
    pub fn bridges(self) -> bool {
        self == Self::GdgBridge
    }
}

/// A set of settings with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Everything that measurement has shown to help.
    Default,
    /// Algorithms 1 and 2 to the letter.
    Paper,
}

impl Preset {
    /// Its name on the command line and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Paper => "paper",
        }
    }

    /// Its settings.
    pub fn settings(self) -> Settings {
        match self {
            Self::Default => Settings::default(),
            Self::Paper => Settings {
                learn: LearnSettings::paper(),
                bridge: BridgeSettings::paper(),
                train: TrainSettings::paper(),
            },
        }
    }
}
