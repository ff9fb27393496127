//! Options of `gdg-tui compare`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args};

use super::method::MethodParser;
use super::values::{counts, parse_threads};
use super::{MapArgs, ScreenArgs};
use crate::tui::{ComparisonOptions, Contender};
use gdg::files::has_extension;
use gdg::learn::Threads;
use gdg::map::builtin;
use gdg::text::sanitized;

const EXAMPLES: &str = "\
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

/// Options of `gdg-tui compare`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
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

    /// Options of what is shown.
    #[command(flatten)]
    pub screen: ScreenArgs,

    /// How the map is read.
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
