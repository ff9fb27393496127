//! How much of a resumed run's earlier table to keep.

use csv::{ByteRecord, StringRecord};

use super::{PROGRESS, column_names, losses, results};
use gdg::train::Trainer;

/// Returns the length in bytes of the rows in `table` that the run of `trainer` had written when it
/// was saved. Later rows, and a last one that was cut off, are to be written again; if all are later,
/// they may be another run's.
pub fn length_to_keep(table: &[u8], trainer: &Trainer) -> Result<u64, String> {
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
