//! All settings of a run.

pub mod reference;

use serde::{Deserialize, Serialize};

use crate::bridge::BridgeSettings;
use crate::env::{EnvSettings, Restart};
use crate::learn::{Auto, LearnSettings, OutOfRange};

/// All settings, serialised as one flat list of names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Networks, losses and batches.
    #[serde(flatten)]
    pub learn: LearnSettings,
    /// Candidates, edges, search and planning.
    #[serde(flatten)]
    pub bridge: BridgeSettings,
    /// Agents, episodes and exploration.
    #[serde(flatten)]
    pub train: TrainSettings,
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

/// When due updates are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateWhen {
    /// As soon as the agents have taken enough steps.
    Step,
    /// At the end of each episode, as in Algorithm 1.
    EpisodeEnd,
}

/// The longest episode, in steps.
const MAX_EPISODE_STEPS: u32 = 60_000;

/// The most environment steps per update: seconds of exploring.
const MAX_ENV_STEPS_PER_UPDATE: u64 = 1_000_000;

/// The most environment steps before the first update: as many as the largest replay buffer holds.
const MAX_LEARNING_STARTS: u64 = 100_000_000;

/// Automatic episodes are at least this long, in steps ...
pub(crate) const MIN_EPISODE_STEPS: u32 = 150;

/// ... and this many times the longest distance in the bridge graph.
pub(crate) const EPISODE_FACTOR: f32 = 3.0;

/// Default of [`TrainSettings::near_goal_steps`].
fn near_goal_steps() -> u32 {
    4
}

/// Settings of agents, episodes and exploration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainSettings {
    /// Agents exploring in parallel.
    pub agents: usize,
    /// Steps per episode. Automatic: a multiple of the longest distance in the bridge graph.
    pub episode_steps: Auto<u32>,
    /// Where episodes begin.
    pub restart: Restart,
    /// Environment steps (summed over all agents) per update.
    pub env_steps_per_update: u64,
    /// When due updates are run.
    pub update_when: UpdateWhen,
    /// Environment steps before the first update.
    #[serde(alias = "warmup_env_steps")]
    pub learning_starts: u64,
    /// Fraction of steps that follow a held random direction instead of the actor.
    pub random_actions: f32,
    /// Mean number of steps that a random direction is held.
    pub random_hold_steps: f32,
    /// Standard deviation of the Gaussian noise on the actor's actions.
    #[serde(alias = "action_noise")]
    pub exploration_noise: f32,
    /// Probability that an agent's goal is where a short straight walk from its place ends, which
    /// needs no knowledge of the world: SoRB (Eysenbach et al. 2019) trains on near goals with
    /// probability 0.8.
    #[serde(default)]
    pub near_goals: f32,
    /// Longest such walk, in steps.
    #[serde(default = "near_goal_steps")]
    pub near_goal_steps: u32,
    /// Whether an agent that reaches its goal gets a new one within the episode.
    pub new_goal_when_reached: bool,
    /// Standard deviation of the noise that the environment adds to every action.
    pub env_noise: f32,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            agents: 32,
            episode_steps: Auto::AUTO,
            restart: Restart::Auto,
            env_steps_per_update: 16,
            update_when: UpdateWhen::Step,
            learning_starts: 4_000,
            random_actions: 0.3,
            random_hold_steps: 10.0,
            exploration_noise: 0.2,
            near_goals: 0.0,
            near_goal_steps: near_goal_steps(),
            new_goal_when_reached: true,
            env_noise: 0.0,
        }
    }
}

impl TrainSettings {
    /// Returns the preset `paper`: one agent, and T updates after each episode of T steps.
    pub fn paper() -> Self {
        Self {
            agents: 1,
            episode_steps: Auto::Given(20),
            restart: Restart::Anywhere,
            env_steps_per_update: 1,
            update_when: UpdateWhen::EpisodeEnd,
            learning_starts: 1_000,
            random_actions: 0.0,
            near_goals: 0.8,
            new_goal_when_reached: false,
            env_noise: 1.0,
            ..Self::default()
        }
    }

