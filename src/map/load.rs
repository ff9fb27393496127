//! Files to maps and scenarios.

use std::io::ErrorKind;
use std::path::Path;

use super::ascii::parse_ascii;
use super::error::{MapError, MapResult};
use super::grid::{Grid, MAX_CELLS};
use super::movingai::{is_movingai, parse_movingai};
use super::scenario::{ScenarioTask, parse_scenario};
use super::text::Text;
use crate::files;

/// No map or scenario is larger: cells, line ends and a header.
const MAX_BYTES: u64 = 4 * MAX_CELLS as u64;

/// Parses a map in either format; `file` is how errors name it, its stem how the map is called.
///
/// # Errors
/// Whatever is malformed, with its place.
pub fn parse_map(file: &str, bytes: &[u8]) -> MapResult<Grid> {
    let text = Text::new(file, bytes)?;
    let name = Path::new(file).file_stem().map_or_else(|| file.to_owned(), |s| s.to_string_lossy().into_owned());
    if is_movingai(&text) { parse_movingai(&name, &text) } else { parse_ascii(&name, &text) }
}

/// Reads and parses a map file.
///
/// # Errors
/// Also what cannot be read: no such file, a directory, no permission, too large.
pub fn load_map(path: &Path) -> MapResult<Grid> {
    parse_map(&path.to_string_lossy(), &read(path)?)
}

/// Reads and parses a scenario for `grid`.
///
/// # Errors
/// As [`load_map`], and tasks that do not fit the map.
pub fn load_scenario(path: &Path, grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    parse_scenario_bytes(&path.to_string_lossy(), &read(path)?, grid)
}

/// Parses a scenario for `grid`; `file` is how errors name it.
///
/// # Errors
/// See [`load_scenario`].
pub fn parse_scenario_bytes(file: &str, bytes: &[u8], grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    parse_scenario(&Text::new(file, bytes)?, grid)
}

fn read(path: &Path) -> MapResult<Vec<u8>> {
    files::read(path, MAX_BYTES).map_err(|error| {
        let (file, right) = (path.to_string_lossy(), "give a map's file, or a name from 'gdg-tui maps'".to_owned());
        let (what, right) = match error.kind() {
            ErrorKind::IsADirectory => ("is a directory".to_owned(), "give the file of one map".to_owned()),
            ErrorKind::FileTooLarge => {
                let right = format!("a map may have up to {MAX_CELLS} cells, as 4096 x 4096 has");
                ("the file is too large for a map".to_owned(), right)
            }
            _ => (format!("cannot be read: {error}"), right),
        };
        MapError::whole(&file, what, right)
    })
}
