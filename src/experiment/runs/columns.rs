//! The columns of a list of runs, which is printed as a table or shown on the screen.

use std::cmp::Ordering;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use super::join::Dated;
use crate::host::runs::{ago, rate};
use gdg::text::{aligned, grouped, sanitized};
use gdg::train::Evaluation;

pub struct Column {
    pub name: &'static str,
    /// What it says about a run.
    pub cell: fn(&Dated) -> String,
    /// The number that runs are sorted by, instead of what the column says.
    pub number: Option<fn(&Dated) -> Option<f64>>,
}

/// All columns from left to right. The last one may be of any width.
pub const COLUMNS: [Column; 9] = [
    text("map", |(run, _)| sanitized(&run.map)),
    text("method", |(run, _)| {
        let variant = run.variant.as_ref().map_or(String::new(), |name| format!(" {name}"));
        sanitized(&format!("{}{variant}", run.method))
    }),
    // The first one first.
    number("seed", |(run, _)| run.seed.to_string(), |(run, _)| Some(-(run.seed as f64))),
    number("updates", |(run, _)| grouped(run.updates), |(run, _)| Some(run.updates as f64)),
    number("success", |run| rate(success(run)), success),
    number("greedy", |run| rate(greedy(run)), greedy),
    text("state", |(run, written)| run.state(*written).name().to_owned()),
    number(
        "written",
        |(_, written)| written.and_then(ago).unwrap_or_default(),
        |(_, written)| seconds((*written)?),
    ),
    text("file", |(run, _)| name(&run.source)),
];

/// The index of the column by which runs are sorted at first.
pub const WRITTEN: usize = 7;

const fn text(name: &'static str, cell: fn(&Dated) -> String) -> Column {
    Column { name, cell, number: None }
}

const fn number(
    name: &'static str,
    cell: fn(&Dated) -> String,
    number: fn(&Dated) -> Option<f64>,
) -> Column {
    Column { name, cell, number: Some(number) }
}

fn success((run, _): &Dated) -> Option<f64> {
    run.last().and_then(Evaluation::success_rate)
}

fn greedy((run, _): &Dated) -> Option<f64> {
    run.last()?.greedy.success
}

fn seconds(at: SystemTime) -> Option<f64> {
    at.duration_since(UNIX_EPOCH).ok().map(|since| since.as_secs_f64())
}

/// A file's name, safe to show.
pub fn name(file: &Path) -> String {
    sanitized(&file.file_name().unwrap_or_default().to_string_lossy())
}

impl Column {
    /// Compares runs: the largest numbers come first unless the order is `reversed`, runs without
    /// one last in both.
    pub fn compare(&self, a: &Dated, b: &Dated, reversed: bool) -> Ordering {
        let order = match self.number.map(|number| (number(a), number(b))) {
            Some((Some(a), Some(b))) => b.total_cmp(&a),
            Some((a, b)) => return b.is_some().cmp(&a.is_some()),
            None => (self.cell)(a).to_lowercase().cmp(&(self.cell)(b).to_lowercase()),
        };
        if reversed { order.reverse() } else { order }
    }
}

/// The table of runs, the newest first, with the paths of their files.
pub fn table(mut runs: Vec<Dated>) -> String {
    runs.sort_by(|a, b| COLUMNS[WRITTEN].compare(a, b, false));
    let row = |run: &Dated| {
        let mut cells = COLUMNS.each_ref().map(|column| (column.cell)(run));
        cells[COLUMNS.len() - 1] = sanitized(&run.0.source.to_string_lossy());
        cells.to_vec()
    };
    let head = COLUMNS.each_ref().map(|column| column.name.to_owned()).to_vec();
    aligned(&std::iter::once(head).chain(runs.iter().map(row)).collect::<Vec<_>>())
}
