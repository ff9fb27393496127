//! All settings of a run.

pub mod reference;

use serde::{Deserialize, Serialize};

use crate::bridge::BridgeSettings;
use crate::env::{EnvSettings, Restart};
use crate::learn::{LearnSettings, OutOfRange};

/// Every setting, in one flat list of names.
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

/// What changing a setting during a run costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing.
    Immediate,
    /// Agents and episodes begin again; networks and replay are kept.
    NewAgents,
    /// The networks begin again; agents and replay are kept.
    NewNetworks,
}

impl Effect {
    /// What is said of it.
    pub fn about(self) -> &'static str {
        match self {
            Self::Immediate => "takes effect immediately",
            Self::NewAgents => "restarts the agents; networks and replay are kept",
            Self::NewNetworks => "resets the networks; the replay is kept",
        }
    }
}

/// When updates that are due get done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateWhen {
    /// As soon as the agents have taken enough steps.
    Step,
    /// At the end of each episode, as in Algorithm 1.
    EpisodeEnd,
}

/// Settings of agents, episodes and exploration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainSettings {
    /// Agents that explore side by side.
    pub agents: usize,
    /// Steps of an episode.
    pub episode_steps: u32,
    /// Where episodes begin.
    pub restart: Restart,
    /// Environment steps (of all agents together) for each update.
    pub env_steps_per_update: u64,
    /// When updates that are due get done.
    pub update_when: UpdateWhen,
    /// Environment steps before the first update.
    #[serde(alias = "warmup_env_steps")]
    pub learning_starts: u64,
    /// Share of steps that follow a random direction held for a while instead of the actor.
    pub random_actions: f32,
    /// Mean number of steps for which a random direction is held.
    pub random_hold_steps: f32,
    /// Standard deviation of the Gaussian noise on the actor's actions.
    #[serde(alias = "action_noise")]
    pub exploration_noise: f32,
    /// Whether an agent that reaches its goal gets a new one within the episode.
    pub new_goal_when_reached: bool,
    /// Standard deviation of the noise that the environment itself adds to every action.
    pub env_noise: f32,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            agents: 32,
            episode_steps: 150,
            restart: Restart::Anywhere,
            env_steps_per_update: 16,
            update_when: UpdateWhen::Step,
            learning_starts: 4_000,
            random_actions: 0.3,
            random_hold_steps: 10.0,
            exploration_noise: 0.2,
            new_goal_when_reached: true,
            env_noise: 0.0,
        }
    }
}

impl TrainSettings {
    /// The preset `paper`: one agent, and after each episode of T steps T updates.
    pub fn paper() -> Self {
        Self {
            agents: 1,
            env_steps_per_update: 1,
            update_when: UpdateWhen::EpisodeEnd,
            random_actions: 0.0,
            new_goal_when_reached: false,
            ..Self::default()
        }
    }

    /// Those of the world.
    pub fn env(&self) -> EnvSettings {
        EnvSettings { restart: self.restart, noise: self.env_noise }
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// The name of the first setting out of range, and what would be right.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let noise = |v: f32| (0.0..=100.0).contains(&v);
        let checks = [
            ("agents", (1..=4096).contains(&self.agents)),
            ("episode_steps", (1..=60_000).contains(&self.episode_steps)),
            ("env_steps_per_update", self.env_steps_per_update > 0),
            ("random_actions", (0.0..=1.0).contains(&self.random_actions)),
            ("random_hold_steps", (1.0..=1e6).contains(&self.random_hold_steps)),
            ("exploration_noise", noise(self.exploration_noise)),
            ("env_noise", noise(self.env_noise)),
        ];
        checks.iter().find(|(_, ok)| !ok).map_or(Ok(()), |(name, _)| Err(OutOfRange(name)))
    }
}

impl Settings {
    /// Checks every value's range, and that the parts fit each other.
    ///
    /// # Errors
    /// The name of the first setting out of range, and what would be right.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.learn.check()?;
        self.bridge.check()?;
        self.train.check()?;
        let longest = self.learn.buffer_size / self.train.agents;
        if longest <= self.train.episode_steps as usize {
            return Err(OutOfRange("buffer_size"));
        }
        Ok(())
    }
}
