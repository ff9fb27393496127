//! The list of runs: which are shown, in which order, which are marked, and which is selected.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use crate::experiment::runs::{Found, Identity, Kind, SavedRun};
use crate::host::runs::{ago, rate};
use gdg::text::{grouped, sanitized};
use gdg::train::Evaluation;

/// Runs that can be marked at once: one for each letter.
pub const MOST_MARKS: usize = 26;

/// What identifies a row while its file grows.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// A run, by its file and, as records may have several, by what it is.
    Run(PathBuf, Option<Identity>),
    /// A file that cannot be read.
    Damaged(PathBuf),
}

impl Key {
    fn of(run: &SavedRun) -> Self {
        // The settings of a checkpoint may change with it.
        let is_records = matches!(run.kind, Kind::Records(_));
        Self::Run(run.source.clone(), is_records.then(|| run.identity()))
    }
}

/// A run in the list.
#[derive(Clone, Debug)]
pub struct Entry {
    /// What identifies it.
    pub key: Key,
    /// The run.
    pub run: Arc<SavedRun>,
    /// When its file was written.
    pub written: Option<SystemTime>,
    /// What it is found by, in small letters.
    words: Vec<String>,
}

/// A column of the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// The map, or the world.
    Map,
    /// The method, and the variant if there is one.
    Method,
    /// The seed.
    Seed,
    /// Updates done.
    Updates,
    /// The last success rate.
    Success,
    /// The last success rate without plans.
    Greedy,
    /// What has become of the run.
    State,
    /// When its file was written.
    Written,
    /// The file.
    File,
}

impl Column {
    /// All columns, from left to right.
    pub const ALL: [Self; 9] = [
        Self::Map,
        Self::Method,
        Self::Seed,
        Self::Updates,
        Self::Success,
        Self::Greedy,
        Self::State,
        Self::Written,
        Self::File,
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Map => "map",
            Self::Method => "method",
            Self::Seed => "seed",
            Self::Updates => "updates",
            Self::Success => "success",
            Self::Greedy => "greedy",
            Self::State => "state",
            Self::Written => "written",
            Self::File => "file",
        }
    }

    /// Whether it has numbers, aligned to the right.
    pub fn is_number(self) -> bool {
        matches!(self, Self::Seed | Self::Updates | Self::Success | Self::Greedy)
    }

    /// Whether the largest come first unless the order is reversed.
    fn descends(self) -> bool {
        matches!(self, Self::Updates | Self::Success | Self::Greedy | Self::Written)
    }

    /// Returns what it says about a run.
    pub fn cell(self, Entry { run, written, .. }: &Entry) -> String {
        match self {
            Self::Map => sanitized(&run.map),
            Self::Method => sanitized(&method(run)),
            Self::Seed => run.seed.to_string(),
            Self::Updates => grouped(run.updates),
            Self::Success => rate(run.last().and_then(Evaluation::success_rate)),
            Self::Greedy => rate(run.last().and_then(|last| last.greedy.success)),
            Self::State => run.state(*written).name().to_owned(),
            Self::Written => written.and_then(ago).unwrap_or_default(),
            Self::File => name(&run.source),
        }
    }

    /// Compares runs, in the direction that is usual for the column. Those that lack it come last
    /// in both.
    fn compare(self, a: &Entry, b: &Entry, reversed: bool) -> Ordering {
        let directed = |order: Ordering| {
            if self.descends() == reversed { order } else { order.reverse() }
        };
        let known = |value: fn(&Entry) -> Option<f64>| match (value(a), value(b)) {
            (Some(a), Some(b)) => directed(a.total_cmp(&b)),
            (a, b) => b.is_some().cmp(&a.is_some()),
        };
        match self {
            Self::Seed => directed(a.run.seed.cmp(&b.run.seed)),
            Self::Updates => directed(a.run.updates.cmp(&b.run.updates)),
            Self::Success => known(|entry| entry.run.last()?.success_rate()),
            Self::Greedy => known(|entry| entry.run.last()?.greedy.success),
            Self::Written => directed(a.written.cmp(&b.written)),
            Self::Map | Self::Method | Self::State | Self::File => {
                directed(self.cell(a).to_lowercase().cmp(&self.cell(b).to_lowercase()))
            }
        }
    }
}

