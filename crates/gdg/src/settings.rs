//! Definition of settings: everything about one is in a single entry, next to its field.
//!
//! A module declares its settings by the macro `settings!`, which makes of the entries a struct
//! with a field each, its values in every [`Preset`], and a list of [`Setting`]s. Checks, errors,
//! `--print-config`, the settings dialog, the page of settings and the ablation come from these.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

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
    pub const ALL: [Self; 4] = [Self::Default, Self::Paper, Self::Tuned, Self::Sb3];

    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Paper => "paper",
            Self::Tuned => "tuned",
            Self::Sb3 => "sb3",
        }
    }

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

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

/// The heading of those that matter most, which are listed first.
pub const USUAL: &str = "usual";

/// The groups of settings, in the order in which they are listed.
pub(crate) const GROUPS: [&str; 8] =
    ["networks", "targets", "batches", "optimiser", "agents", "exploration", "bridges", "planning"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    Immediate,
    /// Restarts agents and episodes; keeps networks and replay buffer.
    NewAgents,
    /// Resets the networks; keeps agents and replay buffer.
    NewNetworks,
}

impl Effect {
    pub fn about(self) -> &'static str {
        match self {
            Self::Immediate => "takes effect immediately",
            Self::NewAgents => "restarts the agents; keeps networks and replay",
            Self::NewNetworks => "resets the networks; keeps the replay",
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its name on the command line and in files.
    pub name: &'static str,
    pub group: &'static str,
    pub about: &'static str,
    /// Of those that matter most: what it does to success, as measured; empty for all others.
    pub usual: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    pub values: Values,
    pub effect: Effect,
    /// The experiment that does without it.
    pub ablation: Option<SettingAblation>,
}

#[derive(Clone, Copy, Debug)]
pub struct SettingAblation {
    pub name: &'static str,
    /// The setting's value, as typed.
    pub value: &'static str,
}

#[expect(clippy::unnecessary_wraps, reason = "as the entry's field takes it")]
pub(crate) const fn without(name: &'static str, value: &'static str) -> Option<SettingAblation> {
    Some(SettingAblation { name, value })
}

impl Setting {
    pub(crate) const PLAIN: Self = Self {
        name: "",
        group: GROUPS[0],
        about: "",
        usual: "",
        unit: "",
        values: Values::SWITCH,
        effect: Effect::Immediate,
        ablation: None,
    };

    /// The group under which it is listed for people.
    pub fn heading(&self) -> &'static str {
        if self.usual.is_empty() { self.group } else { USUAL }
    }
}

/// A setting that is derived from the run unless it is given. In JSON, `"auto"` or the value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Auto<T> {
    Given(T),
    Auto(AutoWord),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AutoWord {
    Auto,
}

impl<T: Copy> Auto<T> {
    pub const AUTO: Self = Self::Auto(AutoWord::Auto);

    pub fn given(self) -> Option<T> {
        match self {
            Self::Given(value) => Some(value),
            Self::Auto(_) => None,
        }
    }
}

