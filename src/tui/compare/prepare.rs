//! The two runs, prepared from the command line.

use std::path::PathBuf;
use std::sync::Arc;

use miette::{Report, miette};

use super::LETTERS;
use crate::host::maps::warn;
use crate::host::report::from_config_error;
use crate::host::setup;
use gdg::env::PointMaze;
use gdg::learn::Threads;
use gdg::map::Reading;
use gdg::train::{Method, Overrides, Registry, Run, Trainer, settings_from};

/// What to compare.
#[derive(Clone, Debug)]
pub struct ComparisonOptions {
    /// The methods, from left to right.
    pub methods: [Method; 2],
    /// Built-in map or map file.
    pub map: PathBuf,
    /// How the map is read.
    pub reading: Reading,
    /// Random seed of both.
    pub seed: u64,
    /// Changes of settings of both, or of one side, `[A:|B:]NAME=VALUE`.
    pub set: Vec<String>,
    /// Threads per side; otherwise half of the cores.
    pub threads: Threads,
    /// The recording to write.
    pub recording: Option<PathBuf>,
}

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
pub fn prepare(
    options: &ComparisonOptions,
    registry: &Arc<Registry>,
) -> Result<[Contestant; 2], Report> {
    let sides = LETTERS.map(|letter| letter.to_string());
    for setting in &options.set {
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
    if let Some(path) = &options.recording {
        setup::refuse_input("--record", path, std::iter::once(options.map.as_path()))?;
    }
    let [left, right] = &options.methods;
    let [a, b] = [(left, &sides[0]), (right, &sides[1])]
        .map(|(method, side)| contestant(method, side, options, registry));
    let contestants = [a?, b?];
    if let Some(maze) = PointMaze::downcast_ref(contestants[0].trainer.world()) {
        warn(maze.map());
    }
    Ok(contestants)
}

fn contestant(
    method: &Method,
    side: &str,
    options: &ComparisonOptions,
    registry: &Arc<Registry>,
) -> Result<Contestant, Report> {
    let preset = registry.preset_of(method);
    let set = setup::settings_of(side, &options.set);
    let settings = settings_from(preset, &Overrides { set: &set, ..Overrides::default() })
        .map_err(from_config_error)?;
    let run = Run { method: method.clone(), preset, seed: options.seed, settings };
    let maze = setup::open_maze(&options.map, &options.reading, &run, registry)?;
    let threads = options.threads.share(LETTERS.len());
    let own = options.set.iter().filter_map(|setting| match setup::split_prefix(setting) {
        (Some(prefix), setting) if prefix == side => Some(format!(" {setting}")),
        _ => None,
    });
    let title = format!("{side} {} {}{}", method.name(), preset.name(), own.collect::<String>());
    Ok(Contestant { trainer: setup::begin(run, &maze, registry, threads)?, title })
}
