//! Reads regular files of bounded size, and detects when one has been replaced.

use std::fs::{File, FileType, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::SystemTime;

use nix::fcntl::OFlag;

use crate::text::line_and_column;

/// What to do with input that is not in a file.
const WRITE_FIRST: &str = "write what is to be read to a file first, and give that";

/// Opens a regular file for reading: a FIFO without a writer would block forever, and a device may
/// have no end.
pub fn open(path: &Path) -> Result<File> {
    if path == Path::new("-") && !path.exists() {
        let problem = format!("standard input is not read here: {WRITE_FIRST}");
        return Err(Error::new(ErrorKind::NotFound, problem));
    }
    let found = std::fs::metadata(path)?;
    ensure_regular_file(found.file_type()).map_err(|error| match error.kind() {
        ErrorKind::InvalidInput => Error::new(error.kind(), format!("{error}: {WRITE_FIRST}")),
        _ => error,
    })?;
    open_with(path, OpenOptions::new().read(true), true)
}

/// Opens a regular file for writing without changing it, or creates an empty one. Follows no
/// symbolic link: its target may be anywhere.
pub fn open_or_create(path: &Path) -> Result<File> {
    if let Ok(found) = std::fs::symlink_metadata(path) {
        ensure_regular_file(found.file_type())?;
    }
    open_with(path, OpenOptions::new().write(true).create(true).truncate(false), false)
}

/// Opens a path whose type has been checked, following a symbolic link only if `follows_links`.
/// Does not block if a FIFO has replaced the file since the check.
fn open_with(path: &Path, options: &mut OpenOptions, follows_links: bool) -> Result<File> {
    let follow = if follows_links { OFlag::empty() } else { OFlag::O_NOFOLLOW };
    let file = options.custom_flags((OFlag::O_NONBLOCK | follow).bits()).open(path)?;
    ensure_regular_file(file.metadata()?.file_type())?;
    Ok(file)
}

/// Reads all of a regular file of at most `max_bytes` bytes.
pub fn read(path: &Path, max_bytes: u64) -> Result<Vec<u8>> {
    let file = open(path)?;
    let size = file.metadata()?.len();
    let too_large = |size: u64| {
        let text = format!("its size of {size} bytes exceeds the limit of {max_bytes}");
        Error::new(ErrorKind::FileTooLarge, text)
    };
    if size > max_bytes {
        return Err(too_large(size));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size as usize).map_err(|_| Error::from(ErrorKind::OutOfMemory))?;
    // The file may grow while it is read, and files in /proc report no size.
    let found = file.take(max_bytes + 1).read_to_end(&mut bytes)? as u64;
    if found > max_bytes { Err(too_large(found)) } else { Ok(bytes) }
}

/// Like [`read`], but returns text, without the byte-order mark that some editors begin a file
/// with.
pub fn read_text(path: &Path, max_bytes: u64) -> Result<String> {
    let text = String::from_utf8(read(path, max_bytes)?).map_err(|e| {
        let valid = e.utf8_error().valid_up_to();
        let (line, column) =
            line_and_column(&String::from_utf8_lossy(&e.as_bytes()[..valid]), valid);
        let text = format!("line {line}, column {column} is not valid UTF-8");
        Error::new(ErrorKind::InvalidData, text)
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Returns an error unless `kind` is a regular file.
pub(super) fn ensure_regular_file(kind: FileType) -> Result<()> {
    if kind.is_file() {
        return Ok(());
    }
    if kind.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "is a directory"));
    }
    let kind_name = match kind {
        kind if kind.is_fifo() => "a FIFO",
        kind if kind.is_socket() => "a socket",
        kind if kind.is_symlink() => "a symbolic link",
        _ => "a device",
    };
    Err(Error::new(ErrorKind::InvalidInput, format!("is {kind_name}, not a regular file")))
}

/// Metadata that identifies a file. It differs between files; for the same file, it may change
/// where inodes are not stable or times are rounded later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileFacts {
    pub bytes: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl FileFacts {
    /// Returns those of the file at `path`, if there is one.
    pub fn of(path: &Path) -> Option<Self> {
        let facts = std::fs::metadata(path).ok()?;
        Some(Self { bytes: facts.len(), modified: facts.modified().ok(), inode: facts.ino() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_opened_and_read_up_to_the_size_limit() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("five"), b"12345").expect("written");
        assert_eq!(read(&path("five"), 5).expect("it fits"), b"12345");
        assert_eq!(read(&path("five"), 4).expect_err("large").kind(), ErrorKind::FileTooLarge);
        assert_eq!(read(folder.path(), 4).expect_err("a folder").kind(), ErrorKind::IsADirectory);
        // What is opened for writing keeps its contents, and no link is followed.
        std::os::unix::fs::symlink("five", path("link")).expect("a link");
        assert!(open_or_create(&path("link")).is_err() && open_or_create(folder.path()).is_err());
        assert!(open_or_create(&path("five")).is_ok() && open_or_create(&path("new")).is_ok());
        let both = ["five", "new"].map(|name| read(&path(name), 9).expect("read"));
        assert_eq!(both, [b"12345".to_vec(), Vec::new()]);
        std::fs::write(path("five"), b"ab\xff").expect("written");
        let error = read_text(&path("five"), 9).expect_err("no text");
        assert!(error.to_string().contains("line 1, column 3"));
        nix::unistd::mkfifo(&path("fifo"), nix::sys::stat::Mode::S_IRWXU).expect("a FIFO");
        let errors = [read(&path("fifo"), 9).err(), read(Path::new("/dev/zero"), 9).err()];
        for error in errors.into_iter().chain([open_or_create(&path("fifo")).err()]) {
            let error = error.expect("no regular file").to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
    }
}
