//! The metrics of a run as CSV: a line per progress record and per evaluation.

use std::fs::{File, TryLockError};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::{PROGRESS_EVERY_UPDATES, updates_per_second};
use crate::setup::Setup;
use crate::setup::outputs::{create, refuse_existing};
use gdg::files;
use gdg::learn::Losses;
use gdg::printing::eprint_line;
use gdg::text::{counted, grouped};
use gdg::train::{Evaluation, Trainer};

/// Columns of every line.
const PROGRESS: &str = "event,seconds,updates,env_steps,episodes,updates_per_second,critic_loss,\
                        model_loss,actor_loss";
const COLUMNS: usize = 9;

type Metric = fn(&Evaluation) -> Option<f64>;

/// Columns of evaluations, besides success at each distance.
const EVALUATION: [(&str, Metric); 12] = [
    ("coverage", |found| found.coverage),
    ("greedy_success", |found| found.greedy.success),
    ("greedy_spl", |found| found.greedy.spl),
    ("planned_success", |found| found.planned.as_ref()?.success),
    ("planned_spl", |found| found.planned.as_ref()?.spl),
    ("error", |found| Some(found.distance_error?.mape)),
    ("near_error", |found| Some(found.distance_error?.near_mape)),
    ("graph_error", |found| Some(found.distance_error?.graph?.mape)),
    ("candidates", |found| Some(found.bridges.as_ref()?.candidates as f64)),
    ("edges", |found| Some(found.bridges.as_ref()?.edges as f64)),
    ("false_edges", |found| Some(found.bridges.as_ref()?.false_edges? as f64)),
    ("goal_distance_left", |found| {
        let marked = found.marked?;
        Some(f64::from(marked.planned.unwrap_or(marked.greedy).left_straight?))
    }),
];

/// Distances at which tasks are evaluated, at most.
const DISTANCES: usize = 6;

/// Size limit of a table that a resumed run continues.
const MAX_BYTES: u64 = 1 << 30;

/// Returns the first line. No name and no number contains a comma.
fn head() -> String {
    let names = PROGRESS.split(',').chain(EVALUATION.map(|(name, _)| name)).map(str::to_owned);
    let at = |actor: &'static str| (1..=DISTANCES).map(move |i| format!("{actor}_success_{i}"));
    names.chain(at("greedy")).chain(at("planned")).collect::<Vec<_>>().join(",")
}

/// The table, while it is written.
pub struct MetricsTable {
    /// Where it was opened, and where it is.
    given: PathBuf,
    path: PathBuf,
    file: File,
    /// All of it.
    text: String,
    /// How much of that the file has, in bytes: the rest could not be written yet, as on a full disk.
    written: usize,
}

