//! Writes files atomically, and replaces nothing but regular files that are not write-protected.

use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::NamedTempFile;

use super::read::ensure_regular_file;

/// Prefix and suffix of temporary files.
const TEMP_AFFIXES: (&str, &str) = (".gdg-", ".tmp");

/// An unlocked temporary file older than this was left by a killed program.
const STALE_AFTER: Duration = Duration::from_secs(5);

/// Maximum length of a chain of symbolic links, as on Linux.
const MAX_LINKS: usize = 40;

/// Writes a file atomically, creating its folder if needed. Follows symbolic links, and keeps an existing file's
/// permissions.
///
/// # Errors
/// Returns the system's error, or an error if the target is write-protected or not a regular file.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    Target::resolve(path)?.write(bytes, |file, path| file.persist(path).map_err(|e| e.error))
}

/// Writes a file at `path`, or at the first unused of `path-2`, `path-3` ..., and returns the path it took.
///
/// # Errors
/// Returns the system's error.
pub fn write_to_unused(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    loop {
        let free = unused_path(path);
        let written =
            Target::resolve(&free)?.write(bytes, |file, path| file.persist_noclobber(path).map_err(|e| e.error));
        match written {
            // Another program took this name first.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            written => return written.map(|()| free),
        }
    }
}

/// Returns `path`, or the first of `path-2`, `path-3` ..., at which there is neither a file nor a backup.
pub fn unused_path(path: &Path) -> PathBuf {
    let taken = |path: &Path| path.symlink_metadata().is_ok() || super::backup_path(path).symlink_metadata().is_ok();
    if !taken(path) {
        return path.to_owned();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |e| format!(".{}", e.to_string_lossy()));
    let numbered = (2..).map(|i: u64| path.with_file_name(format!("{stem}-{i}{extension}")));
    numbered.into_iter().find(|path| !taken(path)).unwrap_or_else(|| path.to_owned())
}

/// Checks that a file can be written at `path` right now, in a folder that may have to be created; changes nothing.
///
/// # Errors
/// Returns the reason why it cannot.
pub fn check_writable(path: &Path) -> Result<()> {
    let mut target = Target::resolve(path)?;
    // The run may be refused yet, and leaves no folders behind: those that are missing can be made where this one can be
    // written to.
    let existing = target.folder.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    target.folder = existing.to_owned();
    target.create_temporary().map(|_| ())
}

/// A file to be written: its path with links resolved, and the metadata of the existing file.
pub(super) struct Target {
    pub path: PathBuf,
    folder: PathBuf,
    existing: Option<Metadata>,
}

