//! Options of `gdg-tui reproduce`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::values::{counts, output};
use crate::experiment::reproduce::{self, Budget, DataFolder, FIGURES};

const EXAMPLES: &str = "\
Examples:
  gdg-tui reproduce all                      all figures; run again to resume
  gdg-tui reproduce fig3 fig4 --budget paper --out /shared/paper
  gdg-tui reproduce fig6 --set gdg:hidden=256    runs only that method's jobs
  gdg-tui reproduce ogbench                  beside published results
  gdg-tui reproduce all --list-jobs          a command per line, for a cluster
  gdg-tui reproduce all --collect            report from the jobs that are done

Exit status: 0 success; 1 a job failed, or --collect found jobs missing; 2 bad usage or input; \
128 + its number after a signal, as 130 after Ctrl-C (all jobs are saved; the same signal again \
exits without saving).";

/// Options of `gdg-tui reproduce`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct ReproduceArgs {
    /// Figures of the paper, all of them, or OGBench's point mazes
    #[arg(value_name = "FIGURE", required = true, value_parser = figures())]
    pub figures: Vec<String>,

    /// How much to train
    #[arg(long, default_value = Budget::Quick.name(), value_parser = budgets())]
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

    /// Folder of OGBench's datasets, for the figure ogbench; those that are not there are collected
    #[arg(long, value_name = "FOLDER", default_value = "saves/ogbench", value_parser = output())]
    pub data_dir: PathBuf,

    /// Python interpreter with the package ogbench, to collect them [default: that of the active
    /// virtual environment, else python3]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    /// Evaluation tasks at each of six distances (five for the arm) at the end, and at most that
    /// many along the way
    #[arg(long, value_name = "N", value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: Option<u32>,

    /// Change one setting of all methods, or of the one named (repeatable)
    #[arg(long, value_name = "[METHOD:]NAME=VALUE")]
    pub set: Vec<String>,

    /// Folder for jobs, data, figures and the report
    #[arg(long, value_name = "FOLDER", default_value = "saves/reproduce", value_parser = output())]
    pub out: PathBuf,

    /// Parallel jobs, each on one thread; results do not depend on their number [default: this
    /// machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,

    /// Print a complete command per job, one a line, and exit
    #[arg(long, conflicts_with_all = ["job", "collect"])]
    pub list_jobs: bool,

    /// Run only this job, by its name or by its line in --list-jobs (repeatable), and draw nothing
    #[arg(long, value_name = "NAME|N", conflicts_with = "collect")]
    pub job: Vec<String>,

    /// Run nothing: draw figures and write the report from the jobs that are done
    #[arg(long)]
    pub collect: bool,

    /// Keep the checkpoints of finished jobs, for --resume
    #[arg(long)]
    pub keep: bool,
}

fn figures() -> PossibleValuesParser {
    let figures = FIGURES.iter().map(|figure| PossibleValue::new(figure.name).help(figure.title));
    figures.chain([PossibleValue::new("all").help("All of the paper's")]).collect::<Vec<_>>().into()
}

fn budgets() -> impl TypedValueParser<Value = Budget> {
    let values = Budget::ALL.map(|budget| PossibleValue::new(budget.name()).help(budget.about()));
    PossibleValuesParser::new(values).map(|name| {
        Budget::ALL.into_iter().find(|budget| budget.name() == name).unwrap_or(Budget::Quick)
    })
}

impl From<ReproduceArgs> for reproduce::Options {
    fn from(args: ReproduceArgs) -> Self {
        Self {
            figures: args.figures,
            budget: args.budget,
            updates: args.updates,
            episodes: args.episodes,
            steps: args.steps,
            seeds: args.seeds,
            eval_tasks: args.eval_tasks,
            data: DataFolder { folder: args.data_dir, python: args.python },
            set: args.set,
            out: args.out,
            jobs: args.jobs,
            list_jobs: args.list_jobs,
            job: args.job,
            collect: args.collect,
            keep: args.keep,
        }
    }
}
