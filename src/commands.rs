//! The commands.

mod check;
mod compare;
mod experiments;
mod export;
mod maps;
mod output;
mod runs;
mod screen;
mod tour;
mod train;

use std::sync::Arc;

use clap::CommandFactory;
use miette::Report;

use crate::cli::{Cli, Command, completions};
use gdg::train::{Registry, reference_page};
pub use output::{Failure, Outcome};
use output::{OrFail, print, print_safely};

/// Runs a command, with the worlds and learners of `registry`, and returns the exit status.
///
/// # Errors
/// The command fails; the failure has its exit status.
pub fn run(cli: Cli, registry: &Arc<Registry>) -> Outcome {
    let text = |made: Result<String, Report>| print_safely(&made.or_bad_input()?);
    match cli.command {
        None => train::run(&cli.train, registry),
        Some(Command::Maps(args)) => maps::run(&args, registry),
        Some(Command::Runs(args)) => runs::run(&args, registry),
        Some(Command::Settings) => print(&reference_page()),
        Some(Command::Tour(args)) => tour::run(&args, registry),
        Some(Command::Compare(args)) => compare::run(&args, registry),
        Some(Command::Suite(args)) => experiments::suite(args, registry),
        Some(Command::Plot(options)) => experiments::plot(&options),
        Some(Command::Reproduce(args)) => experiments::reproduce(args, registry),
        Some(Command::Completions { shell }) => print(&completions(shell)),
        Some(Command::Man) => print(&manual().or_failure()?),
        Some(Command::Check { file, map, strict, reading }) => {
            check::run(&file, map.as_deref(), &(&reading).into(), strict, registry)
        }
        Some(Command::ExportData(args)) => text(export::data(&args, registry)),
        Some(Command::ExportPolicy(args)) => text(export::policy(&args, registry)),
    }
}

/// Returns the manual page.
fn manual() -> Result<String, Report> {
    let mut page = Vec::new();
    clap_mangen::Man::new(Cli::command()).render(&mut page).map_err(Report::msg)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}
