//! Prepares the run that the options of training describe.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::cli::TrainArgs;
use crate::experiment::suite;
use crate::process::errors::{from_checkpoint_error, from_data_error, from_map_error};
use crate::setup::find_maps::{self, THRESHOLD, find_map, known_name};
use crate::setup::outputs::{refuse_existing, refuse_input, refuse_other_kind, save_to};
use crate::setup::saves::{self, SAVES, checkpoint_file, recovered, resume_command};
use crate::setup::values::EditAt;
use crate::setup::{self, Setup, settings};
use gdg::env::{Environment, GymOptions, PointMaze, maze};
use gdg::files;
use gdg::job::Job;
use gdg::map::{self, Grid, MapError, MapFormat, Reading};
use gdg::text::{grouped, safe_file_name, sanitized};
use gdg::train::{self, Edit, Limits, Registry, Setting, Settings, Trainer};

/// Returns the settings that `--print-config` prints: those of the checkpoint to resume from, or
/// those of `args`. Says how far it is to `progress`.
pub fn settings_to_print(
    args: &TrainArgs,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<Settings, Report> {
    let resumed = resumed_file(args, registry)?;
    check_options(args, resumed.as_deref(), registry)?;
    let Some(path) = resumed else { return settings(&args.run, args.map(), registry) };
    // Nothing is run that a checkpoint names.
    let registry = registry.clone().with(|own| own.options.reads_only = true);
    let loaded = train::load_with(&path, &registry, 1, progress);
    Ok(loaded.map_err(from_checkpoint_error)?.run().settings.clone())
}

/// Returns what takes time in [`prepare`], as in "opening the run".
pub fn opening(args: &TrainArgs) -> &'static str {
    match (&args.resume, &args.data) {
        (Some(_), _) => "opening the run",
        (None, Some(_)) => "reading the data",
        (None, None) => "opening the world",
    }
}

