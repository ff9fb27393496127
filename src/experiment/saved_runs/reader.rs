//! Reads folders of runs again and again, as files grow.

use std::collections::{HashMap, HashSet, VecDeque};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::join::{join, whole};
use super::{SavedRun, Stamp, file, files_of, stamp};
use crate::setup::saves::{SAVES, files_in};
use gdg::files::is_hidden;
use gdg::train::is_checkpoint;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoundRuns {
    pub runs: Vec<Arc<SavedRun>>,
    /// The file being read, of how many; both are the same at the end.
    pub read: [usize; 2],
}

/// How far below a folder runs are looked for, and in how many folders at most.
const MOST_DEPTH: usize = 4;
const MOST_FOLDERS: usize = 2_000;

/// The folder of an experiment's jobs, which are read with it; and others without runs.
const JOBS: &str = "jobs";
const LEFT_OUT: [&str; 5] = [JOBS, "target", "node_modules", "site-packages", "__pycache__"];

/// Reads files, and those of folders; what has not changed since, only once.
pub struct RunReader {
    places: Vec<PathBuf>,
    known: HashMap<PathBuf, (Stamp, Vec<Arc<SavedRun>>)>,
}

impl RunReader {
    pub fn new(places: &[PathBuf]) -> Self {
        Self { places: places.to_vec(), known: HashMap::new() }
    }

    /// Reads what is new. Calls `tell` before each file that is, with how many of all have been
    /// read and what they contain, until it says to stop.
    pub fn read(
        &mut self,
        mut tell: impl FnMut([usize; 2], &dyn Fn() -> FoundRuns) -> ControlFlow<()>,
    ) -> FoundRuns {
        let (files, damaged) = self.files();
        let listed: HashSet<&PathBuf> = files.iter().collect();
        self.known.retain(|path, _| listed.contains(path));
        for (i, path) in files.iter().enumerate() {
            let stamp = stamp(path).unwrap_or_default();
            if self.known.get(path).is_some_and(|(known, _)| *known == stamp) {
                continue;
            }
            if tell([i, files.len()], &|| self.found(&files, i + 1, &damaged)).is_break() {
                break;
            }
            // One that is replaced meanwhile is read again next time.
            let runs = file(path).unwrap_or_else(|error| {
                let is_foreign = !self.is_asked_for(path) && !is_checkpoint(path);
                if is_foreign { Vec::new() } else { vec![SavedRun::damaged(path, &error)] }
            });
            let runs = runs.into_iter().map(|run| Arc::new(SavedRun { written: stamp.0, ..run }));
            self.known.insert(path.clone(), (stamp, runs.collect()));
        }
        self.found(&files, files.len(), &damaged)
    }

    /// Lists the files with runs, and the folders that cannot be read.
    fn files(&self) -> (Vec<PathBuf>, Vec<Arc<SavedRun>>) {
        let (mut files, mut damaged) = (Vec::new(), Vec::new());
        for place in &self.places {
            if !place.is_dir() {
                files.push(place.clone());
                continue;
            }
            for folder in with_folders_below(place) {
                let found = files_of(&folder);
                if let Err(error) = &found
                    && folder == *place
                {
                    damaged.push(Arc::new(SavedRun::damaged(&folder, error)));
                }
                files.extend(found.unwrap_or_default());
            }
        }
        // A folder may be named twice.
        let mut listed = HashSet::new();
        let mut files: Vec<PathBuf> = files.into_iter().map(short).collect();
        files.retain(|file| listed.insert(whole(file)));
        (files, damaged)
    }

    /// Whether it is a place, or in one or in the usual ones: other programs' files end in .jsonl, too.
    fn is_asked_for(&self, path: &Path) -> bool {
        let whole_path = whole(path);
        let folder = whole_path.parent();
        let is_place = |place: &PathBuf| place == path || Some(&*whole(place)) == folder;
        let is_own = |folder: &Path| folder.ends_with(JOBS) || folder.ends_with(SAVES);
        self.places.iter().any(is_place) || folder.is_some_and(is_own)
    }

    fn found(&self, files: &[PathBuf], read: usize, damaged: &[Arc<SavedRun>]) -> FoundRuns {
        let known = files.iter().filter_map(|path| self.known.get(path));
        let runs = known.flat_map(|(_, runs)| runs).chain(damaged).cloned().collect();
        FoundRuns { runs: join(runs), read: [read, files.len()] }
    }
}

