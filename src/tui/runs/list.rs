//! The rows of the list: which are shown, in which order, which are marked, and which is selected.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::experiment::runs::{COLUMNS, Dated, Found, Kind, SavedRun, State, WRITTEN};

/// Runs that can be marked at once: one for each letter.
const MAX_MARKS: usize = 26;

/// A run, or a file that cannot be read, and why.
#[derive(Clone, Debug)]
pub enum Row {
    Run(Dated),
    Damaged(PathBuf, String),
}

impl Row {
    pub fn run(&self) -> Option<&SavedRun> {
        match self {
            Self::Run((run, _)) => Some(run),
            Self::Damaged(..) => None,
        }
    }

    pub fn file(&self) -> &Path {
        match self {
            Self::Run((run, _)) => &run.source,
            Self::Damaged(file, _) => file,
        }
    }

    /// Whether its file grows: another program trains the run.
    pub fn is_growing(&self) -> bool {
        matches!(self, Self::Run((run, written)) if run.state(*written) == State::Running)
    }

    /// Whether it is the same row, of which the file may have grown.
    fn is_same(&self, other: &Self) -> bool {
        let is_same_run = || match (self.run(), other.run()) {
            // A file of records may have several; the settings of a checkpoint may change with it.
            (Some(own), Some(run)) => {
                !matches!(own.kind, Kind::Records(_)) || own.identity() == run.identity()
            }
            (own, run) => own.is_none() && run.is_none(),
        };
        self.file() == other.file() && is_same_run()
    }

    /// What it is found by, in small letters.
    fn words(&self) -> Vec<String> {
        let words = match self {
            Self::Run((run, written)) => {
                let files = [&run.source].into_iter().chain(&run.others);
                let files = files.map(|path| path.to_string_lossy().into_owned());
                let facts = [
                    format!("map={}", run.map),
                    format!("method={}", run.method),
                    format!("seed={}", run.seed),
                    run.state(*written).name().to_owned(),
                ];
                let all = facts.into_iter().chain(run.variant.clone()).chain(files);
                all.chain(run.settings.clone()).collect()
            }
            Self::Damaged(file, problem) => vec![format!("{} {problem}", file.display())],
        };
        words.iter().map(|word| word.to_lowercase()).collect()
    }
}

/// The list. At first, the newest run comes first; files that cannot be read always come last.
#[derive(Debug)]
pub struct List {
    all: Vec<Row>,
    /// Indices of those shown, in order.
    shown: Vec<usize>,
    /// The marked runs, by the numbers of their letters.
    marks: BTreeMap<usize, Row>,
    selected: Option<Row>,
    /// The column that it is sorted by, and whether in reverse.
    pub order: (usize, bool),
    words: String,
}

impl Default for List {
    fn default() -> Self {
        let (all, shown, marks) = (Vec::new(), Vec::new(), BTreeMap::new());
        Self { all, shown, marks, selected: None, order: (WRITTEN, false), words: String::new() }
    }
}

impl List {
    /// Shows what has been found; marks and selection stay with their runs.
    pub fn update(&mut self, found: &Found) {
        let problems = found.problems.iter().cloned();
        let damaged = problems.map(|(file, problem)| Row::Damaged(file, problem));
        self.all = found.runs.iter().cloned().map(Row::Run).chain(damaged).collect();
        let now = |before: &Row| self.all.iter().find(|row| row.is_same(before)).cloned();
        let marks = self.marks.iter().filter_map(|(letter, row)| Some((*letter, now(row)?)));
        self.marks = marks.collect();
        self.selected = self.selected.as_ref().and_then(now);
        self.arrange();
    }

    /// Filters and sorts.
    fn arrange(&mut self) {
        let wanted = self.words.to_lowercase();
        let matches = |i: &usize| {
            let own = self.all[*i].words();
            // A word with an equals sign is one as a whole, others are parts.
            let has = |word: &str| {
                own.iter()
                    .any(|own| if word.contains('=') { own == word } else { own.contains(word) })
            };
            wanted.split_whitespace().all(has)
        };
        let mut shown: Vec<usize> = (0..self.all.len()).filter(matches).collect();
        let (column, reversed) = self.order;
        shown.sort_by(|a, b| match (&self.all[*a], &self.all[*b]) {
            (Row::Run(a), Row::Run(b)) => {
                let mut ties = COLUMNS[..3].iter().map(|column| column.compare(a, b, false));
                let order = COLUMNS[column].compare(a, b, reversed);
                order.then_with(|| ties.find(|tie| tie.is_ne()).unwrap_or(Ordering::Equal))
            }
            (a, b) => b.run().is_some().cmp(&a.run().is_some()),
        });
        self.shown = shown;
    }

    /// All rows, whether or not they are shown.
    pub fn all(&self) -> &[Row] {
        &self.all
    }

    /// The rows shown, in order.
    pub fn shown(&self) -> impl ExactSizeIterator<Item = &Row> {
        self.shown.iter().map(|i| &self.all[*i])
    }

    /// Returns the place of the selected row: the first one, if that is not among those shown.
    pub fn position(&self) -> usize {
        let is_selected = |row: &Row| self.selected.as_ref().is_some_and(|own| own.is_same(row));
        self.shown().position(is_selected).unwrap_or(0)
    }

