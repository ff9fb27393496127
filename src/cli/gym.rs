//! Options of environments in Python.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::values::{counts, parse_timeout};
use gdg::env::GymOptions;

/// Options of environments in Python.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Gymnasium environments")]
pub struct GymArgs {
    /// Python interpreter of gym:ID [default: that of the active virtual environment, else python3]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    /// Components of the observation that form the goal, from 0, where there is no achieved_goal
    /// (OGBench) [default: 0,1]
    #[arg(long, value_name = "I,J,...", value_delimiter = ',', conflicts_with = "resume")]
    pub goal: Option<Vec<u16>>,

    /// Python processes that the agents' environments are spread over [default: 1]
    #[arg(long, value_name = "K", value_parser = counts::<u16>(1..=256))]
    pub workers: Option<u16>,

    /// Longest time in seconds that an environment may take to open, to begin an episode or to step
    /// [default: 60]
    #[arg(long, value_name = "S", value_parser = parse_timeout)]
    pub env_timeout: Option<f64>,
}

impl GymArgs {
    /// Returns the options that were given.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            (self.python.is_some(), "--python"),
            (self.goal.is_some(), "--goal"),
            (self.workers.is_some(), "--workers"),
            (self.env_timeout.is_some(), "--env-timeout"),
        ];
        all.into_iter().filter(|(given, _)| *given).map(|(_, option)| option).collect()
    }

    /// Returns the options of environments whose goals are reached within `goal_radius`.
    pub fn options(&self, goal_radius: Option<f32>) -> GymOptions {
        let default = GymOptions::default();
        GymOptions {
            python: self.python.clone(),
            goal: self.goal.as_ref().map(|goal| goal.iter().map(|i| usize::from(*i)).collect()),
            goal_radius,
            workers: self.workers.map_or(default.workers, usize::from),
            timeout: self.env_timeout.map_or(default.timeout, Duration::from_secs_f64),
            ..default
        }
    }
}
