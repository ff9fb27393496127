//! Writes files atomically; only regular files that are not write-protected are replaced.
//!
//! Features that a file system lacks (hard links, permissions, syncing, locks) are skipped; what it
//! refuses is an error. Programs lock what they write.

use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind, Read, Result, Seek, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use same_file::Handle;
use tempfile::NamedTempFile;

use super::read::{ensure_regular_file, open_or_create};
use super::{MAX_NAME_BYTES, TEMP_AFFIXES, beside, numbered, resolve_links};

/// An unlocked temporary file older than this was left by a killed program.
const STALE_AFTER: Duration = Duration::from_secs(5);

/// Writes a file atomically, creating its folder if needed: the file there is replaced once what
/// was written has been read back. Follows symbolic links, and keeps an existing file's permissions.
///
/// # Errors
/// The system's, or the target is write-protected or not a regular file.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    Target::resolve(path)?.write(bytes, replace)
}

/// Like [`write_atomically`], but follows no symbolic link.
///
/// # Errors
/// See [`write_atomically`]; or there is a symbolic link.
pub fn write_unlinked(path: &Path, bytes: &[u8]) -> Result<()> {
    Target::unlinked(path)?.write(bytes, replace)
}

/// Writes a file at `path`, or at the first unused of `path-2`, `path-3` ..., and returns the path
/// it took.
///
/// # Errors
/// The system's.
pub fn write_to_unused(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    loop {
        let free = unused_path(path);
        match Target::resolve(&free)?.write(bytes, place) {
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
///
/// # Errors
/// The reason why it cannot.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = Target::resolve(path)?;
    let existing = target.folder.ancestors().find(|folder| folder.exists());
    let existing = existing.filter(|folder| !folder.as_os_str().is_empty());
    let scratch = tempfile::Builder::new()
        .prefix(TEMP_AFFIXES.0)
        .suffix(TEMP_AFFIXES.1)
        .tempdir_in(existing.unwrap_or(Path::new(".")))
        .map_err(unnamed)?;
    let folder = scratch.path().to_owned();
    let path = folder.join(target.path.file_name().unwrap_or_default());
    Target { path, folder, ..target }.write(b"gdg-tui", replace).map_err(unnamed)
}

/// Checks, without writing, that a file may be written at `path`: its name, and what exists there.
///
/// # Errors
/// The reason why it may not.
pub fn check_name(path: &Path) -> Result<()> {
    Target::resolve(path).map(drop)
}

/// Like [`check_name`], for [`write_unlinked`].
///
/// # Errors
/// The reason why it may not.
pub fn check_replaceable(path: &Path) -> Result<()> {
    Target::unlinked(path).map(drop)
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
    replace(file, path).inspect_err(|_| {
        if path.metadata().is_ok_and(|found| found.len() == 0) {
            let _ = std::fs::remove_file(path);
        }
    })
}

/// A file to be written: its path with links resolved, and the metadata of the existing file.
struct Target {
    path: PathBuf,
    folder: PathBuf,
    existing: Option<Metadata>,
}

impl Target {
    /// Returns the file that `path` leads to.
    fn resolve(path: &Path) -> Result<Self> {
        Self::at(resolve_links(path)?)
    }

    /// Returns the file at `path`, where no symbolic link is.
    fn unlinked(path: &Path) -> Result<Self> {
        if path.is_symlink() {
            return Err(Error::new(
                ErrorKind::InvalidInput,
                "is a symbolic link, which is not followed here",
            ));
        }
        Self::at(path.to_owned())
    }

    fn at(path: PathBuf) -> Result<Self> {
        let Some(name) = path.file_name() else {
            return Err(Error::new(ErrorKind::InvalidFilename, "is not a file name"));
        };
        if name.len() > MAX_NAME_BYTES {
            let problem = format!(
                "its name has {} bytes, more than the {MAX_NAME_BYTES} of file systems",
                name.len()
            );
            return Err(Error::new(ErrorKind::InvalidFilename, problem));
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
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
            .to_owned();
        Ok(Self { path, folder, existing })
    }

    /// Writes `bytes` to a temporary file next to the target, which `persist` then moves into
    /// place.
    fn write(
        &self,
        bytes: &[u8],
        persist: impl FnOnce(NamedTempFile, &Path) -> Result<()>,
    ) -> Result<()> {
        let missing: Vec<&Path> =
            self.folder.ancestors().take_while(|folder| !folder.exists()).collect();
        let write = || {
            let mut file = self.create_temporary()?;
            file.write_all(bytes).map_err(unnamed)?;
            sync(file.as_file())?;
            if !holds(file.as_file(), bytes)? {
                let problem = "what was written could not be read back: nothing is replaced";
                return Err(Error::new(ErrorKind::InvalidData, problem));
            }
            persist(file, &self.path)?;
            sync_folder(&self.folder)
        };
        write().inspect_err(|_| {
            // Folders created for a failed write are removed.
            missing.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
        })
    }

    /// Creates a temporary file in the target's folder, with the permissions intended for the
    /// target.
    fn create_temporary(&self) -> Result<NamedTempFile> {
        std::fs::create_dir_all(&self.folder)?;
        remove_stale(&self.folder);
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMP_AFFIXES.0).suffix(TEMP_AFFIXES.1);
        // Temporary files are private by default; give a new file the user's default permissions,
        // but none that the existing one lacks: they might not be revocable.
        let mode = self.existing.as_ref().map_or(0o666, |existing| existing.mode() & 0o777);
        builder.permissions(PermissionsExt::from_mode(mode));
        let file = builder.tempfile_in(&self.folder).map_err(unnamed)?;
        // The lock marks the file as being written; without lock support, other processes judge by
        // its age.
        let _ = file.as_file().try_lock();
        if let Some(existing) = &self.existing {
            keep_permissions(existing, file.as_file());
        }
        Ok(file)
    }
}

fn holds(mut file: &File, bytes: &[u8]) -> Result<bool> {
    let mut found = vec![0; bytes.len().min(1 << 20)];
    file.rewind()?;
    for expected in bytes.chunks(found.len().max(1)) {
        let found = &mut found[..expected.len()];
        file.read_exact(found)?;
        if found != expected {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Strips the name of the temporary file, which means nothing to users, from a system error.
fn unnamed(error: Error) -> Error {
    let text = error.to_string();
    let system = text.split_once(" at path \"").map(|(system, _)| Error::new(error.kind(), system));
    system.unwrap_or(error)
}

/// Gives a new file the permissions and the owner of the one that it replaces, as far as the file
/// system allows: some have the same for all files, and only root can write a file for another
/// user.
fn keep_permissions(existing: &Metadata, file: &File) {
    let Ok(new) = file.metadata() else { return };
    if (new.uid(), new.gid()) != (existing.uid(), existing.gid()) {
        let _ = fchown(file, Some(existing.uid()), Some(existing.gid()));
    }
    if new.permissions() != existing.permissions() {
        let _ = file.set_permissions(existing.permissions());
    }
}

/// Syncs a file, so that its contents survive a power failure. Some file systems (mostly network
/// ones) do not support this.
fn sync(file: &File) -> Result<()> {
    match file.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Ok(())
        }
        synced => synced,
    }
}

/// Syncs a folder, so that its entries survive a power failure.
fn sync_folder(folder: &Path) -> Result<()> {
    match File::open(folder) {
        // A folder can be writable but not readable.
        Err(error) if error.kind() == ErrorKind::PermissionDenied => Ok(()),
        folder => sync(&folder?),
    }
}

/// Removes the temporary files in `folder` of programs that were killed while writing.
fn remove_stale(folder: &Path) {
    let ours = |name: &str| name.starts_with(TEMP_AFFIXES.0) && name.ends_with(TEMP_AFFIXES.1);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_str().is_some_and(ours)) {
        let path = entry.path();
        let old = |file: &File| {
            let modified = file.metadata().and_then(|metadata| metadata.modified()).ok();
            modified.and_then(|at| at.elapsed().ok()).is_some_and(|age| age > STALE_AFTER)
        };
        let abandoned = |file: File| old(&file) && file.try_lock().is_ok() && is_at(&file, &path);
        if super::open(&path).is_ok_and(abandoned) {
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
    ///
    /// # Errors
    /// The file cannot be created, or something else is in its place.
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
    // writes.
    let (prefix, suffix) = TEMP_AFFIXES;
    let file = beside(&file, prefix, &format!(".lock{suffix}"));
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

/// Whether a handle returned by [`mark_in_use`] marks the file at `path`.
pub fn is_in_use(path: &Path) -> bool {
    let file = OpenOptions::new().write(true).open(path);
    file.is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

/// Whether `file` is still the file at `path`.
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
    fn a_failure_leaves_no_folder_behind() {
        let folder = folder();
        std::fs::create_dir(folder.path().join("a")).expect("created");
        let target = Target::resolve(&folder.path().join("a/b/c/file")).expect("a file");
        target.write(b"x", |_, _| Err(Error::from(ErrorKind::StorageFull))).expect_err("it fails");
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
        for path in [
            &fifo,
            &protected,
            &circle,
            folder.path(),
            Path::new("/dev/null"),
            Path::new("/dev/full/x"),
        ] {
            assert!(
                write_atomically(path, b"x").is_err() && check_writable(path).is_err(),
                "{}",
                path.display()
            );
        }
        assert_eq!(std::fs::read(&protected).expect("there"), b"mine");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 3);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn errors_do_not_name_temporary_files() {
        // No file can be created there, even by root.
        for error in [write_atomically, |path: &Path, _: &[u8]| check_writable(path)]
            .map(|write| write(Path::new("/proc/self/x"), b"x").expect_err("no place for files"))
        {
            assert!(!error.to_string().contains(TEMP_AFFIXES.0), "{error}");
        }
    }

    #[test]
    fn a_fresh_file_gets_an_unused_name() {
        let folder = folder();
        let path = folder.path().join("run.v2.safetensors");
        let names: Vec<PathBuf> =
            (0..3).map(|_| write_to_unused(&path, b"x").expect("written")).collect();
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
        let mut left: Vec<_> = std::fs::read_dir(folder.path())
            .expect("a folder")
            .flatten()
            .map(|entry| entry.file_name())
            .collect();
        left.sort();
        assert_eq!(left, [".gdg-1.tmp", ".gdg-3.tmp", "file", "somebody's.tmp"]);
    }

    #[test]
    fn a_lock_has_one_holder_and_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("job.lock");
        let held = LockFile::try_at(&path).expect("created").expect("free");
        assert!(LockFile::try_at(&path).expect("opened").is_none());
        drop(held);
        assert!(LockFile::try_at(&path).expect("created").is_some());
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn files_are_replaced_by_one_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
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
        assert!(done.load(Ordering::SeqCst) > 0);
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn a_file_is_in_use_until_its_mark_is_dropped() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        assert!(mark_in_use(&path).is_none() && !is_in_use(&path) && !path.exists());
        std::fs::write(&path, b"1").expect("written");
        let mark = mark_in_use(&path).expect("marked");
        assert!(is_in_use(&path));
        drop(mark);
        assert!(!is_in_use(&path));
    }
}