/// Returns a run's method, with the name of its variant.
fn method(run: &SavedRun) -> String {
    let variant = run.variant.iter().flat_map(|name| [" ", name.as_str()]).collect::<String>();
    format!("{}{variant}", run.method)
}

/// Returns a file's name, safe to show.
pub fn name(file: &Path) -> String {
    sanitized(&file.file_name().unwrap_or_default().to_string_lossy())
}

/// Returns a file's name without its extension, safe to show.
pub fn stem(file: &Path) -> String {
    sanitized(&file.file_stem().unwrap_or_default().to_string_lossy())
}

impl Entry {
    fn new(run: Arc<SavedRun>, written: Option<SystemTime>) -> Self {
        let facts = [
            format!("map={}", run.map),
            format!("method={}", run.method),
            format!("seed={}", run.seed),
            run.variant.clone().unwrap_or_default(),
            run.source.to_string_lossy().into_owned(),
        ];
        let others = run.others.iter().map(|path| path.to_string_lossy().into_owned());
        let facts = facts.into_iter().chain(others).collect::<Vec<_>>();
        let words = facts.iter().chain(&run.settings).map(|word| word.to_lowercase()).collect();
        Self { key: Key::of(&run), run, written, words }
    }

    /// Whether it has a word: one with an equals sign as a whole, others as a part.
    fn has(&self, word: &str) -> bool {
        let is = |own: &String| if word.contains('=') { own == word } else { own.contains(word) };
        self.words.iter().any(is) || self.run.state(self.written).name().starts_with(word)
    }
}

/// The list.
#[derive(Debug)]
pub struct List {
    all: Vec<Entry>,
    /// Indices of those shown, in order.
    shown: Vec<usize>,
    /// Indices of the files shown below them, which cannot be read.
    damaged: Vec<usize>,
    /// Files that cannot be read, and why.
    pub problems: Vec<(PathBuf, String)>,
    marks: BTreeMap<usize, Key>,
    selected: Option<Key>,
    column: Column,
    reversed: bool,
    words: String,
}

impl Default for List {
    /// The newest first.
    fn default() -> Self {
        Self {
            all: Vec::new(),
            shown: Vec::new(),
            damaged: Vec::new(),
            problems: Vec::new(),
            marks: BTreeMap::new(),
            selected: None,
            column: Column::Written,
            reversed: false,
            words: String::new(),
        }
    }
}

impl List {
    /// Shows what has been found; marks and selection stay with their runs.
    pub fn update(&mut self, found: &Found) {
        let entries = found.runs.iter().map(|(run, written)| Entry::new(run.clone(), *written));
        self.all = entries.collect();
        self.problems.clone_from(&found.problems);
        let all = &self.all;
        self.marks.retain(|_, key| all.iter().any(|entry| entry.key == *key));
        self.arrange();
    }

    /// Filters and sorts.
    fn arrange(&mut self) {
        let words = self.words.to_lowercase();
        let matches = |i: &usize| words.split_whitespace().all(|word| self.all[*i].has(word));
        let mut shown: Vec<usize> = (0..self.all.len()).filter(matches).collect();
        let tie = |entry: &Entry| (entry.run.map.clone(), method(&entry.run), entry.run.seed);
        shown.sort_by(|a, b| {
            let [a, b] = [a, b].map(|i| &self.all[*i]);
            let order = self.column.compare(a, b, self.reversed);
            order.then_with(|| tie(a).cmp(&tie(b)))
        });
        self.shown = shown;
        let matches = |(path, problem): &(PathBuf, String)| {
            let text = format!("{} {problem}", path.display()).to_lowercase();
            words.split_whitespace().all(|word| text.contains(word))
        };
        let problems = self.problems.iter().enumerate();
        self.damaged = problems.filter(|(_, each)| matches(each)).map(|(i, _)| i).collect();
    }

    /// Returns the runs shown, in order.
    pub fn shown(&self) -> impl ExactSizeIterator<Item = &Entry> {
        self.shown.iter().map(|i| &self.all[*i])
    }

