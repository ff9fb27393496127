//! Loads maps and scenarios from files.

use std::io::ErrorKind;
use std::path::Path;

use super::error::{MapError, MapResult};
use super::formats::{MapFormat, Source};
use super::grid::{Grid, MAX_CELLS, size_limits};
use super::scenario::{Scenario, ScenarioTask, is_scenario};
use crate::files::{self, Format, Mismatch, Wanted};

/// Size limit of a map or scenario file: room for the cells, line endings and a header.
const MAX_BYTES: u64 = 4 * MAX_CELLS as u64;

/// Parses a map in any of the [`FORMATS`](super::FORMATS). Errors refer to it as `file`, whose stem becomes the map's name.
///
/// # Errors
/// Fails on malformed input, with its location.
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
           'gdg-tui maps --help'",
    // A scenario gets an error of its own, with its location.
    own: &[Format::Map, Format::Scenario, Format::Text],
};

/// What is read as a scenario.
const SCENARIO: Wanted = Wanted {
    name: "a scenario",
    help: "a scenario is plain text in Moving AI's format: the line 'version 1', then a task per line",
    own: &[Format::Scenario, Format::Text],
};

/// Reads and parses a map file.
///
/// # Errors
/// Like [`parse_map`]; also if the file cannot be read: missing, a directory, no permission, too
/// large.
pub fn load_map(path: &Path) -> MapResult<Grid> {
    let bytes = read(path, "map").map_err(|error| explained(path, error, &MAP))?;
    let file = path.to_string_lossy();
    let source = Source::new(&file, &bytes);
    parse(&source).map_err(|error| match MapFormat::by_content(&source) {
        Some(_) => error,
        None => explained(path, error, &MAP),
    })
}

/// Reads a scenario, for any map.
///
/// # Errors
/// The file cannot be read, or is not a scenario.
pub fn read_scenario(path: &Path) -> MapResult<Scenario> {
    let parsed =
        read(path, "scenario").and_then(|bytes| Scenario::parse(&path.to_string_lossy(), &bytes));
    parsed.map_err(|error| explained(path, error, &SCENARIO))
}

/// Reads and parses a scenario for `grid`.
///
/// # Errors
/// Like [`read_scenario`]; also if a task does not fit the map.
pub fn load_scenario(path: &Path, grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    read_scenario(path)?.tasks(grid)
}

/// Parses a scenario for `grid`; errors refer to it as `file`.
///
/// # Errors
/// See [`load_scenario`].
pub fn parse_scenario_bytes(file: &str, bytes: &[u8], grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    Scenario::parse(file, bytes)?.tasks(grid)
}

/// Returns an error that names the kind of the file at `path` if that is not `wanted`, else
/// `error`.
fn explained(path: &Path, error: Box<MapError>, wanted: &Wanted) -> Box<MapError> {
    let instead =
        |Mismatch { problem, help }| MapError::whole_file(&path.to_string_lossy(), problem, help);
    wanted.mismatch(path).map_or(error, instead)
}

/// Reads a file that should contain a `kind`: a map or a scenario.
fn read(path: &Path, kind: &str) -> MapResult<Vec<u8>> {
    files::read(path, MAX_BYTES).map_err(|error| {
        let help = format!("give a {kind} file");
        let (problem, help) = match error.kind() {
            ErrorKind::IsADirectory => ("is a directory".to_owned(), help),
            ErrorKind::FileTooLarge => {
                let help = match kind {
                    "map" => size_limits(),
                    _ => help,
                };
                (format!("the file is too large for a {kind}"), help)
            }
            _ => (format!("cannot be read: {error}"), help),
        };
        MapError::whole_file(&path.to_string_lossy(), problem, help)
    })
}