/// The valid values of a setting. Displayed, they complete "must be".
#[derive(Clone, Copy, Debug)]
pub struct Values {
    pub(crate) kind: ValueKind,
    pub(crate) or_auto: bool,
    /// Additional condition on other settings; [`Values::accept`] does not check it.
    condition: &'static str,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ValueKind {
    Switch,
    Word(&'static [&'static str]),
    /// A whole number within both bounds, or without an upper bound.
    Count {
        from: u64,
        to: u64,
    },
    /// A number in single precision, within both bounds or without one of them.
    Number {
        noun: &'static str,
        from: f32,
        to: f32,
        excluded: Excluded,
    },
    /// A list of at most `max_len` numbers, each within both bounds.
    Numbers {
        max_len: usize,
        from: f32,
        to: f32,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Excluded {
    None,
    Lower,
    Upper,
    Both,
}

impl Values {
    pub(crate) const SWITCH: Self = Self::of(ValueKind::Switch);

    /// A number above 0, large enough to divide by.
    pub(crate) const POSITIVE: Self = Self::number(1e-38, 3e38);

    pub(crate) const FRACTION: Self = Self::measure("a fraction", 0.0, 1.0);

    pub(crate) const PROBABILITY: Self = Self::measure("a probability", 0.0, 1.0);

    const fn of(kind: ValueKind) -> Self {
        Self { kind, or_auto: false, condition: "" }
    }

    pub(crate) const fn word(words: &'static [&'static str]) -> Self {
        Self::of(ValueKind::Word(words))
    }

    pub(crate) const fn count(from: u64, to: u64) -> Self {
        Self::of(ValueKind::Count { from, to })
    }

    pub(crate) const fn number(from: f32, to: f32) -> Self {
        Self::measure("a number", from, to)
    }

    pub(crate) const fn steps(from: f32, to: f32) -> Self {
        Self::measure("a number of steps", from, to)
    }

    pub(crate) const fn measure(noun: &'static str, from: f32, to: f32) -> Self {
        Self::of(ValueKind::Number { noun, from, to, excluded: Excluded::None })
    }

    /// A number from 0 to 1, without one bound or both.
    pub(crate) const fn unit(excluded: Excluded) -> Self {
        Self::of(ValueKind::Number { noun: "a number", from: 0.0, to: 1.0, excluded })
    }

    pub(crate) const SCALES: Self =
        Self::of(ValueKind::Numbers { max_len: 16, from: 0.01, to: 1e6 });

    pub(crate) const fn or_auto(self) -> Self {
        Self { or_auto: true, ..self }
    }

    /// These values, with a `condition` that involves other settings and is checked with them.
    pub(crate) const fn with(self, condition: &'static str) -> Self {
        Self { condition, ..self }
    }

    /// Whether they are whole numbers (or, for some settings, a word).
    pub fn are_counts(&self) -> bool {
        matches!(self.kind, ValueKind::Count { .. })
    }

    /// Whether `value` is one of them, as JSON.
    pub fn accept(&self, value: &Value) -> bool {
        // As the field reads it.
        let real = |value: &Value| value.as_f64().map(|value| value as f32);
        if self.or_auto && value == "auto" {
            return true;
        }
        match self.kind {
            ValueKind::Switch => value.is_boolean(),
            ValueKind::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
            ValueKind::Count { from, to } => value.as_u64().is_some_and(|n| from <= n && n <= to),
            ValueKind::Number { from, to, excluded, .. } => {
                real(value).is_some_and(|v| match excluded {
                    Excluded::None => from <= v && v <= to,
                    Excluded::Lower => from < v && v <= to,
                    Excluded::Upper => from <= v && v < to,
                    Excluded::Both => from < v && v < to,
                })
            }
            ValueKind::Numbers { max_len, from, to } => value.as_array().is_some_and(|list| {
                let fits = |v: &Value| real(v).is_some_and(|v| (from..=to).contains(&v));
                list.len() <= max_len && list.iter().all(fits)
            }),
        }
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.or_auto {
            f.write_str("auto, or ")?;
        }
        match self.kind {
            ValueKind::Switch => f.write_str("true or false")?,
            ValueKind::Word(words) => {
                let (last, others) = words.split_last().unwrap_or((&"", &[]));
                write!(f, "{} or {last}", others.join(", "))?;
            }
            ValueKind::Count { from, to: u64::MAX } => write!(f, "an integer, {from} or more")?,
            ValueKind::Count { from, to } if to == from + 1 => write!(f, "{from} or {to}")?,
            ValueKind::Count { from, to } => write!(f, "an integer from {from} to {to}")?,
            kind if kind == Self::POSITIVE.kind => f.write_str("a number above 0")?,
            ValueKind::Number { noun, from, to, excluded } => {
                let (from, to) = (Short(from), Short(to));
                match excluded {
                    Excluded::None => write!(f, "{noun} from {from} to {to}"),
                    Excluded::Lower => write!(f, "{noun} above {from}, at most {to}"),
                    Excluded::Upper => write!(f, "{noun} from {from}, below {to}"),
                    Excluded::Both => write!(f, "{noun} above {from} and below {to}"),
                }?;
            }
            ValueKind::Numbers { max_len, from, to } => {
                write!(f, "up to {max_len} numbers from {} to {}", Short(from), Short(to))?;
            }
        }
        if self.condition.is_empty() { Ok(()) } else { write!(f, ", {}", self.condition) }
    }
}

/// Writes a number exactly, in as few characters as it takes: `0.01`, `1e6`.
struct Short(f32);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [plain, scientific] = [format!("{}", self.0), format!("{:e}", self.0)];
        f.write_str(if plain.len() <= scientific.len() { &plain } else { &scientific })
    }
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
            #[allow(clippy::needless_update, reason = "an entry may give all there is")]
            pub(crate) const ENTRIES: &'static [$crate::settings::Setting] = &[
                $($($crate::settings::Setting {
                    name: stringify!($field),
                    group: stringify!($group),
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
