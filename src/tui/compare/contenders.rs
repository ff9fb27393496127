//! The two runs, prepared from the command line.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args};
use miette::{Report, miette};

use super::LETTERS;
use crate::process::errors::{from_checkpoint_error, from_config_error};
use crate::setup;
use crate::setup::find_maps;
use crate::setup::values::{MethodParser, counts, parse_threads};
use gdg::env::{PointMaze, maze};
use gdg::files::has_extension;
use gdg::job::Job;
use gdg::learn::Threads;
use gdg::map::{Grid, Reading, builtin};
use gdg::text::sanitized;
use gdg::train::{
    self, METHODS, Method, Overrides, Preset, Registry, Run, Trainer, changed_from, settings_from,
    settings_in_world,
};

#[derive(Clone, Debug)]
pub enum Contender {
    Method(Method),
    Checkpoint(PathBuf),
}

#[derive(Clone, Debug, Args)]
pub struct ComparisonOptions {
    /// On the left: a method as in --method, or LEARNER+PLANNER, or a checkpoint
    #[arg(value_name = "A", value_parser = ContenderParser)]
    pub a: Contender,

    /// Method or checkpoint on the right
    #[arg(value_name = "B", value_parser = ContenderParser, hide_possible_values = true)]
    pub b: Contender,

    /// Built-in map or map file [default: fourrooms, or the map of the checkpoint]
    #[arg(value_name = "MAP")]
    pub map: Option<PathBuf>,

    /// Random seed of both methods: same seed, same runs [default: 0, or the checkpoint's]
    #[arg(long, value_parser = counts::<u64>(0..=u64::MAX))]
    pub seed: Option<u64>,

    /// Change one setting of both methods, or of one side (repeatable)
    #[arg(long, value_name = "[A:|B:]NAME=VALUE")]
    pub set: Vec<String>,

    /// Threads that share each update of a side: a number, or auto for as many as make it faster at
    /// the moment, up to half of this machine's cores; results do not depend on it
    #[arg(long, value_name = "N", default_value = "auto", value_parser = parse_threads)]
    pub threads: Threads,
}

impl ComparisonOptions {
    fn contenders(&self) -> [&Contender; 2] {
        [&self.a, &self.b]
    }
}

pub struct Contestant {
    pub trainer: Trainer,
    /// Letter, method, and what the other side may not have; of a saved run, file and seed.
    pub title: String,
    /// That of a saved run, which begins paused.
    pub file: Option<PathBuf>,
}

pub struct Contestants {
    pub both: [Contestant; 2],
    /// Warnings about checkpoints, and about the map.
    pub warnings: Vec<String>,
}

/// Prepares both runs: same map, same seed, each as the trainer would prepare it; or loads them.
/// Says how far it is to `progress`.
pub fn prepare(
    options: &ComparisonOptions,
    reading: &Reading,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<Contestants, Report> {
    check(options)?;
    if let [Contender::Checkpoint(a), Contender::Checkpoint(b)] = options.contenders() {
        check_same([a, b])?;
    }
    let load = |own: usize| {
        progress.begin(own, LETTERS.len());
        let path = options.contenders()[own].checkpoint();
        path.map(|path| load(path, options, registry)).transpose()
    };
    let saved = [load(0)?, load(1)?];
    let found = saved.iter().flatten().next();
    let beside = found.map(|(trainer, map)| (map.clone(), trainer.run().seed));
    let contestant = |own: usize, saved: Option<(Trainer, Arc<Grid>)>| {
        let letter = LETTERS[own];
        match (options.contenders()[own], saved) {
            (Contender::Checkpoint(path), Some((trainer, _))) => {
                let title = format!("{letter} {}", trainer.run().method);
                Ok(Contestant { trainer, title, file: Some(path.clone()) })
            }
            (Contender::Method(method), _) => {
                begin(method, letter, beside.as_ref(), (options, reading), registry)
            }
            (Contender::Checkpoint(path), None) => Err(without_map(path)),
        }
    };
    let [a, b] = saved;
    let mut both = [contestant(0, a)?, contestant(1, b)?];
    let changed = |own: &Contestant| {
        let Run { preset, settings, .. } = own.trainer.run();
        changed_from(settings, &settings_in_world(*preset, maze::KIND.defaults))
    };
    let [a, b] = both.each_ref().map(changed);
    let seeds = both.each_ref().map(|own| own.trainer.run().seed);
    let has_preset = both.iter().any(|own| own.trainer.run().preset != Preset::Default);
    for (own, [set, other]) in both.iter_mut().zip([[&a, &b], [&b, &a]]) {
        let Run { preset, seed, .. } = own.trainer.run();
        let set = set.iter().filter(|(name, value)| other.get(*name) != Some(*value));
        let set = set.map(|(name, value)| format!(" {name}={value}"));
        let seed = (seeds[0] != seeds[1]).then(|| format!(" seed {seed}"));
        let file = own.file.as_deref().and_then(Path::file_stem);
        let file = file.map(|file| format!(" ({})", sanitized(&file.to_string_lossy())));
        let preset = has_preset.then(|| format!(" {}", preset.name()));
        own.title.extend(preset.into_iter().chain(set).chain(seed).chain(file));
    }
    let maze = PointMaze::downcast_ref(both[0].trainer.world());
    let warnings = maze.map_or_else(Vec::new, |maze| find_maps::warnings(maze.map()));
    Ok(Contestants { both, warnings })
}

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
        let mut own = options.contenders().into_iter().zip(&sides).filter(|(_, own)| of_side(own));
        if own.all(|(contender, _)| is_saved(contender)) {
            let help = "a checkpoint has its settings: resume it to change them, and save it";
            return Err(miette!(help = help, "--set {setting}: changes no method"));
        }
    }
    let saved = options.contenders().into_iter().filter_map(Contender::checkpoint);
    if let (Some(map), Some(checkpoint)) = (&options.map, saved.clone().next()) {
        let help = "leave the map out: a checkpoint has its own";
        let (map, checkpoint) = (map.display(), checkpoint.display());
        return Err(miette!(help = help, "{map}: the map is that of {checkpoint}"));
    }
    if options.seed.is_some() && options.contenders().into_iter().all(is_saved) {
        return Err(miette!("--seed: checkpoints have their own seeds"));
    }
    Ok(())
}

