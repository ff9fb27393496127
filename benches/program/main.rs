//! The learner's speed on this machine, as ratios of side-by-side runs: `cargo bench --bench
//! program`, with `-- --only PART` for a part alone.
//!
//! All variants of a case take turns within one process, so that a drifting machine speed affects
//! them equally; the table shows the median of many turns.

mod baseline;
mod cases;
mod checkpoint;
mod edits;
mod interface;
mod loads;
mod time_to;

use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use miette::{IntoDiagnostic, Report};

use gdg::env::PointMaze;
use gdg::learn::Threads;
use gdg::map::{Grid, builtin};
use gdg::text::counted;
use gdg::train::{Method, Preset, Registry, Run, Settings, TrainError, Trainer};
use gdg_tui::host::setup::parallel_jobs;

/// Maps on which whole runs of the default preset are measured.
const MAPS: [&str; 2] = ["fourrooms", "city"];

/// Environment variable from which candle reads its number of threads.
const CANDLE_THREADS: &str = "RAYON_NUM_THREADS";

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// One update of critic, model and actor, against plain candle-nn
    Updates,
    /// One update of the default preset
    Default,
    /// Updates per second on built-in maps
    Training,
    /// Threads beside other programs
    Loads,
    /// Time to a success rate
    TimeTo,
    /// What the interface costs
    Interface,
    /// What a checkpoint consists of
    Checkpoint,
    /// How long an edit of the map holds training up
    Edits,
    /// Single operations
    Other,
}

/// Measures the learner's speed on this machine against plain candle-nn, and what the interface
/// costs.
#[derive(Parser)]
struct Args {
    /// Measure this part alone; may be given more than once [default: all]
    #[arg(long, value_name = "PART")]
    only: Vec<Part>,
    /// Threads to compare with a single one [default: this machine's cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Repetitions of each comparison; the median is reported
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u16).range(1..=1000))]
    runs: u16,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<(), Report> {
    // Compare one thread to one thread, which is also candle at its best: it would spread its
    // operations over spinning threads. Candle reads the number of threads from the environment,
    // which can be set safely only for a new process.
    if std::env::var_os(CANDLE_THREADS).is_none() {
        let mut again = Command::new(std::env::current_exe().into_diagnostic()?);
        let status = again
            .args(std::env::args_os().skip(1))
            .env(CANDLE_THREADS, "1")
            .status()
            .into_diagnostic()?;
        std::process::exit(status.code().unwrap_or(1));
    }
    let args = Args::parse();
    let (threads, runs) = (parallel_jobs(args.threads), args.runs.into());
    for part in Part::value_variants() {
        if args.only.is_empty() || args.only.contains(part) {
            println!("{}", measure(*part, threads, runs)?);
        }
    }
    Ok(())
}

/// Measures a part; returns its table, in which times are medians.
fn measure(part: Part, threads: usize, runs: usize) -> Result<String, Report> {
    let of_maps = |measure: &dyn Fn(&'static str) -> Result<String, TrainError>| {
        MAPS.iter().map(|map| measure(map)).collect::<Result<String, TrainError>>()
    };
    let table = match part {
        Part::Updates => cases::updates(threads, runs),
        Part::Default => cases::default_update(threads, runs),
        Part::Training => of_maps(&|map| cases::default_preset(map, threads, runs)),
        Part::Loads => loads::measure(threads, runs),
        Part::TimeTo => of_maps(&|map| time_to::measure(map, threads, runs)),
        Part::Interface => interface::measure(threads, runs),
        Part::Checkpoint => return checkpoint::measure(MAPS[0], threads),
        Part::Edits => edits::measure(threads),
        Part::Other => cases::other(),
    };
    table.into_diagnostic()
}

/// A run of the default preset on `map`.
fn trainer(map: &Arc<Grid>, seed: u64, threads: impl Into<Threads>) -> Result<Trainer, TrainError> {
    let (method, settings) = (Method::default(), Settings::default());
    let run = Run { method, preset: Preset::Default, seed, settings };
    Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), threads)
}

/// The built-in map called `name`.
fn built_in(name: &str) -> Arc<Grid> {
    builtin(name).map_or_else(|| unreachable!("{name} is built in"), Arc::new)
}

fn on(threads: usize) -> String {
    counted(threads as u64, "thread")
}

/// A number with the given number of decimals; `never` without one.
fn told(number: Option<f64>, decimals: usize) -> String {
    number.map_or("never".to_owned(), |number| format!("{number:.decimals$}"))
}

/// The time that `work` takes, in microseconds.
fn time_us(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_secs_f64() * 1e6
}

fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value below which a share of all values lies.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (values.len() as f64 * share) as usize;
    values.get(at.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
