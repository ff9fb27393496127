//! The two runs, prepared from the command line.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Report, miette};

use super::LETTERS;
use crate::host::maps;
use crate::host::outputs::refuse_input;
use crate::host::report::{from_checkpoint_error, from_config_error};
use crate::host::setup;
use gdg::env::{PointMaze, maze};
use gdg::learn::Threads;
use gdg::map::{Grid, Reading};
use gdg::pulse::Progress;
use gdg::text::sanitized;
use gdg::train::{self, Method, Overrides, Registry, Run, Trainer, settings_from};

/// The map of two methods, unless another one is given.
const DEFAULT_MAP: &str = "fourrooms";

/// What takes part in a comparison.
#[derive(Clone, Debug)]
pub enum Contender {
    /// A method, which begins a run.
    Method(Method),
    /// A saved run.
    Checkpoint(PathBuf),
}

/// What to compare.
#[derive(Clone, Debug)]
pub struct ComparisonOptions {
    /// Methods or checkpoints, from left to right.
    pub contenders: [Contender; 2],
    /// Built-in map or map file; otherwise the checkpoint's, or the default one.
    pub map: Option<PathBuf>,
    /// How the map is read.
    pub reading: Reading,
    /// Random seed of methods; otherwise the checkpoint's, or 0.
    pub seed: Option<u64>,
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
    /// Letter, method, preset, and settings of this side alone; of a saved run, file and seed.
    pub title: String,
    /// Whether it begins paused.
    pub is_paused: bool,
}

/// Both runs.
pub struct Contestants {
    /// From left to right.
    pub both: [Contestant; 2],
    /// Warnings about checkpoints, and about the map.
    pub warnings: Vec<String>,
}

