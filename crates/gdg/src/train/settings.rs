//! All settings of a run.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::bridge::BridgeSettings;
use crate::env::{EnvSettings, Goals, Restart};
use crate::learn::LearnSettings;
use crate::settings::Effect::NewAgents;
use crate::settings::Preset::{Paper, Sb3, Tuned};
use crate::settings::{Auto, GROUPS, Preset, Setting, Values, settings, without};

/// All settings, in the order in which they are listed: group by group.
pub static SETTINGS: LazyLock<Vec<Setting>> = LazyLock::new(|| {
    let modules = [LearnSettings::ENTRIES, TrainSettings::ENTRIES, BridgeSettings::ENTRIES];
    let mut settings = modules.concat();
    settings.sort_by_key(|setting| GROUPS.iter().position(|group| *group == setting.group));
    settings
});

impl Setting {
    pub fn named(name: &str) -> Option<&'static Self> {
        SETTINGS.iter().find(|setting| setting.name == name)
    }
}

/// The values of all settings, serialised as one flat list of names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    #[serde(flatten)]
    pub learn: LearnSettings,
    #[serde(flatten)]
    pub bridge: BridgeSettings,
    #[serde(flatten)]
    pub train: TrainSettings,
}

#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the setting {} is out of range", .0.name)]
pub struct OutOfRange(pub &'static Setting);

impl Preset {
    pub fn settings(self) -> Settings {
        Settings {
            learn: LearnSettings::of(self),
            bridge: BridgeSettings::of(self),
            train: TrainSettings::of(self),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateWhen {
    Step,
    /// At the end of each episode, as in Algorithm 1.
    EpisodeEnd,
}

const MAX_EPISODE_STEPS: u32 = 60_000;

/// Least length of automatic episodes, in steps.
pub(crate) const MIN_EPISODE_STEPS: u32 = 150;

/// Least length of automatic episodes, as a multiple of the longest distance in the bridge graph.
pub(crate) const EPISODE_FACTOR: f32 = 3.0;

/// Mean number of steps for which a random direction is held.
pub(crate) const RANDOM_HOLD_STEPS: f32 = 10.0;

settings! {
    pub struct TrainSettings {
        optimiser {
            env_steps_per_update: u64 = 16, Paper | Sb3 => 1, Tuned => 2;
                "environment steps, summed over all agents, per update",
                usual: "Early, more is better and slower: city 0.14 0.95 1.00 with 4, 16, 64.",
                values: Values::count(1, 1_000_000), unit: "steps";
            update_when: UpdateWhen = UpdateWhen::Step, Paper => UpdateWhen::EpisodeEnd;
                "run updates as soon as they are due or, as in Algorithm 1, after each episode",
                values: Values::word(&["step", "episode-end"]);
            learning_starts: u64 = 4_000, Paper => 1_000, Sb3 => 100;
                "environment steps before the first update",
                values: Values::count(0, 100_000_000), unit: "steps";
        }
        agents {
            offline_updates: u64 = 0;
                "with --data, updates from the data alone before agents act as well; 0: they never do",
                values: Values::count(0, 1_000_000_000), unit: "updates";
            agents: usize = 32, Paper | Sb3 => 1;
                "agents exploring in parallel",
                usual: "They share the steps: city planned 1.00 0.95 0.23 with 8, 32, 128, early.",
                values: Values::count(1, 4096), effect: NewAgents;
            episode_steps: Auto<u32> = Auto::AUTO, Paper => Auto::Given(20), Sb3 => Auto::Given(150);
                "steps per episode; auto: three times the longest distance in the bridge graph, \
                 and at least 150",
                values: Values::count(1, MAX_EPISODE_STEPS as u64).or_auto(), unit: "steps",
                ablation: without("episodes of 150 steps", "150");
            restart: Restart = Restart::Auto, Paper | Sb3 => Restart::Anywhere;
                "start of an episode: anywhere, the map's start S, or where the last one ended; \
                 auto: never if there is an S, and S with goals=map",
                values: Values::word(&["auto", "anywhere", "start-cell", "never"]),
                effect: NewAgents,
                ablation: without("episodes from anywhere", "anywhere");
            /// The paper's local optimum has one goal. Batches are still relabelled as they say, and
            /// bridge points are still first goals on the way.
            goals: Goals = Goals::Anywhere;
                "what agents are asked to reach: places anywhere, or always the map's goal G, from \
                 its start S; reaching it begins a new episode if new_goal_when_reached",
                values: Values::word(&["anywhere", "map"]).with("map only without near_goals and \
                 with restart=auto or start-cell"),
                effect: NewAgents;
            /// It takes no knowledge of the world. SoRB (Eysenbach et al. 2019) trains on near
            /// goals with probability 0.8.
            near_goals: f32 = 0.0, Paper => 0.8;
                "probability that an agent's goal is where a short straight walk from its place \
                 ends",
                values: Values::PROBABILITY;
            near_goal_steps: u32 = 4;
                "longest of these walks",
                values: Values::count(1, 10_000), unit: "steps";
            new_goal_when_reached: bool = true, Paper | Sb3 => false;
                "give an agent that reaches its goal, or gives up on it, a new one within the \
                 episode";
            env_noise: f32 = 0.0, Paper => 1.0;
                "standard deviation of the noise added to every action by the environment",
                values: Values::number(0.0, 100.0);
        }
        exploration {
            random_actions: f32 = 0.3, Paper | Sb3 => 0.0;
                "fraction of steps in a random direction instead of the actor's",
                usual: "All from 0 to 0.6 do well early (four rooms: actor alone 0.70 to 0.78).",
                values: Values::FRACTION;
            exploration_noise: f32 = 0.2;
                "standard deviation of the Gaussian noise on the actor's actions",
                values: Values::number(0.0, 100.0);
        }
    }
}

impl TrainSettings {
    pub fn env(&self) -> EnvSettings {
        EnvSettings { restart: self.restart, goals: self.goals, noise: self.env_noise }
    }
}

impl Settings {
    /// Returns all values by name, in the order of [`SETTINGS`].
    pub fn values(&self) -> Map<String, Value> {
        // Round-trips through text, which prints 0.005 rather than the nearest binary fraction.
        match serde_json::to_string(self).and_then(|text| serde_json::from_str(&text)) {
            Ok(Value::Object(mut map)) => {
                SETTINGS.iter().filter_map(|setting| map.remove_entry(setting.name)).collect()
            }
            _ => unreachable!("settings are an object of names and values"),
        }
    }

    pub fn validate(&self) -> Result<(), OutOfRange> {
        self.validate_ranges()?;
        demand(self.contradicting_goals().is_empty(), "goals")?;
        demand(self.learn.buffer_size >= self.needed_buffer_size(), "buffer_size")
    }

    /// Checks every value's own range.
    pub fn validate_ranges(&self) -> Result<(), OutOfRange> {
        let values = self.values();
        let is_valid = |setting: &Setting| setting.values.accept(&values[setting.name]);
        if let Some(wrong) = SETTINGS.iter().find(|setting| !is_valid(setting)) {
            return Err(OutOfRange(wrong));
        }
        demand(self.learn.goal_random + self.learn.goal_hindsight <= 1.0, "goal_random")
    }

    /// Returns what would have to be set for `goals=map`, by which every episode leads from the
    /// map's start to its goal: nothing if all is well.
    pub fn contradicting_goals(&self) -> Vec<&'static str> {
        let TrainSettings { goals, near_goals, restart, .. } = self.train;
        let moves = [Restart::Anywhere, Restart::Never].contains(&restart);
        let needed = [(near_goals > 0.0, "near_goals=0"), (moves, "restart=start-cell")];
        needed
            .into_iter()
            .filter(|(is, _)| *is && goals == Goals::Map)
            .map(|(_, set)| set)
            .collect()
    }

    pub(crate) fn needed_buffer_size(&self) -> usize {
        self.train.agents.saturating_mul(self.min_episode_steps() as usize + 1)
    }

    /// Returns the minimum of [`Self::episode_steps`].
    pub fn min_episode_steps(&self) -> u32 {
        self.train.episode_steps.given().unwrap_or(MIN_EPISODE_STEPS)
    }

    /// Returns the steps of an episode while the longest distance in the bridge graph is
    /// `longest_steps`: an agent must be able to cross the known world and explore beyond it.
    pub fn episode_steps(&self, longest_steps: f32) -> u32 {
        let automatic = (EPISODE_FACTOR * longest_steps) as u32;
        // The longest that fits into each agent's share of the replay buffer.
        let share = (self.learn.buffer_size / self.train.agents).saturating_sub(1);
        let most = u32::try_from(share).unwrap_or(u32::MAX).min(MAX_EPISODE_STEPS);
        self.train
            .episode_steps
            .given()
            .unwrap_or_else(|| automatic.max(MIN_EPISODE_STEPS).min(most))
    }
}

fn demand(holds: bool, setting: &str) -> Result<(), OutOfRange> {
    Setting::named(setting).filter(|_| !holds).map_or(Ok(()), |setting| Err(OutOfRange(setting)))
}

#[cfg(test)]
mod tests {
    //! Every setting does what its entry says.

    use super::*;
    use crate::settings::ValueKind;
    use crate::train::with_setting;

    fn with(setting: &Setting, value: Value) -> Option<Settings> {
        let mut values = Settings::default().values();
        if setting.name == "goal_random" {
            // Leaves room for all of its own range.
            values["goal_hindsight"] = 0.into();
        }
        values.insert(setting.name.to_owned(), value);
        serde_json::from_value(Value::Object(values)).ok()
    }

    fn number(value: f32) -> Value {
        let text = serde_json::to_string(&value).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or(Value::Null)
    }

    /// Returns the outermost values of this kind, and those beyond.
    fn bounds(kind: ValueKind) -> [Vec<Value>; 2] {
        match kind {
            ValueKind::Switch => [vec![true.into(), false.into()], vec![0.into()]],
            ValueKind::Word(words) => {
                [words.iter().map(|word| (*word).into()).collect(), vec!["other".into(), 1.into()]]
            }
            ValueKind::Count { from, to } => {
                let beyond = [from.checked_sub(1), to.checked_add(1)].into_iter().flatten();
                [vec![from.into(), to.into()], beyond.map(Value::from).collect()]
            }
            ValueKind::Number { from, to, .. } => {
                let within = [from.next_up(), to.next_down()].map(number);
                [within.into(), [from.next_down(), to.next_up()].map(number).into()]
            }
            ValueKind::Numbers { max_len, from, to } => {
                let list = |value: f32, len: usize| Value::from(vec![number(value); len]);
                let beyond = [list(from.next_down(), 1), list(to.next_up(), 1)];
                [vec![list(from, max_len), list(to, 1), list(1.0, 0)], beyond.into()]
            }
        }
    }

    #[test]
    fn the_documented_bounds_are_the_checked_ones() {
        for setting in SETTINGS.iter() {
            let accepted = |value: &Value| {
                let settings = with(setting, value.clone());
                settings.is_some_and(|settings| match settings.validate_ranges() {
                    Ok(()) => settings.values()[setting.name] == *value,
                    Err(OutOfRange(wrong)) => wrong.name != setting.name,
                })
            };
            let [mut valid, mut invalid] = bounds(setting.values.kind);
            if setting.values.or_auto {
                valid.push("auto".into());
                invalid.push("automatic".into());
            }
            let wrong = valid.iter().find(|value| !accepted(value));
            let wrong = wrong.or(invalid.iter().find(|value| accepted(value)));
            assert!(wrong.is_none(), "{}: {wrong:?}, {}", setting.name, setting.values);
        }
    }

    #[test]
    fn presets_and_ablations_are_valid() {
        for preset in Preset::ALL {
            assert!(preset.settings().validate().is_ok(), "{}", preset.name());
        }
        let default = Settings::default();
        for setting in SETTINGS.iter() {
            assert!(GROUPS.contains(&setting.group), "{}", setting.name);
            let Some(ablation) = setting.ablation else { continue };
            let changed = with_setting(&default, setting.name, ablation.value);
            assert!(changed.is_ok_and(|changed| changed != default), "{}", ablation.name);
        }
    }

    #[test]
    fn the_maps_goal_alone_and_what_contradicts_it_are_refused_together() {
        let mut own = Preset::Paper.settings();
        let map_only = |own: &Settings| with_setting(own, "goals", "map");
        let error = map_only(&own).expect_err("goals nearby, starts anywhere");
        assert_eq!(error.help, "set near_goals=0 and restart=start-cell as well");
        own.train.near_goals = 0.0;
        for (restart, fits) in [
            (Restart::Anywhere, false),
            (Restart::Never, false),
            (Restart::Auto, true),
            (Restart::StartCell, true),
        ] {
            own.train.restart = restart;
            assert_eq!(map_only(&own).is_ok(), fits, "{restart:?}");
        }
    }

    #[test]
    fn episodes_grow_with_what_is_known_as_far_as_the_buffer_allows() {
        let mut settings = Settings::default();
        assert_eq!(
            [0.0, 40.0, 240.0].map(|longest| settings.episode_steps(longest)),
            [150, 150, 720]
        );
        settings.learn.buffer_size = 32 * 201;
        assert_eq!(settings.episode_steps(240.0), 200);
        settings.train.episode_steps = Auto::Given(77);
        assert_eq!(settings.episode_steps(240.0), 77);
    }
}