/// Loads map, scenario and checkpoint and prepares the run, with a world and a learner from
/// `registry`; says how far it is to `progress`.
pub fn prepare(
    args: &TrainArgs,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<Setup, Report> {
    let threads = args.threads;
    // Checked before training: otherwise, what was learned might be impossible to save.
    let resumed = resumed_file(args, registry)?;
    let to = |path| save_to(path, resumed.as_deref(), args.headless.overwrite);
    let save = args.save.as_deref().map(to).transpose()?;
    if let Some(path) = &args.headless.csv {
        // A resumed run replaces its own table, and leaves another one alone.
        refuse_existing(path, args.headless.overwrite || resumed.is_some())?;
        refuse_input("--csv", path, inputs(args, resumed.as_deref()).chain(args.save.as_deref()))?;
        if args.headless.overwrite {
            refuse_other_kind(path, "a table of gdg-tui", |start| start.starts_with(b"event,"))?;
        }
        files::check_writable(path).map_err(|error| {
            let help = "give --csv a file in a writable folder";
            miette!(help = help, "{}: a table cannot be written here: {error}", path.display())
        })?;
    }
    check_options(args, resumed.as_deref(), registry)?;
    let (mut trainer, warning) = match &resumed {
        Some(path) => {
            let loaded = train::load_with(path, registry, threads, progress);
            (loaded.map_err(from_checkpoint_error)?, None)
        }
        None => begin_run(args, registry, progress)?,
    };
    trainer.check_data().map_err(from_data_error)?;
    let acts = trainer.acts() || trainer.run().settings.train.offline_updates > 0;
    if args.max_episodes.is_some() && !acts {
        let help = "give --max-updates, or --set offline_updates=N, after which agents act";
        return Err(miette!(help = help, "--max-episodes: with --data alone, no episode ends"));
    }
    if resumed.is_some() && args.data.is_some() && !trainer.reads_data() {
        let help = "leave --data out, or begin a run with it";
        return Err(miette!(help = help, "--data: the checkpoint has transitions of its own"));
    }
    let mut warnings = Vec::from_iter(warning);
    if let Some(path) = resumed.as_deref().filter(|path| args.is_copy && files::is_in_use(path)) {
        let file = sanitized(&path.to_string_lossy());
        warnings.push(format!(
            "{file}: another program still trains this run: this is a copy, as last saved, and is \
             saved to another name"
        ));
    }
    let method = &trainer.run().method;
    let given = args.run.set.iter().filter_map(|set| Setting::named(set.split_once('=')?.0.trim()));
    let idle = given.filter(|setting| registry.is_idle(setting, method));
    warnings.extend(idle.map(|idle| format!("--set {}: changes nothing with {method}", idle.name)));
    warnings.extend(trainer.world().take_warnings());
    if let Some(path) = &args.scen {
        let maze =
            PointMaze::downcast_mut(trainer.world_mut()).ok_or_else(|| not_a_maze("--scen"))?;
        warnings.extend(load_scenario(path, maze, resumed.is_some())?);
    }
    if !args.edit_at.is_empty() {
        trainer.edits = load_edits(args, &trainer)?;
    } else if let Some(maze) = PointMaze::downcast_ref(trainer.world()).cloned() {
        // With the settings and tasks of the run's own map.
        for Edit { updates, world } in &mut trainer.edits {
            let (at, title) = (grouped(*updates), sanitized(world.title()));
            warnings.push(format!("at update {at}, the map is to become {title}"));
            let edited = PointMaze::downcast_ref(&**world).map(|edited| edited.map().clone());
            edited.into_iter().for_each(|map| *world = Box::new(maze.with_map(map)));
        }
    }
    let edits = trainer.edits.iter().map(|edit| &*edit.world);
    let worlds = std::iter::once(trainer.world()).chain(edits);
    let mazes = worlds.filter_map(PointMaze::downcast_ref);
    warnings.extend(mazes.flat_map(|maze| find_maps::warnings(maze.map())));
    let limits = Limits {
        updates: args.max_updates,
        seconds: args.max_seconds.map(|more| trainer.seconds() + more),
        episodes: args.max_episodes,
        env_steps: None,
    };
    Ok(Setup { trainer, threads, limits, save, resumed, warnings })
}

/// Checks that the world of `args`, or of the checkpoint `resumed`, takes the options given.
fn check_options(
    args: &TrainArgs,
    resumed: Option<&Path>,
    registry: &Registry,
) -> Result<(), Report> {
    let kind = match resumed {
        // A file that cannot be read gets an error of its own.
        Some(file) => train::describe(file).map(|found| registry.world(&found.world).copied()),
        None => Ok(registry.world_without_file(known_name(args.map())).copied()),
    };
    if let (Some(option), Ok(kind)) = (args.gym.given().first(), &kind)
        && kind.is_none_or(|kind| kind.open.is_none())
    {
        let help = format!("leave {option} out, or give gym:ID or gym:PACKAGE:ID");
        return Err(miette!(help = help, "{option} applies only to environments in Python"));
    }
    let scenario = args.scen.as_ref().map(|_| "--scen");
    let edit = args.edit_at.first().map(|_| "--edit-at");
    if let (Some(option), Ok(Some(kind))) = (scenario.or(edit), &kind)
        && kind.name != maze::KIND.name
    {
        return Err(not_a_maze(option));
    }
    // Maps that replace the checkpoint's may be images.
    let applies = |option: &&str| *option == THRESHOLD && !args.edit_at.is_empty();
    match (args.map_options().into_iter().find(|option| !applies(option)), resumed, kind) {
        (Some(option), Some(_), _) => {
            let help = format!("leave {option} out: it is as it was");
            Err(miette!(help = help, "{option}: a checkpoint contains its world and its scale"))
        }
        (Some(option), None, Ok(Some(_))) => Err(not_a_maze(option)),
        _ => Ok(()),
    }
}

fn begin_run(
    args: &TrainArgs,
    registry: &Arc<Registry>,
    progress: &Job,
) -> Result<(Trainer, Option<String>), Report> {
    let run = setup::run(&args.run, args.map(), registry, args.seed)?;
    if let Some(file) = &args.data {
        setup::check_data(file, progress)?;
    }
    // A kind that needs no file, or the maze on that map.
    let world: Box<dyn Environment> = match registry.open(known_name(args.map())) {
        Some(opened) => opened.into_diagnostic()?,
        None => Box::new(setup::open_maze(args.map(), &(&args.reading).into(), &run, registry)?),
    };
    if args.data.is_none() && run.settings.train.offline_updates > 0 {
        let help = "give --data FILE, or leave offline_updates out";
        return Err(miette!(help = help, "offline_updates: without --data, agents always act"));
    }
    let mut trainer = setup::begin(run, &*world, registry, args.threads)?;
    let data = args.data.as_deref();
    let warning = data.map_or(Ok(None), |file| setup::learn_from(&mut trainer, file, progress))?;
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
        scenario.check_paths(&tasks, maze.map()).map_err(from_map_error)?;
    }
    maze.set_scenario(tasks);
    let other = scenario.other_map(maze.map());
    Ok(other.map(|problem| format!("{}: {problem}", sanitized(&path.to_string_lossy()))))
}

