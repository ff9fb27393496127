//! The command line.

#[cfg(feature = "tui")]
mod compare;
mod completions;
#[cfg(feature = "tui")]
mod marker;
mod reproduce;
mod suite;
#[cfg(feature = "tui")]
mod tour;
mod values;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Args, CommandFactory, Parser, Subcommand, ValueEnum};

use crate::logging::LogLevel;
use crate::runs::SAVES;
#[cfg(feature = "tui")]
pub use compare::CompareArgs;
pub use completions::completions;
use gdg::bridge::Planner;
use gdg::learn::LEARNERS;
use gdg::map::{RANDOM_SIZES, RandomMapKind};
use gdg::text::nearest;
use gdg::train::{Limits, METHODS, Method, Preset};
#[cfg(feature = "tui")]
pub use marker::Marker;
pub use reproduce::{BudgetArg, FIGURES, ReproduceArgs};
pub use suite::SuiteArgs;
#[cfg(feature = "tui")]
pub use tour::TourArgs;
#[cfg(feature = "tui")]
use values::parse_speed;
use values::{counts, edits, output, parse_minutes, parse_seconds, parse_share};

/// Exit status of a failure while running.
pub const EXIT_FAILURE: u8 = 1;

/// Exit status of bad usage or input.
pub const EXIT_BAD_INPUT: u8 = 2;

/// Exit status when `--require-success` is not reached.
pub const EXIT_NOT_REACHED: u8 = 3;

/// The map to train on unless another is given.
const DEFAULT_MAP: &str = "fourrooms";

const EXAMPLES: &str = "\
Examples:
  gdg-tui                                    watch an agent learn the four rooms
  gdg-tui tour                               a guided minute and a half
  gdg-tui city --seed 3                      the city with another seed
  gdg-tui --no-ui fourrooms --max-updates 60000 --require-success 0.95
  gdg-tui --no-ui my.map --scen my.map.scen --max-seconds 120 --save saves/my.safetensors
  gdg-tui --resume                           resume the run that was saved last; gdg-tui runs lists all
  gdg-tui --resume saves/my.safetensors      resume where that run stopped
  gdg-tui film saves/my.safetensors          how that run learned distance, as an animation
  gdg-tui --record run.cast                  record the screen; gdg-tui frames renders frames of it
  gdg-tui fetch-reach --method gdg           watch a 7-joint arm learn to reach for points in space
  gdg-tui compare gdg-bridge gdg             two methods side by side: with bridge points and without
  gdg-tui suite maps/ --seeds 3              train on every map of a folder: a table, and a report with pictures
  gdg-tui reproduce all                      the paper's figures, with our default beside its methods

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 3 --require-success not reached;
128 + its number after a signal, as 130 after Ctrl-C (the run is saved to --save FILE, or by the interface; the same signal
again exits without saving).";

/// Watch agents learn distance and reach goals without any reward.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXAMPLES, args_conflicts_with_subcommands = true, allow_negative_numbers = true)]
pub struct Cli {
    /// Subcommand; trains if there is none.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Options of a training run.
    #[command(flatten)]
    pub train: TrainArgs,
}

impl Cli {
    /// Parses the arguments of the process.
    ///
    /// # Errors
    /// The error, or the requested help, to be printed.
    pub fn from_arguments() -> Result<Self, clap::Error> {
        Self::try_parse().map_err(|error| match error.get(ContextKind::InvalidSubcommand) {
            // The second of two maps is taken for a command.
            Some(ContextValue::String(second))
                if error.kind() == ErrorKind::ArgumentConflict && Self::command().find_subcommand(second).is_none() =>
            {
                let problem =
                    format!("one map is trained, and '{second}' is one more: gdg-tui suite MAP... trains on several");
                Self::command().error(ErrorKind::ArgumentConflict, problem)
            }
            _ => error,
        })
    }
}

