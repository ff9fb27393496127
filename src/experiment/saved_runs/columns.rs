//! Columns for listing runs, in a printed table or on the screen, and what tells runs apart.

use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::UNIX_EPOCH;

use super::SavedRun;
use crate::setup::saves::{ago, rate};
use gdg::text::{aligned, display_width, fitted, fitted_file, grouped, sanitized};
use gdg::train::{Preset, list_settings};

pub struct RunColumn {
    pub name: &'static str,
    pub cell: fn(&SavedRun) -> String,
    /// The number that runs are sorted by, instead of what the column says.
    pub number: Option<fn(&SavedRun) -> Option<f64>>,
}

/// All columns from left to right. The last one may be of any width.
pub const COLUMNS: [RunColumn; 10] = [
    text("map", |run| sanitized(&run.map)),
    text("method", |run| {
        let variant = run.variant.as_ref().map_or(String::new(), |name| format!(", {name}"));
        sanitized(&format!("{}{variant}", run.method))
    }),
    // The first one first.
    number("seed", |run| run.seed.to_string(), |run| Some(-(run.seed as f64))),
    number("updates", |run| grouped(run.updates), |run| Some(run.updates as f64)),
    number("planned", |run| rate(planned(run)), planned),
    number("alone", |run| rate(alone(run)), alone),
    text("state", |run| run.state().name().to_owned()),
    number(
        "written",
        |run| run.written.and_then(ago).unwrap_or_else(|| "-".to_owned()),
        |run| run.written?.duration_since(UNIX_EPOCH).ok().map(|since| since.as_secs_f64()),
    ),
    // Lists show only the settings that differ, and only as much of a path as tells files apart.
    text("settings", |run| sanitized(&run.settings.join(" "))),
    text("file", |run| name(&run.source)),
];

/// The column by which runs are sorted at first, and the last two.
pub const WRITTEN: usize = 7;
const SETTINGS: usize = 8;
const FILE: usize = 9;

/// The most columns of a text.
const MAX_TEXT: usize = 20;

/// The columns that are left out first, where files have fewer columns than this; before settings, those that
/// say the same of all runs.
const LEFT_OUT: [(&str, usize); 3] = [("written", 18), ("settings", 12), ("seed", 8)];
const ALIKE: [&str; 4] = ["map", "method", "seed", "state"];

const fn text(name: &'static str, cell: fn(&SavedRun) -> String) -> RunColumn {
    RunColumn { name, cell, number: None }
}

const fn number(
    name: &'static str,
    cell: fn(&SavedRun) -> String,
    number: fn(&SavedRun) -> Option<f64>,
) -> RunColumn {
    RunColumn { name, cell, number: Some(number) }
}

fn planned(run: &SavedRun) -> Option<f64> {
    run.of_last(|last| last.planned.as_ref()?.success)
}

fn alone(run: &SavedRun) -> Option<f64> {
    run.of_last(|last| last.alone.success)
}

pub fn name(file: &Path) -> String {
    sanitized(&file.file_name().unwrap_or_default().to_string_lossy())
}

impl RunColumn {
    /// Compares runs: the largest numbers come first unless the order is `reversed`, runs without
    /// one last in both.
    pub fn compare(&self, a: &SavedRun, b: &SavedRun, reversed: bool) -> Ordering {
        let order = match self.number.map(|number| (number(a), number(b))) {
            Some((Some(a), Some(b))) => b.total_cmp(&a),
            Some((a, b)) => return b.is_some().cmp(&a.is_some()),
            None => (self.cell)(a).to_lowercase().cmp(&(self.cell)(b).to_lowercase()),
        };
        if reversed { order.reverse() } else { order }
    }

    /// Cuts or pads `text` to `width` columns of the screen.
    pub fn fitted(&self, text: &str, width: usize) -> String {
        let fit = if self.name == COLUMNS[FILE].name { fitted_file } else { fitted };
        let (text, gap) = (fit(text, width), |text: &str| width - display_width(text));
        let gap = " ".repeat(gap(&text));
        if self.number.is_some() { gap + &text } else { text + &gap }
    }
}

/// The values of all settings in the presets.
static PRESETS: LazyLock<[Vec<(String, String)>; Preset::ALL.len()]> =
    LazyLock::new(|| Preset::ALL.map(|preset| list_settings(&preset.settings())));

impl SavedRun {
    /// Returns a setting's value, if it differs from its preset's.
    pub fn own_setting(&self, name: &str) -> Option<&str> {
        let mut own = self.settings.iter().filter_map(|setting| setting.split_once('='));
        own.find(|(own, _)| *own == name).map(|(_, value)| value)
    }

    /// Returns a setting's value: its own, or else its preset's.
    pub fn setting(&self, name: &str) -> Option<&str> {
        self.own_setting(name).or_else(|| {
            let mut values = PRESETS[Preset::named(self.own_setting("preset")?)? as usize].iter();
            values.find(|(known, _)| known == name).map(|(_, value)| value.as_str())
        })
    }
}

/// Returns the names of the settings that any run has changed.
pub fn changed<'a>(runs: &[&'a SavedRun]) -> Vec<&'a str> {
    let all = runs.iter().flat_map(|run| &run.settings).filter_map(|own| own.split_once('='));
    let mut known = HashSet::new();
    all.map(|(name, _)| name).filter(|name| known.insert(*name)).collect()
}

