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

    /// Python processes that the agents' environments are spread over
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = counts::<u16>(1..=256))]
    pub workers: u16,

    /// Longest time in seconds that an environment may take to open, to begin an episode or to step
    #[arg(long, value_name = "S", default_value_t = 60.0, value_parser = parse_timeout)]
    pub env_timeout: f64,
}

impl GymArgs {
    /// Returns the options of environments whose goals are reached within `goal_radius`.
    pub fn options(&self, goal_radius: Option<f32>) -> GymOptions {
        GymOptions {
            python: self.python.clone(),
            goal: self.goal.as_ref().map(|goal| goal.iter().map(|i| usize::from(*i)).collect()),
            goal_radius,
            workers: self.workers.into(),
            timeout: Duration::from_secs_f64(self.env_timeout),
        }
    }
}
