//! The interface: its options, and those of the commands that open it besides training.

use std::path::PathBuf;

use clap::Args;
use log::LevelFilter;

use crate::setup::find_maps::MapArgs;
use crate::setup::values::{log_levels, parse_threads};
use crate::tui::{ComparisonOptions, InterfaceOptions};
use gdg::learn::Threads;

/// Options of commands that only show something.
#[derive(Debug, Args)]
pub struct ScreenArgs {
    #[command(flatten)]
    pub interface: InterfaceOptions,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", default_value = "info", value_parser = log_levels())]
    pub log_level: LevelFilter,
}

/// Options of commands that open runs.
#[derive(Debug, Args)]
pub struct OpenArgs {
    /// Python interpreter of environments in Python [default: as of gdg-tui]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    #[command(flatten)]
    pub screen: ScreenArgs,
}

const TOUR_EXAMPLES: &str = "\
Examples:
  gdg-tui tour                               a minute and a half, with captions

Enter, the right arrow or a click goes to the next step, Space pauses, Esc ends the tour. Then \
training goes on as usual: it is the run of gdg-tui fourrooms --seed 1.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 128 + its number after a \
signal.";

#[derive(Debug, Args)]
#[command(after_help = TOUR_EXAMPLES, allow_negative_numbers = true)]
pub struct TourArgs {
    /// Threads that share each update: a number, or auto for as many as make it faster at the moment,
    /// up to this machine's cores; results do not depend on it
    #[arg(long, value_name = "N", default_value = "auto", value_parser = parse_threads)]
    pub threads: Threads,

    #[command(flatten)]
    pub screen: ScreenArgs,
}

const RUNS_EXAMPLES: &str = "\
Examples:
  gdg-tui runs                               all in this folder and below
  gdg-tui runs saves/suite records/          of an experiment, and records
  gdg-tui runs --json | jq -r 'select(.success >= 0.9) | .file'

On a terminal, a screen: / filters by words, the arrows sort, m marks runs, whose curves and \
settings are then shown together, also while they grow; Enter resumes, or watches what another \
program trains, and compares two that are marked (q leads back to the list), Delete deletes; \
? lists all keys. Elsewhere, a table. --json writes one JSON object per run and line, of \
checkpoints, results and records alike.

Exit status: 0 success; 2 bad usage or input; 128 + its number after a signal.";

#[derive(Debug, Args)]
#[command(after_help = RUNS_EXAMPLES)]
pub struct RunsArgs {
    /// Folders of checkpoints, of records, or of gdg-tui suite or reproduce
    #[arg(default_value = ".", value_name = "FOLDER")]
    pub folders: Vec<PathBuf>,

    /// Print one JSON object per run
    #[arg(long)]
    pub json: bool,

    #[command(flatten)]
    pub open: OpenArgs,
}

const WATCH_EXAMPLES: &str = "\
Examples:
  gdg-tui watch                              the run that goes on, or the last
  gdg-tui watch runs/a.safetensors           as its checkpoint has it
  gdg-tui watch runs/a.jsonl                 by its records

Map, D and plan follow its checkpoint (--save-every MINUTES), curves and time left its records. \
Nothing is written or locked: it works from any machine that shares the folder. C trains a copy.

Exit status: as of gdg-tui tour.";

#[derive(Debug, Args)]
#[command(after_help = WATCH_EXAMPLES)]
pub struct WatchArgs {
    /// Checkpoint of the run, or its records, or a folder with either
    #[arg(default_value = ".", value_name = "FILE")]
    pub file: PathBuf,

    #[command(flatten)]
    pub open: OpenArgs,
}

const COMPARE_EXAMPLES: &str = "\
Examples:
  gdg-tui compare gdg-bridge gdg trap        with bridge points and without
  gdg-tui compare gdg-bridge her city --seed 3
  gdg-tui compare gdg gdg trap --set B:hidden=64         two sizes of network
  gdg-tui compare saves/a.safetensors saves/b.safetensors    two saved runs
  gdg-tui compare saves/a.safetensors her    a method on its map, with its seed

Click on either map to set the goal of both; e edits the map of both. Each side trains exactly \
as gdg-tui MAP --method METHOD with the same seed and settings does, on its own threads; saved \
runs begin paused, as they were saved, and Space trains them on; s saves both. gdg-tui \
reproduce and gdg-tui suite compare methods over several seeds, without a terminal, and keep \
their results.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 128 + its number after a \
signal.";

#[derive(Debug, Args)]
#[command(after_help = COMPARE_EXAMPLES, allow_negative_numbers = true)]
pub struct CompareArgs {
    #[command(flatten)]
    pub options: ComparisonOptions,

    #[command(flatten)]
    pub screen: ScreenArgs,

    #[command(flatten)]
    pub reading: MapArgs,
}