/// Returns the checkpoints in a folder and below, jobs' too.
pub fn checkpoints_below(folder: &Path) -> Vec<PathBuf> {
    let folders = with_folders_below(folder).into_iter().flat_map(|own| [own.join(JOBS), own]);
    folders.flat_map(|folder| files_in(&folder).unwrap_or_default()).map(short).collect()
}

/// Names of what is in the present folder are short.
fn short(file: PathBuf) -> PathBuf {
    file.strip_prefix(".").map(Path::to_owned).unwrap_or(file)
}

/// Returns a folder and those below it that may have runs, each once, the usual ones first.
fn with_folders_below(folder: &Path) -> Vec<PathBuf> {
    let (mut all, mut known) = (VecDeque::from([(folder.to_owned(), 0)]), HashSet::new());
    let mut found = Vec::new();
    while let Some((folder, depth)) = all.pop_front().filter(|_| known.len() < MOST_FOLDERS) {
        // By links, it may have another name, too.
        if folder.canonicalize().is_ok_and(|real| !known.insert(real)) {
            continue;
        }
        let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        let inner = entries.map(|entry| entry.path()).filter(|path| {
            let is_left_out = LEFT_OUT.iter().any(|name| path.ends_with(name));
            depth < MOST_DEPTH && !is_left_out && !is_hidden(path) && path.is_dir()
        });
        let mut inner: Vec<PathBuf> = inner.collect();
        inner.sort_by_key(|path| (!path.ends_with(SAVES), path.is_symlink(), path.clone()));
        all.extend(inner.into_iter().map(|path| (path, depth + 1)));
        found.push(folder);
    }
    found
}

#[cfg(test)]
mod tests {
    use std::fs::{File, create_dir_all, remove_file, write};
    use std::time::SystemTime;

    use tempfile::TempDir;

    use super::super::{RecordsReader, RunKind, RunState};
    use super::*;

    const START: &str = "{\"event\":\"start\",\"world\":\"maze\",\"map\":{\"name\":\"room\"},\
        \"method\":\"gdg\",\"preset\":\"default\",\"settings\":{},\"seed\":3,\"updates\":0}\n";

    fn records(updates: u64) -> String {
        format!("{START}{{\"event\":\"progress\",\"updates\":{updates}}}\n")
    }

