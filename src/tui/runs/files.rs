//! What is done with the files of runs: resuming, comparing, plotting and deleting them.

use std::collections::BTreeSet;
use std::io::{Error, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};

use super::Wish;
use super::list::{List, Row};
use crate::experiment::plot::{self, Axis, COLUMN, Measure, Options};
use crate::experiment::runs::{Kind, SavedRun, file as read, name};
use crate::figure::Format;
use crate::tui::export::EXPORT_FOLDER;
use gdg::files::{self, unused_path, write_atomically};
use gdg::text::{counted, sanitized};

/// Returns the checkpoint of a row's run, or why it cannot be resumed.
fn checkpoint(row: &Row) -> Result<PathBuf, String> {
    let file = name(row.file());
    let problem = match row.run() {
        None => "it cannot be loaded".to_owned(),
        Some(SavedRun { checkpoint: None, kind: Kind::Result, .. }) => {
            "its checkpoint was not kept (gdg-tui suite --no-keep)".to_owned()
        }
        Some(SavedRun { checkpoint: None, .. }) => "it was trained without --save".to_owned(),
        Some(run @ SavedRun { checkpoint: Some(path), .. }) => {
            // The file that records name may have been replaced since.
            let is_other = |now: &SavedRun| *path != run.source && !now.is_same(run);
            match read(path).ok().and_then(|runs| runs.into_iter().next()) {
                Some(now) if is_other(&now) => {
                    format!("{} is another run by now, with seed {}", path.display(), now.seed)
                }
                _ if !path.is_file() => format!("{} is gone", path.display()),
                _ => return Ok(path.clone()),
            }
        }
    };
    Err(format!("{file} cannot be resumed: {problem}"))
}

fn wish(file: &Row, beside: Option<&Row>) -> Result<Wish, String> {
    let is_growing = [Some(file), beside].into_iter().flatten().any(Row::is_growing);
    let warning = is_growing.then(|| {
        "another program still trains this: what is shown is a copy, as last saved; of the two, \
         the one that saves second does so to another name"
            .to_owned()
    });
    Ok(Wish { file: checkpoint(file)?, beside: beside.map(checkpoint).transpose()?, warning })
}

pub fn to_resume(list: &List) -> Result<Wish, String> {
    wish(list.selected().ok_or("no run is selected")?, None)
}

/// Returns the wish to see the two marked runs, or the marked and the selected one, side by side.
pub fn to_compare(list: &List) -> Result<Wish, String> {
    let mut rows: Vec<&Row> = list.marked().values().collect();
    if rows.len() == 1 {
        rows.extend(list.selected().filter(|row| list.mark(row).is_none()));
    }
    let [a, b] = rows[..] else { return Err("mark two runs to compare them".to_owned()) };
    match [a, b].map(|row| row.run().map(|run| sanitized(&run.map))) {
        [Some(a), Some(b)] if a != b => {
            Err(format!("runs on different maps cannot be compared: {a} and {b}"))
        }
        _ => wish(a, Some(b)),
    }
}

/// Draws the curves of rows' runs to files, as `gdg-tui plot` does; returns what was written, and
/// what is left out.
pub fn plot(rows: &[&Row], measure: Measure, axis: Axis) -> Result<String, String> {
    let runs: Vec<SavedRun> = rows.iter().filter_map(|row| row.run().cloned()).collect();
    let options = Options { y: measure, x: axis, width: COLUMN, ..Options::default() };
    let drawn = plot::draw(&runs, &options).map_err(|problem| problem.to_string())?;
    let figure = |format: Format| format.encode(&drawn.sheet).map_err(|error| error.to_string());
    let mut written = Vec::new();
    for (extension, bytes) in
        [("svg", figure(Format::Svg)?), ("pdf", figure(Format::Pdf)?), ("csv", drawn.table)]
    {
        let file = format!("runs-{}.{extension}", measure.name());
        let path = unused_path(&Path::new(EXPORT_FOLDER).join(file));
        write_atomically(&path, &bytes)
            .map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
        written.push(path.display().to_string());
    }
    let notes = drawn.notes.into_iter().chain(Format::Pdf.lacking(&drawn.sheet));
    let notes: String = notes.map(|note| format!("; {}", sanitized(&note))).collect();
    Ok(format!("wrote {}: {}{notes}", written.join(", "), drawn.caption))
}

/// Files to delete, once the user agrees.
pub struct Deletion {
    /// What the user is asked.
    pub question: String,
    pub files: BTreeSet<PathBuf>,
}

impl Deletion {
    /// Returns the deletion of all files of the marked runs, or else of the selected row, unless one
    /// of them still grows.
    pub fn new(list: &List) -> Result<Self, String> {
        let rows = list.chosen();
        let others = rows.iter().filter_map(|row| row.run()).flat_map(|run| &run.others);
        let all = rows.iter().map(|row| row.file()).chain(others.map(PathBuf::as_path));
        let files: BTreeSet<PathBuf> =
            all.filter(|file| !file.is_dir()).map(Path::to_owned).collect();
        if files.is_empty() {
            return Err("no file is selected".to_owned());
        }
        // A file may have other runs than those chosen.
        let in_files = list.all().iter().filter(|row| files.contains(row.file()));
        if let Some(row) = in_files.clone().find(|row| row.is_growing()) {
            return Err(format!("{} still grows: end its run first", name(row.file())));
        }
        let others = match in_files.count().saturating_sub(rows.len()) as u64 {
            0 => String::new(),
            others => format!(" with {} not chosen", counted(others, "run")),
        };
        let question = format!("delete {}{others} for good?", counted(files.len() as u64, "file"));
        Ok(Self { question, files })
    }

    /// Deletes the files; returns what was done.
    pub fn perform(&self) -> Result<String, String> {
        for file in &self.files {
            remove(file).map_err(|error| format!("{} is kept: {error}", file.display()))?;
        }
        Ok(format!("deleted {}", counted(self.files.len() as u64, "file")))
    }
}

fn remove(file: &Path) -> IoResult<()> {
    let in_use = || Error::new(ErrorKind::ResourceBusy, "another program uses it");
    if files::is_in_use(file) {
        return Err(in_use());
    }
    let removed = files::while_locked(file, || match std::fs::remove_file(file) {
        // What is gone needs no removal.
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    });
    removed.unwrap_or_else(|| Err(in_use()))
}
