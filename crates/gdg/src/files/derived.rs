//! Names made from other names, no longer than file systems allow.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use crate::text::beginning;

/// Longest name of a file on common file systems, in bytes.
pub(super) const MAX_NAME_BYTES: usize = 255;

/// Prefix and suffix of temporary files.
pub(super) const TEMP_AFFIXES: (&str, &str) = (".gdg-", ".tmp");

/// Maximum length of an extension, in bytes: anything longer is part of the stem.
const MAX_EXTENSION_BYTES: usize = 32;

/// Returns the file in `folder` called `stem` and `end`; a stem that is too long is cut.
pub fn named(folder: &Path, stem: impl AsRef<OsStr>, end: &str) -> PathBuf {
    let mut name = fitting(stem.as_ref(), MAX_NAME_BYTES.saturating_sub(end.len()));
    name.push(end);
    folder.join(name)
}

/// Returns `path` with a number after the stem of its name: `run-2.safetensors`.
pub(super) fn numbered(path: &Path, number: u64) -> PathBuf {
    let folder = path.parent().unwrap_or(Path::new(""));
    match (path.file_stem(), path.extension().map(OsStr::to_string_lossy)) {
        (Some(stem), Some(extension)) if extension.len() <= MAX_EXTENSION_BYTES => {
            named(folder, stem, &format!("-{number}.{extension}"))
        }
        _ => named(folder, path.file_name().unwrap_or_default(), &format!("-{number}")),
    }
}

/// Returns the file beside `path` whose name is that of `path` between `prefix` and `suffix`. If
/// that is too long, the name is cut and a checksum keeps it distinct from others that begin alike.
pub(super) fn beside(path: &Path, prefix: &str, suffix: &str) -> PathBuf {
    let own = path.file_name().unwrap_or_default();
    let room = MAX_NAME_BYTES - prefix.len() - suffix.len();
    let mut name = OsString::from(prefix);
    if own.len() <= room {
        name.push(own);
    } else {
        let checksum = format!("-{:08x}", crc32fast::hash(own.as_encoded_bytes()));
        name.push(fitting(own, room - checksum.len()));
        name.push(checksum);
    }
    name.push(suffix);
    path.with_file_name(name)
}

/// Returns where the previous version of `path` is kept until the new one has been read back: under
/// a name that no user would give to a copy, since it is removed afterwards.
pub fn backup_path(path: &Path) -> PathBuf {
    beside(path, "", ".gdg-previous")
}

/// Returns the beginning of a name in at most `max_bytes` bytes.
pub(super) fn fitting(name: &OsStr, max_bytes: usize) -> OsString {
    if name.len() <= max_bytes {
        name.to_owned()
    } else {
        beginning(&name.to_string_lossy(), max_bytes).into()
    }
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
        assert_eq!(beside(Path::new("a/b.csv"), ".gdg-", ".tmp"), Path::new("a/.gdg-b.csv.tmp"));
        // 3 bytes each: no length is a multiple of all rooms.
        for count in 76..=85 {
            let path = folder.join("迷".repeat(count));
            let names = [
                named(folder, path.file_name().expect("a name"), "-auto-123456.safetensors"),
                numbered(&path.with_added_extension("safetensors"), 12),
                numbered(&path, 2),
                beside(&path, "", ".gdg-previous"),
            ];
            assert!(
                names.iter().all(|name| bytes(name) <= MAX_NAME_BYTES && name.to_str().is_some())
            );
        }
    }
}
