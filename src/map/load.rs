//! Loads maps and scenarios from files.

use std::io::ErrorKind;
use std::path::Path;

use super::ascii::parse_ascii;
use super::error::{MapError, MapResult};
use super::grid::{Grid, MAX_CELLS, size_limits};
use super::movingai::{is_movingai, parse_movingai};
use super::scenario::{ScenarioTask, is_scenario, parse_scenario};
use super::text::Text;
use crate::files;

/// Size limit of a map or scenario file: room for the cells, line endings and a header.
const MAX_BYTES: u64 = 4 * MAX_CELLS as u64;

/// Parses a map in either format. Errors refer to it as `file`, whose stem becomes the map's name.
///
/// # Errors
/// Fails on malformed input, with its location.
pub fn parse_map(file: &str, bytes: &[u8]) -> MapResult<Grid> {
    let text = Text::new(file, bytes)?;
    if is_scenario(&text) {
        let help =
            "give its map here, and the scenario with --scen, or to 'gdg-tui check' as a file whose name ends in .scen";
        return Err(text.line_error(0, "this is a scenario file, not a map", help));
    }
    let name = Path::new(file).file_stem().map_or_else(|| file.to_owned(), |s| s.to_string_lossy().into_owned());
    if is_movingai(&text) { parse_movingai(&name, &text) } else { parse_ascii(&name, &text) }
}

/// Reads and parses a map file.
///
/// # Errors
/// Like [`parse_map`]; also if the file cannot be read: missing, a directory, no permission, too large.
pub fn load_map(path: &Path) -> MapResult<Grid> {
    parse_map(&path.to_string_lossy(), &read(path, "map")?)
}

/// Reads and parses a scenario for `grid`.
///
/// # Errors
/// Like [`load_map`]; also if a task does not fit the map.
pub fn load_scenario(path: &Path, grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    parse_scenario_bytes(&path.to_string_lossy(), &read(path, "scenario")?, grid)
}

/// Parses a scenario for `grid`; errors refer to it as `file`.
///
/// # Errors
/// See [`load_scenario`].
pub fn parse_scenario_bytes(file: &str, bytes: &[u8], grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    parse_scenario(&Text::new(file, bytes)?, grid)
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
