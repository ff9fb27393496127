//! What tells files apart without reading them.

use std::path::Path;
use std::time::SystemTime;

/// Metadata that identifies a file. It differs between files; for the same file, it may change
/// where inodes are not stable or times are rounded later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileFacts {
    /// Its length.
    pub bytes: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl FileFacts {
    /// Returns those of the file at `path`, if there is one.
    pub fn of(path: &Path) -> Option<Self> {
        let facts = std::fs::metadata(path).ok()?;
        #[cfg(unix)]
        let inode = std::os::unix::fs::MetadataExt::ino(&facts);
        #[cfg(not(unix))]
        let inode = 0;
        Some(Self { bytes: facts.len(), modified: facts.modified().ok(), inode })
    }
}