    /// Returns the runs of a file.
    pub fn of_file<'a>(&'a self, file: &'a Path) -> impl Iterator<Item = &'a Entry> {
        self.all.iter().filter(move |entry| entry.run.source == file)
    }

    /// Returns how many runs there are.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// Returns the files shown below the runs, which cannot be read, and why.
    pub fn damaged(&self) -> impl ExactSizeIterator<Item = &(PathBuf, String)> {
        self.damaged.iter().map(|i| &self.problems[*i])
    }

    /// Returns the number of rows: of the runs shown, and of files that cannot be read.
    pub fn rows(&self) -> usize {
        self.shown.len() + self.damaged.len()
    }

    /// Returns the selected row: the first one, if the selected run is not among those shown.
    pub fn position(&self) -> usize {
        let Some(key) = &self.selected else { return 0 };
        let place = if let Key::Damaged(file) = key {
            let place = self.damaged().position(|(path, _)| path == file);
            place.map(|place| self.shown.len() + place)
        } else {
            self.shown().position(|entry| entry.key == *key)
        };
        place.unwrap_or(0)
    }

    /// Returns the selected run.
    pub fn selected(&self) -> Option<&Entry> {
        self.shown.get(self.position()).map(|i| &self.all[*i])
    }

    /// Returns the selected file that cannot be read, and why.
    pub fn selected_damage(&self) -> Option<&(PathBuf, String)> {
        let place = self.position().checked_sub(self.shown.len())?;
        self.damaged.get(place).map(|i| &self.problems[*i])
    }

    /// Selects a row, or the nearest one.
    pub fn select(&mut self, row: usize) {
        let row = row.min(self.rows().saturating_sub(1));
        let damaged = || self.damaged.get(row.checked_sub(self.shown.len())?);
        self.selected = match self.shown.get(row) {
            Some(i) => Some(self.all[*i].key.clone()),
            None => damaged().map(|i| Key::Damaged(self.problems[*i].0.clone())),
        };
    }

    /// Moves the selection by a number of rows.
    pub fn step(&mut self, rows: isize) {
        self.select(self.position().saturating_add_signed(rows));
    }

    /// Marks the selected run, or unmarks it. Returns whether there was a letter left for it.
    pub fn toggle_mark(&mut self) -> bool {
        let Some(key) = self.selected().map(|entry| entry.key.clone()) else { return true };
        let before = self.marks.len();
        self.marks.retain(|_, marked| *marked != key);
        if self.marks.len() < before {
            return true;
        }
        let free = (0..MOST_MARKS).find(|letter| !self.marks.contains_key(letter));
        free.is_some_and(|letter| self.marks.insert(letter, key).is_none())
    }

    /// Unmarks all runs; returns whether any was marked.
    pub fn clear_marks(&mut self) -> bool {
        !std::mem::take(&mut self.marks).is_empty()
    }

    /// Returns whether any run is marked.
    pub fn has_marks(&self) -> bool {
        !self.marks.is_empty()
    }

    /// Returns the number of a run's letter, if it is marked.
    pub fn mark(&self, entry: &Entry) -> Option<usize> {
        self.marks.iter().find(|(_, key)| **key == entry.key).map(|(letter, _)| *letter)
    }

    /// Returns the marked runs with the numbers of their letters, even those not shown.
    pub fn marked(&self) -> Vec<(usize, &Entry)> {
        let entry = |key: &Key| self.all.iter().find(|entry| entry.key == *key);
        self.marks.iter().filter_map(|(letter, key)| Some((*letter, entry(key)?))).collect()
    }

    /// Returns the marked runs, or the selected one if there are none.
    pub fn chosen(&self) -> Vec<&Entry> {
        let marked = self.marked();
        if marked.is_empty() {
            return self.selected().into_iter().collect();
        }
        marked.into_iter().map(|(_, entry)| entry).collect()
    }

    /// Returns the column that the list is sorted by, and whether that is in reverse.
    pub fn order(&self) -> (Column, bool) {
        (self.column, self.reversed)
    }

    /// Sorts by a column, or reverses its order if the list is sorted by it.
    pub fn sort_by(&mut self, column: Column) {
        self.reversed = self.column == column && !self.reversed;
        self.column = column;
        self.arrange();
    }

