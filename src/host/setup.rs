//! Prepares a run from the command line, for all front ends.

mod choice;
mod data;
mod edits;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::host::maps::{self, find_map, known_name};
use crate::host::outputs::{refuse_existing, refuse_input, save_to};
use crate::host::report::{from_checkpoint_error, from_data_error, from_map_error};
use crate::host::runs::{self, SAVES};
use gdg::env::{Environment, Goals, PointMaze, Restart, maze};
use gdg::files;
use gdg::job::Job;
use gdg::learn::Threads;
use gdg::map::{self, Grid, MapError, MapFormat, Reading};
use gdg::text::sanitized;
use gdg::train::{self, Limits, Registry, Run, SaveTo, Settings, TrainError, Trainer};

pub use choice::{RunChoice, run, settings, settings_of, split_prefix};
pub use data::learn_from;
use edits::load_edits;
pub use edits::{Edit, EditAt};

/// The option for maps that are images.
pub const THRESHOLD: &str = "--threshold";

/// A run to begin or to resume.
#[derive(Clone, Debug)]
pub struct Request {
    pub map: PathBuf,
    pub reading: Reading,
    /// The options given for that, and those given for environments in Python.
    pub map_options: Vec<&'static str>,
    /// See `map_options`.
    pub python_options: Vec<&'static str>,
    /// Whether the user has named it.
    pub named_map: bool,
    pub run: RunChoice,
    pub seed: u64,
    /// Whether to resume: from the newest checkpoint, or from this one.
    pub resume: Option<Option<PathBuf>>,
    /// Changes of the map.
    pub edits: Vec<EditAt>,
    pub scenario: Option<PathBuf>,
    /// Recorded transitions to learn from.
    pub data: Option<PathBuf>,
    /// Threads that share the work of each update.
    pub threads: Threads,
    pub save: Option<PathBuf>,
    pub table: Option<PathBuf>,
    /// Whether existing files are replaced.
    pub overwrite: bool,
    /// Limits of the run; seconds count from where it begins or resumes.
    pub limits: Limits,
}

pub struct Setup {
    pub trainer: Trainer,
    pub edits: Vec<Edit>,
    /// Threads that share the work of each update.
    pub threads: Threads,
    /// Limits of the run; seconds count from the start of training.
    pub limits: Limits,
    /// Where to save the run, if given.
    pub save: Option<SaveTo>,
    /// The checkpoint that the run was resumed from.
    pub resumed: Option<PathBuf>,
    pub warnings: Vec<String>,
}

/// Returns the settings that `--print-config` prints: those of the checkpoint to resume from, or
/// those of `request`. Says how far it is to `progress`.
pub fn settings_to_print(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<Settings, Report> {
    let resumed = resumed_file(request, registry)?;
    check_options(request, resumed.as_deref(), registry)?;
    match resumed {
        // Nothing is run that a checkpoint names.
        Some(path) => Ok(train::load_with(&path, &registry.clone().only_reading(), 1, progress)
            .map_err(from_checkpoint_error)?
            .run()
            .settings
            .clone()),
        None => settings(&request.run, &request.map, registry),
    }
}

/// Returns what takes time in [`prepare`], as in "opening the run".
pub fn opening(request: &Request) -> &'static str {
    match (&request.resume, &request.data) {
        (Some(_), _) => "opening the run",
        (None, Some(_)) => "reading the data",
        (None, None) => "opening the world",
    }
}

