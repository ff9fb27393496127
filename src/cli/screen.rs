//! The interface: its options, and those of the commands that open it besides training.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args};
use log::LevelFilter;

use crate::host::maps::MapArgs;
use crate::host::runs::SAVES;
use crate::host::values::{MethodParser, counts, log_levels, parse_threads};
use crate::tui::{ComparisonOptions, Contender, InterfaceOptions};
use gdg::files::has_extension;
use gdg::learn::Threads;
use gdg::map::builtin;
use gdg::text::sanitized;

/// Options of commands that only show something.
#[derive(Debug, Args)]
pub struct ScreenArgs {
    #[command(flatten)]
    pub interface: InterfaceOptions,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", default_value = "info", value_parser = log_levels())]
    pub log_level: LevelFilter,
}

const TOUR_EXAMPLES: &str = "\
Examples:
  gdg-tui tour                               a minute and a half, with captions

Enter, the right arrow or a click goes to the next step, p pauses, Esc ends the tour. Then \
training goes on as usual: it is the run of gdg-tui fourrooms --seed 0.

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
  gdg-tui runs                               all in saves/, experiments too
  gdg-tui runs saves/suite records/          of an experiment, and records
  gdg-tui runs --json | jq -r 'select(.success >= 0.9) | .file'

On a terminal, a screen: / filters by words, s sorts, Space marks runs, whose curves and \
settings are then shown together, also while they grow; Enter resumes, c compares (q leads back \
to the list), Delete deletes; ? lists all keys. Elsewhere, a table. --json writes one \
JSON object per run and line, of checkpoints, results and records alike.

Exit status: 0 success; 2 bad usage or input; 128 + its number after a signal.";

#[derive(Debug, Args)]
#[command(after_help = RUNS_EXAMPLES)]
pub struct RunsArgs {
    /// Folders of checkpoints, of records, or of gdg-tui suite or reproduce
    #[arg(default_value = SAVES, value_name = "FOLDER")]
    pub folders: Vec<PathBuf>,

    /// Print one JSON object per run
    #[arg(long)]
    pub json: bool,

    #[command(flatten)]
    pub screen: ScreenArgs,
}

const COMPARE_EXAMPLES: &str = "\
Examples:
  gdg-tui compare gdg-bridge gdg             with bridge points and without
  gdg-tui compare gdg-bridge her city --seed 3
  gdg-tui compare gdg gdg trap --set B:hidden=64         two sizes of network
  gdg-tui compare saves/a.safetensors saves/b.safetensors    two saved runs
  gdg-tui compare saves/a.safetensors her    a method on its map, with its seed

Click on either map to set the goal of both; e edits the map of both. Each side trains exactly \
as gdg-tui MAP --method METHOD with the same seed and settings does, on its own threads; saved \
runs begin paused, as they were saved, and Space trains them on. Nothing is saved: gdg-tui \
reproduce and gdg-tui suite compare methods over several seeds, without a terminal, and keep \
their results.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 128 + its number after a \
signal.";

#[derive(Debug, Args)]
#[command(after_help = COMPARE_EXAMPLES, allow_negative_numbers = true)]
pub struct CompareArgs {
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

    #[command(flatten)]
    pub screen: ScreenArgs,

    #[command(flatten)]
    pub reading: MapArgs,
}

impl CompareArgs {
    /// Returns the options of the comparison.
    pub fn options(&self) -> ComparisonOptions {
        ComparisonOptions {
            contenders: [self.a.clone(), self.b.clone()],
            map: self.map.clone(),
            reading: (&self.reading).into(),
            seed: self.seed,
            set: self.set.clone(),
            threads: self.threads,
        }
    }
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
