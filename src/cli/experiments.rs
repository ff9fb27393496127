//! Options of the commands for many runs: `suite` and `reproduce`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};

use super::MapArgs;
use super::train::BaseArgs;
use super::values::{MethodParser, counts, methods_help, output, shares};
use crate::experiment::figures::{self, Budget, FIGURES};
use crate::experiment::jobs::JobOptions;
use crate::experiment::suite;
use crate::experiment::variants::{Ablation, Variation};
use crate::host::setup::{RunChoice, parallel_jobs};
use gdg::train::{METHODS, Method};

const SUITE_EXAMPLES: &str = "\
Examples:
  gdg-tui suite maps/ --seeds 3              every map; run again to resume
  gdg-tui suite fourrooms city my.map --budget 20000 --set hidden=128
  gdg-tui suite my.map --seeds 3 --method gdg-bridge --method her
  gdg-tui suite my.map --sweep hidden=32,64 --sweep tau=0.01,0.1    all four
  gdg-tui suite my.map --set small:hidden=32    a variant called small as well
  gdg-tui suite fourrooms --ablation components    without each component
  gdg-tui suite maps/ --list                 one line per job
  gdg-tui suite maps/ --job 3 --out /shared/suite    the third, on a cluster

gdg-tui plot draws the curves of the methods and variants.

Exit status: 0 success; 1 a job failed (the others run), or --collect found jobs missing; 2 bad \
usage or input; 3 --require-success not reached; 128 + its number after a signal, as 130 after \
Ctrl-C (all jobs are saved; the same signal again exits without saving).";

const FIGURE_EXAMPLES: &str = "\
Examples:
  gdg-tui reproduce all                      all figures; run again to resume
  gdg-tui reproduce fig3 fig4 --budget paper --out /shared/paper
  gdg-tui reproduce fig6 --set gdg:hidden=256    runs only that method's jobs
  gdg-tui reproduce ogbench                  beside published results
  gdg-tui reproduce all --list               one line per job
  gdg-tui reproduce all --job 3              the third, on a cluster
  gdg-tui reproduce all --collect            report from the jobs that are done

Exit status: as of gdg-tui suite.";

/// Which jobs run, how, and where.
#[derive(Debug, Args)]
pub struct RunningArgs {
    /// Folder for jobs, their checkpoints, results and the report [default: saves/ and the command]
    #[arg(long, value_name = "FOLDER", value_parser = output())]
    pub out: Option<PathBuf>,

    /// Parallel jobs, each on one thread; results do not depend on their number [default: this
    /// machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,

    /// Print one line per job, its name first, and exit
    #[arg(long, conflicts_with_all = ["job", "collect"])]
    pub list: bool,

    /// Run only this job, by its name or by its line in --list (repeatable), and report nothing
    #[arg(long, value_name = "NAME|N", conflicts_with = "collect")]
    pub job: Vec<String>,

    /// Run nothing: report from the jobs that are done
    #[arg(long)]
    pub collect: bool,

    /// Remove the checkpoints of finished jobs, which --resume needs
    #[arg(long)]
    pub no_keep: bool,

    /// Exit with status 3 unless every run's final success rate is at least X
    #[arg(long, value_name = "X", value_parser = shares())]
    pub require_success: Option<f64>,
}

impl RunningArgs {
    fn of_command(self, name: &str) -> JobOptions {
        let Self { out, jobs, list, job, collect, no_keep, require_success } = self;
        let out = out.unwrap_or_else(|| Path::new("saves").join(name));
        let parallel = parallel_jobs(jobs);
        JobOptions { out, parallel, list, job, collect, keep: !no_keep, require_success }
    }
}

#[derive(Debug, Args)]
#[command(after_help = SUITE_EXAMPLES, allow_negative_numbers = true)]
pub struct SuiteArgs {
    /// Built-in maps, map files, folders, of which the .map files that are not hidden are used, or
    /// the .txt files if there are none, and other worlds, like fetch-reach
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

    /// Learner and planner: one of these methods, or LEARNER+PLANNER (repeatable: each trains on
    /// every map)
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Vec<Method>,

