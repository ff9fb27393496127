//! Reads folders of runs again and again, as files grow.

use std::collections::{HashMap, HashSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use miette::Report;

use super::join::{Dated, join};
use super::{SavedRun, file, files_of};
use crate::host::runs::SAVES;
use gdg::text::sanitized;

/// The runs of folders.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The runs, with the time at which their files were written.
    pub runs: Vec<Dated>,
    /// Files and folders that cannot be read, and why.
    pub problems: Vec<(PathBuf, String)>,
    /// The file being read, of how many; both are the same at the end.
    pub read: [usize; 2],
}

/// What distinguishes versions of a file: when it was written, and its size.
type Stamp = (Option<SystemTime>, u64);

/// What a version of a file contains, or why it cannot be read.
struct Version {
    stamp: Stamp,
    contents: Result<Vec<Arc<SavedRun>>, String>,
}

/// Reads folders; what has not changed since, only once.
pub struct Reader {
    folders: Vec<PathBuf>,
    known: HashMap<PathBuf, Version>,
}

impl Reader {
    /// Creates a reader of folders, and of the experiments in them.
    pub fn new(folders: &[PathBuf]) -> Self {
        Self { folders: folders.to_vec(), known: HashMap::new() }
    }

    /// Reads what is new. Calls `tell` before each file that is, with how many of all have been
    /// read and what they contain, until it says to stop.
    pub fn read(
        &mut self,
        mut tell: impl FnMut([usize; 2], &dyn Fn() -> Found) -> ControlFlow<()>,
    ) -> Found {
        let (files, problems) = self.files();
        let all: Vec<(PathBuf, Stamp)> = files.into_iter().map(with_stamp).collect();
        let listed: HashSet<&PathBuf> = all.iter().map(|(file, _)| file).collect();
        self.known.retain(|path, _| listed.contains(path));
        for (i, (path, stamp)) in all.iter().enumerate() {
            if self.known.get(path).is_some_and(|version| version.stamp == *stamp) {
                continue;
            }
            if tell([i, all.len()], &|| self.found(&all, i + 1, &problems)).is_break() {
                break;
            }
            // One that is replaced meanwhile is read again next time.
            let contents = file(path).map(|runs| runs.into_iter().map(Arc::new).collect());
            let contents = contents.map_err(|problem| reason(path, &problem));
            self.known.insert(path.clone(), Version { stamp: *stamp, contents });
        }
        self.found(&all, all.len(), &problems)
    }

    /// Lists the files with runs, and the folders that cannot be read.
    fn files(&self) -> (Vec<PathBuf>, Vec<(PathBuf, String)>) {
        let (mut files, mut problems) = (Vec::new(), Vec::new());
        // The usual folder is created by the first run that is saved.
        let is_missing = |folder: &&PathBuf| folder.as_os_str() == SAVES && !folder.exists();
        let folders = self.folders.iter().filter(|folder| !is_missing(folder));
        for folder in folders.flat_map(|folder| with_experiments(folder)) {
            match files_of(&folder) {
                Ok(found) => files.extend(found),
                Err(problem) => problems.push((folder.clone(), reason(&folder, &problem))),
            }
        }
        // A folder may be named twice, or be an experiment's in another.
        let mut listed = HashSet::new();
        files.retain(|file| listed.insert(file.clone()));
        (files, problems)
    }

    fn found(
        &self,
        files: &[(PathBuf, Stamp)],
        read: usize,
        problems: &[(PathBuf, String)],
    ) -> Found {
        let (mut runs, mut problems) = (Vec::new(), problems.to_vec());
        for (path, (written, _)) in files {
            match self.known.get(path).map(|version| &version.contents) {
                Some(Ok(found)) => runs.extend(found.iter().map(|run| (run.clone(), *written))),
                Some(Err(problem)) => problems.push((path.clone(), problem.clone())),
                None => {}
            }
        }
        Found { runs: join(runs), problems, read: [read, files.len()] }
    }
}

/// Returns a folder, and those in it that are of experiments.
fn with_experiments(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let inner = entries.map(|entry| entry.path()).filter(|path| path.join("jobs").is_dir());
    let mut all: Vec<PathBuf> = inner.collect();
    all.sort();
    all.insert(0, folder.to_owned());
    all
}

fn with_stamp(path: PathBuf) -> (PathBuf, Stamp) {
    let facts = std::fs::metadata(&path).ok();
    let stamp = facts.map_or((None, 0), |facts| (facts.modified().ok(), facts.len()));
    (path, stamp)
}

/// Returns why a file cannot be read, without its name, but with the line if there is one.
fn reason(path: &Path, problem: &Report) -> String {
    let (text, name) = (problem.to_string(), path.display().to_string());
    let Some(rest) = text.strip_prefix(&name) else { return sanitized(&text) };
    let rest = rest.trim_start_matches([':', ' ']);
    let is_line = rest.starts_with(|c: char| c.is_ascii_digit());
    format!("{}{}", if is_line { "line " } else { "" }, sanitized(rest))
}