impl MetricsTable {
    /// Opens the table of the run in `setup`: a new file, or that of a resumed run, as it was when
    /// the run was saved.
    pub fn open(path: &Path, overwrite: bool, setup: &Setup) -> Result<Self, Report> {
        let in_use = || {
            let help = "give --csv another name";
            miette!(help = help, "{}: another run is writing this table", path.display())
        };
        if files::is_in_use(path) {
            return Err(in_use());
        }
        let is_there = setup.resumed.is_some() && path.exists();
        let (file, text) = match is_there.then(|| go_on(path, setup)) {
            Some(Err(_)) if overwrite => (create(path, true)?, String::new()),
            Some(found) => found?,
            None => (create(path, overwrite)?, String::new()),
        };
        // Held until the table is closed; where there are no locks, others can write it.
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(in_use());
        }
        let (given, written) = (path.to_owned(), text.len());
        let mut table = Self { path: given.clone(), given, file, text, written };
        if table.text.is_empty() {
            table.text = head() + "\n";
            let written = table.put().into_diagnostic();
            written.wrap_err_with(|| format!("{}: cannot be written", path.display()))?;
        }
        Ok(table)
    }

    /// Adds a line: the trainer's progress, and an evaluation if there is one. If the file cannot be
    /// written, reports that; training continues, and the line is tried again with the next one.
    pub fn add(&mut self, trainer: &Trainer, evaluation: Option<&Evaluation>) {
        self.write(&row(trainer, evaluation));
    }

    fn write(&mut self, row: &str) {
        let is_first = self.written == self.text.len();
        self.text += row;
        if let Err(error) = self.put()
            && is_first
        {
            let path = self.path.display();
            let then = "rows are missing until the next that can be";
            eprint_line(&format!("{path}: cannot be written, {then}: {error}"));
        }
    }

    /// Writes what the file lacks; all of it to another one, if somebody has deleted, moved or changed
    /// the file, as by an editor.
    fn put(&mut self) -> std::io::Result<()> {
        let (before, all) = (self.written, self.text.len());
        if self.is_at_path(before) {
            self.file.seek(SeekFrom::Start(before as u64))?;
            if let Err(error) = self.file.write_all(&self.text.as_bytes()[before..]) {
                // A part of a line may be there.
                let _ = self.file.set_len(before as u64);
                return Err(error);
            }
        }
        if !self.is_at_path(all) {
            let path = files::write_to_unused(&self.given, self.text.as_bytes())?;
            self.file = files::open_or_create(&path)?;
            let _ = self.file.try_lock();
            let (was, now) = (self.path.display(), path.display());
            eprint_line(&format!("{was}: was deleted, moved or changed: all rows are in {now}"));
            self.path = path;
        }
        self.written = all;
        Ok(())
    }

    /// Whether a file of this length is where the table should be.
    fn is_at_path(&self, bytes: usize) -> bool {
        self.path.metadata().is_ok_and(|found| found.len() == bytes as u64)
    }
}

/// Opens the table of a resumed run for more rows, and cuts off those that the run will write
/// again, of which it keeps a copy; returns the others.
fn go_on(path: &Path, setup: &Setup) -> Result<(File, String), Report> {
    refuse_existing(path, true)?;
    let unreadable = |error: std::io::Error| {
        miette!("{}: the table cannot be continued: {error}", path.display())
    };
    let table = files::read(path, MAX_BYTES).map_err(unreadable)?;
    let (kept, last) = rows_to_keep(&table, setup).map_err(|why| {
        let help = "give --csv another name, or --overwrite to replace the file";
        miette!(help = help, "{}: is not the table of the resumed run: {why}", path.display())
    })?;
    let now = setup.trainer.counters().updates;
    let updates = |line: &&str| line.split(',').nth(2).and_then(|cell| cell.parse::<u64>().ok());
    let cut = String::from_utf8_lossy(&table[kept..]);
    let beyond = cut.lines().filter(|line| updates(line) > Some(now)).count() as u64;
    if beyond > 0 {
        // They may be all that is left of a run that an older copy of it goes on from.
        let copy = files::write_to_unused(path, &table).map_err(unreadable)?;
        let (path, rows, now) = (path.display(), counted(beyond, "row"), grouped(now));
        let copy = copy.display();
        eprint_line(&format!("{path}: removed {rows} beyond update {now}: all are in {copy}"));
    }
    let file = files::open_or_create(path).map_err(unreadable)?;
    file.set_len(kept as u64).map_err(unreadable)?;
    if last / PROGRESS_EVERY_UPDATES < now / PROGRESS_EVERY_UPDATES {
        let [last, now] = [last, now].map(grouped);
        let path = path.display();
        eprint_line(&format!("{path}: has no rows of updates {last} to {now}, without --csv"));
    }
    Ok((file, String::from_utf8_lossy(&table[..kept]).into_owned()))
}