/// Returns the names of the settings in which runs differ; that of the preset comes last.
pub fn differing<'a>(runs: &[&'a SavedRun]) -> Vec<&'a str> {
    let differs = |name: &&str| runs.iter().any(|run| run.setting(name) != runs[0].setting(name));
    let mut names: Vec<&str> = changed(runs).into_iter().filter(differs).collect();
    names.sort_by_key(|name| *name == "preset");
    names
}

/// The cells of the runs of a list that can be read.
pub struct RunCells(pub Vec<Vec<String>>);

impl RunCells {
    pub fn of<'a>(runs: impl IntoIterator<Item = &'a Arc<SavedRun>>) -> Self {
        let runs = runs.into_iter().filter(|run| !run.is_damaged()).map(|run| &**run);
        let runs: Vec<&SavedRun> = runs.collect();
        let differing = differing(&runs);
        let mut places: HashMap<_, HashSet<&Path>> = HashMap::new();
        for run in &runs {
            places.entry(run.source.file_stem()).or_default().insert(&run.source);
        }
        // Without its ending, and with its folder, unless others have the same name.
        let file = |run: &SavedRun| {
            let (stem, folder) = (run.source.file_stem(), run.source.parent());
            let is_beside = |other: &&&Path| other.parent() == folder;
            let (all, beside) = (&places[&stem], places[&stem].iter().filter(is_beside).count());
            let own = if beside > 1 { run.source.file_name() } else { stem };
            let folder = folder.and_then(Path::file_name).filter(|_| all.len() > beside);
            let file = Path::new(folder.unwrap_or_default()).join(own.unwrap_or_default());
            sanitized(&file.to_string_lossy())
        };
        let row = |run: &&SavedRun| {
            let value = |name: &&str| Some(format!("{name}={}", run.setting(name)?));
            let settings = differing.iter().filter_map(value).collect::<Vec<_>>().join(" ");
            let cells = COLUMNS[..SETTINGS].iter().map(|column| (column.cell)(run));
            cells.chain([sanitized(&settings), file(run)]).collect()
        };
        Self(runs.iter().map(row).collect())
    }

    /// Returns the columns that there is room for, but for those called `without`, and their widths, with
    /// gaps of a column: wide enough for every run, but for long texts; the file gets the rest.
    pub fn columns(&self, room: usize, without: &str) -> Vec<(usize, usize)> {
        let of = |i: usize| self.0.iter().map(move |row| row[i].as_str());
        let width = |i: usize| {
            let most = match i {
                _ if COLUMNS[i].number.is_some() => usize::MAX,
                SETTINGS => room / 7 * 2,
                _ => (room / 7).clamp(6, MAX_TEXT),
            };
            // And the sign of the order.
            let widest = of(i).map(display_width).max().unwrap_or(0);
            widest.min(most).max(COLUMNS[i].name.len() + 1)
        };
        let differ = of(SETTINGS).any(|text| !text.is_empty());
        let is_alike = |i: usize| of(i).all(|text| Some(text) == of(i).next());
        let has = |i: &usize| COLUMNS[*i].name != without && (*i != SETTINGS || differ);
        let mut columns: Vec<_> = (0..FILE).filter(has).map(|i| (i, width(i))).collect();
        let left = |columns: &[(usize, usize)]| {
            room.saturating_sub(columns.iter().map(|(_, width)| width + 1).sum())
        };
        for (name, least) in LEFT_OUT {
            for alike in ALIKE.into_iter().filter(|_| differ && name == COLUMNS[SETTINGS].name) {
                if left(&columns) < LEFT_OUT[0].1 {
                    columns.retain(|(i, _)| COLUMNS[*i].name != alike || !is_alike(*i));
                }
            }
            if left(&columns) < least {
                columns.retain(|(i, _)| COLUMNS[*i].name != name);
            }
        }
        columns.push((FILE, left(&columns)));
        columns
    }
}

/// The table of runs, the newest first, with the settings in which they differ.
pub fn table(mut runs: Vec<Arc<SavedRun>>) -> String {
    runs.sort_by(|a, b| COLUMNS[WRITTEN].compare(a, b, false));
    let mut cells = RunCells::of(&runs);
    for (row, run) in cells.0.iter_mut().zip(&runs) {
        row[FILE] = sanitized(&run.source.to_string_lossy());
    }
    let columns = cells.columns(usize::MAX, "");
    let head = COLUMNS.map(|column| column.name.to_owned()).to_vec();
    let row = |row: &Vec<String>| columns.iter().map(|(i, _)| row[*i].clone()).collect();
    aligned(&[head].iter().chain(&cells.0).map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_endings_and_folders_only_to_be_told_apart() {
        let run = |file: &str| Arc::new(SavedRun { source: file.into(), ..SavedRun::default() });
        let runs = ["x/a.json", "x/a.jsonl", "x/b.jsonl", "y/b.json", "y/c.d.json"].map(run);
        let cells = RunCells::of(&runs).0;
        let files = cells.iter().map(|row| row[FILE].as_str());
        assert_eq!(files.collect::<Vec<_>>(), ["a.json", "a.jsonl", "x/b", "y/b", "c.d"]);
    }
}