fn without_map(path: &Path) -> Report {
    let help = "gdg-tui plot draws curves of runs in every world";
    miette!(help = help, "{}: is of a world without a map", path.display())
}

/// Checks that two saved runs are on one map, by what their files say before anything is loaded.
fn check_same(files: [&Path; 2]) -> Result<(), Report> {
    // Loading tells what else is wrong with a file.
    let on_map =
        |file| train::read_history(file).ok().filter(|(of, _)| of.world == maze::KIND.name);
    let [Some(a), Some(b)] = files.map(on_map) else { return Ok(()) };
    if a.0.fingerprint == b.0.fingerprint {
        return Ok(());
    }
    let help = "only runs on the same map can be compared, as goals and starts apply to both";
    let [a, b] = [a, b].map(|(found, history)| {
        let edited = if history.edits().is_empty() { "" } else { ", edited" };
        let size = found.fingerprint.as_deref().and_then(|facts| facts.split(", ").next());
        format!("{} ({}{edited})", sanitized(&found.title), size.unwrap_or_default())
    });
    Err(miette!(help = help, "the checkpoints are of different maps: {a} and {b}"))
}

impl Contender {
    fn checkpoint(&self) -> Option<&Path> {
        if let Self::Checkpoint(path) = self { Some(path) } else { None }
    }
}

/// Loads a saved run with its map, unless its world has none, which may take long to open.
fn load(
    path: &Path,
    options: &ComparisonOptions,
    registry: &Arc<Registry>,
) -> Result<(Trainer, Arc<Grid>), Report> {
    // A file that cannot be read gets an error of its own.
    if train::describe(path).is_ok_and(|found| found.world != maze::KIND.name) {
        return Err(without_map(path));
    }
    let threads = options.threads.share(LETTERS.len());
    let mut trainer = train::load(path, registry, threads).map_err(from_checkpoint_error)?;
    // Both stay on one map.
    trainer.edits.clear();
    let maze = PointMaze::downcast_ref(trainer.world()).ok_or_else(|| without_map(path))?;
    let map = maze.map().clone();
    Ok((trainer, map))
}

/// Begins a run of a method: on the map and with the seed of a saved run beside it, if one is.
fn begin(
    method: &Method,
    letter: char,
    beside: Option<&(Arc<Grid>, u64)>,
    (options, reading): (&ComparisonOptions, &Reading),
    registry: &Arc<Registry>,
) -> Result<Contestant, Report> {
    let side = letter.to_string();
    let preset = registry.preset_of(method);
    let set = setup::settings_of(&[&side], &options.set);
    let settings = settings_from(preset, &Overrides { set: &set, ..Overrides::default() })
        .map_err(from_config_error)?;
    let seed = options.seed.or(beside.map(|(_, seed)| *seed)).unwrap_or(0);
    let run = Run { method: method.clone(), preset, seed, settings };
    let maze = if let Some((map, _)) = beside {
        setup::maze_on(map.clone(), map.name(), &run)?
    } else {
        let map = options.map.as_deref().unwrap_or(Path::new(find_maps::DEFAULT_MAP));
        setup::open_maze(map, reading, &run, registry)?
    };
    let title = format!("{side} {}", method.name());
    let trainer = setup::begin(run, &maze, registry, options.threads.share(LETTERS.len()))?;
    Ok(Contestant { trainer, title, file: None })
}

/// Parses a method or the path of a checkpoint, and lists the named methods.
#[derive(Clone)]
struct ContenderParser;

impl TypedValueParser for ContenderParser {
    type Value = Contender;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<Contender, clap::Error> {
        let path = Path::new(value);
        if has_extension(path, "safetensors") {
            return Ok(Contender::Checkpoint(path.to_owned()));
        }
        let method = MethodParser.parse_ref(command, arg, value);
        method.map(Contender::Method).map_err(|mut error| {
            let name = value.to_string_lossy();
            if builtin(&name).is_some() || path.is_file() {
                let tip = format!("a map comes last: gdg-tui compare A B {}", sanitized(&name));
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            }
            error
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        MethodParser.possible_values()
    }
}

const INTRODUCTION: &str = "Two methods, A and B, train on the same map with the same seed. \
     Colours show the distance D that each has learned (steps by its Q, of those that learn from \
     rewards); @ walks to G with what it has learned so \
     far, in both from the same start: a race, which the one that arrives wins, or both. Click on \
     either map to set the goal of both. The editor draws walls and closes doors on both.";

/// Returns the text that begins the help, which says what each method is.
pub fn introduction(methods: [&Method; 2]) -> String {
    let named = |method: &Method| METHODS.iter().find(|named| Method::from(*named) == *method);
    let about = LETTERS.iter().zip(methods).filter_map(|(letter, method)| {
        named(method).map(|named| format!(" {letter}, {}: {}.", named.name, named.about))
    });
    INTRODUCTION.to_owned() + &about.collect::<String>()
}