/// Returns a line of the table; what is missing is empty.
fn row(trainer: &Trainer, evaluation: Option<&Evaluation>) -> String {
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    let (counters, losses) = (trainer.counters(), trainer.losses());
    let mut row = vec![
        if evaluation.is_some() { "evaluation" } else { "progress" }.to_owned(),
        format!("{:.3}", trainer.seconds()),
    ];
    row.extend([counters.updates, counters.env_steps, counters.episodes].map(|n| n.to_string()));
    row.push(format!("{:.1}", updates_per_second(trainer)));
    row.extend(self::losses([losses.critic, losses.model, losses.actor]));
    row.extend(EVALUATION.map(|(_, metric)| number(evaluation.and_then(metric))));
    let planned = evaluation.and_then(|found| found.planned.as_ref());
    for score in [evaluation.map(|found| &found.greedy), planned] {
        row.extend(
            (0..DISTANCES).map(|i| number(score.and_then(|s| s.by_distance.get(i)?.success))),
        );
    }
    row.join(",") + "\n"
}

fn losses<const N: usize>(losses: [f32; N]) -> [String; N] {
    losses.map(|loss| Losses::known(loss).map_or(String::new(), |loss| loss.to_string()))
}

/// Returns the length in bytes of the rows in `table` that the run in `setup` had written when it
/// was saved, and the updates of the last one. Later rows, and a last one that was cut off, are to be
/// written again; if all are later, they may be another run's.
fn rows_to_keep(table: &[u8], setup: &Setup) -> Result<(usize, u64), String> {
    let Setup { trainer, limits, .. } = setup;
    let (now, history) = (trainer.counters().updates, trainer.history());
    // An evaluation may have followed the save; one that ends the run is made again.
    let is_evaluated = history.evaluations().iter().any(|(updates, _)| *updates == now)
        && trainer.limit_reached(limits).is_none();
    let mut lines = table.split_inclusive(|byte| *byte == b'\n');
    let Some(first) = lines.next() else { return Ok((0, now)) };
    let head = head();
    if first.trim_ascii_end() != head.as_bytes() {
        return Err("it is not a table of metrics, or has other columns".to_owned());
    }
    let (mut kept, mut last) = (first.len(), 0);
    for (line, number) in lines.filter(|line| line.ends_with(b"\n")).zip(2..) {
        let text = String::from_utf8_lossy(line);
        let cells: Vec<&str> = text.trim_end().split(',').collect();
        let updates = cells.get(2).and_then(|cell| cell.parse::<u64>().ok());
        let updates = updates.filter(|_| cells.len() == head.split(',').count());
        let updates = updates.ok_or_else(|| format!("line {number} is not a row of one"))?;
        // The history is thinned: it knows the losses of some rows.
        let points = history.points();
        if let Ok(i) = points.binary_search_by_key(&updates, |point| point.updates)
            && let losses = losses(points[i].losses)
            && losses[..] != cells[COLUMNS - losses.len()..COLUMNS]
        {
            return Err(format!("line {number} is of another run"));
        }
        if updates > now && kept == first.len() {
            return Err("all of its rows are later".to_owned());
        }
        last = updates.min(now);
        if updates > now || updates == now && cells[0] == "evaluation" && !is_evaluated {
            break;
        }
        kept += line.len();
    }
    Ok((kept, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_could_not_be_written_come_with_the_next_one_and_go_with_the_table() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let read = |name: &str| std::fs::read_to_string(path(name)).expect("a table");
        std::fs::write(path("m.csv"), "1\n").expect("written");
        let file = File::open(path("m.csv")).expect("one that cannot be written");
        let text = "1\n".to_owned();
        let (given, path_now) = (path("m.csv"), path("m.csv"));
        let mut table = MetricsTable { given, path: path_now, file, text, written: 2 };
        table.write("2\n");
        table.file = File::options().write(true).open(path("m.csv")).expect("a file");
        table.write("3\n");
        assert_eq!(read("m.csv"), "1\n2\n3\n");
        std::fs::rename(path("m.csv"), path("moved.csv")).expect("moved");
        table.write("4\n");
        // As by an editor: what it has saved is left alone.
        for edited in ["m.csv", "m-2.csv"] {
            assert_eq!(read(edited), table.text);
            std::fs::write(path(edited), &table.text[..5]).expect("written");
            table.write("5\n");
            assert_eq!(read(edited), "1\n2\n3");
        }
        assert_eq!(read("m-3.csv"), "1\n2\n3\n4\n5\n5\n");
    }
}
