//! File access: regular files only, within size limits, replaced atomically.

mod kind;
mod read;
mod write;

use std::ffi::{OsStr, OsString};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

pub use kind::{FileFormat, Mismatch, Wanted};
pub use read::{FileFacts, open, open_or_create, read, read_text};
pub use write::{
    LockFile, check_name, check_writable, is_in_use, mark_in_use, mark_output_in_use, prepare,
    unused_path, while_locked, write_atomically, write_to_unused,
};

use crate::text::beginning;

/// Longest name of a file on common file systems, in bytes.
const MAX_NAME_BYTES: usize = 255;

/// Prefix and suffix of temporary files.
const TEMP_AFFIXES: (&str, &str) = (".gdg-", ".tmp");

/// Maximum length of an extension, in bytes: anything longer is part of the stem.
const MAX_EXTENSION_BYTES: usize = 32;

/// Returns the file in `folder` called `stem` and `end`; a stem that is too long is cut.
pub fn named(folder: &Path, stem: impl AsRef<OsStr>, end: &str) -> PathBuf {
    let (stem, room) = (stem.as_ref(), MAX_NAME_BYTES.saturating_sub(end.len()));
    let is_short = stem.len() <= room;
    let mut name: OsString =
        if is_short { stem.into() } else { beginning(&stem.to_string_lossy(), room).into() };
    name.push(end);
    folder.join(name)
}

/// Returns `path` with a number after the stem of its name: `run-2.safetensors`.
pub fn numbered(path: &Path, number: u64) -> PathBuf {
    let folder = path.parent().unwrap_or(Path::new(""));
    match (path.file_stem(), path.extension().map(OsStr::to_string_lossy)) {
        (Some(stem), Some(extension)) if extension.len() <= MAX_EXTENSION_BYTES => {
            named(folder, stem, &format!("-{number}.{extension}"))
        }
        _ => named(folder, path.file_name().unwrap_or_default(), &format!("-{number}")),
    }
}

/// Maximum length of a chain of symbolic links, as on Linux.
const MAX_LINKS: usize = 40;

/// Returns whether a file has this extension, ignoring case.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// Returns whether a file is hidden: macOS puts a `._NAME` beside every `NAME` on foreign file
/// systems.
pub fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// Resolves the symbolic links at `path`; their target need not exist.
fn resolve_links(path: &Path) -> Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match path.symlink_metadata() {
            Ok(metadata) if metadata.is_symlink() => {
                let to = path.read_link()?;
                path = path.parent().map_or(to.clone(), |folder| folder.join(&to));
            }
            _ => return Ok(path),
        }
    }
    Err(Error::new(ErrorKind::InvalidInput, "has too many levels of symbolic links"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the length of a path's name in bytes.
    fn bytes(path: &Path) -> usize {
        path.file_name().expect("a name").len()
    }

    #[test]
    fn short_names_are_kept_and_long_ones_fit() {
        let folder = Path::new("saves");
        assert_eq!(
            named(folder, "rooms", "-auto-5.safetensors"),
            folder.join("rooms-auto-5.safetensors")
        );
        assert_eq!(numbered(Path::new("a/b.v2.safetensors"), 3), Path::new("a/b.v2-3.safetensors"));
        // 3 bytes each: no length is a multiple of all rooms.
        for count in 76..=85 {
            let path = folder.join("迷".repeat(count));
            let names = [
                named(folder, path.file_name().expect("a name"), "-auto-123456.safetensors"),
                numbered(&path.with_added_extension("safetensors"), 12),
                numbered(&path, 2),
            ];
            assert!(
                names.iter().all(|name| bytes(name) <= MAX_NAME_BYTES && name.to_str().is_some())
            );
        }
    }
}
