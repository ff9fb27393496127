//! Options of `gdg-tui compare`.

use std::path::PathBuf;

use clap::Args;

use super::method::MethodParser;
use super::values::{counts, parse_threads};
use super::{MapArgs, ScreenArgs};
use crate::tui::ComparisonOptions;
use gdg::learn::Threads;
use gdg::train::Method;

const EXAMPLES: &str = "\
Examples:
  gdg-tui compare gdg-bridge gdg             with bridge points and without, on the four rooms
  gdg-tui compare gdg-bridge her city --seed 3
  gdg-tui compare gdg gdg trap --set B:hidden=64    one method with two sizes of network
  gdg-tui compare gdg-bridge her --record race.cast    and record the screen

Click on either map to set the goal of both; e edits the map of both. Each side trains exactly as gdg-tui MAP --method METHOD with the same seed
and settings does, on its own threads. Nothing is saved: gdg-tui reproduce and gdg-tui suite compare methods over several
seeds, without a terminal, and keep their results.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 128 + its number after a signal.";

/// Options of `gdg-tui compare`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct CompareArgs {
    /// Method on the left: a name as in --method, or LEARNER+PLANNER
    #[arg(value_name = "A", value_parser = MethodParser)]
    pub a: Method,

    /// Method on the right
    #[arg(value_name = "B", value_parser = MethodParser, hide_possible_values = true)]
    pub b: Method,

    /// Built-in map or map file
    #[arg(default_value = "fourrooms", value_name = "MAP")]
    pub map: PathBuf,

    /// Random seed of both: same seed, same runs
    #[arg(long, default_value_t = 0, value_parser = counts::<u64>(0..=u64::MAX))]
    pub seed: u64,

    /// Change one setting of both methods, or of one side (repeatable)
    #[arg(long, value_name = "[A:|B:]NAME=VALUE")]
    pub set: Vec<String>,

    /// Threads that share each update of a side: a number, or auto for as many as make it faster at
    /// the moment, up to half of this machine's cores; results do not depend on it
    #[arg(long, value_name = "N", default_value = "auto", value_parser = parse_threads)]
    pub threads: Threads,

    /// Options of what is shown and recorded.
    #[command(flatten)]
    pub screen: ScreenArgs,

    /// How the map is read.
    #[command(flatten)]
    pub reading: MapArgs,
}

impl CompareArgs {
    /// Returns the options of the comparison.
    pub fn options(&self) -> ComparisonOptions {
        ComparisonOptions {
            methods: [self.a.clone(), self.b.clone()],
            map: self.map.clone(),
            reading: (&self.reading).into(),
            seed: self.seed,
            set: self.set.clone(),
            threads: self.threads,
            recording: self.screen.interface.record.clone(),
        }
    }
}
