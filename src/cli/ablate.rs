//! Options of `gdg-tui ablate`.

use std::path::PathBuf;

use clap::Args;

use super::values::{counts, output};
use crate::experiment::ablate;

/// Options of `gdg-tui ablate`.
#[derive(Debug, Args)]
pub struct AblateArgs {
    /// Built-in map or map file
    #[arg(default_value = "fourrooms", value_name = "MAP")]
    pub map: PathBuf,
    /// Climb from the preset paper to the default instead, component by component
    #[arg(long)]
    pub ladder: bool,
    /// Updates per run
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = counts::<u64>(1..=u64::MAX))]
    pub updates: u64,
    /// Runs per variant, with seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = counts::<u64>(1..=1000))]
    pub seeds: u64,
    /// Evaluation tasks at each of six distances
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: u32,
    /// Parallel runs, each on one thread [default: this machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,
    /// Folder of the results: runs that are done are not repeated, interrupted ones go on
    #[arg(long, value_name = "FOLDER", default_value = "saves/ablation", value_parser = output())]
    pub out: PathBuf,
    /// Also write all results to this file as JSON
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub json: Option<PathBuf>,
    /// Replace the JSON file if it exists
    #[arg(long, requires = "json")]
    pub overwrite: bool,
}

impl From<AblateArgs> for ablate::Options {
    fn from(args: AblateArgs) -> Self {
        let AblateArgs { map, ladder, updates, seeds, eval_tasks, jobs, out, json, overwrite } =
            args;
        Self { map, ladder, updates, seeds, eval_tasks, jobs, out, json, overwrite }
    }
}