    #[command(flatten)]
    pub base: BaseArgs,

    /// Change one setting, of all runs, or of the method called NAME; any other NAME is a variant,
    /// which trains with these changes beside the runs without (repeatable)
    #[arg(long, value_name = "[NAME:]SETTING=VALUE")]
    pub set: Vec<String>,

    /// Train with each of these values (repeatable: with all combinations)
    #[arg(long, value_name = "SETTING=VALUE,VALUE")]
    pub sweep: Vec<String>,

    /// Train the variants of an ablation of the default method instead
    #[arg(long, value_enum, value_name = "WHICH", conflicts_with_all = ["method", "preset", "config", "sweep"])]
    pub ablation: Option<Ablation>,

    /// Print the table as Markdown, with all columns, as in the report
    #[arg(long)]
    pub markdown: bool,

    #[command(flatten)]
    pub running: RunningArgs,

    #[command(flatten)]
    pub reading: MapArgs,
}

impl From<SuiteArgs> for suite::Options {
    fn from(args: SuiteArgs) -> Self {
        let BaseArgs { preset, config } = args.base;
        Self {
            reading: (&args.reading).into(),
            worlds: args.maps,
            budget: args.budget,
            seeds: args.seeds,
            eval_tasks: args.eval_tasks,
            methods: args.method,
            base: RunChoice { method: Method::default(), preset, config, set: args.set },
            variation: args.ablation.map_or(Variation::Sweep(args.sweep), Variation::Ablation),
            markdown: args.markdown,
            running: args.running.of_command("suite"),
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = FIGURE_EXAMPLES, allow_negative_numbers = true)]
pub struct ReproduceArgs {
    /// Figures of the paper, all of them, or OGBench's point mazes
    #[arg(value_name = "FIGURE", required = true, value_parser = figures())]
    pub figures: Vec<String>,

    /// How much to train
    #[arg(long, value_enum, default_value_t = Budget::Quick)]
    pub budget: Budget,

    /// Train every job for N updates instead
    #[arg(long, value_name = "N", value_parser = counts::<u64>(1..=1 << 53))]
    pub updates: Option<u64>,

    /// Train every job for N episodes instead
    #[arg(long, value_name = "N", conflicts_with = "updates", value_parser = counts::<u64>(1..=1 << 53))]
    pub episodes: Option<u64>,

    /// Train every job for N environment steps instead
    #[arg(long, value_name = "N", conflicts_with_all = ["updates", "episodes"], value_parser = counts::<u64>(1..=1 << 53))]
    pub steps: Option<u64>,

    /// Runs per method in figures over several seeds, with seeds 1, 2, ...
    #[arg(long, value_name = "N", value_parser = counts::<u64>(1..=1000))]
    pub seeds: Option<u64>,

    /// Folder of OGBench's datasets, for the figure ogbench
    #[arg(long, value_name = "FOLDER", default_value = "saves/ogbench", value_parser = output())]
    pub data_dir: PathBuf,

    /// Evaluation tasks at each of six distances (five for the arm) at the end, and at most that
    /// many along the way
    #[arg(long, value_name = "N", value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: Option<u32>,

    /// Change one setting of all methods, or of the one named (repeatable)
    #[arg(long, value_name = "[METHOD:]NAME=VALUE")]
    pub set: Vec<String>,

    #[command(flatten)]
    pub running: RunningArgs,
}

fn figures() -> PossibleValuesParser {
    let figures = FIGURES.iter().map(|figure| PossibleValue::new(figure.name).help(figure.title));
    figures.chain([PossibleValue::new("all").help("All of the paper's")]).collect::<Vec<_>>().into()
}

impl From<ReproduceArgs> for figures::Options {
    fn from(args: ReproduceArgs) -> Self {
        Self {
            figures: args.figures,
            budget: args.budget,
            updates: args.updates,
            episodes: args.episodes,
            steps: args.steps,
            seeds: args.seeds,
            eval_tasks: args.eval_tasks,
            data: args.data_dir,
            set: args.set,
            running: args.running.of_command("reproduce"),
        }
    }
}