/// Commands besides training.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the built-in maps with size, free cells and farthest distance, or print a random map
    Maps {
        /// Print a random map of this kind as plain ASCII
        #[arg(long, value_name = "KIND", value_enum)]
        random: Option<MapKindArg>,
        /// Cells along each side of the random map [default: 44 for maze, 101 for city, 33 for
        /// perfect]. Perfect mazes of an even size end at the edge of the map instead of a wall
        #[arg(long, value_name = "N", requires = "random", value_parser = sides())]
        size: Option<u16>,
        /// Seed of the random map: same seed, same map
        #[arg(long, default_value_t = 0, requires = "random", value_parser = counts::<u64>(0..=u64::MAX))]
        seed: u64,
    },
    /// List the saved runs of a folder, the newest first
    Runs {
        /// Folder of the checkpoints
        #[arg(default_value = SAVES, value_name = "FOLDER")]
        folder: PathBuf,
    },
    /// Print the reference of all settings in Markdown
    Settings,
    /// Take a guided tour of the four rooms: a minute and a half
    #[cfg(feature = "tui")]
    Tour(TourArgs),
    /// Watch two methods train side by side on the same map
    #[cfg(feature = "tui")]
    Compare(CompareArgs),
    /// Benchmark suite: train on every map, and write a table and a report with pictures
    Suite(SuiteArgs),
    /// Reproduce the paper's figures: data, drawings and a report that compares
    Reproduce(ReproduceArgs),
    /// Ablation study: measure the effect of switching off each component of the default preset
    Ablate(AblateArgs),
    /// Write a checkpoint's actor as a safetensors file that other programs can run
    ExportPolicy(ExportPolicyArgs),
    /// Write the film of how a checkpoint's run learned distance as an animated PNG
    Film(FilmArgs),
    /// Render frames of a screen recording as PNG files, or all of it as an animation
    #[cfg(feature = "tui")]
    Frames(FramesArgs),
    /// Print shell completions
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
    /// Validate a map or scenario file and print its facts
    Check {
        /// Map (.map or plain ASCII), scenario (.scen) or built-in map
        file: PathBuf,
        /// Map of the scenario, if it is not in the same folder
        #[arg(long, value_name = "FILE")]
        map: Option<PathBuf>,
    },
}

/// Options of `gdg-tui ablate`.
#[derive(Debug, Args)]
pub struct AblateArgs {
    /// Built-in map or map file
    #[arg(default_value = "fourrooms", value_name = "MAP")]
    pub map: PathBuf,
    /// Climb from the preset paper to the default instead, component by component
    #[arg(long)]
    pub ladder: bool,
    /// Updates per run
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = counts::<u64>(1..=u64::MAX))]
    pub updates: u64,
    /// Runs per variant, with seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = counts::<u64>(1..=1000))]
    pub seeds: u64,
    /// Evaluation tasks at each of six distances
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: u32,
    /// Parallel runs, each on one thread [default: this machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,
    /// Folder of the results: runs that are done are not repeated, interrupted ones go on
    #[arg(long, value_name = "FOLDER", default_value = "saves/ablation", value_parser = output())]
    pub out: PathBuf,
    /// Also write all results to this file as JSON
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub json: Option<PathBuf>,
    /// Replace the JSON file if it exists
    #[arg(long, requires = "json")]
    pub overwrite: bool,
}

/// Options of `gdg-tui export-policy`.
#[derive(Debug, Args)]
pub struct ExportPolicyArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with the extension .policy.safetensors]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}

/// Options of `gdg-tui film`.
#[derive(Debug, Args)]
pub struct FilmArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with the extension .film.png]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}

/// Options of `gdg-tui frames`.
#[cfg(feature = "tui")]
#[derive(Debug, Args)]
pub struct FramesArgs {
    /// Recording made with --record
    pub cast: PathBuf,
    /// Times to render, in seconds from the start of the recording
    #[arg(
        long,
        value_name = "S",
        value_delimiter = ',',
        required_unless_present = "animate",
        value_parser = parse_seconds
    )]
    pub at: Vec<f64>,
    /// Render an animated PNG into this file instead
    #[arg(long, value_name = "FILE", conflicts_with = "at", value_parser = output())]
    pub animate: Option<PathBuf>,
    /// Begin the animation at this time, in seconds
    #[arg(long, value_name = "S", requires = "animate", default_value_t = 0.0, value_parser = parse_seconds)]
    pub from: f64,
    /// End the animation at this time, in seconds [default: the recording's end]
    #[arg(long, value_name = "S", requires = "animate", value_parser = parse_seconds)]
    pub to: Option<f64>,
    /// Frames per second of the animation
    #[arg(long, value_name = "N", requires = "animate", default_value_t = 5, value_parser = counts::<u16>(1..=50))]
    pub fps: u16,
    /// Play the animation this many times as fast
    #[arg(long, value_name = "X", requires = "animate", default_value_t = 1.0, value_parser = parse_speed)]
    pub speed: f64,
    /// Output folder: one FILE-SECONDS.png per time
    #[arg(long, value_name = "FOLDER", default_value = ".", value_parser = output())]
    pub out: PathBuf,
    /// Replace existing pictures
    #[arg(long)]
    pub overwrite: bool,
}

