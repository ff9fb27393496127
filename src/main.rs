//! The binary: picks a front end and turns errors into messages and exit statuses.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use gdg_tui::cli::{Cli, Command};
use gdg_tui::map::{print_ascii, random};
use gdg_tui::{ablate, bench, facts, frames, headless, setup, tui};
use miette::Report;

/// Exit status of what fails while running.
const FAILED: u8 = 1;

/// Exit status of bad usage and bad input.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let status = match &cli.command {
        Some(Command::Maps { random: None, .. }) => print(&facts::list()),
        Some(Command::Maps { random: Some(kind), seed }) => print(&print_ascii(&random((*kind).into(), *seed))),
        Some(Command::Ablate(args)) => match ablate::run(args) {
            Ok(table) => print(&table),
            Err(error) => fail(&error, BAD_INPUT),
        },
        Some(Command::Frames(args)) => match frames::run(args) {
            Ok(text) => print(&text),
            Err(error) => fail(&error, BAD_INPUT),
        },
        Some(Command::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "gdg-tui", &mut script);
            print(&String::from_utf8_lossy(&script))
        }
        Some(Command::Man) => {
            let mut page = Vec::new();
            match clap_mangen::Man::new(Cli::command()).render(&mut page) {
                Ok(()) => print(&String::from_utf8_lossy(&page)),
                Err(error) => fail(&Report::msg(error), FAILED),
            }
        }
        Some(Command::Check { file, map }) => match facts::check(file, map.as_deref()) {
            Ok(text) => print(&text),
            Err(error) => fail(&error, BAD_INPUT),
        },
        Some(Command::Bench { json, threads, runs }) => {
            match bench::run(*json, setup::threads(*threads), (*runs).into()) {
                Ok(text) => print(&text),
                Err(error) => fail(&error, FAILED),
            }
        }
        None => train(&cli),
    };
    ExitCode::from(status)
}

fn train(cli: &Cli) -> u8 {
    let args = &cli.train;
    if args.print_config {
        return match setup::settings(args) {
            Ok(settings) => match serde_json::to_string_pretty(&settings) {
                Ok(text) => print(&(text + "\n")),
                Err(error) => fail(&Report::msg(error), FAILED),
            },
            Err(error) => fail(&error, BAD_INPUT),
        };
    }
    if args.print_config_template {
        return print(&tui::config_template());
    }
    let headless = args.no_ui || !std::io::stdout().is_terminal();
    let setup = match setup::prepare(args) {
        Ok(setup) => setup,
        Err(error) => return fail(&error, BAD_INPUT),
    };
    let result = if headless {
        headless::run(setup, args)
    } else {
        match tui::prepare(args) {
            Ok(prepared) => tui::run(setup, prepared, args),
            Err(error) => return fail(&error, BAD_INPUT),
        }
    };
    result.unwrap_or_else(|error| fail(&error, FAILED))
}

/// Prints to standard output; one that is closed early (`| head`) is not an error of ours.
fn print(text: &str) -> u8 {
    use std::io::Write;
    match std::io::stdout().write_all(text.as_bytes()) {
        Ok(()) => 0,
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => 0,
        Err(e) => fail(&Report::msg(e), FAILED),
    }
}

fn fail(error: &Report, status: u8) -> u8 {
    eprintln!("{error:?}");
    status
}
