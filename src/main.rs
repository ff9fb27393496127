//! The binary: picks a front end and turns errors into messages and exit statuses.
#![forbid(unsafe_code)]

#[cfg(feature = "tui")]
use std::io::IsTerminal;
use std::process::ExitCode;
#[cfg(feature = "tui")]
use std::sync::Arc;

use clap::CommandFactory;
#[cfg(feature = "tui")]
use gdg::env::Scene;
use gdg::map::{print_ascii, random};
use gdg::printing::eprint_line;
use gdg::text::{sanitized_lines, terminal_obeys_escapes};
use gdg::train::{Registry, print_settings, reference_page};
use gdg::{faults, printing};
use gdg_tui::cli::{
    Cli, Command, EXIT_BAD_INPUT, EXIT_FAILURE, ReproduceArgs, SuiteArgs, completions,
};
#[cfg(feature = "tui")]
use gdg_tui::cli::{CompareArgs, ScreenArgs, TourArgs};
use gdg_tui::experiment::{ablate, reproduce, suite};
use gdg_tui::logging::LogLevel;
#[cfg(feature = "tui")]
use gdg_tui::tui::PreparedInterface;
use gdg_tui::{export_policy, facts, film, headless, logging, report, runs, setup, signals};
#[cfg(feature = "tui")]
use gdg_tui::{frames, tui};
use miette::Report;

fn main() -> ExitCode {
    faults::install_panic_hook();
    report::set_up_colours();
    if let Err(error) = signals::survive_file_size_limit() {
        eprint_line(&format!("files that become too large will end the program: {error}"));
    }
    // Not a command for people: neither help nor completions list it.
    #[cfg(feature = "tui")]
    if std::env::args_os().nth(1).is_some_and(|first| first == tui::GUARD_COMMAND) {
        tui::guard_terminal();
        return ExitCode::SUCCESS;
    }
    let status = Cli::from_arguments().map_or_else(|error| usage(&error), |cli| run(&cli));
    printing::finish();
    ExitCode::from(status)
}

/// Runs a command and returns the exit status.
fn run(cli: &Cli) -> u8 {
    match &cli.command {
        Some(Command::Maps { random: None, .. }) => print(&facts::list()),
        Some(Command::Maps { random: Some(kind), size, seed }) => {
            let size = size.map(usize::from);
            print(&print_ascii(&random((*kind).into(), size, *seed)))
        }
        Some(Command::Runs { folder }) => printed(runs::list(folder), EXIT_BAD_INPUT),
        Some(Command::Settings) => print(&reference_page()),
        #[cfg(feature = "tui")]
        Some(Command::Tour(args)) => run_tour(args),
        #[cfg(feature = "tui")]
        Some(Command::Compare(args)) => run_comparison(args),
        Some(Command::Suite(args)) => run_suite(args),
        Some(Command::Reproduce(args)) => run_reproduce(args),
        Some(Command::Ablate(args)) => {
            ablate::run(args).unwrap_or_else(|error| fail(error, EXIT_BAD_INPUT))
        }
        #[cfg(feature = "tui")]
        Some(Command::Frames(args)) => printed(frames::run(args), EXIT_BAD_INPUT),
        Some(Command::Completions { shell }) => print(&completions(*shell)),
        Some(Command::Man) => {
            let mut page = Vec::new();
            match clap_mangen::Man::new(Cli::command()).render(&mut page) {
                Ok(()) => print(&String::from_utf8_lossy(&page)),
                Err(error) => fail(Report::msg(error), EXIT_FAILURE),
            }
        }
        Some(Command::Check { file, map }) => {
            printed(facts::check(file, map.as_deref()), EXIT_BAD_INPUT)
        }
        Some(Command::ExportPolicy(args)) => printed(export_policy::run(args), EXIT_BAD_INPUT),
        Some(Command::Film(args)) => printed(film::run(args), EXIT_BAD_INPUT),
        None => train(cli),
    }
}

#[cfg(feature = "tui")]
fn run_tour(args: &TourArgs) -> u8 {
    let needs_terminal =
        ("a tour is something to watch: it needs a terminal", "gdg-tui --no-ui trains without one");
    watch(
        &args.screen,
        needs_terminal,
        |registry| tui::prepare_tour(args, registry),
        tui::take_tour,
    )
}

#[cfg(feature = "tui")]
fn run_comparison(args: &CompareArgs) -> u8 {
    let needs_terminal = (
        "a comparison is something to watch: it needs a terminal",
        "gdg-tui reproduce and gdg-tui suite --method METHOD compare methods without one",
    );
    watch(
        &args.screen,
        needs_terminal,
        |registry| tui::prepare_comparison(args, registry),
        tui::compare,
    )
}