#[cfg(test)]
mod tests {
    use std::fs::{create_dir, remove_file, write};

    use super::*;

    const START: &str = r#"{"event":"start","world":"maze","map":{"name":"room"},"method":"gdg",
        "preset":"default","settings":{},"seed":3,"updates":0}"#;

    fn start() -> String {
        START.replace('\n', "") + "\n"
    }

    fn progress(updates: u64) -> String {
        format!("{{\"event\":\"progress\",\"updates\":{updates}}}\n")
    }

    fn read(reader: &mut Reader) -> (Vec<u64>, usize, usize) {
        let mut told = 0;
        let found = reader.read(|_, _| {
            told += 1;
            ControlFlow::Continue(())
        });
        let updates = found.runs.iter().map(|(run, _)| run.updates).collect();
        (updates, found.problems.len(), told)
    }

    #[test]
    fn only_files_that_have_changed_are_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two] = ["one.jsonl", "two.jsonl"].map(|name| folder.path().join(name));
        write(&one, start() + &progress(1_000)).expect("a file");
        write(&two, "{}\n").expect("a file");
        write(folder.path().join("notes.txt"), "not read").expect("a file");
        let mut reader = Reader::new(&[folder.path().to_owned()]);
        assert_eq!(read(&mut reader), (vec![1_000], 1, 2), "the second one is damaged");
        assert_eq!(read(&mut reader), (vec![1_000], 1, 0), "nothing is new");
        // Its last line is not complete yet.
        write(&one, start() + &progress(1_000) + &progress(2_000) + "{\"eve").expect("a file");
        assert_eq!(read(&mut reader), (vec![2_000], 1, 1), "it has grown");
        remove_file(&two).expect("a file");
        assert_eq!(read(&mut reader), (vec![2_000], 0, 0));
    }

    #[test]
    fn runs_of_a_file_are_in_the_order_in_which_they_began() {
        let folder = tempfile::tempdir().expect("a folder");
        let of_map = |name: &str| start().replace("room", name) + &progress(1_000);
        let text = of_map("b") + &of_map("c") + &of_map("a") + &of_map("c");
        write(folder.path().join("one.jsonl"), text).expect("a file");
        let found = Reader::new(&[folder.path().to_owned()]).read(|_, _| ControlFlow::Continue(()));
        let maps: Vec<&str> = found.runs.iter().map(|(run, _)| &*run.map).collect();
        assert_eq!(maps, ["b", "c", "a"]);
    }

    #[test]
    fn what_is_trained_again_after_a_resume_replaces_what_was_lost() {
        let folder = tempfile::tempdir().expect("a folder");
        let evaluated = |updates: u64, success: f64| {
            format!(
                "{{\"event\":\"evaluation\",\"updates\":{updates},\"greedy\":{{\"success\":{success},\
                 \"spl\":null,\"steps_ratio\":null,\"by_distance\":[]}},\"planned\":null}}\n"
            )
        };
        let first: String = [(3_000, 0.1), (6_000, 0.2), (9_000, 0.3)]
            .map(|(updates, success)| evaluated(updates, success))
            .concat();
        // Saved at 5,000 updates and killed after 9,000.
        let again = evaluated(6_000, 0.4) + &evaluated(7_000, 0.5);
        let text =
            start() + &first + &start().replace("\"updates\":0", "\"updates\":5000") + &again;
        write(folder.path().join("one.jsonl"), text).expect("a file");
        let found = Reader::new(&[folder.path().to_owned()]).read(|_, _| ControlFlow::Continue(()));
        let [(run, _)] = &found.runs[..] else { panic!("{:?}", found.runs) };
        let curve: Vec<_> =
            run.evaluations.iter().map(|at| (at.updates, at.evaluation.greedy.success)).collect();
        assert_eq!(curve, [(3_000, Some(0.1)), (6_000, Some(0.4)), (7_000, Some(0.5))]);
    }

    #[test]
    fn a_run_in_an_environment_in_python_is_named_after_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let facts = r#""world":"gym","gym":{"id":"FetchReach-v4"}"#;
        let start = start().replace(r#""world":"maze","map":{"name":"room"}"#, facts);
        write(folder.path().join("one.jsonl"), start).expect("a file");
        let found = Reader::new(&[folder.path().to_owned()]).read(|_, _| ControlFlow::Continue(()));
        assert_eq!(found.runs[0].0.map, "FetchReach-v4");
    }

    #[test]
    fn experiments_in_a_folder_are_read_and_their_results_replace_records() {
        let folder = tempfile::tempdir().expect("a folder");
        let jobs = folder.path().join("suite/jobs");
        std::fs::create_dir_all(&jobs).expect("a folder");
        create_dir(folder.path().join("other")).expect("a folder");
        let result = serde_json::json!({
            "name": "a", "key": "0", "version": "1", "method": "gdg", "preset": "default",
            "settings": [], "seed": 3, "map": "room", "updates": 500, "seconds": 1.0,
            "evaluations": [],
        });
        for (name, text) in [
            ("suite/jobs/a.json", result.to_string()),
            ("suite/jobs/a.jsonl", start() + &progress(400)),
            ("suite/jobs/b.jsonl", start() + &progress(300)),
            ("other/c.jsonl", start()),
        ] {
            write(folder.path().join(name), text).expect("a file");
        }
        let mut reader = Reader::new(&[folder.path().to_owned()]);
        let (updates, problems, _) = read(&mut reader);
        assert_eq!((updates, problems), (vec![500, 300], 0), "c is in no experiment");
    }

    #[test]
    fn a_line_that_is_no_record_is_named_and_explained() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("run.jsonl");
        let long = "x".repeat(17 << 20);
        for (line, problem) in [
            ("[1]", ": not a record: no object with an \"event\""),
            ("{\"event\":", ":9: not a record: not JSON"),
            (
                "{\"event\":\"progress\",\"updates\":-3}",
                ": not a record: invalid value: integer `-3`, expected u64",
            ),
            (&long, ": not a record: longer than 16 MB"),
        ] {
            let read = |text: String| {
                write(&file, text).expect("a file");
                let mut reader = Reader::new(&[folder.path().to_owned()]);
                reader.read(|_, _| ControlFlow::Continue(()))
            };
            let found = read(line.to_owned() + "\n");
            assert_eq!(found.problems, [(file.clone(), format!("line 1{problem}"))], "no run");
            let found = read(start() + &progress(1_000) + line + "\n" + &progress(2_000));
            assert_eq!(found.problems, [], "the others are read");
            let run = &found.runs[0].0;
            assert_eq!((run.updates, run.skipped.to_string()), (2_000, format!("3{problem}")));
            let note = format!("{}:3{problem}: left out", file.display());
            assert_eq!(run.note(), Some(note));
        }
        write(&file, "version https://git-lfs.github.com/spec/v1\n").expect("a file");
        let error = crate::experiment::runs::file(&file).expect_err("no records").to_string();
        assert!(
            error
                .ends_with("is a Git LFS pointer, which stands for the file, not records of a run")
        );
    }

    #[test]
    fn files_that_windows_wrote_and_folders_that_are_named_twice_are_read_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!("\u{feff}{}{}", start(), progress(1_000)).replace('\n', "\r\n");
        write(folder.path().join("one.jsonl"), text).expect("a file");
        let mut reader = Reader::new(&[folder.path().to_owned(), folder.path().to_owned()]);
        assert_eq!(read(&mut reader), (vec![1_000], 0, 1));
    }

    #[test]
    fn a_checkpoint_is_found_from_above_its_records() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["saves", "records"] {
            create_dir(path(name)).expect("a folder");
        }
        write(path("saves/a.safetensors"), "").expect("a file");
        let saved = r#"{"event":"saved","updates":1,"path":"saves/a.safetensors"}"#;
        write(path("records/a.jsonl"), start() + saved + "\n").expect("a file");
        let found = Reader::new(&[path("records")]).read(|_, _| ControlFlow::Continue(()));
        assert_eq!(found.runs[0].0.checkpoint, Some(path("saves/a.safetensors")));
    }

    #[test]
    fn a_name_that_is_no_text_is_in_json_all_the_same() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().expect("a folder");
        let name = std::ffi::OsStr::from_bytes(b"a\xff.jsonl");
        if write(folder.path().join(name), start()).is_err() {
            return; // Not every file system has such names.
        }
        let mut reader = Reader::new(&[folder.path().to_owned()]);
        let found = reader.read(|_, _| ControlFlow::Continue(()));
        let line = serde_json::to_string(&found.runs[0].0.line(None)).expect("JSON");
        assert!(line.contains("a\u{fffd}.jsonl"), "{line}");
    }

    #[test]
    fn a_folder_that_is_missing_is_named_and_a_reader_can_be_stopped() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("none");
        let found =
            Reader::new(std::slice::from_ref(&missing)).read(|_, _| ControlFlow::Continue(()));
        assert!(
            found.problems[0].0 == missing && found.problems[0].1.starts_with("cannot be read"),
            "{:?}",
            found.problems
        );
        for name in ["a.jsonl", "b.jsonl"] {
            write(folder.path().join(name), start()).expect("a file");
        }
        let mut told = Vec::new();
        Reader::new(&[folder.path().to_owned()]).read(|_, found| {
            told.push(found().read);
            ControlFlow::Break(())
        });
        assert_eq!(told, [[1, 2]]);
    }
}
