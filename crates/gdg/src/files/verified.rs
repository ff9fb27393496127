//! Replaces files that must not be lost: the previous version is kept until the new one has been
//! read back.

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

use super::derived::backup_path;
use super::read::read;
use super::write::{Target, replace, sync_folder};

/// Writes a file like [`super::write_atomically`] and reads it back: it must be equal, and
/// `is_valid`. Until then the previous version is kept at its [`backup_path`]; it is restored if
/// the check fails.
///
/// # Errors
/// Returns the system's error, or an error if the check fails.
pub fn write_verified(path: &Path, bytes: &[u8], is_valid: impl Fn(&[u8]) -> bool) -> Result<()> {
    let target = Target::resolve(path)?;
    let backup = backup_path(&target.path);
    // Make the backup only after the new file has been written next to the target, so that a full
    // disk changes nothing.
    target.write(bytes, |file, path| {
        keep_backup(&target, &backup, &is_valid)?;
        replace(file, path)
    })?;
    if read_all(&target.path).is_ok_and(|found| found == bytes && is_valid(&found)) {
        // The new file is in place, whether or not the old one can be removed.
        let _ = std::fs::remove_file(&backup);
        return Ok(());
    }
    if backup.symlink_metadata().is_ok() {
        std::fs::rename(&backup, &target.path)?;
        sync_folder(
            target.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")),
        )?;
    }
    Err(Error::new(
        ErrorKind::InvalidData,
        "the new file could not be read back; the previous one is kept",
    ))
}

/// Keeps the existing file of `target` as `backup`.
fn keep_backup(target: &Target, backup: &Path, is_valid: impl Fn(&[u8]) -> bool) -> Result<()> {
    // A program that was killed left an existing backup: replace it only if the file itself is
    // good.
    let left_behind = backup.symlink_metadata().is_ok();
    if !target.exists()
        || left_behind && !read_all(&target.path).is_ok_and(|found| is_valid(&found))
    {
        return Ok(());
    }
    if left_behind {
        std::fs::remove_file(backup)?;
    }
    // A hard link, so that the file exists under some name at every moment; a copy where links are
    // not possible.
    if std::fs::hard_link(&target.path, backup).is_err() {
        target.called(backup.to_owned()).write(&read_all(&target.path)?, replace)?;
    }
    Ok(())
}

fn read_all(path: &Path) -> Result<Vec<u8>> {
    read(path, u64::MAX - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_read_back_does_not_replace_a_good_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        let is_valid = |bytes: &[u8]| bytes.starts_with(b"good");
        write_verified(&path, b"good 1", is_valid).expect("written");
        write_verified(&path, b"bad", is_valid).expect_err("not good");
        assert_eq!(std::fs::read(&path).expect("there"), b"good 1");
        write_verified(&path, b"good 2", is_valid).expect("written");
        assert_eq!(std::fs::read(&path).expect("there"), b"good 2");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "no backup");
        let copy = folder.path().join("file.bak");
        std::fs::write(&copy, b"the user's own").expect("written");
        write_verified(&path, b"good 3", is_valid).expect("written");
        assert_eq!(std::fs::read(&copy).expect("there"), b"the user's own");
    }

    #[test]
    fn a_leftover_backup_is_replaced_only_by_a_good_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        let is_valid = |bytes: &[u8]| bytes.starts_with(b"good");
        std::fs::write(&path, b"broken").expect("written");
        std::fs::write(backup_path(&path), b"good 1").expect("written");
        write_verified(&path, b"bad", is_valid).expect_err("not good");
        assert_eq!(std::fs::read(&path).expect("there"), b"good 1", "the broken file is not kept");
        std::fs::write(backup_path(&path), b"good 0").expect("written");
        write_verified(&path, b"bad", is_valid).expect_err("not good");
        assert_eq!(std::fs::read(&path).expect("there"), b"good 1", "the newer good one is kept");
    }
}
