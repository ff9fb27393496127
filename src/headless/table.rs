//! The metrics of a run as CSV: a line per progress record and per evaluation.

use std::fs::{File, TryLockError};
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, StringRecord};
use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::updates_per_second;
use crate::host::outputs::{create, refuse_existing};
use crate::host::setup::Setup;
use gdg::files;
use gdg::learn::Losses;
use gdg::printing::eprint_line;
use gdg::train::{Evaluation, Score, Trainer};

/// Columns of every line.
const PROGRESS: [&str; 9] = [
    "event",
    "seconds",
    "updates",
    "env_steps",
    "episodes",
    "updates_per_second",
    "critic_loss",
    "model_loss",
    "actor_loss",
];

/// Columns of evaluations, besides success at each distance.
const EVALUATION: [&str; 12] = [
    "coverage",
    "greedy_success",
    "greedy_spl",
    "planned_success",
    "planned_spl",
    "error",
    "near_error",
    "graph_error",
    "candidates",
    "edges",
    "false_edges",
    "goal_distance_left",
];

/// Distances at which tasks are evaluated, at most.
const DISTANCES: usize = 6;

/// Size limit of a table that a resumed run continues.
const MAX_BYTES: u64 = 1 << 30;

fn column_names() -> impl Iterator<Item = String> {
    let at = |actor: &'static str| (1..=DISTANCES).map(move |i| format!("{actor}_success_{i}"));
    PROGRESS
        .into_iter()
        .chain(EVALUATION)
        .map(str::to_owned)
        .chain(at("greedy"))
        .chain(at("planned"))
}

/// The table, while it is written.
pub struct Table {
    path: PathBuf,
    /// `None` once writing has failed.
    writer: Option<csv::Writer<File>>,
}

impl Table {
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
        let file = match is_there.then(|| go_on(path, &setup.trainer)) {
            None => create(path, overwrite)?,
            Some(Err(_)) if overwrite => create(path, true)?,
            Some(file) => file?,
        };
        // Held until the table is closed; where there are no locks, others can write it.
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(in_use());
        }
        let is_empty = file.metadata().is_ok_and(|found| found.len() == 0);
        let mut writer = csv::Writer::from_writer(file);
        if is_empty {
            writer.write_record(column_names()).into_diagnostic()?;
            writer
                .flush()
                .into_diagnostic()
                .wrap_err_with(|| format!("{}: cannot be written", path.display()))?;
        }
        Ok(Self { path: path.to_owned(), writer: Some(writer) })
    }

    /// Adds a line: the trainer's progress, and an evaluation if there is one. If the file can no
    /// longer be written, reports that once; training continues.
    pub fn add(&mut self, trainer: &Trainer, evaluation: Option<&Evaluation>) {
        let Some(writer) = &mut self.writer else { return };
        let line = progress(trainer, evaluation.is_some()).into_iter().chain(results(evaluation));
        let written =
            writer.write_record(line).map_err(std::io::Error::from).and_then(|()| writer.flush());
        if let Err(error) = written {
            eprint_line(&format!(
                "{}: cannot be written, so the table ends here: {error}",
                self.path.display()
            ));
            self.writer = None;
        }
    }
}

/// Opens the table of a resumed run for more rows, and cuts off those that the run will write
/// again.
fn go_on(path: &Path, trainer: &Trainer) -> Result<File, Report> {
    refuse_existing(path, true)?;
    let unreadable = |error: std::io::Error| {
        miette!("{}: the table cannot be continued: {error}", path.display())
    };
    let table = files::read(path, MAX_BYTES).map_err(unreadable)?;
    let kept = length_to_keep(&table, trainer).map_err(|why| {
        let help = "give --csv another name, or --overwrite to replace the file";
        miette!(help = help, "{}: is not the table of the resumed run: {why}", path.display())
    })?;
    let is_header = !table[..kept as usize].trim_ascii_end().contains(&b'\n');
    if is_header && table.len() as u64 > kept {
        let copy = files::write_to_unused(path, &table).map_err(unreadable)?;
        let (path, copy) = (path.display(), copy.display());
        eprint_line(&format!(
            "{path}: begins anew, as all of its rows are later; they are in {copy}"
        ));
    }
    let mut file = files::open_or_create(path).map_err(unreadable)?;
    file.set_len(kept).and_then(|()| file.seek(SeekFrom::End(0))).map_err(unreadable)?;
    Ok(file)
}

fn progress(trainer: &Trainer, evaluated: bool) -> Vec<String> {
    let (counters, losses) = (trainer.counters(), trainer.losses());
    let mut line = vec![if evaluated { "evaluation" } else { "progress" }.to_owned()];
    line.push(format!("{:.3}", trainer.seconds()));
    line.extend([counters.updates, counters.env_steps, counters.episodes].map(|n| n.to_string()));
    line.push(format!("{:.1}", updates_per_second(trainer)));
    line.extend(self::losses([losses.critic, losses.model, losses.actor]));
    line
}

/// Returns the columns of the losses; empty for missing losses.
fn losses(losses: [f32; 3]) -> [String; 3] {
    losses.map(|loss| Losses::known(loss).map_or(String::new(), |loss| loss.to_string()))
}

