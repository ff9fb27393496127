//! The folder of an experiment: results, checkpoints and pictures of its jobs.
//!
//! ```text
//! jobs/NAME.json          the result of a finished job
//! jobs/NAME.safetensors   its checkpoint, from when it has begun
//! jobs/NAME.lock          held by the process that runs it
//! pictures/NAME.png
//! ```

use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::spec::{JobResult, JobSpec};
use crate::figure::{table_behind, text_with_sums};
use crate::setup::outputs::{elsewhere, prepare_file};
use gdg::files::{self, FileFormat, LockFile, Mismatch, Wanted, has_extension, is_hidden};
use gdg::printing::eprint_line;
use gdg::text::{escape_json_line, sanitized};
use gdg::train::{describe, is_checkpoint, remove_own};

const MAX_RESULT_BYTES: u64 = 64 << 20;

const MOVE_AWAY: &str = "move it away, or give --out another folder";

const FORMATS: &[FileFormat] = &[FileFormat::Json, FileFormat::Text];
const RESULT: Wanted = Wanted { name: "the result of a job", help: MOVE_AWAY, own: FORMATS };

pub fn read_result(path: &Path) -> Result<JobResult, Report> {
    let problem =
        |problem: String| Report::msg(sanitized(&format!("{}: {problem}", path.display())));
    let bytes = files::read(path, MAX_RESULT_BYTES)
        .map_err(|error| problem(format!("cannot be read: {error}")))?;
    let result: JobResult =
        serde_json::from_slice(&bytes).map_err(|error| problem(format!("is damaged: {error}")))?;
    match result.evaluations.iter().find(|at| !at.is_possible()) {
        Some(at) => {
            Err(problem(format!("is damaged: impossible numbers at update {}", at.updates)))
        }
        None => Ok(result),
    }
}

/// The folder of an experiment, which need not exist yet.
#[derive(Clone, Debug)]
pub struct Folder(pub PathBuf);

impl Folder {
    /// Checks that it can be written to.
    pub fn check_writable(&self) -> Result<(), Report> {
        ["report.md", "jobs/NAME.json"].map(|name| self.0.join(name)).iter().try_for_each(|path| {
            files::check_writable(path).map_err(|error| {
                let (help, path) = ("give --out a writable folder", path.display());
                miette!(help = help, "{path}: results cannot be saved here: {error}")
            })
        })
    }

