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
    use std::fs::{create_dir_all, remove_file, write};

    use tempfile::TempDir;

    use super::*;

    const START: &str = "{\"event\":\"start\",\"world\":\"maze\",\"map\":{\"name\":\"room\"},\
        \"method\":\"gdg\",\"preset\":\"default\",\"settings\":{},\"seed\":3,\"updates\":0}\n";

    /// Returns the records of a run that has made so many updates.
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

    fn reader(folder: &Path) -> Reader {
        Reader::new(&[folder.to_owned()])
    }

    fn read_all(reader: &mut Reader) -> Found {
        reader.read(|_, _| ControlFlow::Continue(()))
    }

    /// Returns the updates of each run, and how many files cannot be read and were read.
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
        let files = [("1.jsonl", &*records(1_000)), ("2.jsonl", "{}\n"), ("notes.txt", "other")];
        let folder = folder_of(&files);
        let mut reader = Reader::new(&[folder.path().to_owned(), folder.path().to_owned()]);
        assert_eq!(read(&mut reader), (vec![1_000], 1, 2), "the second one is damaged");
        assert_eq!(read(&mut reader), (vec![1_000], 1, 0), "nothing is new");
        // Its last line is not complete yet.
        write(folder.path().join("1.jsonl"), records(2_000) + "{\"eve").expect("a file");
        assert_eq!(read(&mut reader), (vec![2_000], 1, 1), "it has grown");
        remove_file(folder.path().join("2.jsonl")).expect("a file");
        assert_eq!(read(&mut reader), (vec![2_000], 0, 0));
        let windows = format!("\u{feff}{}", records(5)).replace('\n', "\r\n");
        write(folder.path().join("1.jsonl"), windows).expect("a file");
        assert_eq!(read(&mut reader), (vec![5], 0, 1));
    }

    #[test]
    fn runs_of_a_file_are_named_after_their_worlds_in_the_order_in_which_they_began() {
        let maze = |name: &str| records(1_000).replace("room", name);
        let python = records(1).replace(r#""map":{"name":"room"}"#, r#""gym":{"id":"FetchReach"}"#);
        let text = maze("b") + &maze("c") + &maze("a") + &maze("c") + &python;
        let folder = folder_of(&[("1.jsonl", &text)]);
        let found = read_all(&mut reader(folder.path()));
        let maps: Vec<&str> = found.runs.iter().map(|(run, _)| &*run.map).collect();
        assert_eq!(maps, ["b", "c", "a", "FetchReach"]);
    }

    #[test]
    fn what_is_trained_again_after_a_resume_replaces_what_was_lost() {
        let evaluated = |(updates, success): (u64, f64)| {
            format!(
                "{{\"event\":\"evaluation\",\"updates\":{updates},\"greedy\":{{\"success\":{success},\
                 \"spl\":null,\"steps_ratio\":null,\"by_distance\":[]}},\"planned\":null}}\n"
            )
        };
        let first = [(3_000, 0.1), (6_000, 0.2), (9_000, 0.3)].map(evaluated).concat();
        // Saved at 5,000 updates and killed after 9,000.
        let resumed = START.replace("\"updates\":0", "\"updates\":5000");
        let again = [(6_000, 0.4), (7_000, 0.5)].map(evaluated).concat();
        let folder = folder_of(&[("1.jsonl", &(START.to_owned() + &first + &resumed + &again))]);
        let found = read_all(&mut reader(folder.path()));
        let [(run, _)] = &found.runs[..] else { panic!("{:?}", found.runs) };
        let curve: Vec<_> =
            run.evaluations.iter().map(|at| (at.updates, at.evaluation.greedy.success)).collect();
        assert_eq!(curve, [(3_000, Some(0.1)), (6_000, Some(0.4)), (7_000, Some(0.5))]);
    }

    #[test]
    fn experiments_in_a_folder_are_read_but_no_others() {
        let folder = folder_of(&[
            ("suite/jobs/a.json", "{}"),
            ("suite/jobs/b.jsonl", &records(300)),
            ("other/c.jsonl", START),
        ]);
        assert_eq!(read(&mut reader(folder.path())), (vec![300], 1, 2));
    }

    #[test]
    fn a_line_that_is_no_record_is_named_and_explained() {
        let folder = folder_of(&[]);
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
                read_all(&mut reader(folder.path()))
            };
            let found = read(line.to_owned() + "\n");
            assert_eq!(found.problems, [(file.clone(), format!("line 1{problem}"))], "no run");
            let found = read(records(1_000) + line + "\n{\"event\":\"progress\",\"updates\":9}\n");
            assert_eq!(found.problems, [], "the others are read");
            let run = &found.runs[0].0;
            assert_eq!((run.updates, run.skipped.to_string()), (9, format!("3{problem}")));
            let note = format!("{}:3{problem}: left out", file.display());
            assert_eq!(run.note(), Some(note));
        }
        write(&file, "version https://git-lfs.github.com/spec/v1\n").expect("a file");
        let error = crate::experiment::runs::file(&file).expect_err("no records").to_string();
        let pointer = "is a Git LFS pointer, which stands for the file, not records of a run";
        assert!(error.ends_with(pointer), "{error}");
    }

    #[test]
    fn a_checkpoint_is_found_from_above_its_records_and_null_in_json_once_it_is_gone() {
        let saved = r#"{"event":"saved","updates":1,"path":"saves/a.safetensors"}"#;
        let text = format!("{START}{saved}\n");
        let folder = folder_of(&[("saves/a.safetensors", ""), ("records/a.jsonl", &text)]);
        let found = read_all(&mut reader(&folder.path().join("records")));
        let (run, path) = (&found.runs[0].0, folder.path().join("saves/a.safetensors"));
        assert_eq!(run.checkpoint.as_ref(), Some(&path));
        let line = || serde_json::to_value(run.line(None)).expect("JSON");
        assert!(line()["checkpoint"].as_str().is_some_and(|name| path.ends_with(name)));
        remove_file(path).expect("a file");
        assert!(line()["checkpoint"].is_null());
    }

    #[test]
    fn a_name_that_is_no_text_is_in_json_all_the_same() {
        use std::os::unix::ffi::OsStrExt;
        let folder = folder_of(&[]);
        let name = std::ffi::OsStr::from_bytes(b"a\xff.jsonl");
        if write(folder.path().join(name), START).is_err() {
            return; // Not every file system has such names.
        }
        let found = read_all(&mut reader(folder.path()));
        let line = serde_json::to_string(&found.runs[0].0.line(None)).expect("JSON");
        assert!(line.contains("a\u{fffd}.jsonl"), "{line}");
    }

    #[test]
    fn a_folder_that_is_missing_is_named_and_a_reader_can_be_stopped() {
        let folder = folder_of(&[("a.jsonl", START), ("b.jsonl", START)]);
        let missing = folder.path().join("none");
        let found = read_all(&mut reader(&missing));
        let (path, problem) = &found.problems[0];
        assert!(*path == missing && problem.starts_with("cannot be read"), "{problem}");
        let mut told = Vec::new();
        reader(folder.path()).read(|_, found| {
            told.push(found().read);
            ControlFlow::Break(())
        });
        assert_eq!(told, [[1, 2]]);
    }
}
