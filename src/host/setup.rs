//! Prepares a run from the command line, for all front ends.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::host::maps::{self, find_map, known_name};
use crate::host::outputs::{refuse_existing, refuse_input, save_to};
use crate::host::report::{from_checkpoint_error, from_config_error, from_map_error};
use crate::host::runs::{self, SAVES};
use gdg::env::{Environment, Goals, PointMaze, Restart, maze};
use gdg::files;
use gdg::learn::Threads;
use gdg::map::{self, Grid, MapError, MapFormat, Reading};
use gdg::pulse::Progress;
use gdg::text::{safe_file_name, sanitized};
use gdg::train::{
    self, Dataset, LeftOut, Limits, Loaded, Method, Overrides, Preset, Registry, Run, SaveTo,
    Settings, TrainError, Trainer,
};

/// The option for maps that are images.
pub const THRESHOLD: &str = "--threshold";

/// Stages of beginning a run with data: the file is checked, the world opened, the data read and
/// learned from.
const BEGIN_STAGES: usize = 4;

/// Share of recorded transitions that are impossible on the map from which on they may be of
/// another one.
const OF_ANOTHER_MAP: f64 = 0.05;

/// Which method to train, and with which settings.
#[derive(Clone, Debug)]
pub struct RunChoice {
    /// Learner and planner.
    pub method: Method,
    /// The preset to start from; otherwise that of the method.
    pub preset: Option<Preset>,
    /// A settings file.
    pub config: Option<PathBuf>,
    /// Changes of single settings, `NAME=VALUE`.
    pub set: Vec<String>,
}

impl RunChoice {
    /// Returns the preset to start from, with a learner of `registry`.
    pub fn preset(&self, registry: &Registry) -> Preset {
        self.preset.unwrap_or_else(|| registry.preset_of(&self.method))
    }
}

/// A change of the map to another one.
#[derive(Clone, Debug)]
pub struct EditAt {
    /// Number of updates after which to switch.
    pub updates: u64,
    /// The map file.
    pub file: PathBuf,
}

/// A run to begin or to resume.
#[derive(Clone, Debug)]
pub struct Request {
    /// The map or world.
    pub map: PathBuf,
    /// How the map is read.
    pub reading: Reading,
    /// The options given for that, and those given for environments in Python.
    pub map_options: Vec<&'static str>,
    /// See `map_options`.
    pub python_options: Vec<&'static str>,
    /// Whether the user has named it.
    pub named_map: bool,
    /// Method and settings.
    pub run: RunChoice,
    /// Random seed.
    pub seed: u64,
    /// Whether to resume: from the newest checkpoint, or from this one.
    pub resume: Option<Option<PathBuf>>,
    /// Changes of the map.
    pub edits: Vec<EditAt>,
    /// The scenario to evaluate on.
    pub scenario: Option<PathBuf>,
    /// Recorded transitions to learn from.
    pub data: Option<PathBuf>,
    /// Threads that share the work of each update.
    pub threads: Threads,
    /// The checkpoint to write.
    pub save: Option<PathBuf>,
    /// The table to write.
    pub table: Option<PathBuf>,
    /// The recording to write.
    pub recording: Option<PathBuf>,
    /// Whether existing files are replaced.
    pub overwrite: bool,
    /// Limits of the run; seconds count from where it begins or resumes.
    pub limits: Limits,
}

/// A scheduled change of the world.
pub struct Edit {
    /// Number of updates after which to apply it.
    pub updates: u64,
    /// The edited world.
    pub world: Box<dyn Environment>,
}

/// A trainer and everything that goes with it.
pub struct Setup {
    /// The run, new or resumed.
    pub trainer: Trainer,
    /// Scheduled edits of the world.
    pub edits: Vec<Edit>,
    /// Threads that share the work of each update.
    pub threads: Threads,
    /// Limits of the run; seconds count from the start of training.
    pub limits: Limits,
    /// Where to save the run, if given.
    pub save: Option<SaveTo>,
    /// The checkpoint that the run was resumed from.
    pub resumed: Option<PathBuf>,
    /// Warnings about that checkpoint, and about the map.
    pub warnings: Vec<String>,
}

/// Returns the settings of `choice` for a run in the world that `world` opens: a map or a world
/// of `registry`.
///
/// # Errors
/// See [`train::settings_from`].
pub fn settings(choice: &RunChoice, world: &Path, registry: &Registry) -> Result<Settings, Report> {
    let defaults =
        registry.world_opened_by(known_name(world)).map_or(&[][..], |kind| kind.defaults);
    let overrides = Overrides { defaults, config: choice.config.as_deref(), set: &choice.set };
    train::settings_from(choice.preset(registry), &overrides).map_err(from_config_error)
}