    fn folder_of(files: &[(&str, &str)]) -> TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            create_dir_all(path.parent().expect("a folder")).expect("a folder");
            write(path, text).expect("a file");
        }
        folder
    }

    fn read(reader: &mut RunReader) -> (Vec<Arc<SavedRun>>, usize) {
        let mut told = 0;
        let found = reader.read(|_, _| {
            told += 1;
            ControlFlow::Continue(())
        });
        (found.runs, told)
    }

    fn read_all(folder: &Path) -> Vec<Arc<SavedRun>> {
        read(&mut RunReader::new(&[folder.to_owned()])).0
    }

    #[test]
    fn only_files_that_have_changed_are_read_again() {
        let files = [
            ("1.jsonl", &*records(1_000)),
            ("2.jsonl", "{}\n"),
            ("notes.txt", "other"),
            ("suite/jobs/b.jsonl", &records(300)),
            ("other/c.jsonl", START),
            ("other/data.jsonl", "[]\n"),
            ("other/model.safetensors", "none of ours"),
            ("target/d.jsonl", START),
        ];
        let folder = folder_of(&files);
        let path = |name: &str| folder.path().join(name);
        let mut reader = RunReader::new(&[folder.path().to_owned(), folder.path().to_owned()]);
        let mut read = || {
            let (runs, told) = read(&mut reader);
            (runs.iter().map(|run| run.updates).collect::<Vec<u64>>(), told)
        };
        // A link to a folder beside it.
        std::os::unix::fs::symlink("suite", path("linked")).expect("a link");
        assert_eq!(read(), (vec![1_000, 0, 0, 300], 6), "the second one is damaged");
        assert_eq!(read(), (vec![1_000, 0, 0, 300], 0), "nothing is new");
        // Its last line is not complete yet.
        write(path("1.jsonl"), records(2_000) + "{\"eve").expect("a file");
        assert_eq!(read(), (vec![2_000, 0, 0, 300], 1), "it has grown");
        remove_file(path("2.jsonl")).expect("a file");
        let windows = format!("\u{feff}{}", records(5)).replace('\n', "\r\n");
        write(path("1.jsonl"), windows).expect("a file");
        assert_eq!(read(), (vec![5, 0, 300], 1));
        let mut told = Vec::new();
        RunReader::new(&[folder.path().to_owned()]).read(|_, found| {
            told.push(found().read);
            ControlFlow::Break(())
        });
        assert_eq!(told, [[1, 5]], "it stops");
    }

    #[test]
    fn records_are_read_on_and_anew_where_they_are_others() {
        let folder = folder_of(&[("a.jsonl", &records(1_000))]);
        let path = folder.path().join("a.jsonl");
        let mut reader = RecordsReader::new(&path);
        let mut read = |text: String| {
            write(&path, text).expect("a file");
            let runs = reader.read().expect("records");
            (runs.len(), runs[0].seed, runs[0].updates)
        };
        assert_eq!(read(String::new()), (1, 0, 0), "it has just begun");
        assert_eq!(read(records(1_000)), (1, 3, 1_000));
        // What was read before is not read again.
        let rest = "?".repeat(records(1_000).len() - START.len() - 1);
        let grown = format!("{START}{rest}\n{{\"event\":\"prog");
        assert_eq!(read(grown.clone()), (1, 3, 1_000), "its last line is not complete yet");
        assert_eq!(read(grown + "ress\",\"updates\":2000}\n"), (1, 3, 2_000));
        assert_eq!(read(records(5)), (1, 3, 5), "it has shrunk");
        assert_eq!(read(records(9_000_000).replace("\"seed\":3", "\"seed\":4")), (1, 4, 9_000_000));
        // Another program's file may be large.
        write(&path, "{}\n".repeat(400_000) + &records(5)).expect("a file");
        assert!(RecordsReader::new(&path).read().is_err());
    }

    #[test]
    fn a_job_runs_as_long_as_its_checkpoint_is_held_and_saved() {
        let folder = folder_of(&[("job.lock", "")]);
        let (now, source) = (SystemTime::now(), folder.path().join("job.safetensors"));
        let state = |minutes: u64| {
            let written = Some(now - std::time::Duration::from_mins(minutes));
            let (kind, end) = (RunKind::Checkpoint, Some(RunState::Ended));
            SavedRun { source: source.clone(), kind, end, written, ..SavedRun::default() }.state()
        };
        assert_eq!([1, 20].map(state), [RunState::Running, RunState::Ended]);
        remove_file(folder.path().join("job.lock")).expect("a file");
        assert_eq!(state(1), RunState::Ended);
        let held = File::create(&source).expect("a file");
        held.lock().expect("a lock");
        assert_eq!([1, 20].map(state), [RunState::Running, RunState::Ended], "in an interface");
    }

    #[test]
    fn a_file_may_have_several_runs_and_parts_of_one() {
        let maze = |name: &str| records(1_000).replace("room", name);
        let python = records(1).replace(r#""map":{"name":"room"}"#, r#""gym":{"id":"FetchReach"}"#);
        let text = maze("b") + &maze("c") + &maze("a") + &maze("c") + &python;
        let runs = read_all(folder_of(&[("1.jsonl", &text)]).path());
        let maps: Vec<&str> = runs.iter().map(|run| &*run.map).collect();
        assert_eq!(maps, ["b", "c", "a", "FetchReach"], "in the order in which they began");
        let evaluated = |(updates, success): (u64, f64)| {
            format!(
                "{{\"event\":\"evaluation\",\"updates\":{updates},\"env_steps\":0,\"seconds\":0,\"greedy\":{{\"success\":{success},\
                 \"spl\":null,\"steps_ratio\":null,\"by_distance\":[]}},\"planned\":null}}\n"
            )
        };
        let first = [(3_000, 0.1), (6_000, 0.2), (9_000, 0.3)].map(evaluated).concat();
        // Saved at 5,000 updates and killed after 9,000.
        let resumed = START.replace("\"updates\":0", "\"updates\":5000");
        let again = [(6_000, 0.4), (7_000, 0.5)].map(evaluated).concat();
        let folder = folder_of(&[("1.jsonl", &(START.to_owned() + &first + &resumed + &again))]);
        let curve = read_all(folder.path()).remove(0);
        let curve = curve.evaluations.iter();
        let curve: Vec<_> = curve.map(|at| (at.updates, at.evaluation.alone.success)).collect();
        assert_eq!(curve, [(3_000, Some(0.1)), (6_000, Some(0.4)), (7_000, Some(0.5))]);
    }
}
