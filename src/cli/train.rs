//! Options of a training run.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use log::LevelFilter;

use crate::headless::HeadlessOptions;
use crate::setup::RunChoice;
use crate::setup::find_maps::{DEFAULT_MAP, MapArgs, given};
use crate::setup::values::{EditAt, counts, edits, log_levels, output, parse_threads, reals};
use crate::tui::InterfaceOptions;
use gdg::env::GymOptions;
use gdg::learn::Threads;

/// Options of a training run.
#[derive(Clone, Debug, Args)]
pub struct TrainArgs {
    /// Built-in map, map file (gdg-tui maps --help lists the formats), or world: fetch-reach, or a
    /// Gymnasium environment, gym:ID or gym:PACKAGE:ID [default: fourrooms]
    #[arg(value_name = "MAP")]
    pub map: Option<PathBuf>,

    /// Train without the interface: JSON lines on standard output
    #[arg(long, conflicts_with_all = ["ui_config", "marker"])]
    pub no_ui: bool,

    #[command(flatten)]
    pub run: RunChoice,

    /// Random seed: same seed, same run; suite and reproduce begin with 1, as the tour does
    #[arg(long, default_value_t = 0, value_parser = counts::<u64>(0..=u64::MAX))]
    pub seed: u64,

    /// Print all settings as JSON, with MAP's own or those of --resume, and exit
    #[arg(long)]
    pub print_config: bool,

    /// Stop after N updates, counted from the start of training; with the method random, which
    /// makes none, after the steps of N updates (env_steps_per_update each)
    #[arg(long, value_name = "N", value_parser = counts::<u64>(0..=u64::MAX))]
    pub max_updates: Option<u64>,

    /// Stop after S seconds of training, not counting evaluation; counted from where a resumed run
    /// goes on
    #[arg(long, value_name = "S", value_parser = reals(0.0..=1e9, "a number of seconds from 0 to 1e9"))]
    pub max_seconds: Option<f64>,

    /// Stop after N episodes, counted from the start of training
    #[arg(long, value_name = "N", value_parser = counts::<u64>(0..=u64::MAX))]
    pub max_episodes: Option<u64>,

    /// Switch to another map of the same size at this update, 0 for the start (repeatable; requires
    /// --no-ui)
    #[arg(long, value_name = "UPDATES:FILE", value_parser = edits(), requires = "no_ui")]
    pub edit_at: Vec<EditAt>,

    /// Evaluate on the tasks of this scenario, or of the agents of a map for planners (6 x --eval-tasks of them, evenly spaced)
    #[arg(long, value_name = "FILE")]
    pub scen: Option<PathBuf>,

    /// Learn from recorded transitions instead of acting, or before (--set offline_updates=N): a
    /// file of OGBench or of export-data; with --resume, where the run's file is now
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,

    /// Threads that share each update: a number, or auto for as many as make it faster at the moment,
    /// up to this machine's cores; results do not depend on it
    #[arg(long, value_name = "N", default_value = "auto", value_parser = parse_threads)]
    pub threads: Threads,

    /// Save checkpoints to this file during training and at the end, or beside it if it belongs to
    /// another run
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub save: Option<PathBuf>,

    #[command(flatten)]
    pub headless: HeadlessOptions,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", default_value = "info", value_parser = log_levels())]
    pub log_level: LevelFilter,

    /// Resume from a checkpoint, which contains its map and settings (the interface can change them): from
    /// FILE; else from the newest in saves/, of the map if one is named, before or after (city --resume,
    /// --resume city); with --no-ui, it is saved only with --save, which may name the same file
    #[arg(long, value_name = "FILE|MAP", num_args = 0..=1, conflicts_with_all = ["method", "preset", "seed", "config", "set"])]
    pub resume: Option<Option<PathBuf>>,

    /// Whether what is resumed becomes a run of this program, not one that it watches.
    #[arg(skip = true)]
    pub is_copy: bool,

    #[command(flatten)]
    pub interface: InterfaceOptions,

    /// Print a template of the configuration file for theme, keys etc. with its default path, and
    /// exit
    #[arg(long)]
    pub print_config_template: bool,

    // Last, since their headings hold for all that follows.
    #[command(flatten)]
    pub reading: MapArgs,

    #[command(flatten)]
    pub gym: GymArgs,
}

impl TrainArgs {
    pub fn map(&self) -> &Path {
        self.map.as_deref().unwrap_or(Path::new(DEFAULT_MAP))
    }

    /// Returns the options given for maps; a checkpoint has the goal radius of any world.
    pub fn map_options(&self) -> Vec<&'static str> {
        let resumed = self.resume.as_ref().map(|_| Path::new(""));
        self.reading.only_for_maps(resumed.unwrap_or(self.map()))
    }
}

/// Options of environments in Python.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Gymnasium environments")]
pub struct GymArgs {
    /// Python interpreter of gym:ID [default: the checkpoint's, the virtual environment's, or python3]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    /// Components of the observation that form the goal, from 0, where there is no achieved_goal
    /// (OGBench) [default: 0,1]
    #[arg(long, value_name = "I,J,...", value_delimiter = ',', conflicts_with = "resume")]
    pub goal: Option<Vec<u16>>,

    /// Python processes that the agents' environments are spread over [default: 1]
    #[arg(long, value_name = "K", value_parser = counts::<u16>(1..=256))]
    pub workers: Option<u16>,

    /// Longest time in seconds that an environment may take to open, to begin an episode or to step
    /// [default: 60]
    #[arg(long, value_name = "S", value_parser = reals(0.1..=1e6, "a number of seconds from 0.1 to 1e6"))]
    pub env_timeout: Option<f64>,
}

impl GymArgs {
    pub fn given(&self) -> Vec<&'static str> {
        given([
            (self.python.is_some(), "--python"),
            (self.goal.is_some(), "--goal"),
            (self.workers.is_some(), "--workers"),
            (self.env_timeout.is_some(), "--env-timeout"),
        ])
    }

    /// Returns the options of environments whose goals are reached within `goal_radius`.
    pub fn options(&self, goal_radius: Option<f64>) -> GymOptions {
        let default = GymOptions::default();
        GymOptions {
            python: self.python.clone(),
            goal: self.goal.as_ref().map(|goal| goal.iter().map(|i| usize::from(*i)).collect()),
            goal_radius: goal_radius.map(|radius| radius as f32),
            workers: self.workers.map_or(default.workers, usize::from),
            timeout: self.env_timeout.map_or(default.timeout, Duration::from_secs_f64),
            ..default
        }
    }
}