impl Target {
    pub fn resolve(path: &Path) -> Result<Self> {
        let path = resolve_links(path)?;
        if path.file_name().is_none() {
            return Err(Error::new(ErrorKind::InvalidFilename, "is not a file name"));
        }
        let existing = match std::fs::metadata(&path) {
            Ok(existing) => Some(existing),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        if let Some(existing) = &existing {
            ensure_regular_file(existing.file_type())?;
            if existing.permissions().readonly() {
                return Err(Error::new(ErrorKind::PermissionDenied, "is write-protected"));
            }
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
        Ok(Self { path, folder, existing })
    }

    /// Returns whether the file already exists.
    pub fn exists(&self) -> bool {
        self.existing.is_some()
    }

    /// Writes `bytes` to a temporary file next to the target, which `persist` then moves into place.
    pub fn write<T>(&self, bytes: &[u8], persist: impl FnOnce(NamedTempFile, &Path) -> Result<T>) -> Result<()> {
        let mut file = self.create_temporary()?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        persist(file, &self.path)?;
        sync_folder(&self.folder)
    }

    /// Creates a temporary file in the target's folder, with the permissions intended for the target.
    fn create_temporary(&self) -> Result<NamedTempFile> {
        std::fs::create_dir_all(&self.folder)?;
        remove_stale(&self.folder);
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMP_AFFIXES.0).suffix(TEMP_AFFIXES.1);
        // Temporary files are private by default; give a new file the user's usual permissions.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(&self.folder)?;
        // The lock marks the file as being written; without lock support, other processes judge by its age.
        let _ = file.as_file().try_lock();
        if let Some(existing) = &self.existing {
            file.as_file().set_permissions(existing.permissions())?;
            // Keep the owner; only root can write a file for another user, so failure is ignored.
            #[cfg(unix)]
            {
                use std::os::unix::fs::MetadataExt;
                let _ = std::os::unix::fs::fchown(file.as_file(), Some(existing.uid()), Some(existing.gid()));
            }
        }
        Ok(file)
    }
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

/// Syncs a folder, so that its entries survive a power failure.
pub(super) fn sync_folder(folder: &Path) -> Result<()> {
    #[cfg(unix)]
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems (mostly network ones) do not support this.
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {}
        synced => return synced,
    }
    let _ = folder;
    Ok(())
}

/// Removes the temporary files in `folder` of programs that were killed while writing.
fn remove_stale(folder: &Path) {
    let ours = |name: &str| name.starts_with(TEMP_AFFIXES.0) && name.ends_with(TEMP_AFFIXES.1);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_str().is_some_and(ours)) {
        let old = |file: &File| {
            let modified = file.metadata().and_then(|metadata| metadata.modified()).ok();
            modified.and_then(|at| at.elapsed().ok()).is_some_and(|age| age > STALE_AFTER)
        };
        if super::open(&entry.path()).is_ok_and(|file| old(&file) && file.try_lock().is_ok()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::time::SystemTime;

    use super::*;

    fn folder() -> tempfile::TempDir {
        tempfile::tempdir().expect("a folder")
    }

    fn mode(path: &Path) -> u32 {
        path.metadata().expect("a file").permissions().mode() & 0o777
    }

    #[test]
    fn checking_leaves_no_folder_behind() {
        let folder = folder();
        check_writable(&folder.path().join("a/b/file")).expect("writable");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
        std::fs::create_dir(folder.path().join("a")).expect("created");
        check_writable(&folder.path().join("a/b/file")).expect("writable");
        assert!(folder.path().join("a").is_dir() && !folder.path().join("a/b").exists());
    }

    #[test]
    fn writing_keeps_permissions_and_links_and_leaves_no_temporary_file() {
        let folder = folder();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        std::fs::write(&real, b"old").expect("written");
        std::fs::set_permissions(&real, PermissionsExt::from_mode(0o600)).expect("set");
        symlink("real", &link).expect("a link");
        write_atomically(&link, b"new").expect("written");
        assert!(link.symlink_metadata().expect("there").is_symlink());
        assert_eq!((std::fs::read(&real).expect("there"), mode(&real)), (b"new".to_vec(), 0o600));
        let dangling = folder.path().join("dangling");
        symlink("sub/later", &dangling).expect("a link");
        write_atomically(&dangling, b"1").expect("written");
        assert_eq!(std::fs::read(folder.path().join("sub/later")).expect("there"), b"1");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 4);
    }

    #[test]
    fn special_and_write_protected_files_are_left_untouched() {
        let folder = folder();
        let fifo = folder.path().join("fifo");
        nix::unistd::mkfifo(&fifo, nix::sys::stat::Mode::S_IRWXU).expect("a FIFO");
        let protected = folder.path().join("protected");
        std::fs::write(&protected, b"mine").expect("written");
        std::fs::set_permissions(&protected, PermissionsExt::from_mode(0o444)).expect("set");
        let circle = folder.path().join("circle");
        symlink("circle", &circle).expect("a link");
        for path in [&fifo, &protected, &circle, folder.path(), Path::new("/dev/null"), Path::new("/dev/full/x")] {
            assert!(write_atomically(path, b"x").is_err() && check_writable(path).is_err(), "{}", path.display());
        }
        assert_eq!(std::fs::read(&protected).expect("there"), b"mine");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 3);
    }

    #[test]
    fn a_fresh_file_gets_an_unused_name() {
        let folder = folder();
        let path = folder.path().join("run.v2.safetensors");
        let names: Vec<PathBuf> = (0..3).map(|_| write_to_unused(&path, b"x").expect("written")).collect();
        let expected = ["run.v2.safetensors", "run.v2-2.safetensors", "run.v2-3.safetensors"];
        assert_eq!(names, expected.map(|name| folder.path().join(name)));
    }

    #[test]
    fn stale_temporary_files_are_removed_and_active_ones_kept() {
        let folder = folder();
        let old = |name: &str| {
            let file = File::create(folder.path().join(name)).expect("a file");
            file.set_modified(SystemTime::now() - 10 * STALE_AFTER).expect("set");
            file
        };
        let written = old(".gdg-1.tmp");
        written.try_lock().expect("a lock");
        for name in [".gdg-2.tmp", "somebody's.tmp"] {
            old(name);
        }
        File::create(folder.path().join(".gdg-3.tmp")).expect("a file");
        write_atomically(&folder.path().join("file"), b"x").expect("written");
        let mut left: Vec<_> =
            std::fs::read_dir(folder.path()).expect("a folder").flatten().map(|entry| entry.file_name()).collect();
        left.sort();
        assert_eq!(left, [".gdg-1.tmp", ".gdg-3.tmp", "file", "somebody's.tmp"]);
    }
}
