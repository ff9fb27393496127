//! What is done with the files of runs: plotting, resuming and deleting them.

use std::collections::BTreeSet;
use std::io::{Error, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};

use super::Curves;
use super::list::{Entry, List, name};
use crate::experiment::plot::{self, COLUMN, Options};
use crate::experiment::runs::{Kind, SavedRun, State};
use crate::figure::Format;
use crate::tui::export::EXPORT_FOLDER;
use gdg::files::{self, backup_path, named, unused_path, write_atomically};
use gdg::text::{counted, sanitized};

/// Returns the file that a run can be resumed from.
///
/// # Errors
/// Why it cannot be resumed.
pub fn checkpoint(entry: &Entry) -> Result<&Path, String> {
    let (run, file) = (&entry.run, name(&entry.run.source));
    match &run.checkpoint {
        Some(path) if path.is_file() => Ok(path),
        Some(path) => Err(format!("{file} cannot be resumed: {} is gone", path.display())),
        None if run.kind == Kind::Result => Err(format!(
            "{file} is a result, and its checkpoint was not kept: gdg-tui suite --keep"
        )),
        None => Err(format!("{file} has no checkpoint: it was trained without --save")),
    }
}

/// Returns the checkpoints of the two marked runs, or of the marked and the selected one.
///
/// # Errors
/// Why there are not two to compare.
pub fn pair(list: &List) -> Result<[PathBuf; 2], String> {
    let mut runs = list.chosen();
    let selected = list.selected().filter(|entry| list.mark(entry).is_none());
    if let ([_], true) = (&runs[..], list.has_marks()) {
        runs.extend(selected);
    }
    let [a, b] = runs[..] else {
        return Err("mark two runs to compare them".to_owned());
    };
    if a.run.map != b.run.map {
        let [a, b] = [a, b].map(|entry| sanitized(&entry.run.map));
        return Err(format!("runs on different maps cannot be compared: {a} and {b}"));
    }
    Ok([checkpoint(a)?.to_owned(), checkpoint(b)?.to_owned()])
}

/// Draws runs as `gdg-tui plot` does; returns which files were written.
///
/// # Errors
/// What cannot be drawn or written.
pub fn plot(runs: &[&Entry], Curves { measure, axis }: Curves) -> Result<String, String> {
    let runs: Vec<SavedRun> = runs.iter().map(|entry| (*entry.run).clone()).collect();
    let options = Options { y: measure, x: axis, width: COLUMN, ..Options::default() };
    let drawn = plot::draw(&runs, &options).map_err(|problem| problem.to_string())?;
    let stem = format!("runs-{}", measure.name());
    let mut written = Vec::new();
    let mut write = |extension: &str, bytes: &[u8]| {
        let path = unused_path(&named(Path::new(EXPORT_FOLDER), &stem, &format!(".{extension}")));
        write_atomically(&path, bytes)
            .map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
        written.push(path.display().to_string());
        Ok::<_, String>(())
    };
    for format in [Format::Svg, Format::Pdf] {
        let bytes = format.encode(&drawn.sheet).map_err(|problem| problem.to_string())?;
        write(format.extension(), &bytes)?;
    }
    write("csv", &drawn.table)?;
    Ok(format!("wrote {}: {}", written.join(", "), drawn.caption))
}

/// Asks whether to delete files.
pub struct Question {
    /// What it asks.
    pub text: String,
    files: Vec<PathBuf>,
}

impl Question {
    /// Asks about the files of runs; `None` if there are none.
    ///
    /// # Errors
    /// A run still goes on.
    pub fn new(runs: &[&Entry]) -> Result<Option<Self>, String> {
        let running = runs.iter().find(|entry| entry.run.state(entry.written) == State::Running);
        if let Some(entry) = running {
            return Err(format!("{} still grows: end its run first", name(&entry.run.source)));
        }
        let files: BTreeSet<&PathBuf> = runs.iter().map(|entry| &entry.run.source).collect();
        let files: Vec<PathBuf> = files.into_iter().cloned().collect();
        let what = match &files[..] {
            [] => return Ok(None),
            [file] => file.display().to_string(),
            files => counted(files.len() as u64, "file"),
        };
        Ok(Some(Self { text: format!("delete {what} for good?"), files }))
    }

    /// Deletes the files; returns what was done.
    ///
    /// # Errors
    /// What could not be deleted, and why.
    pub fn delete(&self) -> Result<String, String> {
        for file in &self.files {
            remove(file).map_err(|error| format!("{} is kept: {error}", file.display()))?;
        }
        Ok(format!("deleted {}", counted(self.files.len() as u64, "file")))
    }
}

/// Removes a file, and the backup of a checkpoint.
fn remove(file: &Path) -> IoResult<()> {
    let in_use = || Error::new(ErrorKind::ResourceBusy, "another program uses it");
    if files::is_in_use(file) {
        return Err(in_use());
    }
    let removed = files::while_locked(file, || {
        // A backup would come back in place of its checkpoint.
        match std::fs::remove_file(backup_path(file)) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => std::fs::remove_file(file),
        }
    });
    removed.unwrap_or_else(|| Err(in_use()))
}
