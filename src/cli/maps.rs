//! Options of `gdg-tui maps`.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};

use crate::setup::find_maps::MapArgs;
use crate::setup::values::{counts, output};
use gdg::map::{FORMATS, MapFormat, RANDOM_SIZES, RandomMapKind};

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, after_help = formats_help())]
pub struct MapsArgs {
    /// What to do instead.
    #[command(subcommand)]
    pub command: Option<MapsCommand>,

    /// Print a random map of this kind as plain ASCII
    #[arg(long, value_name = "KIND", value_parser = kinds())]
    pub random: Option<RandomMapKind>,

    /// Cells along each side of the random map [default: 44 for maze, 101 for city, 33 for
    /// perfect]. Perfect mazes of an even size end at the edge of the map instead of a wall
    #[arg(long, value_name = "N", requires = "random", value_parser = sides())]
    pub size: Option<u16>,

    /// Seed of the random map: same seed, same map
    #[arg(long, default_value_t = 0, requires = "random", value_parser = counts::<u64>(0..=u64::MAX))]
    pub seed: u64,
}

/// What to do with maps.
#[derive(Debug, Subcommand)]
pub enum MapsCommand {
    /// Write a map in another format
    Convert(ConvertArgs),
}

#[derive(Debug, Args)]
#[command(after_help = formats_help(), allow_negative_numbers = true)]
pub struct ConvertArgs {
    /// Built-in map or map file, in any format
    #[arg(value_name = "IN")]
    pub input: PathBuf,

    /// File to write
    #[arg(value_name = "OUT", value_parser = output())]
    pub output: PathBuf,

    /// Format to write [default: by the ending of OUT; .yaml is ros]
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    pub format: Option<&'static MapFormat>,

    /// Mark the starts and goals of this scenario's tasks, or of the agents of a map for planners
    #[arg(long, value_name = "FILE")]
    pub scen: Option<PathBuf>,

    /// Replace existing files
    #[arg(long)]
    pub overwrite: bool,

    #[command(flatten)]
    pub map: MapArgs,
}

/// Returns the parser of the cells along each side of a random map.
fn sides() -> impl Fn(&str) -> Result<u16, String> + Clone + Send + Sync + 'static {
    counts(*RANDOM_SIZES.start() as u64..=*RANDOM_SIZES.end() as u64)
}

fn kinds() -> impl TypedValueParser<Value = RandomMapKind> {
    let values = RandomMapKind::ALL.map(|kind| PossibleValue::new(kind.name()).help(kind.about()));
    PossibleValuesParser::new(values).try_map(|name| {
        let mut all = RandomMapKind::ALL.into_iter();
        all.find(|kind| kind.name() == name).ok_or("there is no such kind")
    })
}

fn formats() -> impl TypedValueParser<Value = &'static MapFormat> {
    let name = |format: &MapFormat| PossibleValue::new(format.name).help(format.about);
    PossibleValuesParser::new(FORMATS.iter().map(name).collect::<Vec<_>>()).try_map(|name| {
        FORMATS.iter().find(|format| format.name == name).ok_or("there is no such format")
    })
}

fn formats_help() -> String {
    let line = |format: &MapFormat| {
        let endings: Vec<String> = format.endings.iter().map(|end| format!(".{end}")).collect();
        format!("  {:<9} {}\n      {}\n", format.name, endings.join(" "), format.about)
    };
    format!(
        "Formats of maps, recognised by what is in the file:\n{}",
        FORMATS.iter().map(line).collect::<String>()
    )
}
