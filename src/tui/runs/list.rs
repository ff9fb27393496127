//! The rows of the list: filter, order, marks, selection; what is resumed, compared or deleted.

use std::cmp::Ordering;
use std::collections::{BTreeMap, HashSet};
use std::io::{Error, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use super::Wish;
use crate::experiment::saved_runs::{
    COLUMNS, RunKind, RunState, SavedRun, WRITTEN, file, name, whole,
};
use crate::setup::saves::ago;
use crate::tui::dialog::Picker;
use crate::tui::lists;
use gdg::files;
use gdg::text::{counted, sanitized};

/// Runs that can be marked at once: one for each letter.
const MAX_MARKS: usize = 26;

/// The list. At first, the newest run comes first; files that cannot be read always come last.
#[derive(Debug)]
pub struct List {
    all: Vec<Arc<SavedRun>>,
    shown: Vec<usize>,
    /// The marked runs, by the numbers of their letters.
    marks: BTreeMap<usize, Arc<SavedRun>>,
    selected: Option<Arc<SavedRun>>,
    pub order: (usize, bool),
    words: String,
}

impl Default for List {
    fn default() -> Self {
        let (all, shown, marks) = (Vec::new(), Vec::new(), BTreeMap::new());
        Self { all, shown, marks, selected: None, order: (WRITTEN, false), words: String::new() }
    }
}

/// Whether it is the same run, of which the file may have grown.
fn is_same(a: &SavedRun, b: &SavedRun) -> bool {
    // A file of records may have several; the settings of a checkpoint may change with it.
    let is_same_run = || match (a.kind, b.kind) {
        (RunKind::Records, _) => a.identity() == b.identity(),
        _ => a.is_damaged() == b.is_damaged(),
    };
    a.source == b.source && is_same_run()
}

/// Whether its file grows: another program trains the run.
pub fn is_growing(run: &SavedRun) -> bool {
    !run.is_damaged() && run.state() == RunState::Running
}

fn words(run: &SavedRun) -> Vec<String> {
    let files = [&run.source].into_iter().chain(&run.others);
    let files = files.map(|path| path.to_string_lossy().into_owned());
    let facts = [
        format!("map={}", run.map),
        format!("method={}", run.method),
        format!("seed={}", run.seed),
        run.state().name().to_owned(),
    ];
    let all = facts.into_iter().chain(run.variant.clone()).chain(run.problem.clone()).chain(files);
    all.chain(run.settings.clone()).map(|word| word.to_lowercase()).collect()
}

impl List {
    /// Shows what has been found; marks and selection stay with their runs.
    pub fn update(&mut self, found: &[Arc<SavedRun>]) {
        self.all = found.to_vec();
        let now = |before: &Arc<SavedRun>| found.iter().find(|run| is_same(run, before)).cloned();
        let marks = self.marks.iter().filter_map(|(letter, run)| Some((*letter, now(run)?)));
        self.marks = marks.collect();
        self.selected = self.selected.as_ref().and_then(now);
        self.arrange();
    }

    fn arrange(&mut self) {
        let wanted = self.words.to_lowercase();
        let matches = |i: &usize| {
            let own = words(&self.all[*i]);
            // A word with an equals sign is one as a whole, others are parts.
            let has = |word: &str| {
                own.iter()
                    .any(|own| if word.contains('=') { own == word } else { own.contains(word) })
            };
            wanted.split_whitespace().all(has)
        };
        let mut shown: Vec<usize> = (0..self.all.len()).filter(matches).collect();
        let (column, reversed) = self.order;
        shown.sort_by(|a, b| {
            let (a, b) = (&self.all[*a], &self.all[*b]);
            let mut ties = COLUMNS[..3].iter().map(|column| column.compare(a, b, false));
            let order = a.is_damaged().cmp(&b.is_damaged());
            order
                .then_with(|| COLUMNS[column].compare(a, b, reversed))
                .then_with(|| ties.find(|tie| tie.is_ne()).unwrap_or(Ordering::Equal))
        });
        self.shown = shown;
    }

    pub fn all(&self) -> &[Arc<SavedRun>] {
        &self.all
    }

    pub fn shown(&self) -> impl ExactSizeIterator<Item = &Arc<SavedRun>> {
        self.shown.iter().map(|i| &self.all[*i])
    }

    /// Returns the place of the selected row: the first one, if that is not among those shown.
    pub fn position(&self) -> usize {
        let is_selected =
            |run: &Arc<SavedRun>| self.selected.as_ref().is_some_and(|own| is_same(own, run));
        self.shown().position(is_selected).unwrap_or(0)
    }

    pub fn selected(&self) -> Option<&Arc<SavedRun>> {
        self.shown().nth(self.position())
    }

    pub fn select(&mut self, place: usize) {
        let place = place.min(self.shown.len().saturating_sub(1));
        self.selected = self.shown.get(place).map(|i| self.all[*i].clone());
    }

    pub fn step(&mut self, rows: isize) {
        self.select(self.position().saturating_add_signed(rows));
    }

    /// Marks the selected run, or unmarks it. Returns whether there was a letter left for it.
    pub fn toggle_mark(&mut self) -> bool {
        let Some(run) = self.selected().filter(|run| !run.is_damaged()).cloned() else {
            return true;
        };
        if let Some(letter) = self.mark(&run) {
            self.marks.remove(&letter);
            return true;
        }
        let free = (0..MAX_MARKS).find(|letter| !self.marks.contains_key(letter));
        free.is_some_and(|letter| self.marks.insert(letter, run).is_none())
    }

    pub fn clear_marks(&mut self) {
        self.marks.clear();
    }

    /// The number of a run's letter, if it is marked.
    pub fn mark(&self, run: &SavedRun) -> Option<usize> {
        self.marks.iter().find(|(_, marked)| is_same(marked, run)).map(|(letter, _)| *letter)
    }

    /// Returns the marked runs with the numbers of their letters, even those not shown.
    pub fn marked(&self) -> &BTreeMap<usize, Arc<SavedRun>> {
        &self.marks
    }

    pub fn sort_by(&mut self, column: usize) {
        self.order = (column, self.order == (column, false));
        self.arrange();
    }

    pub fn filter(&mut self, words: &str) {
        words.clone_into(&mut self.words);
        self.arrange();
    }

    /// The two marked runs, if there are two.
    pub fn pair(&self) -> Option<[&Arc<SavedRun>; 2]> {
        self.marks.values().collect::<Vec<_>>().try_into().ok()
    }

    /// Returns the wish to see the two marked runs side by side, or else the selected one.
    pub fn to_open(&self) -> Result<Wish, String> {
        match self.pair() {
            Some([a, b]) => wish(a, Some(b)),
            None => wish(self.selected().ok_or("no run is selected")?, None),
        }
    }

    /// Selects a file's run that grows; returns the wish to watch it, or what is awaited until it is saved.
    pub fn select_growing(&mut self, source: &Path) -> Option<Result<Wish, String>> {
        let mut growing = self.all.iter().filter(|run| run.source == source && is_growing(run));
        let run = growing.next_back()?.clone();
        self.selected = Some(run.clone());
        Some(wish(&run, None).map_err(|_| awaited(&run)))
    }

    /// Returns the question whether to delete all files of the marked runs, or else of the selected
    /// one, and the files, unless one of them still grows.
    pub fn to_delete(&self) -> Result<(Picker, Written), String> {
        let mut rows: Vec<&Arc<SavedRun>> = self.marks.values().collect();
        if rows.is_empty() {
            rows.extend(self.selected());
        }
        let is_chosen = |run: &Arc<SavedRun>| rows.iter().any(|chosen| is_same(chosen, run));
        let kept: Vec<&Arc<SavedRun>> = self.all.iter().filter(|run| !is_chosen(run)).collect();
        // A copy of a run, or one started again, may name the same checkpoint.
        let named = kept.iter().flat_map(|run| run.checkpoint.iter().chain(&run.resumed));
        let named: HashSet<PathBuf> = named.map(|path| whole(path)).collect();
        let others = rows.iter().flat_map(|run| &run.others);
        let others = others.filter(|file| !named.contains(&whole(file)));
        let files = rows.iter().map(|run| &run.source).chain(others).filter(|file| !file.is_dir());
        let files: Written = files.map(|file| (file.clone(), written(file))).collect();
        if files.is_empty() {
            return Err("no file is selected".to_owned());
        }
        // A file may have other runs than those chosen.
        let is_in_files = |run: &&&Arc<SavedRun>| {
            [&run.source].into_iter().chain(&run.others).any(|file| files.contains_key(file))
        };
        let others: Vec<_> = kept.iter().filter(is_in_files).collect();
        if let Some(run) = rows.iter().chain(others.iter().copied()).find(|run| is_growing(run)) {
            return Err(format!("{} still grows: end its run first", name(&run.source)));
        }
        let others = match others.len() as u64 {
            0 => String::new(),
            others => format!(" with {} not chosen", counted(others, "run")),
        };
        let names = files.keys().map(|file| sanitized(&file.to_string_lossy()));
        let names = names.collect::<Vec<_>>().join(", ");
        // What has just been written another program may still train.
        let written = files.values().flatten().max().copied();
        let written = written.and_then(ago).map_or(String::new(), |at| format!("; written {at}"));
        let is_job = |file: &PathBuf| file.parent().is_some_and(|folder| folder.ends_with("jobs"));
        let report = if files.keys().any(is_job) { "; the report stays" } else { "" };
        let count = counted(files.len() as u64, "file");
        Ok((lists::deletion(&format!("{count}{others}"), names + &written + report), files))
    }
}

fn wish(run: &SavedRun, beside: Option<&Arc<SavedRun>>) -> Result<Wish, String> {
    // What the records of a run name may have been replaced since.
    let is_own = |run: &SavedRun, path: &Path| {
        let is_same = |found: &SavedRun| run.has_saved(found) || found.is_of_one_run(run);
        run.kind != RunKind::Records || file(path).iter().flatten().all(is_same)
    };
    let checkpoint = |run: &SavedRun| {
        let why = match &run.checkpoint {
            Some(path) if !path.is_file() => format!("{} is gone", path.display()),
            Some(path) if !is_own(run, path) => format!("{} is another run's", path.display()),
            Some(path) => return Ok(path.clone()),
            None if run.is_damaged() => "it cannot be read".to_owned(),
            None => "it has no checkpoint".to_owned(),
        };
        Err(format!("{} cannot be resumed: {why}", name(&run.source)))
    };
    // One alone is watched.
    let watches = (beside.is_none() && is_growing(run)).then(|| run.source.clone());
    let is_growing = is_growing(run) || beside.is_some_and(|run| is_growing(run));
    let warning = (is_growing && watches.is_none()).then(|| {
        "another program still trains this: what is shown is a copy, as last saved; of the two, \
         the one that saves second does so to another name"
            .to_owned()
    });
    let beside = beside.map(|run| checkpoint(run)).transpose()?;
    Ok(Wish { file: checkpoint(run)?, beside, warning, watches })
}

/// Says what is awaited of a run that has not been saved yet.
fn awaited(run: &SavedRun) -> String {
    let when = match &run.saves {
        _ if run.method.is_empty() => "it begins".to_owned(),
        Some((_, Some(every))) => {
            let first = gdg::train::FIRST_SAVE.as_secs_f64().min(*every);
            let minutes = (every / 6.0).round() / 10.0;
            format!("after {first} s of training, then every {minutes} min")
        }
        Some((_, None)) => "at its end".to_owned(),
        None => "never: it has no --save".to_owned(),
    };
    let file = run.saves.as_ref().map_or(&run.source, |(file, _)| file);
    format!("{}: not saved yet; {when}  Esc list", name(file))
}

/// Files, and when each was last written.
pub type Written = BTreeMap<PathBuf, Option<SystemTime>>;

fn written(file: &Path) -> Option<SystemTime> {
    file.metadata().ok()?.modified().ok()
}

/// Removes files, unless one has been written since it was asked.
pub fn delete(files: &Written) -> Result<String, String> {
    if let Some((file, _)) = files.iter().find(|(file, then)| written(file) != **then) {
        return Err(format!("{} has just been written: nothing is deleted", file.display()));
    }
    for file in files.keys() {
        remove(file).map_err(|error| format!("{} is kept: {error}", file.display()))?;
    }
    Ok(format!("deleted {}", counted(files.len() as u64, "file")))
}

fn remove(file: &Path) -> IoResult<()> {
    let remove = || match std::fs::remove_file(file) {
        // What is gone needs no removal.
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    };
    let removed = (!files::is_in_use(file)).then(|| files::while_locked(file, remove)).flatten();
    removed.unwrap_or_else(|| Err(Error::new(ErrorKind::ResourceBusy, "another program uses it")))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{found, saved};
    use super::*;

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
        list.shown().map(|run| run.source.to_string_lossy()[..1].to_owned()).collect()
    }

    #[test]
    fn a_checkpoint_is_resumed_unless_another_run_has_replaced_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("kept.jsonl");
        let mut run = saved("a.jsonl", "trap", "gdg", 1, &[0.5]);
        (run.kind, run.checkpoint) = (RunKind::Records, Some(path.clone()));
        let resumed = |seed: u64, hidden: u64, updates: u64| {
            let start = serde_json::json!({"event": "start", "world": "trap", "method": "gdg",
                "preset": "default", "settings": {"hidden": hidden}, "seed": seed});
            let mut found = serde_json::json!(run.evaluations[0]);
            (found["event"], found["updates"]) = ("evaluation".into(), updates.into());
            std::fs::write(&path, format!("{start}\n{found}\n")).expect("a file");
            wish(&run, None).map(|wish| wish.file)
        };
        assert_eq!(resumed(1, 16, 900), Ok(path.clone()));
        assert_eq!(resumed(1, 32, 1_000), Ok(path.clone()), "its settings were changed");
        for other in [resumed(2, 16, 900), resumed(1, 32, 900)] {
            assert!(other.is_err_and(|why| why.contains("is another run's")));
        }
        assert_eq!(resumed(1, 16, 900), Ok(path.clone()));
        let edits = vec![(1, "b".to_owned())];
        let edited = SavedRun { edits, saved_at: Some(950), ..run.clone() };
        assert!(wish(&edited, None).is_err(), "any map would do, but it was saved later");
    }

    #[test]
    fn runs_are_sorted_by_columns_and_found_by_words() {
        let mut list = list();
        for (name, order, reversed) in [
            ("planned", "acb", "acb"),
            ("alone", "abc", "bac"),
            ("map", "cab", "abc"),
            ("method", "cab", "bca"),
            ("seed", "acb", "bca"),
            ("written", "cba", "abc"),
            ("file", "abc", "cba"),
        ] {
            for expected in [order, reversed] {
                list.sort_by(column(name));
                assert_eq!(names(&list), expected, "{name}: those without a number come last");
            }
        }
        list.sort_by(column("file"));
        // Words are parts, and those with an equals sign are whole.
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
            let all = list.marked().iter().map(|(i, run)| format!("{i}{} ", run.map));
            all.collect::<String>()
        };
        assert_eq!(marked(&list), "0trap 1city ");
        list.filter("her");
        assert_eq!((list.shown().len(), marked(&list)), (1, "0trap 1city ".to_owned()));
        assert!(list.toggle_mark());
        assert_eq!(marked(&list), "1city ");
        let of_file = |seed| SavedRun {
            kind: RunKind::Records,
            end: None,
            ..saved("own.jsonl", "own", "gdg", seed, &[0.5])
        };
        list.filter("");
        list.update(&found(&[5, 7].map(of_file)));
        list.sort_by(column("seed"));
        list.select(1);
        assert!(list.toggle_mark());
        list.update(&found(&[4, 5, 6, 7].map(of_file)));
        let seed = |run: Option<&Arc<SavedRun>>| run.map(|run| run.seed);
        assert_eq!(seed(list.selected()), Some(7), "its file has grown");
        assert_eq!(seed(list.marked().values().next()), Some(7));
        list.update(&found(&[]));
        list.step(-1);
        assert!(list.selected().is_none() && list.marked().is_empty() && list.toggle_mark());
    }
}