/// Loads map, scenario and checkpoint and prepares the run, with a world and a learner from
/// `registry`; says how far it is to `progress`.
pub fn prepare(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<Setup, Report> {
    let threads = request.threads;
    // Checked before training: otherwise, what was learned might be impossible to save.
    let resumed = resumed_file(request, registry)?;
    let save = request
        .save
        .as_deref()
        .map(|path| save_to(path, resumed.as_deref(), request.overwrite))
        .transpose()?;
    if let Some(path) = &request.table {
        // A resumed run continues its own table.
        refuse_existing(path, request.overwrite || resumed.is_some())?;
        refuse_input("--csv", path, inputs(request, resumed.as_deref()))?;
        files::check_writable(path).map_err(|error| {
            let help = "give --csv a file in a writable folder";
            miette!(help = help, "{}: a table cannot be written here: {error}", path.display())
        })?;
    }
    check_options(request, resumed.as_deref(), registry)?;
    let (mut trainer, warning) = match &resumed {
        Some(path) => {
            let loaded = train::load_with(path, registry, threads, progress);
            (loaded.map_err(from_checkpoint_error)?, None)
        }
        None => begin_run(request, registry, progress)?,
    };
    trainer.check_data().map_err(from_data_error)?;
    if resumed.is_some() && request.data.is_some() && !trainer.reads_data() {
        let help = "leave --data out, or begin a run with it";
        return Err(miette!(
            help = help,
            "--data: the checkpoint contains its transitions and reads no file"
        ));
    }
    let mut warnings = Vec::from_iter(warning);
    if let Some(path) = resumed.as_deref().filter(|path| files::is_in_use(path)) {
        let file = sanitized(&path.to_string_lossy());
        warnings.push(format!(
            "{file}: another program still trains this run: this is a copy, as last saved, and is \
             saved to another name"
        ));
    }
    warnings.extend(trainer.world().take_warnings());
    if let Some(path) = &request.scenario {
        let maze =
            PointMaze::downcast_mut(trainer.world_mut()).ok_or_else(|| not_a_maze("--scen"))?;
        warnings.extend(load_scenario(path, maze, resumed.is_some())?);
    }
    let edits = load_edits(request, &trainer)?;
    let worlds = std::iter::once(trainer.world()).chain(edits.iter().map(|edit| &*edit.world));
    let mazes = worlds.filter_map(PointMaze::downcast_ref);
    warnings.extend(mazes.flat_map(|maze| maps::warnings(maze.map())));
    let limits = Limits {
        seconds: request.limits.seconds.map(|more| trainer.seconds() + more),
        ..request.limits
    };
    Ok(Setup { trainer, edits, threads, limits, save, resumed, warnings })
}

/// Checks that the world of `request`, or of the checkpoint `resumed`, takes the options given.
fn check_options(
    request: &Request,
    resumed: Option<&Path>,
    registry: &Registry,
) -> Result<(), Report> {
    let kind = match resumed {
        // A file that cannot be read gets an error of its own.
        Some(file) => train::describe(file).map(|found| registry.world(&found.world).copied()),
        None => Ok(registry.world_without_file(known_name(&request.map)).copied()),
    };
    if let (Some(option), Ok(kind)) = (request.python_options.first(), &kind)
        && kind.is_none_or(|kind| kind.open.is_none())
    {
        let help = format!("leave {option} out, or give gym:ID or gym:PACKAGE:ID");
        return Err(miette!(help = help, "{option} applies only to environments in Python"));
    }
    let scenario = request.scenario.as_ref().map(|_| "--scen");
    let edit = request.edits.first().map(|_| "--edit-at");
    if let (Some(option), Ok(Some(kind))) = (scenario.or(edit), &kind)
        && kind.name != maze::KIND.name
    {
        return Err(not_a_maze(option));
    }
    // Maps that replace the checkpoint's may be images.
    let applies = |option: &&&str| **option == THRESHOLD && !request.edits.is_empty();
    match (request.map_options.iter().find(|option| !applies(option)), resumed, kind) {
        (Some(option), Some(_), _) => {
            let help = format!("leave {option} out: it is as it was");
            Err(miette!(help = help, "{option}: a checkpoint contains its world and its scale"))
        }
        (Some(option), None, Ok(Some(_))) => Err(not_a_maze(option)),
        _ => Ok(()),
    }
}

fn begin_run(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<(Trainer, Option<String>), Report> {
    let run = self::run(&request.run, &request.map, registry, request.seed)?;
    if let Some(file) = &request.data {
        data::check(file, progress)?;
    }
    let world = open_world(&request.map, &request.reading, &run, registry)?;
    if request.data.is_none() && run.settings.train.offline_updates > 0 {
        let help = "give --data FILE, or leave offline_updates out";
        return Err(miette!(help = help, "offline_updates: without --data, agents always act"));
    }
    let mut trainer = begin(run, &*world, registry, request.threads)?;
    let data = request.data.as_deref();
    let warning = data.map_or(Ok(None), |file| learn_from(&mut trainer, file, progress))?;
    Ok((trainer, warning))
}

/// Gives `maze` the tasks of a scenario; returns a warning if that names another map. The map of a
/// resumed run may have been edited, which may make paths longer.
fn load_scenario(
    path: &Path,
    maze: &mut PointMaze,
    resumed: bool,
) -> Result<Option<String>, Report> {
    let scenario = map::read_scenario(path).map_err(from_map_error)?;
    let tasks = scenario.tasks(maze.map()).map_err(from_map_error)?;
    if !resumed {
        scenario.check_lengths(&tasks, maze.map()).map_err(from_map_error)?;
    }
    maze.set_scenario(tasks);
    let other = scenario.other_map(maze.map());
    Ok(other.map(|problem| format!("warning: {}: {problem}", sanitized(&path.to_string_lossy()))))
}

/// Returns the checkpoint that `--resume` asks for: the given file, or the newest, of a map if one
/// is named.
fn resumed_file(request: &Request, registry: &Registry) -> Result<Option<PathBuf>, Report> {
    let Some(given) = &request.resume else { return Ok(None) };
    let map = request.named_map.then_some(&request.map);
    let name = match (given, map) {
        (Some(_), Some(map)) => {
            let map = map.display();
            let help = format!(
                "give --resume FILE alone, or {map} --resume for the newest checkpoint of {map}"
            );
            return Err(miette!(
                help = help,
                "a map and --resume FILE: a checkpoint contains its map"
            ));
        }
        (Some(file), None) => {
            let name = known_name(file);
            let is_name =
                map::builtin(name).is_some() || registry.world_without_file(name).is_some();
            let is_map = || MapFormat::by_name(file).is_some();
            if train::is_checkpoint(file) || !is_name && !is_map() {
                return Ok(Some(file.clone()));
            }
            Some(file.clone())
        }
        (None, map) => map.cloned(),
    };
    let title = name.map(|name| title_of(&name, registry)).transpose()?;
    let newest = runs::newest(Path::new(SAVES), title.as_deref());
    newest.map(|found| Some(found.file)).ok_or_else(|| {
        let of = title.map_or(String::new(), |title| format!(" of {title}"));
        let help = "gdg-tui runs FOLDER lists a folder's checkpoints; give one with --resume FILE";
        miette!(help = help, "--resume: there is no checkpoint{of} in {SAVES}/")
    })
}

/// Returns the title of the world called `name`, as in its checkpoints.
fn title_of(name: &Path, registry: &Registry) -> Result<String, Report> {
    let given = known_name(name);
    match registry.world_without_file(given).map(|kind| kind.create) {
        Some(Some(create)) => Ok(create().title().to_owned()),
        // Its argument ends with its title.
        Some(None) => Ok(given.rsplit(':').next().unwrap_or_default().to_owned()),
        None => Ok(find_map(name, &Reading::default(), registry)?.name().to_owned()),
    }
}

/// Begins `run` in `world`, if it fits into memory.
pub fn begin(
    run: Run,
    world: &dyn Environment,
    registry: &Arc<Registry>,
    threads: impl Into<Threads>,
) -> Result<Trainer, Report> {
    train::memory::check(&run, world, registry).map_err(|error| match error {
        TrainError::Memory { .. } | TrainError::AddressSpace { .. } => {
            Report::msg(error).wrap_err("not enough memory")
        }
        other => Report::msg(other),
    })?;
    Trainer::new(run, world, registry, threads).into_diagnostic()
}

/// Opens the world called `name`: a kind that needs no file, or the maze on that map.
fn open_world(
    name: &Path,
    reading: &Reading,
    run: &Run,
    registry: &Registry,
) -> Result<Box<dyn Environment>, Report> {
    if let Some(opened) = registry.open(known_name(name)) {
        return opened.into_diagnostic();
    }
    open_maze(name, reading, run, registry).map(|maze| Box::new(maze) as _)
}

/// Opens the maze on the built-in map or the map file called `name`.
pub fn open_maze(
    name: &Path,
    reading: &Reading,
    run: &Run,
    registry: &Registry,
) -> Result<PointMaze, Report> {
    maze_on(Arc::new(find_map(name, reading, registry)?), &name.to_string_lossy(), run)
}

/// Returns the maze on a map; `called` is its file, or its name, in errors.
pub fn maze_on(map: Arc<Grid>, called: &str, run: &Run) -> Result<PointMaze, Report> {
    if run.settings.train.restart == Restart::StartCell && map.starts().is_empty() {
        let problem = "has no start S, which restart=start-cell requires";
        return Err(from_map_error(MapError::whole_file(
            called,
            problem,
            "mark a start with S, or use restart=anywhere",
        )));
    }
    let unmarked = [("start S", map.starts().is_empty()), ("goal G", map.goals().is_empty())];
    let missing = unmarked.into_iter().find(|(_, is_missing)| *is_missing);
    if let Some((mark, _)) = missing.filter(|_| run.settings.train.goals == Goals::Map) {
        return Err(from_map_error(MapError::whole_file(
            called,
            format!("has no {mark}, which goals=map requires"),
            "mark a start with S and a goal with G, or use goals=anywhere",
        )));
    }
    Ok(PointMaze::new(map, 0))
}

fn not_a_maze(option: &str) -> Report {
    miette!(help = "give a map", "{option} applies only to maps")
}

fn inputs<'a>(request: &'a Request, resumed: Option<&'a Path>) -> impl Iterator<Item = &'a Path> {
    let map = request.named_map.then_some(request.map.as_path());
    let edits = request.edits.iter().map(|edit| edit.file.as_path());
    [
        map,
        request.scenario.as_deref(),
        request.data.as_deref(),
        request.run.config.as_deref(),
        resumed,
    ]
    .into_iter()
    .flatten()
    .chain(edits)
}

/// Returns the requested number of parallel jobs, else the number of cores.
pub fn parallel_jobs(requested: Option<u16>) -> usize {
    requested.map_or_else(|| Threads::auto().most(), usize::from)
}
