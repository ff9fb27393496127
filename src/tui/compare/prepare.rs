//! The two runs, prepared from the command line.

use std::sync::Arc;

use miette::{Report, miette};

use super::LETTERS;
use crate::cli::CompareArgs;
use crate::facts::warn;
use crate::report::from_config_error;
use crate::setup;
use gdg::env::PointMaze;
use gdg::train::{Method, Overrides, Preset, Registry, Run, Trainer, settings_from};

/// A run that takes part in a comparison.
pub struct Contestant {
    /// The run.
    pub trainer: Trainer,
    /// Letter, method, preset, and settings of this side alone.
    pub title: String,
}

/// Prepares both runs: same map, same seed, each as the trainer would prepare it.
///
/// # Errors
/// The map or a setting is invalid, or a run needs more memory than is left.
pub fn prepare(args: &CompareArgs, registry: &Arc<Registry>) -> Result<[Contestant; 2], Report> {
    let sides = LETTERS.map(|letter| letter.to_string());
    for setting in &args.set {
        if let Some(prefix) =
            setup::split_prefix(setting).0.filter(|prefix| sides.iter().all(|side| side != prefix))
        {
            let help =
                "A:NAME=VALUE changes the left side, B:NAME=VALUE the right one, NAME=VALUE both";
            return Err(miette!(
                help = help,
                "--set {setting}: there is no side called {prefix:?}"
            ));
        }
    }
    if let Some(path) = &args.screen.interface.record {
        setup::refuse_input(("--record", path), std::iter::once(args.map.as_path()))?;
    }
    let [a, b] = [(&args.a, &sides[0]), (&args.b, &sides[1])]
        .map(|(method, side)| contestant(method, side, args, registry));
    let contestants = [a?, b?];
    if let Some(maze) = PointMaze::downcast_ref(contestants[0].trainer.world()) {
        warn(maze.map());
    }
    Ok(contestants)
}

fn contestant(
    method: &Method,
    side: &str,
    args: &CompareArgs,
    registry: &Arc<Registry>,
) -> Result<Contestant, Report> {
    let preset = Preset::of_method(method);
    let set = setup::settings_of(side, &args.set);
    let settings = settings_from(preset, &Overrides { set: &set, ..Overrides::default() })
        .map_err(from_config_error)?;
    let run = Run { method: method.clone(), preset, seed: args.seed, settings };
    let maze = setup::open_maze(&args.map, &run, registry)?;
    let threads = args.threads.map_or((setup::threads(None) / LETTERS.len()).max(1), usize::from);
    let own = args.set.iter().filter_map(|setting| match setup::split_prefix(setting) {
        (Some(prefix), setting) if prefix == side => Some(format!(" {setting}")),
        _ => None,
    });
    let title = format!("{side} {} {}{}", method.name(), preset.name(), own.collect::<String>());
    Ok(Contestant { trainer: setup::begin(run, &maze, registry, threads)?, title })
}