    pub fn selected(&self) -> Option<&Row> {
        self.shown().nth(self.position())
    }

    /// Selects a row, or the nearest one.
    pub fn select(&mut self, place: usize) {
        let place = place.min(self.shown.len().saturating_sub(1));
        self.selected = self.shown.get(place).map(|i| self.all[*i].clone());
    }

    /// Moves the selection by a number of rows.
    pub fn step(&mut self, rows: isize) {
        self.select(self.position().saturating_add_signed(rows));
    }

    /// Marks the selected run, or unmarks it. Returns whether there was a letter left for it.
    pub fn toggle_mark(&mut self) -> bool {
        let Some(row) = self.selected().filter(|row| row.run().is_some()).cloned() else {
            return true;
        };
        if let Some(letter) = self.mark(&row) {
            self.marks.remove(&letter);
            return true;
        }
        let free = (0..MAX_MARKS).find(|letter| !self.marks.contains_key(letter));
        free.is_some_and(|letter| self.marks.insert(letter, row).is_none())
    }

    pub fn clear_marks(&mut self) {
        self.marks.clear();
    }

    /// The number of a run's letter, if it is marked.
    pub fn mark(&self, row: &Row) -> Option<usize> {
        self.marks.iter().find(|(_, marked)| marked.is_same(row)).map(|(letter, _)| *letter)
    }

    /// Returns the marked runs with the numbers of their letters, even those not shown.
    pub fn marked(&self) -> &BTreeMap<usize, Row> {
        &self.marks
    }

    /// Returns the marked rows, or the selected one if there are none.
    pub fn chosen(&self) -> Vec<&Row> {
        if self.marks.is_empty() {
            return self.selected().into_iter().collect();
        }
        self.marks.values().collect()
    }

    /// Sorts by a column, or reverses its order if the list is sorted by it.
    pub fn sort_by(&mut self, column: usize) {
        self.order = (column, self.order == (column, false));
        self.arrange();
    }

    pub fn sort_by_next(&mut self) {
        self.sort_by((self.order.0 + 1) % COLUMNS.len());
    }

    /// Shows only rows with all of these words.
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

    fn column(name: &str) -> usize {
        COLUMNS.iter().position(|column| column.name == name).expect("a column")
    }

    fn names(list: &List) -> String {
        list.shown().map(|row| row.file().to_string_lossy()[..1].to_owned()).collect()
    }

    #[test]
    fn runs_are_sorted_by_each_column_and_those_without_a_number_come_last() {
        let mut list = list();
        for (name, order, reversed) in [
            ("success", "abc", "bac"),
            ("map", "cab", "abc"),
            ("method", "cab", "bca"),
            ("seed", "acb", "bca"),
            ("written", "cba", "abc"),
            ("file", "abc", "cba"),
        ] {
            for expected in [order, reversed] {
                list.sort_by(column(name));
                assert_eq!(names(&list), expected, "{name}");
            }
        }
        list.sort_by_next();
        assert_eq!(list.order, (0, false), "after the last column comes the first");
    }

    #[test]
    fn words_are_parts_and_those_with_an_equals_sign_are_whole() {
        let mut list = list();
        list.sort_by(column("file"));
        for (words, found) in [
            ("", "abc"),
            ("TRAP", "ab"),
            ("gdg trap", "a"),
            ("seed=1", "a"),
            ("hidden=16", "abc"),
            ("hidden=1", ""),
            ("b.safe", "b"),
        ] {
            list.filter(words);
            assert_eq!(names(&list), found, "{words}");
        }
    }

    #[test]
    fn selection_and_marks_stay_with_their_runs() {
        let mut list = list();
        list.sort_by(column("file"));
        list.step(1);
        assert!(list.toggle_mark());
        list.select(9);
        assert!(list.toggle_mark());
        list.sort_by(column("file"));
        assert_eq!((names(&list), list.position()), ("cba".to_owned(), 0));
        let marked = |list: &List| {
            let map = |row: &Row| row.run().map_or(String::new(), |run| run.map.clone());
            let all = list.marked().iter().map(|(i, row)| format!("{i}{}", map(row)));
            all.collect::<Vec<_>>().join(" ")
        };
        assert_eq!(marked(&list), "0trap 1city");
        list.filter("her");
        assert_eq!((list.shown().len(), marked(&list)), (1, "0trap 1city".to_owned()));
        assert!(list.toggle_mark());
        assert_eq!((marked(&list), list.chosen().len()), ("1city".to_owned(), 1));
        let of_file = |seed| SavedRun {
            kind: Kind::Records(Ending::Open),
            ..saved("own.jsonl", "own", "gdg", seed, &[0.5])
        };
        list.filter("");
        list.update(&found(&[5, 7].map(of_file)));
        list.sort_by(column("seed"));
        list.select(1);
        assert!(list.toggle_mark());
        list.update(&found(&[4, 5, 6, 7].map(of_file)));
        let seed = |row: Option<&Row>| row.and_then(Row::run).map(|run| run.seed);
        assert_eq!(seed(list.selected()), Some(7), "its file has grown");
        assert_eq!(seed(list.chosen().first().copied()), Some(7));
        list.update(&found(&[]));
        list.step(-1);
        assert!(list.selected().is_none() && list.chosen().is_empty() && list.toggle_mark());
    }
}