/// Returns the checkpoint that `--resume` asks for, by file or name, or the newest, also of a map.
fn resumed_file(args: &TrainArgs, registry: &Registry) -> Result<Option<PathBuf>, Report> {
    let Some(given) = &args.resume else { return Ok(None) };
    let name = match (given, &args.map) {
        (Some(_), Some(map)) => {
            let map = map.display();
            let help = format!("give --resume FILE alone, or {map} --resume for its newest run");
            return Err(miette!(help = help, "a map and --resume FILE: a checkpoint has its map"));
        }
        (Some(file), None) => {
            let name = known_name(file);
            let is_name =
                map::builtin(name).is_some() || registry.world_without_file(name).is_some();
            if train::is_checkpoint(file) || !is_name && MapFormat::by_name(file).is_none() {
                // The name of a checkpoint or of a map will do.
                let of_map = || Some(saves::newest(Path::new(SAVES), Some(name))?.file);
                let there = [file.clone(), checkpoint_file(name)].into_iter().find(|f| f.exists());
                return Ok(there.or_else(of_map).or_else(|| Some(file.clone())));
            }
            Some(file.clone())
        }
        (None, map) => map.clone(),
    };
    let title = name.map(|name| title_of(&name, registry)).transpose()?;
    let newest = saves::newest(Path::new(SAVES), title.as_deref());
    newest.map(|found| Some(found.file)).ok_or_else(|| {
        let of = title.as_ref().map_or(String::new(), |title| format!(" of {title}"));
        let saved = recovered().and_then(|folder| saves::newest(&folder, title.as_deref()));
        let help = match saved {
            Some(found) => format!(
                "one was saved elsewhere: {}",
                resume_command(&found.file, &GymOptions::default())
            ),
            None => "gdg-tui runs FOLDER lists a folder's checkpoints; give one with --resume FILE"
                .to_owned(),
        };
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

/// Loads the maps of `--edit-at`. All are read before the run starts, and the run must reach their
/// updates. Leaves out those that the run had applied before it was saved, right after them.
fn load_edits(args: &TrainArgs, trainer: &Trainer) -> Result<Vec<Edit>, Report> {
    let maze = PointMaze::downcast_ref(trainer.world()).ok_or_else(|| not_a_maze("--edit-at"))?;
    let (map, begun) = (maze.map(), trainer.counters().updates);
    let load = |edit: &EditAt| {
        let (at, most) = (edit.updates, args.max_updates.unwrap_or(u64::MAX));
        if !(begun..=most).contains(&at) {
            let end = if at < begun { ("starts", begun) } else { ("ends", most) };
            let file = edit.file.display();
            return Err(miette!("--edit-at {at}:{file}: the run {} at update {}", end.0, end.1));
        }
        let threshold = Reading::from(&args.reading).threshold;
        let new = map::load_map_like(&edit.file, map, threshold).map_err(from_map_error)?;
        if (new.width(), new.height()) != (map.width(), map.height()) {
            let problem = format!("is {} x {} cells", new.width(), new.height());
            let (width, height) = (map.width(), map.height());
            let help = format!("give a map of {width} x {height}, the size of the run's map");
            let file = edit.file.to_string_lossy();
            return Err(from_map_error(MapError::whole_file(&file, problem, help)));
        }
        Ok(Edit { updates: edit.updates, world: Box::new(maze.with_map(Arc::new(new))) })
    };
    let mut edits = args.edit_at.iter().map(load).collect::<Result<Vec<Edit>, Report>>()?;
    let last = edits
        .iter()
        .rfind(|edit| edit.updates == begun)
        .and_then(|edit| PointMaze::downcast_ref(&*edit.world));
    // Checkpoints contain sanitised names.
    let as_saved = |map: &Grid| map.clone().named(&safe_file_name(map.name()));
    if args.resume.is_some() && last.is_some_and(|edited| as_saved(edited.map()) == **map) {
        edits.retain(|edit| edit.updates != begun);
    }
    Ok(edits)
}

/// Returns the registry with the goal radius of environments in Python, unless other options of maps
/// are given for a world that is none.
pub fn registry_of_suite(
    suite::SuiteOptions { maps, reading, python, .. }: &suite::SuiteOptions,
    registry: &Arc<Registry>,
) -> Result<Arc<Registry>, Report> {
    let is_world = |name: &&PathBuf| registry.world_without_file(known_name(name)).is_some();
    let mut given = maps.iter().filter(is_world).flat_map(|name| reading.only_for_maps(name));
    let goal_radius = reading.goal_radius.map(|radius| radius as f32);
    let options = GymOptions { goal_radius, python: python.clone(), ..GymOptions::default() };
    let with_options = || Ok(registry.clone().with(|own| own.options = options));
    given.next().map_or_else(with_options, |it| Err(not_a_maze(it)))
}

fn not_a_maze(option: &str) -> Report {
    miette!(help = "give a map", "{option} applies only to maps")
}

fn inputs<'a>(args: &'a TrainArgs, resumed: Option<&'a Path>) -> impl Iterator<Item = &'a Path> {
    let map = args.map.as_deref();
    let edits = args.edit_at.iter().map(|edit| edit.file.as_path());
    [map, args.scen.as_deref(), args.data.as_deref(), args.run.base.config.as_deref(), resumed]
        .into_iter()
        .flatten()
        .chain(edits)
}
