//! The commands that train: `gdg-tui [MAP]`, with or without the interface, `tour` and `compare`.

use std::io::IsTerminal;
use std::sync::Arc;

use clap::CommandFactory;
use miette::{Report, miette};

use super::{CommandOutcome, bad_input, failure, prepare, print};
use crate::cli::{Cli, CompareArgs, ScreenArgs, TourArgs, TrainArgs};
use crate::headless;
use crate::process::logging;
use crate::process::waiting::Waiting;
use crate::setup::find_maps;
use crate::tui::{self, PreparedInterface};
use gdg::printing::eprint_line;
use gdg::text::{sanitized_lines, terminal_obeys_escapes};
use gdg::train::{Limits, Registry, print_settings};

/// Trains, or prints what it would train with.
pub fn run(args: &TrainArgs, registry: &Arc<Registry>) -> CommandOutcome {
    let (options, data) = (args.gym.options(args.reading.goal_radius), args.data.clone());
    let registry = &registry.clone().with(|own| (own.options, own.data) = (options, data));
    if args.print_config {
        let opening = Waiting::on(prepare::opening(args));
        let settings = prepare::settings_to_print(args, registry, &opening);
        drop(opening);
        return print(&print_settings(&settings.map_err(bad_input)?));
    }
    if args.print_config_template {
        return print(&tui::config_template());
    }
    logging::start(args.log_level);
    if args.resume.is_none() && find_maps::is_unknown_name(args.map(), registry) {
        // It may be a mistyped command.
        let cli = Cli::command();
        let commands = cli.get_subcommands().map(|command| command.get_name().to_owned());
        let commands: Vec<String> = commands.collect();
        return Err(bad_input(find_maps::unknown_name(args.map(), registry, &commands)));
    }
    let obstacle = if args.no_ui { None } else { obstacle() };
    let setup = prepare::prepare(args, registry, &Waiting::on(prepare::opening(args)));
    let setup = setup.map_err(bad_input)?;
    if let Some(obstacle) = &obstacle {
        let meant = "--no-ui says that this is meant";
        let is_endless = setup.limits == Limits::default();
        let until = if is_endless { ", until Ctrl-C or a limit: --max-updates N" } else { "" };
        eprint_line(&format!("trains without the interface, as {obstacle} ({meant}){until}"));
    }
    if args.no_ui || obstacle.is_some() {
        return headless::run(setup, &args.headless).map_err(failure);
    }
    let mut interface = tui::prepare(&args.interface).map_err(bad_input)?;
    Ok(tui::run(setup, None, &mut interface).map_err(failure)?.0)
}

/// Returns why the interface cannot be shown, if it cannot.
pub fn obstacle() -> Option<String> {
    if !std::io::stdout().is_terminal() {
        return Some("the output is not a terminal".to_owned());
    }
    let of_kind = || match std::env::var("TERM").unwrap_or_default().as_str() {
        "" => "TERM is not set".to_owned(),
        term => format!("TERM={}", sanitized_lines(term)),
    };
    (!terminal_obeys_escapes()).then(|| format!("the terminal cannot draw it ({})", of_kind()))
}

/// Prepares and shows what needs a terminal: `what` is said without one, and what works instead.
pub fn on_screen<T>(
    args: &ScreenArgs,
    [what, instead]: [&str; 2],
    prepare: impl FnOnce() -> Result<T, Report>,
    show: impl FnOnce(T, &mut PreparedInterface) -> tui::Closing,
) -> CommandOutcome {
    logging::start(args.log_level);
    let prepared = prepare().map_err(bad_input)?;
    if let Some(obstacle) = obstacle() {
        let problem = format!("{what} is something to watch: it needs a terminal, but {obstacle}");
        return Err(bad_input(miette!(help = instead, "{problem}")));
    }
    let mut interface = tui::prepare(&args.interface).map_err(bad_input)?;
    Ok(show(prepared, &mut interface).map_err(failure)?.0)
}

pub fn tour(args: &TourArgs, registry: &Arc<Registry>) -> CommandOutcome {
    let refusal = ["a tour", "gdg-tui --no-ui trains without one"];
    on_screen(&args.screen, refusal, || tui::prepare_tour(args.threads, registry), tui::take_tour)
}

pub fn compare(args: &CompareArgs, registry: &Arc<Registry>) -> CommandOutcome {
    let instead = "gdg-tui reproduce and gdg-tui suite --method METHOD compare methods without one";
    let prepare = || {
        let opening = Waiting::on("opening both runs");
        tui::prepare_comparison(&args.options, &(&args.reading).into(), registry, &opening)
    };
    on_screen(&args.screen, ["a comparison", instead], prepare, tui::compare)
}
