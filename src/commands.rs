//! The commands.

mod check;
mod export;
mod maps;
mod output;
pub mod prepare;
mod runs;
mod screen;
mod train;

use std::path::PathBuf;
use std::sync::Arc;

use clap::CommandFactory;
use miette::Report;

use crate::cli::{Cli, Command, ReproduceArgs, SuiteArgs, completions};
use crate::experiment::{figures, plot, suite};
use crate::host::logging::{self, LogLevel};
use crate::host::maps::known_name;
use gdg::env::GymOptions;
use gdg::train::{Registry, reference_page};
pub use output::{Failure, Outcome};
use output::{OrFail, print, print_safely};

/// Runs a command, with the worlds and learners of `registry`, and returns the exit status.
pub fn run(cli: Cli, registry: &Arc<Registry>) -> Outcome {
    let text = |made: Result<String, Report>| print_safely(&made.or_bad_input()?);
    match cli.command {
        None => train::run(&cli.train, registry),
        Some(Command::Maps(args)) => maps::run(&args, registry),
        Some(Command::Runs(args)) => runs::run(&args, registry),
        Some(Command::Settings) => print(&reference_page()),
        Some(Command::Tour(args)) => screen::tour(&args, registry),
        Some(Command::Compare(args)) => screen::compare(&args, registry),
        Some(Command::Suite(args)) => suite(args, registry),
        Some(Command::Plot(options)) => print_safely(&plot::run(&options).or_bad_input()?),
        Some(Command::Reproduce(args)) => reproduce(args, registry),
        Some(Command::Completions { shell }) => print(&completions(shell)),
        Some(Command::Man) => print(&manual().or_failure()?),
        Some(Command::Check { file, map, strict, reading }) => {
            check::run(&file, map.as_deref(), &(&reading).into(), strict, registry)
        }
        Some(Command::ExportData(args)) => text(export::data(&args, registry)),
        Some(Command::ExportPolicy(args)) => text(export::policy(&args, registry)),
    }
}

/// Trains on every map, and reports.
fn suite(args: SuiteArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    let is_world = |name: &&PathBuf| registry.world_without_file(known_name(name)).is_some();
    let others = args.maps.iter().filter(is_world);
    if let Some(option) = others.flat_map(|name| args.reading.only_for_maps(name)).next() {
        return Err(prepare::not_a_maze(option)).or_bad_input();
    }
    let gym = GymOptions { goal_radius: args.reading.goal_radius, ..GymOptions::default() };
    let registry = registry.clone().with_gym(gym);
    suite::prepare(&args.into(), &registry).or_bad_input()?.run().or_failure()
}

/// Trains what the figures need, and draws them.
fn reproduce(args: ReproduceArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    figures::prepare(&args.into(), registry).or_bad_input()?.run().or_failure()
}

fn manual() -> Result<String, Report> {
    let mut page = Vec::new();
    clap_mangen::Man::new(Cli::command()).render(&mut page).map_err(Report::msg)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}
