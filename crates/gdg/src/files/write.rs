//! Writes files atomically; only regular files that are not write-protected are replaced.
//!
//! Features that a file system lacks (hard links, permissions, syncing, locks) are skipped; what it
//! refuses is an error. Programs lock what they write.

use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind, Result, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use same_file::Handle;
use tempfile::NamedTempFile;

use super::read::{ensure_regular_file, open_or_create};
use super::{MAX_NAME_BYTES, TEMP_AFFIXES, numbered, resolve_links};

/// An unlocked temporary file older than this was left by a killed program.
const STALE_AFTER: Duration = Duration::from_secs(5);

/// Writes a file atomically, creating its folder if needed. Follows symbolic links, and keeps an
/// existing file's permissions; a write-protected file is not replaced.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    prepare(path, bytes)?()
}

/// Writes as [`write_atomically`] does, but returns what moves the file into place: of several, all can
/// be written first.
pub fn prepare(path: &Path, bytes: &[u8]) -> Result<impl FnOnce() -> Result<()> + use<>> {
    WriteTarget::resolve(path)?.write(bytes, replace)
}

/// Writes a file at `path`, or at the first unused of `path-2`, `path-3` ..., and returns the path
/// it took.
pub fn write_to_unused(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    loop {
        let free = unused_path(path);
        match WriteTarget::resolve(&free)?.write(bytes, place)?() {
            // Another program took this name first.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            written => return written.map(|()| free),
        }
    }
}

/// Returns `path`, or the first of `path-2`, `path-3` ..., at which there is no file.
pub fn unused_path(path: &Path) -> PathBuf {
    let taken = |path: &PathBuf| path.symlink_metadata().is_ok();
    let paths = std::iter::once(path.to_owned()).chain((2..).map(|number| numbered(path, number)));
    paths.into_iter().find(|path| !taken(path)).unwrap_or_else(|| path.to_owned())
}

/// Checks that a file can be written at `path` right now, in a folder that may have to be created:
/// writes one of the same name into a temporary folder there. Changes nothing.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = WriteTarget::resolve(path)?;
    let existing = target.folder.ancestors().find(|folder| folder.exists());
    let existing = existing.filter(|folder| !folder.as_os_str().is_empty());
    let scratch = tempfile::Builder::new()
        .prefix(TEMP_AFFIXES.0)
        .suffix(TEMP_AFFIXES.1)
        .tempdir_in(existing.unwrap_or(Path::new(".")))
        .map_err(unnamed)?;
    let folder = scratch.path().to_owned();
    let path = folder.join(target.path.file_name().unwrap_or_default());
    let target = WriteTarget { path, folder, ..target };
    target.write(b"gdg-tui", replace).and_then(|place| place()).map_err(unnamed)
}

/// Checks, without writing, that a file may be written at `path`: its name, and what exists there.
pub fn check_name(path: &Path) -> Result<()> {
    WriteTarget::resolve(path).map(drop)
}

/// Moves a temporary file to `path`; replaces the file there.
fn replace(file: NamedTempFile, path: &Path) -> Result<()> {
    file.persist(path).map(drop).map_err(|e| e.error)
}

/// Moves a temporary file to `path` unless something is there.
fn place(file: NamedTempFile, path: &Path) -> Result<()> {
    let file = match file.persist_noclobber(path) {
        Ok(_) => return Ok(()),
        Err(e) if e.error.kind() == ErrorKind::AlreadyExists => return Err(e.error),
        Err(e) => e.file,
    };
    // The file system can neither link nor rename without replacing: an empty file keeps others
    // from the name.
    drop(File::create_new(path)?);
    replace(file, path).inspect_err(|_| drop(std::fs::remove_file(path)))
}

/// A file to be written: its path with links resolved, and the metadata of the existing file.
struct WriteTarget {
    path: PathBuf,
    folder: PathBuf,
    existing: Option<Metadata>,
}

