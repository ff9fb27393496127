//! What is done with the files of runs: plotting, resuming and deleting them.

use std::collections::BTreeSet;
use std::io::{Error, ErrorKind, Result as IoResult};
use std::iter;
use std::path::{Path, PathBuf};

use super::list::{Entry, List, name};
use super::{Curves, Saved};
use crate::experiment::plot::{self, COLUMN, Options};
use crate::experiment::runs::{Kind, SavedRun, State, file as read};
use crate::figure::Format;
use crate::tui::export::EXPORT_FOLDER;
use gdg::files::{self, unused_path, write_atomically};
use gdg::pulse::Progress;
use gdg::text::{counted, sanitized};

/// Returns the file that a run can be resumed from.
///
/// # Errors
/// Why it cannot be resumed.
fn checkpoint(entry: &Entry) -> Result<&Path, String> {
    let (run, file) = (&entry.run, name(&entry.run.source));
    match &run.checkpoint {
        Some(path) if path.is_file() => {
            // The file that records name may have been replaced since.
            let now = if *path == run.source { Vec::new() } else { read(path).unwrap_or_default() };
            match now.first().filter(|now| !now.is_same(run)) {
                Some(now) => Err(format!(
                    "{file} cannot be resumed: {} is another run by now, with seed {} on {}",
                    path.display(),
                    now.seed,
                    now.map
                )),
                None => Ok(path),
            }
        }
        Some(path) => Err(format!("{file} cannot be resumed: {} is gone", path.display())),
        None if run.kind == Kind::Result => Err(format!(
            "{file} is a result, and its checkpoint was not kept: gdg-tui suite --keep"
        )),
        None => Err(format!("{file} has no checkpoint: it was trained without --save")),
    }
}

/// Returns a run as it was saved.
///
/// # Errors
/// Why it cannot be resumed.
pub fn saved(entry: &Entry) -> Result<Saved, String> {
    let goes_on = entry.run.state(entry.written) == State::Running;
    checkpoint(entry).map(|file| Saved { file: file.to_owned(), goes_on })
}

/// Returns the two marked runs as they were saved, or of the marked and the selected one.
///
/// # Errors
/// Why there are not two to compare.
pub fn pair(list: &List) -> Result<[Saved; 2], String> {
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
    Ok([saved(a)?, saved(b)?])
}

/// Draws runs as `gdg-tui plot` does; returns which files were written, and what is left out. Says
/// how far it is to `progress`.
///
/// # Errors
/// What cannot be drawn or written.
pub fn plot(
    runs: &[SavedRun],
    Curves { measure, axis }: Curves,
    progress: &Progress,
) -> Result<String, String> {
    progress.begin(0, 2);
    let options = Options { y: measure, x: axis, width: COLUMN, ..Options::default() };
    let drawn = plot::draw(runs, &options).map_err(|problem| problem.to_string())?;
    let figure = |format: Format| format.encode(&drawn.sheet).map_err(|error| error.to_string());
    let files =
        [("svg", figure(Format::Svg)?), ("pdf", figure(Format::Pdf)?), ("csv", drawn.table)];
    let stem =
        unused_stem(&format!("runs-{}", measure.name()), &files.each_ref().map(|file| file.0));
    progress.begin(1, 2);
    for (i, (extension, bytes)) in files.iter().enumerate() {
        progress.set(i, files.len());
        let path = stem.with_extension(extension);
        write_atomically(&path, bytes)
            .map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
    }
    let notes = drawn.notes.into_iter().chain(Format::Pdf.lacking(&drawn.sheet));
    let notes: String = notes.map(|note| format!("; {}", sanitized(&note))).collect();
    Ok(format!("wrote {}.svg, .pdf and .csv: {}{notes}", stem.display(), drawn.caption))
}

/// Returns the first name at which there is no file with any of these extensions.
fn unused_stem(name: &str, extensions: &[&str]) -> PathBuf {
    let names = (2..).map(|number| format!("{name}-{number}"));
    let mut stems =
        iter::once(name.to_owned()).chain(names).map(|name| Path::new(EXPORT_FOLDER).join(name));
    let is_unused = |stem: &PathBuf| {
        let paths = extensions.iter().map(|extension| stem.with_extension(extension));
        paths.into_iter().all(|path| unused_path(&path) == path)
    };
    stems.find(is_unused).unwrap_or_default()
}

/// Asks whether to delete files.
pub struct Question {
    /// What it asks.
    pub title: String,
    /// The files that would be deleted.
    pub files: Vec<PathBuf>,
}

impl Question {
    /// Asks about all files of the chosen runs, or the selected file that cannot be read; `None` if
    /// there are none.
    ///
    /// # Errors
    /// A run in one of the files still goes on.
    pub fn new(list: &List) -> Result<Option<Self>, String> {
        let runs = list.chosen();
        let sources = runs.iter().map(|entry| &entry.run.source);
        let damaged = list.selected_damage().map(|(path, _)| path).filter(|path| path.is_file());
        let files: BTreeSet<&PathBuf> = sources
            .chain(runs.iter().flat_map(|entry| &entry.run.others))
            .chain(damaged.filter(|_| !list.has_marks()))
            .collect();
        let files: Vec<PathBuf> = files.into_iter().cloned().collect();
        if files.is_empty() {
            return Ok(None);
        }
        // A file may have other runs than those chosen.
        let in_files: Vec<&Entry> = files.iter().flat_map(|file| list.of_file(file)).collect();
        let grows = |entry: &&&Entry| entry.run.state(entry.written) == State::Running;
        if let Some(entry) = in_files.iter().find(grows) {
            return Err(format!("{} still grows: end its run first", name(&entry.run.source)));
        }
        let others = match in_files.len().saturating_sub(runs.len()) as u64 {
            0 => String::new(),
            others => format!(" with {} not chosen", counted(others, "run")),
        };
        let title = format!("delete {}{others} for good?", counted(files.len() as u64, "file"));
        Ok(Some(Self { title, files }))
    }

    /// Deletes the files; returns what was done. Says how far it is to `progress`.
    ///
    /// # Errors
    /// What could not be deleted, and why.
    pub fn delete(&self, progress: &Progress) -> Result<String, String> {
        progress.begin(0, 1);
        for (i, file) in self.files.iter().enumerate() {
            progress.set(i, self.files.len());
            remove(file).map_err(|error| format!("{} is kept: {error}", file.display()))?;
        }
        Ok(format!("deleted {}", counted(self.files.len() as u64, "file")))
    }
}

/// Removes a file.
fn remove(file: &Path) -> IoResult<()> {
    let in_use = || Error::new(ErrorKind::ResourceBusy, "another program uses it");
    if files::is_in_use(file) {
        return Err(in_use());
    }
    let removed = files::while_locked(file, || {
        match std::fs::remove_file(file) {
            // What is gone needs no removal.
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    });
    removed.unwrap_or_else(|| Err(in_use()))
}
