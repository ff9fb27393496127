//! The commands.

mod check;
mod export;
mod maps;
pub mod prepare;
mod runs;
mod train;

use std::io::{IsTerminal, stdout};
use std::sync::Arc;

use clap::CommandFactory;
use log::LevelFilter;
use miette::{IntoDiagnostic, Report};

use crate::cli::{Cli, Command, completions};
use crate::experiment::{figures, plot, suite};
use crate::process::errors::from_config_error;
use crate::process::{EXIT_BAD_INPUT, EXIT_FAILURE, errors, logging};
use gdg::train::{
    Registry, SETTINGS, Setting, Settings, USUAL, list_settings, reference_page, setting_page,
};

/// Why a command failed: the error for the user, and the exit status.
pub struct CommandFailure {
    pub error: Report,
    pub status: u8,
}

/// The exit status of a command.
pub type CommandOutcome = Result<u8, CommandFailure>;

fn bad_input(error: Report) -> CommandFailure {
    CommandFailure { error, status: EXIT_BAD_INPUT }
}

fn failure(error: Report) -> CommandFailure {
    CommandFailure { error, status: EXIT_FAILURE }
}

/// Runs a command, with the worlds and learners of `registry`, and returns the exit status.
pub fn run(cli: Cli, registry: &Arc<Registry>) -> CommandOutcome {
    let text = |made: Result<String, Report>| print(&made.map_err(bad_input)?);
    match cli.command {
        None => train::run(&cli.train, registry),
        Some(Command::Maps(args)) => maps::run(&args, registry),
        Some(Command::Runs(args)) => runs::run(&args, registry),
        Some(Command::Watch(args)) => runs::watch(&args, registry),
        Some(Command::Settings { names }) => {
            let pages = names.iter().map(|name| setting_page(name).map_err(from_config_error));
            let size = crossterm::terminal::size().ok().filter(|_| stdout().is_terminal());
            text(pages.collect::<Result<String, _>>().map(|pages| match size {
                None if names.is_empty() => reference_page(),
                None => pages,
                Some((columns, _)) if names.is_empty() => settings(columns.into()),
                Some((columns, _)) => textwrap::fill(&pages, usize::from(columns)),
            }))
        }
        Some(Command::Tour(args)) => train::tour(&args, registry),
        Some(Command::Compare(args)) => train::compare(&args, registry),
        Some(Command::Suite(options)) => {
            logging::start(LevelFilter::Info);
            let registry = &prepare::registry_of_suite(&options, registry).map_err(bad_input)?;
            suite::prepare(&options, registry).map_err(bad_input)?.run().map_err(failure)
        }
        Some(Command::Reproduce(options)) => {
            logging::start(LevelFilter::Info);
            figures::prepare(&options, registry).map_err(bad_input)?.run().map_err(failure)
        }
        Some(Command::Plot(options)) => text(plot::run(&options)),
        Some(Command::Completions { shell }) => print(&completions(shell)),
        Some(Command::Man) => {
            let mut page = Vec::new();
            let command = Cli::command().mut_subcommands(|each| each.hide(false));
            clap_mangen::Man::new(command).render(&mut page).into_diagnostic().map_err(failure)?;
            print(&String::from_utf8_lossy(&page))
        }
        Some(Command::Check(args)) => check::run(&args, registry),
        Some(Command::ExportData(args)) => text(export::data(&args, registry)),
        Some(Command::ExportPolicy(args)) => text(export::policy(&args, registry)),
    }
}

/// Returns the settings with their defaults, by group and wrapped to `columns`.
fn settings(columns: usize) -> String {
    let mut all: Vec<_> = SETTINGS.iter().zip(list_settings(&Settings::default())).collect();
    all.sort_by_key(|(setting, _)| setting.heading() != USUAL);
    let indent = " ".repeat(32);
    let options = textwrap::Options::new(columns.max(60)).subsequent_indent(&indent);
    let line = |(setting, (name, value)): &(&Setting, (String, String))| {
        textwrap::fill(&format!("  {name:<22}{value:<7} {}", setting.about), &options) + "\n"
    };
    let groups = all.chunk_by(|a, b| a.0.heading() == b.0.heading());
    let lines = groups.map(|own| {
        own[0].0.heading().to_owned() + "\n" + &own.iter().map(line).collect::<String>()
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn print(text: &str) -> CommandOutcome {
    errors::print(text).map(|()| 0).map_err(failure)
}
