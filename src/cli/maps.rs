//! Options of `gdg-tui maps`, and how maps are read.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};

use crate::host::values::{counts, output, reals};
use gdg::map::{FORMATS, MapFormat, MapScale, RANDOM_SIZES, RandomMapKind, Reading};

/// The option for maps that are images.
pub const THRESHOLD: &str = "--threshold";

/// The option that is not only for maps.
pub const GOAL_RADIUS: &str = "--goal-radius";

/// How the file of a map is read.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Mazes of other programs")]
pub struct MapArgs {
    /// Enlarge a maze: N cells along each side of a block [default: 1]. Starts and goals are in the
    /// middle of their blocks
    #[arg(long, value_name = "N", value_parser = counts::<usize>(1..=MapScale::MAX_CELL as u64))]
    pub cell: Option<usize>,

    /// Widen walls and the map's edge by the radius of a body, in cells (after --cell) [default: 0]
    #[arg(long, value_name = "M", value_parser = reals(0.0..=f64::from(MapScale::MAX_MARGIN), "a number from 0 to 100"))]
    pub margin: Option<f64>,

    /// Distance below which a goal is reached: in cells (after --cell) [default: 1], or in the unit
    /// of an environment in Python [default: the environment's own]
    #[arg(long, value_name = "R", value_parser = reals(1e-9..=1e9, "a distance from 1e-9 to 1e9"))]
    pub goal_radius: Option<f64>,

    /// Brightness below which pixels of an image are walls, from 0 to 1 [default: 0.5]
    #[arg(long, value_name = "X", value_parser = reals(0.0..=1.0, "a number from 0 to 1"))]
    pub threshold: Option<f64>,
}

impl MapArgs {
    /// Returns the options that were given.
    pub fn given(&self) -> Vec<&'static str> {
        given([
            (self.cell.is_some(), "--cell"),
            (self.margin.is_some(), "--margin"),
            (self.goal_radius.is_some(), GOAL_RADIUS),
            (self.threshold.is_some(), THRESHOLD),
        ])
    }
}

/// Returns the options that were given.
pub fn given<const N: usize>(all: [(bool, &'static str); N]) -> Vec<&'static str> {
    all.into_iter().filter(|(given, _)| *given).map(|(_, option)| option).collect()
}

impl From<&MapArgs> for Reading {
    fn from(args: &MapArgs) -> Self {
        let Self { scale, threshold, .. } = Self::default();
        let scale = MapScale {
            cell: args.cell.unwrap_or(scale.cell),
            margin: args.margin.map_or(scale.margin, |margin| margin as f32),
            ..scale
        };
        let threshold = args.threshold.map_or(threshold, |threshold| threshold as f32);
        Self { scale, goal_radius: args.goal_radius.map(|radius| radius as f32), threshold }
    }
}

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

/// Returns the parser of a format's name.
fn formats() -> impl TypedValueParser<Value = &'static MapFormat> {
    let name = |format: &MapFormat| PossibleValue::new(format.name).help(format.about);
    PossibleValuesParser::new(FORMATS.iter().map(name).collect::<Vec<_>>()).try_map(|name| {
        FORMATS.iter().find(|format| format.name == name).ok_or("there is no such format")
    })
}

/// Returns the list of formats.
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
