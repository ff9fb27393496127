//! What the fuzz targets share.

use std::path::PathBuf;

/// Returns a file of this process for readers that take a path, in memory if possible.
pub fn memory_file(ending: &str) -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    folder.join(format!("gdg-tui-fuzz-{}.{ending}", std::process::id()))
}
