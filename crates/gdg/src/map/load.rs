//! Loads maps and scenarios from files, and those compiled into the program.

use std::path::Path;

use super::formats::{FORMATS, MapFormat, Source, THRESHOLD, has_agents};
use super::grid::{Grid, MapScale};
use super::ogbench::Ogbench;
use super::scenario::{Scenario, is_scenario};
use super::text_file::{MapError, MapResult, TextFile, read_file};
use crate::files::{FileFormat, Mismatch, Wanted};

/// Name and text of every built-in map; those of OGBench are layouts of blocks.
pub const BUILTIN: [(&str, &str); 8] = [
    ("fourrooms", include_str!("../../maps/fourrooms.txt")),
    ("city", include_str!("../../maps/city.txt")),
    ("trap", include_str!("../../maps/trap.txt")),
    ("dead-end", include_str!("../../maps/dead-end.txt")),
    ("ogbench-pointmaze-medium", include_str!("../../maps/ogbench-pointmaze-medium.txt")),
    ("ogbench-pointmaze-large", include_str!("../../maps/ogbench-pointmaze-large.txt")),
    ("ogbench-pointmaze-giant", include_str!("../../maps/ogbench-pointmaze-giant.txt")),
    ("ogbench-pointmaze-teleport", include_str!("../../maps/ogbench-pointmaze-teleport.txt")),
];

/// Returns the built-in map called `name`.
///
/// # Panics
/// Never: tests check the built-in maps.
pub fn builtin(name: &str) -> Option<Grid> {
    let (name, text) = BUILTIN.iter().find(|(n, _)| *n == name)?;
    let map = parse_map(name, text.as_bytes()).expect("built-in maps are well-formed");
    let benchmark = Ogbench::ALL.into_iter().find(|benchmark| benchmark.name() == *name);
    let Some(benchmark) = benchmark else { return Some(map) };
    let scale = MapScale {
        cell: Ogbench::BLOCK_CELLS,
        margin: Ogbench::BALL_CELLS,
        goal_radius: Ogbench::GOAL_CELLS,
        benchmark: Some(benchmark),
    };
    Some(scale.of(name, &map).expect("layouts have room for their scale"))
}

/// Parses a map in any of the [`FORMATS`]. Errors refer to it as `file`, whose stem becomes the
/// map's name.
pub fn parse_map(file: &str, bytes: &[u8]) -> MapResult<Grid> {
    parse(&Source::new(file, bytes))
}

/// Parses a map, unless it is a scenario.
fn parse(source: &Source) -> MapResult<Grid> {
    if let Ok(text) = &source.text
        && is_scenario(text)
    {
        let help = "give its map here, and the scenario with --scen, or to 'gdg-tui check' as a file whose name ends in .scen";
        return Err(text.line_error(0, "this is a scenario file, not a map", help));
    }
    MapFormat::of(source).read(source)
}

/// What is read as a map.
const MAP: Wanted = Wanted {
    name: "a map",
    help: "a map is plain text: one character per cell ('#' is a wall, '.' is free), or in one of the formats of \
           'gdg-tui maps --help'; images are PNG or PGM",
    // A scenario gets an error of its own, with its location.
    own: &[FileFormat::Map, FileFormat::Scenario, FileFormat::Text],
};

/// What is read as a scenario.
const SCENARIO: Wanted = Wanted {
    name: "a scenario",
    help: "a scenario is plain text in Moving AI's format: the line 'version 1', then a task per line",
    own: &[FileFormat::Scenario, FileFormat::Text],
};

/// How the file of a map is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The scale of the map, unless it has its own.
    pub scale: MapScale,
    /// The brightness, from 0 to 1, below which pixels of images are walls.
    pub threshold: f32,
}

impl Default for Reading {
    fn default() -> Self {
        Self { scale: MapScale::default(), threshold: THRESHOLD }
    }
}

/// Reads and parses a map file.
pub fn load_map(path: &Path) -> MapResult<Grid> {
    load_map_as(path, &Reading::default())
}

