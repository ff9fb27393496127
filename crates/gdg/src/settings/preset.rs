//! Named sets of settings.

use serde::{Deserialize, Serialize};

/// A named set of settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Every addition that measurably helps.
    Default,
    /// Algorithms 1 and 2 exactly as published.
    Paper,
    /// Rivals with rewards as published, in the setting in which they do best here.
    Tuned,
    /// Rivals with rewards by Stable-Baselines3's defaults.
    Sb3,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 4] = [Self::Default, Self::Paper, Self::Tuned, Self::Sb3];

    /// Returns the name used on the command line and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Paper => "paper",
            Self::Tuned => "tuned",
            Self::Sb3 => "sb3",
        }
    }

    /// Returns the preset called `name`.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// Returns a short description.
    pub fn about(self) -> &'static str {
        match self {
            Self::Default => "All additions that measurably help",
            Self::Paper => "The algorithms exactly as published",
            Self::Tuned => "Baselines (ddpg, her, ddpg-distance) as they do best here",
            Self::Sb3 => "Baselines by the defaults of Stable-Baselines3",
        }
    }

    /// Whether a world's default settings ([`WorldKind::defaults`](crate::env::WorldKind)) apply to
    /// it: published presets stay as they are.
    pub fn adapts_to_world(self) -> bool {
        match self {
            Self::Default | Self::Tuned => true,
            Self::Paper | Self::Sb3 => false,
        }
    }
}
