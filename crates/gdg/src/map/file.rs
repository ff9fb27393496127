//! Reads the bytes of map and scenario files.

use std::io::ErrorKind;
use std::path::Path;

use super::grid::{MAX_CELLS, size_limits};
use super::text::{MapError, MapResult};
use crate::files;

/// Size limit of a map or scenario file: room for the cells, line endings and a header.
const MAX_BYTES: u64 = 4 * MAX_CELLS as u64;

/// Reads a file that should contain a `kind`: a map, a scenario or an image.
pub fn read(path: &Path, kind: &str) -> MapResult<Vec<u8>> {
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