    /// Sorts by the next column.
    pub fn sort_by_next(&mut self) {
        let place = Column::ALL.iter().position(|column| *column == self.column).unwrap_or(0);
        self.sort_by(Column::ALL[(place + 1) % Column::ALL.len()]);
    }

    /// Shows only runs with all of these words.
    pub fn filter(&mut self, words: &str) {
        words.clone_into(&mut self.words);
        self.arrange();
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{found, saved};
    use super::*;
    use crate::experiment::runs::Ending;

    fn list() -> List {
        let mut list = List::default();
        list.update(&found(&[
            saved("a.safetensors", "trap", "gdg-bridge", 1, &[0.2, 0.9]),
            saved("b.safetensors", "trap", "her", 12, &[0.4]),
            saved("c.safetensors", "city", "gdg-bridge", 2, &[]),
        ]));
        list
    }

    fn names(list: &List) -> Vec<String> {
        list.shown().map(|entry| Column::File.cell(entry)[..1].to_owned()).collect()
    }

    #[test]
    fn runs_are_sorted_by_each_column_and_those_without_a_number_come_last() {
        let mut list = list();
        for (column, order, reversed) in [
            (Column::Success, "a b c", "b a c"),
            (Column::Map, "c a b", "a b c"),
            (Column::Method, "c a b", "b c a"),
            (Column::Seed, "a c b", "b c a"),
            (Column::File, "a b c", "c b a"),
        ] {
            list.sort_by(column);
            assert_eq!(names(&list).join(" "), order, "{column:?}");
            list.sort_by(column);
            assert_eq!(names(&list).join(" "), reversed, "{column:?} reversed");
        }
        list.sort_by(Column::File);
        list.sort_by_next();
        assert_eq!(list.order(), (Column::Map, false), "after the last column comes the first");
    }

    #[test]
    fn words_are_parts_and_those_with_an_equals_sign_are_whole() {
        let mut list = list();
        list.sort_by(Column::File);
        for (words, found) in [
            ("", "a b c"),
            ("TRAP", "a b"),
            ("gdg trap", "a"),
            ("seed=1", "a"),
            ("hidden=16", "a b c"),
            ("hidden=1", ""),
            ("b.safe", "b"),
        ] {
            list.filter(words);
            assert_eq!(names(&list).join(" "), found, "{words}");
        }
    }

    #[test]
    fn selection_and_marks_stay_with_their_runs() {
        let mut list = list();
        list.sort_by(Column::File);
        list.step(1);
        assert!(list.toggle_mark());
        list.select(9);
        assert!(list.toggle_mark());
        list.sort_by(Column::File);
        assert_eq!((names(&list).concat(), list.position()), ("cba".to_owned(), 0));
        let marked = |list: &List| {
            let all = list.marked().into_iter();
            all.map(|(i, entry)| format!("{i}{}", entry.run.map)).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(marked(&list), "0trap 1city");
        list.filter("her");
        assert_eq!((list.shown().len(), marked(&list)), (1, "0trap 1city".to_owned()));
        // The first letter becomes free, and is given away again.
        assert!(list.toggle_mark());
        assert_eq!((marked(&list), list.chosen().len()), ("1city".to_owned(), 1));
        let of_file = |seed| SavedRun {
            kind: Kind::Records(Ending::Open),
            ..saved("own.jsonl", "own", "gdg", seed, &[0.5])
        };
        list.filter("");
        list.update(&found(&[5, 7].map(of_file)));
        list.sort_by(Column::Seed);
        let row = list.shown().position(|entry| entry.run.seed == 7);
        list.select(row.expect("its row"));
        assert!(list.toggle_mark());
        list.update(&found(&[4, 5, 6, 7].map(of_file)));
        let seed = |entry: Option<&Entry>| entry.map(|entry| entry.run.seed);
        assert_eq!(seed(list.selected()), Some(7), "its file has grown");
        assert_eq!(seed(list.chosen().first().copied()), Some(7));
        list.update(&found(&[]));
        list.step(-1);
        assert!(list.selected().is_none() && list.chosen().is_empty() && list.toggle_mark());
    }
}