/// Prepares and shows something that makes no sense without a terminal; without one, reports
/// `needs_terminal`, an error and its help.
#[cfg(feature = "tui")]
fn watch<T>(
    args: &ScreenArgs,
    (needs_terminal, help): (&str, &str),
    prepare: impl FnOnce(&Arc<Registry>) -> Result<T, Report>,
    show: impl FnOnce(T, PreparedInterface) -> Result<u8, Report>,
) -> u8 {
    logging::start(args.log_level);
    let prepared = prepare(&Registry::builtin()).and_then(|prepared| {
        if let Some(obstacle) = obstacle_to_interface() {
            return Err(miette::miette!(help = help, "{needs_terminal}, but {obstacle}"));
        }
        Ok((prepared, tui::prepare(&args.interface, args.overwrite)?))
    });
    match prepared {
        Ok((prepared, interface)) => {
            show(prepared, interface).unwrap_or_else(|error| fail(error, EXIT_FAILURE))
        }
        Err(error) => fail(error, EXIT_BAD_INPUT),
    }
}

/// Returns why the interface cannot be shown, if it cannot.
#[cfg(feature = "tui")]
fn obstacle_to_interface() -> Option<String> {
    if !std::io::stdout().is_terminal() {
        return Some("the output is not a terminal".to_owned());
    }
    let of_kind = || match std::env::var("TERM").unwrap_or_default().as_str() {
        "" => "TERM is not set".to_owned(),
        term => format!("TERM={}", sanitized_lines(term)),
    };
    (!terminal_obeys_escapes()).then(|| format!("the terminal cannot draw it ({})", of_kind()))
}

fn run_suite(args: &SuiteArgs) -> u8 {
    logging::start(LogLevel::Info);
    match suite::prepare(args, &Registry::builtin()) {
        Ok(suite) => suite.run().unwrap_or_else(|error| fail(error, EXIT_FAILURE)),
        Err(error) => fail(error, EXIT_BAD_INPUT),
    }
}

fn run_reproduce(args: &ReproduceArgs) -> u8 {
    logging::start(LogLevel::Info);
    match reproduce::prepare(args, &Registry::builtin()) {
        Ok(figures) => figures.run().unwrap_or_else(|error| fail(error, EXIT_FAILURE)),
        Err(error) => fail(error, EXIT_BAD_INPUT),
    }
}

fn train(cli: &Cli) -> u8 {
    let args = &cli.train;
    if args.print_config {
        return match setup::settings_to_print(args, &Registry::builtin()) {
            Ok(settings) => print(&print_settings(&settings)),
            Err(error) => fail(error, EXIT_BAD_INPUT),
        };
    }
    #[cfg(feature = "tui")]
    if args.print_config_template {
        return print(&tui::config_template());
    }
    logging::start(args.log_level);
    #[cfg(feature = "tui")]
    let obstacle = obstacle_to_interface();
    #[cfg(feature = "tui")]
    let with_ui = !args.no_ui && obstacle.is_none();
    #[cfg(feature = "tui")]
    if let Some(obstacle) = obstacle.filter(|_| !args.no_ui) {
        if args.interface.record.is_some() {
            let help = "run it in a terminal, or without --record";
            let error = miette::miette!(help = help, "--record: there is no screen, as {obstacle}");
            return fail(error, EXIT_BAD_INPUT);
        }
        eprint_line(&format!(
            "trains without the interface, as {obstacle} (--no-ui says that this is meant)"
        ));
    }
    let setup = match setup::prepare(args, &Registry::builtin()) {
        Ok(setup) => setup,
        Err(error) => return fail(error, EXIT_BAD_INPUT),
    };
    #[cfg(feature = "tui")]
    if with_ui {
        if matches!(setup.trainer.world().scene(), Scene::Nothing) {
            let help = "train it with --no-ui";
            return fail(
                miette::miette!(help = help, "the interface cannot draw this world"),
                EXIT_BAD_INPUT,
            );
        }
        return match tui::prepare(&args.interface, args.overwrite) {
            Ok(prepared) => {
                tui::run(setup, prepared, args).unwrap_or_else(|error| fail(error, EXIT_FAILURE))
            }
            Err(error) => fail(error, EXIT_BAD_INPUT),
        };
    }
    headless::run(setup, args).unwrap_or_else(|error| fail(error, EXIT_FAILURE))
}

/// Prints the error in the arguments, or the requested help.
fn usage(error: &clap::Error) -> u8 {
    let text = error.to_string();
    if sanitized_lines(&text) == text && terminal_obeys_escapes() {
        if let Err(problem) = error.print()
            && !error.use_stderr()
            && problem.kind() != std::io::ErrorKind::BrokenPipe
        {
            return fail(Report::msg(problem).wrap_err("standard output"), EXIT_FAILURE);
        }
    } else if error.use_stderr() {
        // It quotes an argument that contains terminal control characters, or colours mean nothing
        // here.
        eprint_line(sanitized_lines(&text).trim_end());
    } else {
        print(&text);
    }
    error.exit_code() as u8
}

fn printed(text: Result<String, Report>, status: u8) -> u8 {
    text.map_or_else(|error| fail(error, status), |text| print(&sanitized_lines(&text)))
}

/// Prints to standard output. An early close (`| head`) is not an error.
fn print(text: &str) -> u8 {
    match printing::print_text(text) {
        Ok(()) => 0,
        Err(error) => fail(Report::msg(error).wrap_err("standard output"), EXIT_FAILURE),
    }
}

fn fail(error: Report, status: u8) -> u8 {
    tracing::error!("{error}");
    report::print_error(error);
    status
}