    pub fn check_has_jobs(&self) -> Result<(), Report> {
        if self.0.join("jobs").is_dir() {
            return Ok(());
        }
        let problem =
            if self.0.is_dir() { "this folder has no jobs" } else { "there is no such folder" };
        let help = "give --out the folder in which the jobs were run";
        Err(miette!(help = help, "{}: {problem}", self.0.display()))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Report> {
        prepare_file(&self.path(name), bytes)?().map(drop)
    }

    /// Writes the report; says so and leaves the one there if this program has not written it like that.
    pub fn write_report(&self, text: String) -> Result<(), Report> {
        let path = self.path("report.md");
        if path.exists() && table_behind(&path).is_none() {
            let why = "not as gdg-tui has written it, so it is left as it is";
            eprint_line(&format!("{}: {why}: move it away to have a new one", path.display()));
            return Ok(());
        }
        let written = self.write("report.md", &text_with_sums(text.into_bytes(), b""));
        written.map(|()| eprint_line(&format!("report: {}", path.display())))
    }

    pub fn checkpoint(&self, job: &JobSpec) -> PathBuf {
        self.0.join(format!("jobs/{}.safetensors", job.name))
    }

    fn result_path(&self, job: &JobSpec) -> PathBuf {
        self.0.join(format!("jobs/{}.json", job.name))
    }

    pub fn state(&self, job: &JobSpec) -> String {
        if self.result_of(job).is_some() {
            return "done".to_owned();
        }
        let begun = describe(&self.checkpoint(job));
        begun.map_or("not begun".to_owned(), |found| {
            format!("begun, {} updates done", found.updates)
        })
    }

    /// Returns the job's result, if it is done and the result can be used.
    pub fn result_of(&self, job: &JobSpec) -> Option<JobResult> {
        read_result(&self.result_path(job)).ok().filter(|result| result.key == job.key)
    }

    /// Returns why the job's result, if there is one, cannot be used and is made again. Files of
    /// other kinds are not replaced.
    pub fn problem(&self, job: &JobSpec) -> Result<Option<String>, Report> {
        let path = self.result_path(job);
        let Ok(found) = path.metadata() else { return Ok(None) };
        let is_of_another_kind = || RESULT.mismatch(&path).filter(|_| found.len() > 0);
        match read_result(&path) {
            Ok(result) if result.key == job.key => Ok(None),
            Ok(_) => Ok(Some(format!("{}: is the result of another job", path.display()))),
            Err(problem) => match is_of_another_kind() {
                Some(Mismatch { problem, help }) => {
                    Err(miette!(help = help, "{}: {problem}", path.display()))
                }
                None => Ok(Some(problem.to_string())),
            },
        }
    }

    /// Returns the results of all jobs ever finished in it, sorted by name, and says why the others
    /// cannot be used.
    pub fn results(&self) -> (Vec<JobResult>, Vec<Report>) {
        let entries = std::fs::read_dir(self.0.join("jobs")).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        paths.retain(|path| has_extension(path, "json") && !is_hidden(path));
        paths.sort();
        let read = paths.iter().map(|path| read_result(path));
        let (results, problems): (Vec<_>, Vec<_>) = read.partition(Result::is_ok);
        let problems = problems.into_iter().filter_map(Result::err);
        (results.into_iter().flatten().collect(), problems.collect())
    }

    pub fn check_result_writable(&self, job: &JobSpec) -> Result<(), Report> {
        let checkpoint = self.checkpoint(job);
        if checkpoint.is_file() && !is_checkpoint(&checkpoint) {
            let problem = "is not a checkpoint of gdg-tui and is not replaced";
            return Err(miette!(help = MOVE_AWAY, "{}: {problem}", checkpoint.display()));
        }
        let files = [
            (self.result_path(job), "result"),
            (self.path(&picture_name(&job.name)), "picture"),
            (checkpoint, "checkpoint"),
        ];
        files.into_iter().try_for_each(|(path, what)| {
            files::check_name(&path).map_err(|error| {
                let path = path.display();
                miette!(help = MOVE_AWAY, "{path}: the {what} cannot be saved: {error}")
            })
        })
    }

    /// Locks the job for this process until the lock is dropped; returns `None` if another process
    /// runs it. Where the file system has no locks, two processes may do the same work, with the
    /// same result.
    pub fn lock(&self, job: &JobSpec) -> Result<Option<LockFile>, Report> {
        let path = self.0.join(format!("jobs/{}.lock", job.name));
        let locked =
            std::fs::create_dir_all(self.0.join("jobs")).and_then(|()| LockFile::try_at(&path));
        locked.map_err(|error| {
            miette!(help = MOVE_AWAY, "{}: the job cannot be locked: {error}", path.display())
        })
    }

    /// Writes the job's result and, if there is one, its picture, and removes its checkpoint unless
    /// `keep`. The result is kept if only the picture cannot be written.
    pub fn finish(
        &self,
        job: &JobSpec,
        result: &JobResult,
        picture: Option<&[u8]>,
        keep: bool,
    ) -> Result<(), Report> {
        let json = serde_json::to_string_pretty(result).into_diagnostic()?;
        let json = escape_json_line(&json) + "\n";
        let drawn = picture.map_or(Ok(()), |picture| self.write(&picture_name(&job.name), picture));
        // The result last: it marks the job as done.
        self.write(&format!("jobs/{}.json", job.name), json.as_bytes())?;
        if !keep {
            // A leftover checkpoint does no harm: the result counts. Somebody may go on with it.
            let checkpoint = self.checkpoint(job);
            elsewhere(&checkpoint).iter().chain([&checkpoint]).for_each(|path| remove_own(path));
        }
        drawn.wrap_err("the result is kept, but its picture cannot be written")
    }
}

pub fn picture_name(job: &str) -> String {
    format!("pictures/{job}.png")
}