impl WriteTarget {
    fn resolve(path: &Path) -> Result<Self> {
        if path.starts_with("~") && !Path::new("~").exists() {
            let problem = "~ is not replaced here as in a shell: give the folder itself";
            return Err(Error::new(ErrorKind::InvalidFilename, problem));
        }
        let path = resolve_links(path)?;
        let Some(name) = path.file_name() else {
            return Err(Error::new(ErrorKind::InvalidFilename, "is not a file name"));
        };
        if name.len() > MAX_NAME_BYTES {
            let most = format!("more than the {MAX_NAME_BYTES} of file systems");
            let problem = format!("its name has {} bytes, {most}", name.len());
            return Err(Error::new(ErrorKind::InvalidFilename, problem));
        }
        let existing = match std::fs::metadata(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            existing => Some(existing?),
        };
        if let Some(existing) = &existing {
            ensure_regular_file(existing.file_type())?;
            if existing.permissions().readonly() {
                return Err(Error::new(ErrorKind::PermissionDenied, "is write-protected"));
            }
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        Ok(Self { path, folder, existing })
    }

    /// Writes `bytes` to a temporary file next to the target; returns what has `persist` move it into
    /// place.
    fn write(
        self,
        bytes: &[u8],
        persist: fn(NamedTempFile, &Path) -> Result<()>,
    ) -> Result<impl FnOnce() -> Result<()> + use<>> {
        std::fs::create_dir_all(&self.folder)?;
        remove_stale(&self.folder);
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMP_AFFIXES.0).suffix(TEMP_AFFIXES.1);
        // Temporary files are private by default; give a new file the user's default permissions,
        // but none that the existing one lacks: they might not be revocable.
        let mode = self.existing.as_ref().map_or(0o666, |existing| existing.mode() & 0o777);
        builder.permissions(PermissionsExt::from_mode(mode));
        let mut file = builder.tempfile_in(&self.folder).map_err(unnamed)?;
        // The lock marks the file as being written; without lock support, other processes judge by
        // its age.
        let _ = file.as_file().try_lock();
        if let Some(existing) = &self.existing {
            // Some file systems have the same permissions for all files, and only root can write a
            // file for another user.
            let _ = fchown(file.as_file(), Some(existing.uid()), Some(existing.gid()));
            let _ = file.as_file().set_permissions(existing.permissions());
        }
        file.write_all(bytes).map_err(unnamed)?;
        sync(file.as_file())?;
        Ok(move || {
            persist(file, &self.path)?;
            match File::open(&self.folder) {
                // A folder can be writable but not readable.
                Err(error) if error.kind() == ErrorKind::PermissionDenied => Ok(()),
                folder => sync(&folder?),
            }
        })
    }
}

/// Strips the name of the temporary file, which means nothing to users, from a system error.
fn unnamed(error: Error) -> Error {
    let text = error.to_string();
    let system = text.split_once(" at path \"").map(|(system, _)| Error::new(error.kind(), system));
    system.unwrap_or(error)
}

/// Syncs a file or a folder, so that its contents survive a power failure. Some file systems (mostly
/// network ones) do not support this.
fn sync(file: &File) -> Result<()> {
    match file.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Ok(())
        }
        synced => synced,
    }
}

