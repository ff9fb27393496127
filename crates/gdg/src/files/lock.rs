//! Locks between programs.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::Result;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use same_file::Handle;

use super::read::open_or_create;
use super::{TEMP_AFFIXES, beside, resolve_links};

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
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

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