/// Returns the columns of an evaluation; empty for missing numbers.
fn results(evaluation: Option<&Evaluation>) -> Vec<String> {
    let Some(evaluation) = evaluation else {
        return vec![String::new(); EVALUATION.len() + 2 * DISTANCES];
    };
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    let Evaluation { greedy, planned, distance_error, bridges, coverage, marked, .. } = evaluation;
    let planned = planned.as_ref();
    let left = marked.and_then(|marked| marked.planned.unwrap_or(marked.greedy).left_straight);
    let bridges = bridges.as_ref();
    let mut line = vec![
        number(*coverage),
        number(greedy.success),
        number(greedy.spl),
        number(planned.and_then(|score| score.success)),
        number(planned.and_then(|score| score.spl)),
        number(distance_error.map(|error| error.mape)),
        number(distance_error.map(|error| error.near_mape)),
        number(distance_error.and_then(|error| Some(error.graph?.mape))),
        number(bridges.map(|bridges| bridges.candidates as f64)),
        number(bridges.map(|bridges| bridges.edges as f64)),
        number(bridges.and_then(|bridges| Some(bridges.false_edges? as f64))),
        number(left.map(f64::from)),
    ];
    let at = |score: Option<&Score>, i: usize| Some(number(score?.by_distance.get(i)?.success));
    for score in [Some(greedy), planned] {
        line.extend((0..DISTANCES).map(|i| -> String { at(score, i).unwrap_or_default() }));
    }
    line
}

/// Returns the length in bytes of the rows in `table` that the run of `trainer` had written when it
/// was saved. Later rows, and a last one that was cut off, are to be written again; if all are later,
/// they may be another run's.
fn length_to_keep(table: &[u8], trainer: &Trainer) -> Result<u64, String> {
    let complete = table.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
    let rows =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(&table[..complete]);
    let mut rows = rows.into_byte_records();
    match rows.next().map(|row| row.map(|row| as_text(&row))) {
        None if table.is_empty() => return Ok(0),
        Some(Ok(row)) if row.iter().eq(column_names()) => {}
        Some(Ok(row)) if row.get(0) == Some(PROGRESS[0]) => {
            return Err("it has other columns".to_owned());
        }
        _ => return Err("it is not a table of metrics".to_owned()),
    }
    let (mut kept, mut matches, mut before, mut is_later) = (None, false, 0, true);
    for row in rows {
        let row = row.map_err(|error| error.to_string())?;
        let at = row.position().map_or(0, |at| at.byte() as usize);
        // The reader counts a line's LF after its CR to the next row.
        let begin = at + table[at..].iter().take_while(|byte| b"\r\n".contains(byte)).count();
        let line = || table[..begin].split(|byte| *byte == b'\n').count();
        let row = Row::parse(&as_text(&row))
            .ok_or_else(|| format!("line {} is not a row of such a table", line()))?;
        if row.updates < before {
            return Err(format!("its updates go back in line {}", line()));
        }
        before = row.updates;
        if kept.is_none() && row.is_before(trainer) {
            is_later = false;
            matches |=
                row.matches(trainer).ok_or_else(|| format!("line {} is of another run", line()))?;
        } else {
            kept.get_or_insert(begin as u64);
        }
    }
    if matches || is_later {
        Ok(kept.unwrap_or(complete as u64))
    } else {
        Err("none of its rows shows that it is this run's".to_owned())
    }
}

fn as_text(row: &ByteRecord) -> StringRecord {
    StringRecord::from_byte_record_lossy(row.clone())
}

/// The columns of a row that identify its run.
struct Row {
    is_evaluation: bool,
    updates: u64,
    losses: Vec<String>,
    results: Vec<String>,
}

impl Row {
    fn parse(row: &StringRecord) -> Option<Self> {
        let is_evaluation = match row.get(0)? {
            "evaluation" => true,
            "progress" => false,
            _ => return None,
        };
        let texts =
            |from: usize, to: usize| row.iter().take(to).skip(from).map(str::to_owned).collect();
        let updates = row.get(2)?.parse().ok()?;
        let (losses, results) =
            (texts(PROGRESS.len() - 3, PROGRESS.len()), texts(PROGRESS.len(), row.len()));
        (row.len() == column_names().count()).then_some(Self {
            is_evaluation,
            updates,
            losses,
            results,
        })
    }

    /// Returns whether the run had written the row when it was saved. An evaluation may have
    /// followed the save.
    fn is_before(&self, trainer: &Trainer) -> bool {
        let now = trainer.counters().updates;
        let is_recorded =
            || trainer.history().evaluations().iter().any(|(updates, _)| *updates == now);
        self.updates < now || self.updates == now && (!self.is_evaluation || is_recorded())
    }

    /// Returns whether the run's history, which is thinned, confirms the row; `None` if it
    /// contradicts it.
    fn matches(&self, trainer: &Trainer) -> Option<bool> {
        let history = trainer.history();
        let points = history.points();
        let point = points
            .binary_search_by_key(&self.updates, |point| point.updates)
            .ok()
            .map(|i| points[i]);
        let mut evaluations =
            history.evaluations().iter().filter(|(updates, _)| *updates == self.updates).peekable();
        let same_losses = point.map(|point| self.losses.iter().eq(losses(point.losses).iter()));
        let same_results = (self.is_evaluation && evaluations.peek().is_some())
            .then(|| evaluations.any(|(_, evaluation)| results(Some(evaluation)) == self.results));
        if same_losses == Some(false) || same_results == Some(false) {
            return None;
        }
        // A method that learns nothing has no losses to compare.
        let has_losses = self.losses.iter().any(|loss| !loss.is_empty());
        Some(same_results.is_some() || same_losses.is_some() && has_losses)
    }
}