/// Reads and parses a map file at a scale.
pub fn load_map_as(path: &Path, reading: &Reading) -> MapResult<Grid> {
    let (_, maze) = load_maze(path, reading.threshold)?;
    reading.scale.of(&path.to_string_lossy(), &maze)
}

/// Reads a map file that replaces `map` while agents move there: a maze that the map's scale
/// enlarges to its size, or one that has it already.
pub fn load_map_like(path: &Path, map: &Grid, threshold: f32) -> MapResult<Grid> {
    let ((_, maze), scale) = (load_maze(path, threshold)?, map.scale());
    let fits =
        |cell: usize| (cell * maze.width(), cell * maze.height()) == (map.width(), map.height());
    if fits(scale.cell) {
        // The run's goal radius counts.
        let maze = maze.with_scale(MapScale::default());
        return scale.of(&path.to_string_lossy(), &maze);
    }
    Ok(if fits(1) { maze.with_scale(scale) } else { maze })
}

/// Reads a map file, a block a cell; returns its format, too.
fn load_maze(path: &Path, threshold: f32) -> MapResult<(&'static MapFormat, Grid)> {
    let bytes = read_file(path, "map").map_err(|error| explained(path, error, &MAP))?;
    let file = path.to_string_lossy();
    let folder = path.parent();
    let source = Source { folder, threshold, ..Source::new(&file, &bytes) };
    let maze = parse(&source).map_err(|error| match MapFormat::by_content(&source) {
        Some(_) => error,
        None => explained(path, error, &MAP),
    });
    Ok((MapFormat::of(&source), maze?))
}

/// Returns the format in which a map is written to `path`: that of the map there, so that plain maps
/// called .map keep their starts and goals, or else the one that the name asks for.
pub fn format_for(path: &Path) -> &'static MapFormat {
    let [.., plain] = &FORMATS;
    let there = load_maze(path, THRESHOLD).ok().map(|(format, _)| format);
    there.or_else(|| MapFormat::by_name(path)).unwrap_or(plain)
}

/// Returns what the map file at `path` has that is lost if `map` is written over it: nothing if it is as
/// this program writes it, but for blanks.
pub fn lost_from(path: &Path, map: &Grid) -> Option<String> {
    let (format, found) = load_maze(path, THRESHOLD).ok()?;
    let is_own = format.write(&found, path).iter().all(|(path, own)| {
        let bare = |byte: &&u8| !byte.is_ascii_whitespace();
        let is = |there: Vec<u8>| there.iter().filter(bare).eq(own.iter().filter(bare));
        read_file(path, "map").is_ok_and(is)
    });
    let size = |map: &Grid| format!("size of {} x {} cells", map.width(), map.height());
    let own = if is_own { size(&found) } else { format.besides.to_owned() };
    (own != size(map)).then_some(own)
}

pub fn read_scenario(path: &Path) -> MapResult<Scenario> {
    let parsed = read_file(path, "scenario")
        .and_then(|bytes| Scenario::parse(&path.to_string_lossy(), &bytes));
    parsed.map_err(|error| explained(path, error, &SCENARIO))
}

/// Reads the agents of a map for planners as a scenario; `None` if the file is another map.
pub fn agents_of(path: &Path) -> MapResult<Option<Scenario>> {
    let Ok(bytes) = read_file(path, "map") else { return Ok(None) };
    let file = path.to_string_lossy();
    let has_agents = TextFile::new(&file, &bytes).is_ok_and(|text| has_agents(&text));
    has_agents.then(|| Scenario::parse(&file, &bytes)).transpose()
}

/// Returns an error that names the kind of the file at `path` if that is not `wanted`, else
/// `error`.
fn explained(path: &Path, error: Box<MapError>, wanted: &Wanted) -> Box<MapError> {
    let instead =
        |Mismatch { problem, help }| MapError::whole_file(&path.to_string_lossy(), problem, help);
    wanted.mismatch(path).map_or(error, instead)
}