/// Options of a training run.
#[derive(Debug, Args)]
pub struct TrainArgs {
    /// Built-in map, map file, or world: fetch-reach or fetch-reach-wall [default: fourrooms]
    #[arg(value_name = "MAP")]
    pub map: Option<PathBuf>,

    /// Train without the interface: JSON lines on standard output
    #[cfg_attr(feature = "tui", arg(long, conflicts_with_all = ["record", "ui_config", "marker"]))]
    #[cfg_attr(not(feature = "tui"), arg(long))]
    pub no_ui: bool,

    /// Method and settings.
    #[command(flatten)]
    pub run: RunArgs,

    /// Random seed: same seed, same run
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
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub max_seconds: Option<f64>,

    /// Stop after N episodes, counted from the start of training
    #[arg(long, value_name = "N", value_parser = counts::<u64>(0..=u64::MAX))]
    pub max_episodes: Option<u64>,

    /// Evaluate every N updates
    #[arg(long, value_name = "N", value_parser = counts::<u64>(1..=u64::MAX))]
    pub eval_every_updates: Option<u64>,

    /// Switch to another map of the same size at this update, 0 for the start (repeatable; requires
    /// --no-ui)
    #[arg(long, value_name = "UPDATES:FILE", value_parser = edits(), requires = "no_ui")]
    pub edit_at: Vec<EditAt>,

    /// Evaluation tasks at each of six distances (five in fetch-reach)
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: u32,

    /// Evaluate on this scenario's tasks (6 x --eval-tasks of them, evenly spaced)
    #[arg(long, value_name = "FILE")]
    pub scen: Option<PathBuf>,

    /// Threads per update; results do not depend on their number [default: this machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub threads: Option<u16>,

    /// Save checkpoints to this file during training and at the end, or beside it if it belongs to
    /// another run
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub save: Option<PathBuf>,

    /// Minutes between checkpoints during training; 0 for none [default: 5 with --save; interface:
    /// see autosave_minutes]
    #[arg(long, value_name = "MINUTES", value_parser = parse_minutes, requires = "no_ui")]
    pub save_every: Option<f64>,

    /// Replace existing files: recordings, tables and, with --save, checkpoints of other runs
    #[arg(long)]
    pub overwrite: bool,

    /// Also write the metrics of progress and evaluations to this file as CSV; a resumed run goes
    /// on in its own table
    #[arg(long, value_name = "FILE", requires = "no_ui", value_parser = output())]
    pub csv: Option<PathBuf>,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = LogLevel::Info)]
    pub log_level: LogLevel,

    /// Resume from a checkpoint, which contains its map and settings: from FILE; else from the
    /// newest in saves/, of the map if one is named, before or after (city --resume, --resume city)
    #[arg(long, value_name = "FILE|MAP", num_args = 0..=1, conflicts_with_all = ["method", "preset", "seed", "config", "set"])]
    pub resume: Option<Option<PathBuf>>,

    /// Options of the interface.
    #[cfg(feature = "tui")]
    #[command(flatten)]
    pub interface: InterfaceArgs,

    /// Print a template of the configuration file for theme, keys etc. with its default path, and
    /// exit
    #[cfg(feature = "tui")]
    #[arg(long)]
    pub print_config_template: bool,

    /// Exit with status 3 unless the final evaluation's success rate is at least X
    #[arg(long, value_name = "X", value_parser = parse_share)]
    pub require_success: Option<f64>,
}

/// Options of the interface.
#[cfg(feature = "tui")]
#[derive(Debug, Args)]
pub struct InterfaceArgs {
    /// Record the screen as an asciinema cast
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub record: Option<PathBuf>,

    /// Configuration file for theme, keys etc., instead of the default one
    #[arg(long, value_name = "FILE")]
    pub ui_config: Option<PathBuf>,

    /// What the map is drawn with [default: auto: pixels where the terminal shows pictures, else
    /// half blocks or quadrants]
    #[arg(long, value_name = "MARKER", value_enum)]
    pub marker: Option<Marker>,
}

/// Options of commands that only show something.
#[cfg(feature = "tui")]
#[derive(Debug, Args)]
pub struct ScreenArgs {
    /// Options of the interface.
    #[command(flatten)]
    pub interface: InterfaceArgs,

