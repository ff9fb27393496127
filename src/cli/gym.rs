//! Options of environments in Python.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::values::{counts, parse_radius, parse_timeout};
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

    /// Distance below which a goal is reached, in the environment's unit [default: the
    /// environment's own]
    #[arg(long, value_name = "R", value_parser = parse_radius, conflicts_with = "resume")]
    pub goal_radius: Option<f64>,

    /// Python processes that the agents' environments are spread over
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = counts::<u16>(1..=256))]
    pub workers: u16,

    /// Longest time in seconds that an environment may take to open, to begin an episode or to step
    #[arg(long, value_name = "S", default_value_t = 60.0, value_parser = parse_timeout)]
    pub env_timeout: f64,
}

impl From<&GymArgs> for GymOptions {
    fn from(args: &GymArgs) -> Self {
        Self {
            python: args.python.clone(),
            goal: args.goal.as_ref().map(|goal| goal.iter().map(|i| usize::from(*i)).collect()),
            goal_radius: args.goal_radius.map(|radius| radius as f32),
            workers: args.workers.into(),
            timeout: Duration::from_secs_f64(args.env_timeout),
        }
    }
}