/// A side before it is prepared.
enum Side<'a> {
    Method(&'a Method),
    Saved(&'a Path, Box<Trainer>),
}

/// Where methods begin: on a map, with a seed.
type Beginning = (Arc<Grid>, u64);

/// Prepares both runs: same map, same seed, each as the trainer would prepare it; or loads them.
/// Says how far it is to `progress`.
///
/// # Errors
/// The map or a setting is invalid, a checkpoint cannot be loaded, two are of different maps, or a
/// run needs more memory than is left.
pub fn prepare(
    options: &ComparisonOptions,
    registry: &Arc<Registry>,
    progress: &Progress,
) -> Result<Contestants, Report> {
    check(options)?;
    let mut done = 0..;
    let [a, b] = options.contenders.each_ref().map(|contender| {
        progress.begin(done.next().unwrap_or_default(), LETTERS.len());
        Side::load(contender, options, registry)
    });
    let sides = [a?, b?];
    let [a, b] = sides.each_ref().map(Side::beginning);
    let (a, b) = (a?, b?);
    if let (Some((a, _)), Some((b, _))) = (&a, &b) {
        check_same(a, b)?;
    }
    let beginning = a.or(b);
    let [a, b] = sides;
    let [a, b] = [(a, LETTERS[0]), (b, LETTERS[1])]
        .map(|(side, letter)| side.prepare(letter, beginning.as_ref(), options, registry));
    let both = [a?, b?];
    let maze = PointMaze::downcast_ref(both[0].trainer.world());
    let warnings = maze.map_or_else(Vec::new, |maze| maps::warnings(maze.map()));
    Ok(Contestants { both, warnings })
}

/// Checks what can be checked before anything is loaded.
fn check(options: &ComparisonOptions) -> Result<(), Report> {
    let sides = LETTERS.map(|letter| letter.to_string());
    let is_saved = |contender: &Contender| matches!(contender, Contender::Checkpoint(_));
    for setting in &options.set {
        let prefix = setup::split_prefix(setting).0;
        if prefix.is_some_and(|prefix| sides.iter().all(|side| side != prefix)) {
            let help =
                "A:NAME=VALUE changes the left side, B:NAME=VALUE the right one, NAME=VALUE both";
            let prefix = prefix.unwrap_or_default();
            return Err(miette!(
                help = help,
                "--set {setting}: there is no side called {prefix:?}"
            ));
        }
        let of_side = |side: &String| prefix.is_none_or(|prefix| side == prefix);
        let mut own = options.contenders.iter().zip(&sides).filter(|(_, side)| of_side(side));
        if own.all(|(contender, _)| is_saved(contender)) {
            let help = "a checkpoint has its settings: resume it to change them, and save it";
            return Err(miette!(help = help, "--set {setting}: changes no method"));
        }
    }
    let saved = options.contenders.iter().filter_map(Contender::checkpoint);
    if let Some(path) = &options.recording {
        let map = options.map.as_deref();
        refuse_input("--record", path, map.into_iter().chain(saved.clone()))?;
    }
    if let (Some(map), Some(checkpoint)) = (&options.map, saved.clone().next()) {
        let help = "leave the map out: a checkpoint has its own";
        let (map, checkpoint) = (map.display(), checkpoint.display());
        return Err(miette!(help = help, "{map}: the map is that of {checkpoint}"));
    }
    if options.seed.is_some() && options.contenders.iter().all(is_saved) {
        return Err(miette!("--seed: checkpoints have their own seeds"));
    }
    Ok(())
}

/// Reports a saved run of a world without a map.
fn without_map(path: &Path) -> Report {
    let help = "gdg-tui plot draws curves of runs in every world";
    miette!(help = help, "{}: is of a world without a map", path.display())
}

/// Checks that two saved runs are on the same map.
fn check_same(a: &Grid, b: &Grid) -> Result<(), Report> {
    if (a.width(), a.free()) == (b.width(), b.free()) {
        return Ok(());
    }
    let help = "only runs on the same map can be compared, as goals and starts apply to both";
    let [a, b] =
        [a, b].map(|map| format!("{} ({} x {})", sanitized(map.name()), map.width(), map.height()));
    Err(miette!(help = help, "the checkpoints are of different maps: {a} and {b}"))
}

impl Contender {
    fn checkpoint(&self) -> Option<&Path> {
        match self {
            Self::Method(_) => None,
            Self::Checkpoint(path) => Some(path),
        }
    }
}

impl<'a> Side<'a> {
    /// Loads a saved run, unless its world has no map, which may take long to open.
    fn load(
        contender: &'a Contender,
        options: &ComparisonOptions,
        registry: &Arc<Registry>,
    ) -> Result<Self, Report> {
        let path = match contender {
            Contender::Method(method) => return Ok(Self::Method(method)),
            Contender::Checkpoint(path) => path,
        };
        // A file that cannot be read gets an error of its own.
        if train::describe(path).is_ok_and(|found| found.world != maze::KIND.name) {
            return Err(without_map(path));
        }
        let threads = options.threads.share(LETTERS.len());
        let trainer = train::load(path, registry, threads).map_err(from_checkpoint_error)?;
        Ok(Self::Saved(path, Box::new(trainer)))
    }

    /// Returns the map and the seed of a saved run.
    fn beginning(&self) -> Result<Option<Beginning>, Report> {
        let Self::Saved(path, trainer) = self else { return Ok(None) };
        let maze = PointMaze::downcast_ref(trainer.world()).ok_or_else(|| without_map(path))?;
        Ok(Some((maze.map().clone(), trainer.run().seed)))
    }

    fn prepare(
        self,
        letter: char,
        beginning: Option<&Beginning>,
        options: &ComparisonOptions,
        registry: &Arc<Registry>,
    ) -> Result<Contestant, Report> {
        match self {
            Self::Method(method) => contestant(method, letter, beginning, options, registry),
            Self::Saved(path, trainer) => {
                let (run, file) = (trainer.run(), path.file_name().unwrap_or_default());
                let (file, method) = (sanitized(&file.to_string_lossy()), run.method.name());
                let title =
                    format!("{letter} {file}: {method} {} seed {}", run.preset.name(), run.seed);
                Ok(Contestant { trainer: *trainer, title, is_paused: true })
            }
        }
    }
}

fn contestant(
    method: &Method,
    letter: char,
    beginning: Option<&Beginning>,
    options: &ComparisonOptions,
    registry: &Arc<Registry>,
) -> Result<Contestant, Report> {
    let side = letter.to_string();
    let preset = registry.preset_of(method);
    let set = setup::settings_of(&side, &options.set);
    let settings = settings_from(preset, &Overrides { set: &set, ..Overrides::default() })
        .map_err(from_config_error)?;
    let seed = options.seed.or(beginning.map(|(_, seed)| *seed)).unwrap_or(0);
    let run = Run { method: method.clone(), preset, seed, settings };
    let maze = if let Some((map, _)) = beginning {
        setup::maze_on(map.clone(), map.name(), &run)?
    } else {
        let map = options.map.as_deref().unwrap_or(Path::new(DEFAULT_MAP));
        setup::open_maze(map, &options.reading, &run, registry)?
    };
    let threads = options.threads.share(LETTERS.len());
    let own = options.set.iter().filter_map(|setting| match setup::split_prefix(setting) {
        (Some(prefix), setting) if prefix == side => Some(format!(" {setting}")),
        _ => None,
    });
    let title = format!("{side} {} {}{}", method.name(), preset.name(), own.collect::<String>());
    let trainer = setup::begin(run, &maze, registry, threads)?;
    Ok(Contestant { trainer, title, is_paused: false })
}