/// Removes the temporary files in `folder` of programs that were killed while writing.
fn remove_stale(folder: &Path) {
    let ours = |name: &str| name.starts_with(TEMP_AFFIXES.0) && name.ends_with(TEMP_AFFIXES.1);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_old = |found: Metadata| {
        found.modified().is_ok_and(|at| at.elapsed().unwrap_or_default() > STALE_AFTER)
    };
    for entry in entries.filter(|entry| entry.file_name().to_str().is_some_and(ours)) {
        let path = entry.path();
        // Of a check that was killed.
        if entry.metadata().is_ok_and(|found| found.is_dir() && is_old(found)) {
            let _ = std::fs::remove_dir_all(&path);
            continue;
        }
        let abandoned = |file: File| {
            Ok(is_old(file.metadata()?) && file.try_lock().is_ok() && is_at(&file, &path))
        };
        if super::open(&path).and_then(abandoned).unwrap_or(false) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Timeout and polling interval while another program replaces the same file.
const MAX_WAIT: Duration = Duration::from_secs(2);
const RETRY_AFTER: Duration = Duration::from_millis(5);

/// Maximum number of attempts to lock a file that others keep removing. On file systems without
/// stable inodes, it always looks removed.
const MAX_TRIES: usize = 100;

/// A lock file; dropping it removes the file and ends the lock.
#[derive(Debug)]
pub struct LockFile {
    path: PathBuf,
    _file: File,
}

impl LockFile {
    /// Locks the file at `path`, which is created; returns `None` if another program holds it.
    /// Where the file system has no locks, several may hold it.
    pub fn try_at(path: &Path) -> Result<Option<Self>> {
        let mut tries = 0..MAX_TRIES;
        loop {
            let file = open_or_create(path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => return Ok(None),
                // The holder has removed the file since it was opened: the next program would lock
                // a new one.
                Ok(()) if !is_at(&file, path) && tries.next().is_some() => {}
                Ok(()) | Err(TryLockError::Error(_)) => {
                    return Ok(Some(Self { path: path.to_owned(), _file: file }));
                }
            }
        }
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Runs `replace` while no other program can replace the file at `path`; returns `None` if another
/// one does so for too long. Where no lock file can be created, nothing is excluded.
pub fn while_locked<T>(path: &Path, replace: impl FnOnce() -> T) -> Option<T> {
    let file = resolve_links(path).unwrap_or_else(|_| path.to_owned());
    // Named like a temporary file: one that a killed program leaves is removed by the next that
    // writes. A checksum, as names may be too long for more.
    let name = crc32fast::hash(file.file_name().unwrap_or_default().as_encoded_bytes());
    let file = file.with_file_name(format!("{}{name:08x}.lock{}", TEMP_AFFIXES.0, TEMP_AFFIXES.1));
    let began = Instant::now();
    loop {
        match LockFile::try_at(&file) {
            Ok(None) if began.elapsed() > MAX_WAIT => return None,
            Ok(None) => std::thread::sleep(RETRY_AFTER),
            _lock @ (Ok(Some(_)) | Err(_)) => return Some(replace()),
        }
    }
}

/// Marks the file at `path` as in use until the returned handle is dropped; returns `None` where
/// that is not possible.
pub fn mark_in_use(path: &Path) -> Option<File> {
    let file = OpenOptions::new().write(true).open(path).ok()?;
    file.try_lock().ok().map(|()| file)
}

/// Marks the file that standard output goes to, if it is one, as in use until the program ends.
pub fn mark_output_in_use() {
    let output = std::io::stdout().as_fd().try_clone_to_owned();
    // What is locked is the open file, which this handle shares.
    let _ = output.map(|output| File::from(output).try_lock_shared());
}

/// Whether a program has marked the file at `path`.
pub fn is_in_use(path: &Path) -> bool {
    let file = OpenOptions::new().write(true).open(path);
    file.is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

pub(super) fn is_at(file: &File, path: &Path) -> bool {
    let own = file.try_clone().and_then(Handle::from_file);
    own.is_ok_and(|own| Handle::from_path(path).is_ok_and(|found| found == own))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::SystemTime;

    use super::*;

    fn folder() -> tempfile::TempDir {
        tempfile::tempdir().expect("a folder")
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("a folder").flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn writing_keeps_permissions_and_links_and_leaves_nothing_else() {
        let folder = folder();
        let path = |name: &str| folder.path().join(name);
        check_writable(&path("a/b/file")).expect("writable");
        assert!(names(folder.path()).is_empty(), "checking creates no folder");
        std::fs::write(path("real"), b"old").expect("written");
        std::fs::set_permissions(path("real"), PermissionsExt::from_mode(0o600)).expect("set");
        symlink("real", path("link")).expect("a link");
        write_atomically(&path("link"), b"new").expect("written");
        assert!(path("link").is_symlink());
        let mode = path("real").metadata().expect("a file").mode() & 0o777;
        assert_eq!((std::fs::read(path("real")).expect("there"), mode), (b"new".to_vec(), 0o600));
        symlink("sub/later", path("dangling")).expect("a link");
        write_atomically(&path("dangling"), b"1").expect("written");
        assert_eq!(std::fs::read(path("sub/later")).expect("there"), b"1");
        assert_eq!(names(folder.path()), ["dangling", "link", "real", "sub"]);
    }

    #[test]
    fn special_and_write_protected_files_are_left_untouched() {
        let folder = folder();
        let [fifo, protected, circle] =
            ["fifo", "protected", "circle"].map(|name| folder.path().join(name));
        nix::unistd::mkfifo(&fifo, nix::sys::stat::Mode::S_IRWXU).expect("a FIFO");
        std::fs::write(&protected, b"mine").expect("written");
        std::fs::set_permissions(&protected, PermissionsExt::from_mode(0o444)).expect("set");
        symlink("circle", &circle).expect("a link");
        let others = ["/dev/null", "/dev/full/x", "/proc/self/x", "~/x"].map(Path::new);
        for path in [&*fifo, &protected, &circle, folder.path()].into_iter().chain(others) {
            for result in [write_atomically(path, b"x"), check_writable(path)] {
                let error = result.expect_err("not a file to be replaced").to_string();
                assert!(!error.contains(TEMP_AFFIXES.0), "{}: {error}", path.display());
            }
        }
        assert_eq!(std::fs::read(&protected).expect("there"), b"mine");
        assert_eq!(names(folder.path()), ["circle", "fifo", "protected"]);
    }

    #[test]
    fn names_are_unused_and_only_stale_temporary_files_are_removed() {
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
        for (name, age) in [(".gdg-4.tmp", 10 * STALE_AFTER), (".gdg-5.tmp", Duration::ZERO)] {
            let of_a_check = folder.path().join(name);
            std::fs::create_dir(&of_a_check).expect("a folder");
            std::fs::write(of_a_check.join("run"), b"gdg-tui").expect("written");
            let changed = File::open(&of_a_check).expect("a folder");
            changed.set_modified(SystemTime::now() - age).expect("set");
        }
        for _ in 0..3 {
            write_to_unused(&folder.path().join("run.v2.st"), b"x").expect("written");
        }
        let runs = ["run.v2-2.st", "run.v2-3.st", "run.v2.st"];
        let left = [".gdg-1.tmp", ".gdg-3.tmp", ".gdg-5.tmp"];
        let expected = [&left[..], &runs, &["somebody's.tmp"]].concat();
        assert_eq!(names(folder.path()), expected);
    }

    #[test]
    fn a_lock_has_one_holder_and_leaves_no_file() {
        let folder = folder();
        let path = folder.path().join("job.lock");
        let held = LockFile::try_at(&path).expect("created").expect("free");
        assert!(LockFile::try_at(&path).expect("opened").is_none());
        drop(held);
        assert!(LockFile::try_at(&path).expect("created").is_some());
        assert!(names(folder.path()).is_empty());
        assert!(mark_in_use(&path).is_none() && !is_in_use(&path) && !path.exists());
        std::fs::write(&path, b"1").expect("written");
        let mark = mark_in_use(&path).expect("marked");
        assert!(is_in_use(&path));
        drop(mark);
        assert!(!is_in_use(&path));
    }

    #[test]
    fn files_are_replaced_by_one_at_a_time() {
        let folder = folder();
        let path = folder.path().join("x".repeat(255));
        let (inside, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = || {
            for _ in 0..25 {
                let alone = while_locked(&path, || {
                    let others = inside.fetch_add(1, Ordering::SeqCst);
                    std::thread::yield_now();
                    inside.fetch_sub(1, Ordering::SeqCst);
                    others == 0
                });
                assert_ne!(alone, Some(false));
                done.fetch_add(usize::from(alone.is_some()), Ordering::SeqCst);
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(work))));
        assert!(done.load(Ordering::SeqCst) > 0 && names(folder.path()).is_empty());
    }
}