    /// Replace the recording if it exists
    #[arg(long, requires = "record")]
    pub overwrite: bool,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = LogLevel::Info)]
    pub log_level: LogLevel,
}

/// Method and settings of a run.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Learner and planner: one of these methods, or LEARNER+PLANNER
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Method,

    /// Preset to start from [default: tuned for ddpg, her and ddpg-distance, otherwise default]
    #[arg(long, value_parser = preset_parser())]
    pub preset: Option<Preset>,

    /// Settings file: a JSON object as printed by --print-config
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,

    /// Change one setting (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
}

impl RunArgs {
    /// Returns the preset to start from.
    pub fn preset(&self) -> Preset {
        self.preset.unwrap_or_else(|| Preset::of_method(&self.method))
    }
}

/// A scheduled change of the map.
#[derive(Clone, Debug)]
pub struct EditAt {
    /// Number of updates after which to switch.
    pub updates: u64,
    /// The map file.
    pub file: PathBuf,
}

impl TrainArgs {
    /// Returns the map or world to train on.
    pub fn map(&self) -> &Path {
        self.map.as_deref().unwrap_or(Path::new(DEFAULT_MAP))
    }

    /// Returns the limits of a run that has been trained for `seconds` before.
    pub fn limits(&self, seconds: f64) -> Limits {
        let until = self.max_seconds.map(|more| seconds + more);
        Limits { updates: self.max_updates, seconds: until, episodes: self.max_episodes }
    }
}

/// [`RandomMapKind`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum MapKindArg {
    /// Rooms of 4 by 4 cells with thin walls, connected by doors
    Maze,
    /// Streets between blocks, about a third of them closed
    City,
    /// A perfect maze: corridors and walls one cell wide, one path between any two cells
    Perfect,
}

/// Returns the parser of the cells along each side of a random map.
fn sides() -> impl Fn(&str) -> Result<u16, String> + Clone + Send + Sync + 'static {
    counts(*RANDOM_SIZES.start() as u64..=*RANDOM_SIZES.end() as u64)
}

impl From<MapKindArg> for RandomMapKind {
    fn from(arg: MapKindArg) -> Self {
        match arg {
            MapKindArg::Maze => Self::Maze,
            MapKindArg::City => Self::City,
            MapKindArg::Perfect => Self::Perfect,
        }
    }
}

/// Parses a method and lists the named ones.
#[derive(Clone)]
struct MethodParser;

impl TypedValueParser for MethodParser {
    type Value = Method;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<Method, clap::Error> {
        if let Some(method) = value.to_str().and_then(|text| text.parse().ok()) {
            return Ok(method);
        }
        // Gives an error that suggests the nearest name.
        let named = PossibleValuesParser::new(METHODS.map(|named| named.name))
            .parse_ref(command, arg, value);
        let name = named.map_err(|mut error| {
            let list = |names: Vec<&str>| names.join(", ");
            let tip = format!(
                "any other method is LEARNER+PLANNER; learners: {}; planners: {}",
                list(LEARNERS.iter().map(|kind| kind.name).collect()),
                list(Planner::ALL.iter().map(|planner| planner.name()).collect())
            );
            if let Some(known) =
                value.to_str().and_then(|typed| nearest(typed, METHODS.map(|named| named.name)))
            {
                error.insert(ContextKind::SuggestedValue, ContextValue::String(known.to_owned()));
            }
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            error
        })?;
        Ok(name.parse().unwrap_or_default())
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(METHODS.iter().map(|named| PossibleValue::new(named.name).help(named.about))))
    }
}

/// Returns the long help of `--method`, which lists learners and planners.
fn methods_help() -> String {
    let list = |entries: Vec<(&str, &str)>| {
        entries.iter().map(|(name, about)| format!("  {name:<13} {about}\n")).collect::<String>()
    };
    format!(
        "Learner and planner: one of these methods, or LEARNER+PLANNER\n\nLearners:\n{}\nPlanners:\n{}",
        list(LEARNERS.iter().map(|kind| (kind.name, kind.about)).collect()),
        list(Planner::ALL.iter().map(|planner| (planner.name(), planner.about())).collect())
    )
}

/// Returns the parser of presets.
fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    let values = Preset::ALL.map(|preset| PossibleValue::new(preset.name()).help(preset.about()));
    PossibleValuesParser::new(values).map(|name| Preset::named(&name).unwrap_or(Preset::Default))
}