/// Returns the settings that `--print-config` prints: those of the checkpoint to resume from, or
/// those of `request`. Says how far it is to `progress`.
///
/// # Errors
/// See [`settings`] and [`train::load`].
pub fn settings_to_print(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Progress,
) -> Result<Settings, Report> {
    let resumed = resumed_file(request, registry)?;
    check_options(request, resumed.as_deref(), registry)?;
    match resumed {
        Some(path) => Ok(train::load_with(&path, registry, 1, progress)
            .map_err(from_checkpoint_error)?
            .trainer
            .run()
            .settings
            .clone()),
        None => settings(&request.run, &request.map, registry),
    }
}

/// Splits `PREFIX:NAME=VALUE`, a setting of one of several runs; the prefix is `None` if there is
/// none.
pub fn split_prefix(setting: &str) -> (Option<&str>, &str) {
    match setting.split_once(':') {
        Some((prefix, setting)) if !prefix.contains('=') => (Some(prefix), setting),
        _ => (None, setting),
    }
}

/// Returns the settings in `set` that apply to the run called `name`, without their prefixes.
pub fn settings_of(name: &str, set: &[String]) -> Vec<String> {
    let split = set.iter().map(|setting| split_prefix(setting));
    split
        .filter(|(prefix, _)| prefix.is_none_or(|prefix| prefix == name))
        .map(|(_, own)| own.to_owned())
        .collect()
}

/// Returns the run of `choice` and `seed` in the world that `world` opens.
///
/// # Errors
/// See [`settings`].
pub fn run(
    choice: &RunChoice,
    world: &Path,
    registry: &Registry,
    seed: u64,
) -> Result<Run, Report> {
    let settings = settings(choice, world, registry)?;
    Ok(Run { method: choice.method.clone(), preset: choice.preset(registry), seed, settings })
}

/// Returns what takes time in [`prepare`], as in "waiting for ACTIVITY".
pub fn opening(request: &Request) -> &'static str {
    match (&request.resume, &request.data) {
        (Some(_), _) => "the run to be opened",
        (None, Some(_)) => "the data to be read",
        (None, None) => "the world to open",
    }
}

