//! Options of `gdg-tui suite`.

use std::path::PathBuf;

use clap::Args;

use super::MapArgs;
use super::method::{BaseArgs, MethodParser, methods_help};
use super::values::{counts, output, parse_share};
use crate::experiment::suite;
use gdg::train::{METHODS, Method};

const EXAMPLES: &str = "\
Examples:
  gdg-tui suite maps/ --seeds 3              every map; run again to resume
  gdg-tui suite fourrooms city my.map --budget 20000 --set hidden=128
  gdg-tui suite my.map --seeds 3 --method gdg-bridge --method her
  gdg-tui suite my.map --set small:hidden=32    a variant called small as well
  gdg-tui suite maps/ --list                 one line per job
  gdg-tui suite maps/ --job den312d-1-3f2a9c --out /shared/suite    on a cluster

gdg-tui plot draws the curves of the methods and variants.

Exit status: 0 success; 1 a job failed (the others run); 2 bad usage or input; 3 \
--require-success not reached; 128 + its number after a signal, as 130 after Ctrl-C (all jobs \
are saved; the same signal again exits without saving).";

/// Options of `gdg-tui suite`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct SuiteArgs {
    /// Built-in maps, map files, and folders, of which the .map files that are not hidden are used,
    /// or the .txt files if there are none
    #[arg(value_name = "FOLDER|MAP", required = true)]
    pub maps: Vec<PathBuf>,

    /// Updates per map [default: 60000 up to 6,000 free cells, 200000 up to 50,000, 600000 beyond]
    #[arg(
        long,
        visible_alias = "max-updates",
        value_name = "N",
        value_parser = counts::<u64>(1..=1 << 53)
    )]
    pub budget: Option<u64>,

    /// Runs per map, with seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = counts::<u64>(1..=1000))]
    pub seeds: u64,

    /// Evaluation tasks at each of six distances
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: u32,

    /// Folder for results, pictures and the report, and for checkpoints until a job is done
    #[arg(long, value_name = "FOLDER", default_value = "saves/suite", value_parser = output())]
    pub out: PathBuf,

    /// Parallel jobs, each on one thread; results do not depend on their number [default: this
    /// machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,

    /// Learner and planner: one of these methods, or LEARNER+PLANNER (repeatable: each trains on
    /// every map)
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Vec<Method>,

    /// What the settings are based on.
    #[command(flatten)]
    pub base: BaseArgs,

    /// Change one setting, of all runs, or of the method called NAME; any other NAME is a variant,
    /// which trains with these changes beside the runs without (repeatable)
    #[arg(long, value_name = "[NAME:]SETTING=VALUE")]
    pub set: Vec<String>,

    /// Print one line per job and exit
    #[arg(long)]
    pub list: bool,

    /// Run only this job (repeatable); --list prints the names
    #[arg(long, value_name = "NAME")]
    pub job: Vec<String>,

    /// Keep the checkpoints of finished jobs, for --resume
    #[arg(long)]
    pub keep: bool,

    /// Exit with status 3 unless every run's final success rate is at least X
    #[arg(long, value_name = "X", value_parser = parse_share)]
    pub require_success: Option<f64>,

    /// How the maps are read.
    #[command(flatten)]
    pub reading: MapArgs,
}

impl From<SuiteArgs> for suite::Options {
    fn from(args: SuiteArgs) -> Self {
        Self {
            reading: (&args.reading).into(),
            maps: args.maps,
            budget: args.budget,
            seeds: args.seeds,
            eval_tasks: args.eval_tasks,
            out: args.out,
            jobs: args.jobs,
            methods: args.method,
            preset: args.base.preset,
            config: args.base.config,
            set: args.set,
            list: args.list,
            job: args.job,
            keep: args.keep,
            require_success: args.require_success,
        }
    }
}
