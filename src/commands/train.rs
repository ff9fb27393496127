//! `gdg-tui [MAP]`: trains, with or without the interface.

use std::path::Path;
use std::sync::Arc;

use clap::CommandFactory;
use gdg::printing::eprint_line;
use gdg::train::{Registry, print_settings};

use super::output::{OrFail, Outcome, print};
use super::prepare;
use super::screen::obstacle;
use crate::cli::{Cli, TrainArgs};
use crate::headless;
use crate::host::setup::Setup;
use crate::host::waiting::Waiting;
use crate::host::{logging, maps};
use crate::tui;

/// Trains, or prints what it would train with.
pub fn run(args: &TrainArgs, registry: &Arc<Registry>) -> Outcome {
    let registry = &registry_for(args, registry);
    if args.print_config {
        let opening = Waiting::on(prepare::opening(args));
        let settings = prepare::settings_to_print(args, registry, &opening);
        drop(opening);
        let settings = settings.or_bad_input()?;
        return print(&print_settings(&settings));
    }
    if args.print_config_template {
        return print(&tui::config_template());
    }
    logging::start(args.log_level);
    let with_ui = is_shown(args);
    if args.resume.is_none() {
        check_for_command(args.map(), registry)?;
    }
    let opening = Waiting::on(prepare::opening(args));
    let setup = prepare::prepare(args, registry, &opening);
    drop(opening);
    let setup = setup.or_bad_input()?;
    if with_ui {
        return show(setup, args);
    }
    headless::run(setup, &args.headless()).or_failure()
}

/// Returns the registry with what is given of environments in Python and recorded data.
pub fn registry_for(args: &TrainArgs, registry: &Arc<Registry>) -> Arc<Registry> {
    let options = args.gym.options(args.reading.goal_radius);
    registry.clone().with_gym(options).with_data(args.data.clone())
}

/// Decides whether the run is shown; prints a notice if it is not, unless `--no-ui` asked for that.
fn is_shown(args: &TrainArgs) -> bool {
    if args.no_ui {
        return false;
    }
    let Some(obstacle) = obstacle() else { return true };
    eprint_line(&format!(
        "trains without the interface, as {obstacle} (--no-ui says that this is meant)"
    ));
    false
}

fn show(setup: Setup, args: &TrainArgs) -> Outcome {
    let mut interface = tui::prepare(&args.interface.options()).or_bad_input()?;
    Ok(tui::run(setup, &mut interface, args.map.as_deref()).or_failure()?.0)
}

/// Checks that the map argument is not a mistyped command.
fn check_for_command(map: &Path, registry: &Registry) -> Result<(), super::Failure> {
    if !maps::is_unknown_name(map, registry) {
        return Ok(());
    }
    let commands: Vec<String> =
        Cli::command().get_subcommands().map(|command| command.get_name().to_owned()).collect();
    Err(maps::unknown_name(map, registry, &commands)).or_bad_input()
}
