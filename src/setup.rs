//! Sets up runs: method, settings, map or world from options, the trainer, and the files that it is
//! saved to and resumed from.

pub mod find_maps;
pub mod outputs;
pub mod saves;
pub mod values;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use miette::{IntoDiagnostic, Report, miette};

use crate::process::errors::{from_config_error, from_data_error, from_map_error};
use crate::setup::find_maps::{find_map, known_name};
use crate::setup::values::{MethodParser, methods_help, preset_parser};
use gdg::env::{Environment, Goals, PointMaze, Restart};
use gdg::job::Job;
use gdg::learn::Threads;
use gdg::map::{Grid, MapError, Reading};
use gdg::text::sanitized;
use gdg::train::{
    self, Dataset, LeftOut, Limits, METHODS, Method, Overrides, Preset, Registry, Run, SaveTo,
    Settings, TrainError, Trainer,
};

/// A run that is ready to be trained.
pub struct Setup {
    pub trainer: Trainer,
    /// Threads that share the work of each update.
    pub threads: Threads,
    /// Limits of the run; seconds count from the start of training.
    pub limits: Limits,
    pub save: Option<SaveTo>,
    /// The checkpoint that the run was resumed from.
    pub resumed: Option<PathBuf>,
    pub warnings: Vec<String>,
}

/// Which method to train, and with which settings.
#[derive(Clone, Debug, Args)]
pub struct RunChoice {
    /// Learner and planner: one of these methods, or LEARNER+PLANNER
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Method,

    #[command(flatten)]
    pub base: SettingsBase,

    /// Change one setting (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
}

/// What the settings of a run are based on.
#[derive(Clone, Debug, Default, Args)]
pub struct SettingsBase {
    /// Preset to start from [default: tuned for ddpg, her and ddpg-distance, otherwise default]
    #[arg(long, value_parser = preset_parser())]
    pub preset: Option<Preset>,

    /// Settings file: a JSON object as printed by --print-config
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

impl RunChoice {
    /// Returns the preset to start from, with a learner of `registry`.
    pub fn preset(&self, registry: &Registry) -> Preset {
        self.base.preset.unwrap_or_else(|| registry.preset_of(&self.method))
    }
}

/// Returns the settings of `choice` for a run in the world that `world` opens: a map or a world
/// of `registry`.
pub fn settings(choice: &RunChoice, world: &Path, registry: &Registry) -> Result<Settings, Report> {
    let defaults =
        registry.world_opened_by(known_name(world)).map_or(&[][..], |kind| kind.defaults);
    let overrides = Overrides { defaults, config: choice.base.config.as_deref(), set: &choice.set };
    train::settings_from(choice.preset(registry), &overrides).map_err(from_config_error)
}

/// Splits `PREFIX:NAME=VALUE`, a setting of one of several runs; the prefix is `None` if there is
/// none.
pub fn split_prefix(setting: &str) -> (Option<&str>, &str) {
    let split = setting.split_once(':').filter(|(prefix, _)| !prefix.contains('='));
    split.map_or((None, setting), |(prefix, own)| (Some(prefix), own))
}

/// Returns the settings in `set` that apply to a run with these `names`, without their prefixes.
pub fn settings_of(names: &[&str], set: &[String]) -> Vec<String> {
    let split = set.iter().map(|setting| split_prefix(setting));
    let own = split.filter(|(prefix, _)| prefix.is_none_or(|prefix| names.contains(&prefix)));
    own.map(|(_, own)| own.to_owned()).collect()
}

/// Returns the run of `choice` and `seed` in the world that `world` opens.
pub fn run(
    choice: &RunChoice,
    world: &Path,
    registry: &Registry,
    seed: u64,
) -> Result<Run, Report> {
    let settings = settings(choice, world, registry)?;
    Ok(Run { method: choice.method.clone(), preset: choice.preset(registry), seed, settings })
}

/// Begins `run` in `world`, if it fits into memory.
pub fn begin(
    run: Run,
    world: &dyn Environment,
    registry: &Arc<Registry>,
    threads: impl Into<Threads>,
) -> Result<Trainer, Report> {
    train::memory::check(&run, world, registry).map_err(|error| match error {
        TrainError::Memory(_) => Report::msg(error).wrap_err("not enough memory"),
        other => Report::msg(other),
    })?;
    Trainer::new(run, world, registry, threads).into_diagnostic()
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
    let (no_start, no_goal) = (map.starts().is_empty(), map.goals().is_empty());
    let train = &run.settings.train;
    let missing = if train.restart == Restart::StartCell && no_start {
        Some(("start S", "restart=start-cell", "mark a start with S, or use restart=anywhere"))
    } else if train.goals == Goals::Map && (no_start || no_goal) {
        let help = "mark a start with S and a goal with G, or use goals=anywhere";
        Some((if no_start { "start S" } else { "goal G" }, "goals=map", help))
    } else {
        None
    };
    if let Some((mark, setting, help)) = missing {
        let problem = format!("has no {mark}, which {setting} requires");
        return Err(from_map_error(MapError::whole_file(called, problem, help)));
    }
    Ok(PointMaze::new(map, 0))
}

/// Stages of beginning a run with data: the file is checked, the world opened, the data read and
/// learned from.
const BEGIN_STAGES: usize = 4;

/// Share of recorded transitions that are impossible on the map from which on they may be of
/// another one.
const OF_ANOTHER_MAP: f64 = 0.05;

/// Checks the file with the recorded transitions, before the world is opened, which may take a
/// minute.
pub fn check_data(file: &Path, progress: &Job) -> Result<(), Report> {
    progress.begin(0, BEGIN_STAGES);
    Dataset::check_file(file, progress).map_err(from_data_error)?;
    progress.begin(1, BEGIN_STAGES);
    Ok(())
}

/// Has `trainer` learn from the recorded transitions in `file`; returns a warning if some of them
/// are left out, and says how far it is to `progress`.
pub fn learn_from(
    trainer: &mut Trainer,
    file: &Path,
    progress: &Job,
) -> Result<Option<String>, Report> {
    progress.begin(2, BEGIN_STAGES);
    let data = Dataset::read(file, trainer.world(), progress).map_err(from_data_error)?;
    progress.begin(3, BEGIN_STAGES);
    let doubts = data.doubts(trainer.world());
    let LeftOut { impossible, by_chance } =
        trainer.learn_from(&data, progress).into_diagnostic()?;
    let (all, file) = (data.source().transitions, sanitized(&file.to_string_lossy()));
    if 2 * impossible > all {
        let help = "give the data of this world: positions in its unit, on this map";
        return Err(miette!(
            help = help,
            "{file}: {impossible} of {all} transitions are impossible on this map"
        ));
    }
    let is_of_another = impossible as f64 > OF_ANOTHER_MAP * all as f64;
    let doubt = ": the data may be of another map, or of another version of it";
    let reasons = [
        (impossible, "impossible on this map", if is_of_another { doubt } else { "" }),
        (by_chance, "they lead far, and not always to the same place", ""),
    ];
    let left_out = reasons.iter().filter(|(count, ..)| *count > 0).map(|(count, why, doubt)| {
        format!("{count} of {all} transitions are left out: {why}{doubt}")
    });
    let said: Vec<String> = doubts.into_iter().chain(left_out).collect();
    said.iter().for_each(|said| log::warn!("{file}: {said}"));
    Ok((!said.is_empty()).then(|| format!("{file}: {}", said.join("; "))))
}

/// Returns the requested number of parallel jobs, else the number of cores.
pub fn parallel_jobs(requested: Option<u16>) -> usize {
    requested.map_or_else(|| Threads::auto().most(), usize::from)
}