    /// Returns the preset `tuned`: more updates per step.
    pub fn tuned() -> Self {
        Self { env_steps_per_update: 2, ..Self::default() }
    }

    /// Returns the preset `sb3`: one agent that makes an update at every step and pursues one goal
    /// in each episode.
    pub fn sb3() -> Self {
        Self {
            agents: 1,
            episode_steps: Auto::Given(150),
            restart: Restart::Anywhere,
            env_steps_per_update: 1,
            learning_starts: 100,
            random_actions: 0.0,
            new_goal_when_reached: false,
            ..Self::default()
        }
    }

    /// Returns the settings of the environment.
    pub fn env(&self) -> EnvSettings {
        EnvSettings { restart: self.restart, noise: self.env_noise }
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// The name of the first setting out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let noise = |v: f32| (0.0..=100.0).contains(&v);
        let checks = [
            ("agents", (1..=4096).contains(&self.agents)),
            (
                "episode_steps",
                self.episode_steps
                    .given()
                    .is_none_or(|steps| (1..=MAX_EPISODE_STEPS).contains(&steps)),
            ),
            (
                "env_steps_per_update",
                (1..=MAX_ENV_STEPS_PER_UPDATE).contains(&self.env_steps_per_update),
            ),
            ("learning_starts", self.learning_starts <= MAX_LEARNING_STARTS),
            ("random_actions", (0.0..=1.0).contains(&self.random_actions)),
            ("random_hold_steps", (1.0..=1e6).contains(&self.random_hold_steps)),
            ("exploration_noise", noise(self.exploration_noise)),
            ("near_goals", (0.0..=1.0).contains(&self.near_goals)),
            ("near_goal_steps", (1..=10_000).contains(&self.near_goal_steps)),
            ("env_noise", noise(self.env_noise)),
        ];
        checks.iter().find(|(_, ok)| !ok).map_or(Ok(()), |(name, _)| Err(OutOfRange(name)))
    }
}

impl Settings {
    /// Checks every value's range and the constraints between settings.
    ///
    /// # Errors
    /// The name of the first setting out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        self.validate_ranges()?;
        if self.learn.buffer_size < self.needed_buffer_size() {
            Err(OutOfRange("buffer_size"))
        } else {
            Ok(())
        }
    }

    /// Checks every value's own range.
    ///
    /// # Errors
    /// The name of the first setting out of range.
    pub fn validate_ranges(&self) -> Result<(), OutOfRange> {
        self.learn.validate()?;
        self.bridge.validate()?;
        self.train.validate()
    }

    /// Returns the smallest buffer that holds an episode of every agent.
    pub fn needed_buffer_size(&self) -> usize {
        self.train.agents.saturating_mul(self.min_episode_steps() as usize + 1)
    }

    /// Returns the least that `episode_steps` may come to.
    pub fn min_episode_steps(&self) -> u32 {
        self.train.episode_steps.given().unwrap_or(MIN_EPISODE_STEPS)
    }

    /// Returns the longest episode that fits into each agent's share of the replay buffer.
    fn max_episode_steps(&self) -> u32 {
        let share = (self.learn.buffer_size / self.train.agents).saturating_sub(1);
        u32::try_from(share).unwrap_or(u32::MAX).min(MAX_EPISODE_STEPS)
    }

    /// Returns the steps of an episode while the longest distance in the bridge graph is
    /// `longest_steps`: an agent must be able to cross all that is known and go on from there.
    pub fn episode_steps(&self, longest_steps: f32) -> u32 {
        let automatic = (EPISODE_FACTOR * longest_steps) as u32;
        let most = self.max_episode_steps();
        self.train
            .episode_steps
            .given()
            .unwrap_or_else(|| automatic.max(MIN_EPISODE_STEPS).min(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