/// Loads map, scenario and checkpoint and prepares the run, with a world and a learner from
/// `registry`; says how far it is to `progress`.
///
/// # Errors
/// A file or setting is invalid; the report is meant for the user.
pub fn prepare(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Progress,
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
    if let Some(path) = &request.recording {
        refuse_input("--record", path, inputs(request, resumed.as_deref()))?;
    }
    check_options(request, resumed.as_deref(), registry)?;
    let Loaded { mut trainer, warning } = match &resumed {
        Some(path) => {
            let loaded = train::load_with(path, registry, threads, progress);
            loaded.map_err(from_checkpoint_error)?
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
    if trainer.rollout().has_restarted() {
        let title = sanitized(trainer.world().title());
        warnings.push(format!(
            "{title}: the agents begin new episodes, as their environments could not be put back"
        ));
    }
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

/// Begins the run of `request` in its world, with its data.
fn begin_run(
    request: &Request,
    registry: &Arc<Registry>,
    progress: &Progress,
) -> Result<Loaded, Report> {
    let run = self::run(&request.run, &request.map, registry, request.seed)?;
    if let Some(file) = &request.data {
        // Opening a world may take a minute.
        progress.begin(0, BEGIN_STAGES);
        Dataset::check_file(file, progress).map_err(from_data_error)?;
        progress.begin(1, BEGIN_STAGES);
    }
    let world = open_world(&request.map, &request.reading, &run, registry)?;
    if request.data.is_none() && run.settings.train.offline_updates > 0 {
        let help = "give --data FILE, or leave offline_updates out";
        return Err(miette!(help = help, "offline_updates: without --data, agents always act"));
    }
    let mut trainer = begin(run, &*world, registry, request.threads)?;
    let data = request.data.as_deref();
    let warning = data.map_or(Ok(None), |file| learn_from(&mut trainer, file, progress))?;
    Ok(Loaded { trainer, warning })
}

/// Has `trainer` learn from the recorded transitions in `file`; returns a warning if some of them
/// are left out, and says how far it is to `progress`.
///
/// # Errors
/// The file cannot be read, does not fit, or most of it is impossible.
pub fn learn_from(
    trainer: &mut Trainer,
    file: &Path,
    progress: &Progress,
) -> Result<Option<String>, Report> {
    progress.begin(2, BEGIN_STAGES);
    let data = Dataset::read(file, trainer.world(), progress).map_err(from_data_error)?;
    progress.begin(3, BEGIN_STAGES);
    let LeftOut { impossible, by_chance } = trainer.learn_from(&data, progress);
    let (all, file) = (data.source().transitions, sanitized(&file.to_string_lossy()));
    if 2 * impossible > all {
        let help = "give the data of this world: positions in its unit, on this map";
        return Err(miette!(
            help = help,
            "{file}: {impossible} of {all} transitions are impossible on this map"
        ));
    }
    let of_another = OF_ANOTHER_MAP * all as f64;
    let impossible_as = if impossible as f64 > of_another {
        "impossible on this map: the data may be of another map, or of another version of it"
    } else {
        "impossible on this map"
    };
    let reasons = [
        (impossible, impossible_as),
        (by_chance, "they lead far, and not always to the same place"),
    ];
    let left_out: Vec<String> = reasons
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, why)| format!("{count} of {all} transitions are left out: {why}"))
        .collect();
    Ok((!left_out.is_empty()).then(|| format!("warning: {file}: {}", left_out.join("; "))))
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

/// Reports data that cannot be learned from.
fn from_data_error(error: impl Into<TrainError>) -> Report {
    let help = "--data takes .npz files with observations, actions and terminals: \
                gdg-tui export-data writes them, and OGBench has some";
    miette!(help = help, "{}", sanitized(&error.into().to_string()))
}

/// Begins `run` in `world`, if it fits into memory.
///
/// # Errors
/// The run needs more memory than is available, or its learner is not registered or cannot be
/// created.
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
///
/// # Errors
/// There is no such map, it is invalid, or it lacks what the settings of `run` require.
pub fn open_maze(
    name: &Path,
    reading: &Reading,
    run: &Run,
    registry: &Registry,
) -> Result<PointMaze, Report> {
    maze_on(Arc::new(find_map(name, reading, registry)?), &name.to_string_lossy(), run)
}

/// Returns the maze on a map; `called` is its file, or its name, in errors.
///
/// # Errors
/// It lacks a start that the run's settings require.
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

/// Reports an option that applies only to mazes.
fn not_a_maze(option: &str) -> Report {
    miette!(help = "give a map", "{option} applies only to maps")
}

/// Returns the files that a run reads.
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

/// Loads the maps of `--edit-at`. All are read before the run starts, and the run must reach their
/// updates. Leaves out those that the run had applied before it was saved, right after them.
fn load_edits(request: &Request, trainer: &Trainer) -> Result<Vec<Edit>, Report> {
    if request.edits.is_empty() {
        return Ok(Vec::new());
    }
    let maze = PointMaze::downcast_ref(trainer.world()).ok_or_else(|| not_a_maze("--edit-at"))?;
    let (map, begun) = (maze.map(), trainer.counters().updates);
    let load = |edit: &EditAt| {
        let never =
            |why: String| miette!("--edit-at {}:{}: {why}", edit.updates, edit.file.display());
        if edit.updates < begun {
            return Err(never(format!(
                "the run starts at update {begun}: give that or a later one"
            )));
        }
        if let Some(most) = request.limits.updates.filter(|most| edit.updates > *most) {
            return Err(never(format!(
                "the run ends at update {most}: give that or an earlier one"
            )));
        }
        let threshold = request.reading.threshold;
        let new = map::load_map_like(&edit.file, map, threshold).map_err(from_map_error)?;
        if (new.width(), new.height()) != (map.width(), map.height()) {
            let problem = format!("is {} x {} cells", new.width(), new.height());
            let help = format!(
                "give a map of {} x {}, the size of the run's map",
                map.width(),
                map.height()
            );
            return Err(from_map_error(MapError::whole_file(
                &edit.file.to_string_lossy(),
                problem,
                help,
            )));
        }
        let new: Box<dyn Environment> = Box::new(maze.with_map(Arc::new(new)));
        Ok(Edit { updates: edit.updates, world: new })
    };
    let mut edits = request.edits.iter().map(load).collect::<Result<Vec<Edit>, Report>>()?;
    let last = edits
        .iter()
        .rfind(|edit| edit.updates == begun)
        .and_then(|edit| PointMaze::downcast_ref(&*edit.world));
    // Checkpoints contain sanitised names.
    let as_saved = |map: &Grid| map.clone().named(&safe_file_name(map.name()));
    if request.resume.is_some() && last.is_some_and(|edited| as_saved(edited.map()) == **map) {
        edits.retain(|edit| edit.updates != begun);
    }
    Ok(edits)
}
