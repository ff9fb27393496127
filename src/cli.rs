//! The command line.

mod maps;
mod screen_args;
mod train;

use std::path::PathBuf;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;

use crate::experiment::{figures, plot, suite};
use crate::setup::find_maps::MapArgs;
use crate::setup::values::output;
use gdg::map::BUILTIN;
use gdg::train::Registry;

pub use maps::{ConvertArgs, MapsArgs, MapsCommand};
pub use screen_args::{CompareArgs, OpenArgs, RunsArgs, ScreenArgs, TourArgs, WatchArgs};
pub use train::TrainArgs;

/// The program's name on the command line.
const PROGRAM: &str = "gdg-tui";

const EXAMPLES: &str = "\
Examples:
  gdg-tui                                    watch an agent learn the four rooms
  gdg-tui tour                               a guided minute and a half
  gdg-tui city --seed 3                      the city with another seed
  gdg-tui --no-ui fourrooms --max-updates 60000 --require-success 0.95
  gdg-tui --resume                           resume the run that was saved last
  gdg-tui runs                               all runs: resume, compare
  gdg-tui watch                              the run that another program trains
  gdg-tui fetch-reach --method gdg           a 7-joint arm reaches for points
  gdg-tui --no-ui gym:gymnasium_robotics:PointMaze_UMaze-v3    in Python
  gdg-tui compare gdg-bridge gdg trap        with bridge points and without
  gdg-tui suite maps/ --seeds 3              every map of a folder: a report
  gdg-tui plot saves/suite --out fig.pdf     their curves, for a paper's column
  gdg-tui reproduce all                      the paper's figures

More commands, each with --help: settings, export-data, export-policy, completions, man.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 3 --require-success not \
reached; 128 + its number after a signal, as 130 after Ctrl-C (the run is saved to --save FILE, \
or by the interface; the same signal again exits without saving).";

/// Watch agents learn distance and reach goals without any reward.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXAMPLES, args_conflicts_with_subcommands = true, allow_negative_numbers = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub train: TrainArgs,
}

impl Cli {
    /// Parses the arguments of the process; help that is asked for is an error, too.
    pub fn from_arguments() -> Result<Self, clap::Error> {
        // Of all commands: `--margin -1` is a wrong number, not an unknown option.
        let command = Self::command().mut_subcommands(|each| each.allow_negative_numbers(true));
        let parsed = command.try_get_matches().and_then(|found| Self::from_arg_matches(&found));
        parsed.map_err(|error| match error.get(ContextKind::InvalidSubcommand) {
            // clap takes the second of two maps for a command.
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
    /// List the built-in maps with size, free cells and farthest distance, print a random map, or
    /// convert maps
    Maps(MapsArgs),
    /// Show the runs of folders: filter, sort, compare their curves and settings, resume them
    Runs(RunsArgs),
    /// Watch a run that another program trains, here or on a machine that shares the folder
    Watch(WatchArgs),
    /// Print the reference of all settings in Markdown, or what some of them are
    #[command(hide = true)]
    Settings {
        /// Settings to show instead of all, or words in their names and descriptions
        #[arg(value_name = "NAME|WORD")]
        names: Vec<String>,
    },
    /// Take a guided tour of the four rooms: a minute and a half
    Tour(TourArgs),
    /// Watch two methods train side by side on the same map
    Compare(CompareArgs),
    /// Train on many maps, with several methods, settings and seeds: a table, and a report with
    /// pictures
    Suite(suite::SuiteOptions),
    /// Draw the curves of several runs over their seeds, as a figure for a paper and as a table
    Plot(plot::PlotOptions),
    /// Reproduce the paper's figures: data, drawings and a report that compares
    Reproduce(figures::FigureOptions),
    /// Write the transitions that a checkpoint's run has seen as an .npz file, for --data
    #[command(hide = true)]
    ExportData(ExportArgs),
    /// Write a checkpoint's policy as a safetensors file that other programs can run: with the Python
    /// module gdg_tui, gdg_tui.load_policy(FILE)
    #[command(hide = true)]
    ExportPolicy(ExportPolicyArgs),
    /// Print shell completions
    #[command(hide = true)]
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Print the manual page
    #[command(hide = true)]
    Man,
    /// Validate a map or scenario file and print its facts
    Check(CheckArgs),
}

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Map (in any format of gdg-tui maps --help), scenario (.scen) or built-in map
    pub file: PathBuf,
    /// Map of the scenario, if it is not in the same folder
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Exit with status 3, otherwise 0, if a marked goal cannot be reached, or a start is cut off
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub reading: MapArgs,
}

/// What is exported, and where to.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: exports/CHECKPOINT, with another extension]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}

#[derive(Debug, Args)]
pub struct ExportPolicyArgs {
    #[command(flatten)]
    pub export: ExportArgs,
    /// Also write what plans need: critics, dynamics model, bridge candidates and edges. The Python
    /// module gdg_tui then follows bridges as this program does
    #[arg(long)]
    pub plans: bool,
}

/// Returns the script that completes the command line in `shell`.
pub fn completions(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut completed(), PROGRAM, &mut script);
    let script = String::from_utf8_lossy(&script);
    match shell {
        // clap_complete names the function of a program with a hyphen in one way, and refers to its
        // commands in another.
        Shell::Bash => {
            script.replace(&PROGRAM.replace('-', "__subcmd__"), &PROGRAM.replace('-', "__"))
        }
        // The first word may also be a file.
        Shell::Zsh => {
            let commands = format!("_describe -t commands '{PROGRAM} commands' commands \"$@\"\n");
            script.replace(&commands, &format!("{commands}    _files\n"))
        }
        _ => script.into_owned(),
    }
}

/// Returns the command line for completion. Maps and worlds become commands with the options of
/// training, as scripts accept either a command or a value as the first word, not both.
fn completed() -> clap::Command {
    let cli = Cli::command().mut_subcommands(|each| each.hide(false));
    let options: Vec<Arg> =
        cli.get_arguments().filter(|arg| !arg.is_positional()).cloned().collect();
    let registry = Registry::builtin();
    let worlds = registry.named_worlds().map(|kind| (kind.name, "world"));
    let maps = BUILTIN.iter().map(|(name, _)| (*name, "built-in map"));
    let trained = maps
        .chain(worlds)
        .map(|(name, about)| clap::Command::new(name).about(about).args(&options));
    clap::Command::new(PROGRAM)
        .args(&options)
        .subcommands(cli.get_subcommands().cloned())
        .subcommands(trained)
        .disable_help_subcommand(true)
}
