//! Finds the maps that commands name, reads them as options say, and warns about them.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::Path;

use clap::Args;
use miette::{Report, miette};

use crate::process::errors::from_map_error;
use crate::setup::values::{counts, reals};
use gdg::map::{self, Cell, Components, Grid, MapError, MapScale, Reading};
use gdg::text::{counted, did_you_mean, sanitized};
use gdg::train::Registry;

/// The map to train on unless another is given.
pub const DEFAULT_MAP: &str = "fourrooms";

/// Maps with fewer free cells are taken for mistakes.
const FEWEST_CELLS: usize = 4;

/// The option for maps that are images.
pub const THRESHOLD: &str = "--threshold";

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
    /// Returns the options given that are only for maps: the goal radius of an environment in
    /// Python is not a map's.
    pub fn only_for_maps(&self, world: &Path) -> Vec<&'static str> {
        let is_python = world.to_str().is_some_and(|name| name.starts_with("gym:"));
        given([
            (self.cell.is_some(), "--cell"),
            (self.margin.is_some(), "--margin"),
            (self.goal_radius.is_some() && !is_python, "--goal-radius"),
            (self.threshold.is_some(), THRESHOLD),
        ])
    }
}

pub fn given<const N: usize>(all: [(bool, &'static str); N]) -> Vec<&'static str> {
    all.into_iter().filter(|(given, _)| *given).map(|(_, option)| option).collect()
}

impl From<&MapArgs> for Reading {
    fn from(args: &MapArgs) -> Self {
        let Self { scale, threshold } = Self::default();
        let scale = MapScale {
            cell: args.cell.unwrap_or(scale.cell),
            margin: args.margin.map_or(scale.margin, |margin| margin as f32),
            goal_radius: args.goal_radius.map_or(scale.goal_radius, |radius| radius as f32),
            ..scale
        };
        Self { scale, threshold: args.threshold.map_or(threshold, |threshold| threshold as f32) }
    }
}

/// Returns warnings about a map for its user, with its name: the first of its faults, too.
pub fn warnings(grid: &Grid) -> Vec<String> {
    let named = |problem| format!("{}: {problem}", sanitized(grid.name()));
    let first = faults(grid).into_iter().next();
    doubts(grid).into_iter().chain(first).map(named).collect()
}

/// Returns signs that a map is not what its author meant.
pub fn doubts(grid: &Grid) -> Option<String> {
    let free = grid.free_count();
    let few = counted(free as u64, "free cell");
    let few = format!("the map has only {few}: too few to learn anything");
    let (radius, side) = (grid.scale().goal_radius, grid.width().max(grid.height()));
    let large = format!("the goal radius of {radius} cells is more than half of the map's {side}");
    let is_large = 2.0 * radius > side as f32;
    (free < FEWEST_CELLS).then_some(few).or(is_large.then_some(large))
}

/// Returns which marked goals no agent can reach, and which starts are cut off.
pub fn faults(grid: &Grid) -> Vec<String> {
    let components = Components::of(grid);
    let part = |cell: &Cell| components.of_cell[grid.index(*cell)];
    let parts = |cells: &[Cell]| cells.iter().filter_map(part).collect::<BTreeSet<_>>();
    let (starts, goals, largest) = (grid.starts(), grid.goals(), components.largest());
    // On a map without S, agents start in the largest component.
    let (from, to) = match starts {
        [] => (BTreeSet::from([largest]), "the largest component, where agents start"),
        _ => (parts(starts), "any start S"),
    };
    let goal = |cell: &Cell| {
        let is_reached = part(cell).is_some_and(|own| from.contains(&own));
        (!is_reached).then(|| format!("the goal G at {} cannot be reached from {to}", place(*cell)))
    };
    let ends = parts(goals);
    let start = |cell: &Cell| {
        let problem = match part(cell) {
            Some(own) if !ends.is_empty() && !ends.contains(&own) => "reaches no goal G",
            Some(own) if own != largest => {
                "is cut off from the largest component, where tasks are drawn"
            }
            _ => return None,
        };
        Some(format!("the start S at {} {problem}", place(*cell)))
    };
    goals.iter().filter_map(goal).chain(starts.iter().filter_map(start)).collect()
}

fn place(cell: Cell) -> String {
    format!("column {}, row {}", cell.x + 1, cell.y + 1)
}

/// Returns a path as a possible name of a built-in map or world; empty if it is not UTF-8.
pub fn known_name(path: &Path) -> &str {
    path.to_str().unwrap_or_default()
}

/// Loads the built-in map or the file at `path` at a scale; errors also list the worlds of `registry` that
/// need no file.
pub fn find_map(path: &Path, reading: &Reading, registry: &Registry) -> Result<Grid, Report> {
    let name = known_name(path);
    if let Some(grid) = map::builtin(name) {
        return reading.scale.of(name, &grid).map_err(from_map_error);
    }
    if registry.world_without_file(name).is_some() && !path.exists() {
        let help = "give a map: a built-in name or a file";
        return Err(miette!(help = help, "{name}: is a world without a map, which this needs"));
    }
    if is_unknown_name(path, registry) {
        return Err(unknown_name(path, registry, &[]));
    }
    map::load_map_as(path, reading).map_err(|mut error| {
        if !path.exists() {
            error.help = format!("{}{}, or a name from 'gdg-tui maps'", meant(path), error.help);
        }
        from_map_error(error)
    })
}

/// Asks for the file beside `path`, which does not exist, whose name is most like its own.
fn meant(path: &Path) -> String {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let beside =
        std::fs::read_dir(folder.unwrap_or(Path::new("."))).into_iter().flatten().flatten();
    let beside: Vec<String> =
        beside.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let typed = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
    did_you_mean(typed, beside.iter().map(String::as_str))
}

/// Returns whether `path` looks like a name rather than a file, and is neither that of a built-in
/// map nor that of a world of `registry`.
pub fn is_unknown_name(path: &Path, registry: &Registry) -> bool {
    let name = known_name(path);
    name != "-"
        && !path.exists()
        && path.extension().is_none()
        && path.components().count() == 1
        && map::builtin(name).is_none()
        && registry.world_without_file(name).is_none()
}

/// Reports an unknown name, with the nearest of those that are known, among them `others`.
pub fn unknown_name(path: &Path, registry: &Registry, others: &[String]) -> Report {
    let maps = map::BUILTIN.map(|(known, _)| known);
    let worlds: Vec<&str> = registry.named_worlds().map(|kind| kind.name).collect();
    let names = maps.iter().chain(&worlds).copied().chain(others.iter().map(String::as_str));
    let nearest = did_you_mean(known_name(path), names);
    let listed = if worlds.is_empty() { "" } else { "; worlds: " }.to_owned() + &worlds.join(", ");
    from_map_error(MapError::whole_file(
        &path.to_string_lossy(),
        "is neither a built-in map nor a file",
        format!("{nearest}Built-in maps: {}{listed}; or give a map file", maps.join(", ")),
    ))
}
