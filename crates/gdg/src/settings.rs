//! Definition of settings: everything about one is in a single entry, next to its field.
//!
//! A module declares its settings by the macro `settings!`, which makes of the entries a struct
//! with a field each, its values in every [`Preset`], and a list of [`Setting`]s. Checks, errors,
//! `--print-config`, the settings dialog, the page of settings and the ablation come from these.

pub(crate) mod values;

use serde::{Deserialize, Serialize};

pub(crate) use values::Excluded;
pub use values::{Auto, AutoWord, Values};

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

/// A group of related settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// The networks and their inputs.
    Networks,
    /// The critics' targets.
    Targets,
    /// Composition of a batch.
    Batches,
    /// Step sizes, update schedule and backend.
    Optimiser,
    /// Agents, episodes and the world.
    Agents,
    /// How agents explore.
    Exploration,
    /// Bridge candidates and the edges between them.
    Bridges,
    /// Execution of plans.
    Planning,
}

impl Group {
    /// All groups, in the order in which settings are listed.
    pub const ALL: [Self; 8] = [
        Self::Networks,
        Self::Targets,
        Self::Batches,
        Self::Optimiser,
        Self::Agents,
        Self::Exploration,
        Self::Bridges,
        Self::Planning,
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Networks => "networks",
            Self::Targets => "targets",
            Self::Batches => "batches",
            Self::Optimiser => "optimiser",
            Self::Agents => "agents",
            Self::Exploration => "exploration",
            Self::Bridges => "bridges",
            Self::Planning => "planning",
        }
    }
}

/// Effect of changing a setting during a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Takes effect immediately.
    Immediate,
    /// Restarts agents and episodes; keeps networks and replay buffer.
    NewAgents,
    /// Resets the networks; keeps agents and replay buffer.
    NewNetworks,
}

impl Effect {
    /// Returns a short description.
    pub fn about(self) -> &'static str {
        match self {
            Self::Immediate => "takes effect immediately",
            Self::NewAgents => "restarts the agents; keeps networks and replay",
            Self::NewNetworks => "resets the networks; keeps the replay",
        }
    }
}

/// Everything about a setting except its type and its values in the presets.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its name on the command line and in files.
    pub name: &'static str,
    /// The group it belongs to.
    pub group: Group,
    /// Description.
    pub about: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// Its valid values.
    pub values: Values,
    /// Effect of a change during a run.
    pub effect: Effect,
    /// The experiment that does without it.
    pub ablation: Option<Ablation>,
}

/// A run that does without something, by another value of its setting.
#[derive(Clone, Copy, Debug)]
pub struct Ablation {
    /// What is missing.
    pub name: &'static str,
    /// The setting's value, as typed.
    pub value: &'static str,
}

/// Returns an [`Ablation`] for an entry.
#[expect(clippy::unnecessary_wraps, reason = "as the entry's field takes it")]
pub(crate) const fn without(name: &'static str, value: &'static str) -> Option<Ablation> {
    Some(Ablation { name, value })
}

impl Setting {
    /// Defaults for what an entry leaves out.
    pub(crate) const PLAIN: Self = Self {
        name: "",
        group: Group::Networks,
        about: "",
        unit: "",
        values: Values::SWITCH,
        effect: Effect::Immediate,
        ablation: None,
    };
}

/// Defines a struct of settings from one entry each, by group:
///
/// ```text
/// pub struct NAME {
///     GROUP {
///         field: type = default, Preset | Preset => value;
///             "description", values: .., unit: "..", effect: .., ablation: without("..", "..");
///     }
/// }
/// ```
///
/// All but name, type, default and description can be left out: a plain setting is a switch that
/// takes effect immediately. Doc comments before an entry add to its description.
macro_rules! settings {
    (
        $(#[$about_all:meta])*
        pub struct $name:ident {
            $($group:ident {
                $(
                    $(#[$attribute:meta])*
                    $field:ident: $type:ty =
                        $default:expr $(, $preset:pat => $value:expr)*;
                        $about:literal $(, $property:ident: $content:expr)*;
                )*
            })*
        }
    ) => {
        $(#[$about_all])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        pub struct $name {
            $($(
                #[doc = $about]
                #[doc = ""]
                $(#[$attribute])*
                pub $field: $type,
            )*)*
        }

        impl $name {
            /// An entry for each field.
            #[allow(clippy::needless_update, reason = "an entry may give all there is")]
            pub(crate) const ENTRIES: &'static [$crate::settings::Setting] = &[
                $($($crate::settings::Setting {
                    name: stringify!($field),
                    group: $crate::settings::Group::$group,
                    about: $about,
                    $($property: $content,)*
                    ..$crate::settings::Setting::PLAIN
                },)*)*
            ];

            /// Returns the values in `preset`.
            pub fn of(preset: $crate::settings::Preset) -> Self {
                Self {
                    $($($field: match preset {
                        $($preset => $value,)*
                        _ => $default,
                    },)*)*
                }
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::of($crate::settings::Preset::Default)
            }
        }
    };
}

pub(crate) use settings;
