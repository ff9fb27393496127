//! The folder of an experiment: results, checkpoints and pictures of its jobs.
//!
//! ```text
//! jobs/NAME.json          the result of a finished job
//! jobs/NAME.safetensors   the checkpoint of one that has begun
//! jobs/NAME.lock          held by the process that runs it
//! pictures/NAME.png
//! ```

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::{Deserialize, Serialize};

use super::job::{Job, JobResult};
use crate::host::outputs::elsewhere;
use gdg::files::{self, LockFile, has_extension, is_hidden};
use gdg::text::{escape_json_line, sanitized};
use gdg::train::{describe, is_checkpoint, remove_own};

/// Maximum size of a result file.
const MAX_RESULT_BYTES: u64 = 64 << 20;

/// A job's state on disk.
#[derive(Clone, Debug)]
pub enum State {
    /// Nothing is stored, or a result that cannot be used.
    NotBegun,
    /// Begun: the checkpoint's number of updates.
    Begun(u64),
    /// There is a result.
    Done(Box<JobResult>),
}

/// Why a result cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ResultError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// Its contents are not what was written.
    #[error("is damaged: {0}")]
    Damaged(String),
    /// The beginning of the other job's key is the same.
    #[error("is the result of another job")]
    Other,
}

/// A result as it is stored.
#[derive(Serialize, Deserialize)]
struct StoredResult {
    #[serde(flatten)]
    result: JobResult,
    /// CRC-32 of the result as compact JSON, in hexadecimal digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    checksum: Option<String>,
}

fn checksum_of(result: &JobResult) -> String {
    // A result that cannot be serialised matches no stored checksum.
    let json = serde_json::to_vec(result).unwrap_or_default();
    format!("{:08x}", crc32fast::hash(&json))
}

/// Reads a result without knowing its job.
///
/// # Errors
/// The file cannot be read, or is not a result as it was written.
pub fn read_result(path: &Path) -> Result<JobResult, ResultError> {
    let bytes = files::read(path, MAX_RESULT_BYTES)?;
    let StoredResult { result, checksum } =
        serde_json::from_slice(&bytes).map_err(|error| ResultError::Damaged(error.to_string()))?;
    // Older results have no checksum.
    if checksum.is_some_and(|checksum| checksum != checksum_of(&result)) {
        return Err(ResultError::Damaged("its checksum is wrong".to_owned()));
    }
    Ok(result)
}

/// The folder of an experiment.
#[derive(Clone, Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// Returns the folder at `path`, which need not exist yet.
    pub fn new(path: &Path) -> Self {
        Self(path.to_owned())
    }

    /// Checks that files called `names` can be written to it; creates it if needed.
    ///
    /// # Errors
    /// They cannot, or the folder has never had jobs but already contains other files there.
    pub fn check_writable(&self, names: &[&str]) -> Result<(), Report> {
        let first_part =
            |name: &&str| Path::new(*name).components().next().map(|part| self.0.join(part));
        let is_used = |path: &PathBuf| {
            path.is_file() || path.read_dir().is_ok_and(|mut entries| entries.next().is_some())
        };
        if !self.0.join("jobs").exists()
            && let Some(other) = names.iter().filter_map(first_part).find(is_used)
        {
            let help = "give --out a folder of its own";
            return Err(miette!(
                help = help,
                "{}: was not written by gdg-tui and is not replaced",
                other.display()
            ));
        }
        let check = |path: PathBuf| {
            files::check_replaceable(&path).and_then(|()| files::check_writable(&path)).map_err(
                |error| {
                    let help = "give --out a writable folder";
                    miette!(
                        help = help,
                        "{}: results cannot be saved here: {error}",
                        path.display()
                    )
                },
            )
        };
        names.iter().map(|name| self.0.join(name)).try_for_each(check)
    }

    /// Checks that jobs have been run in it.
    ///
    /// # Errors
    /// There is no such folder, or it has no jobs.
    pub fn check_has_jobs(&self) -> Result<(), Report> {
        if self.0.join("jobs").is_dir() {
            return Ok(());
        }
        let problem =
            if self.0.is_dir() { "this folder has no jobs" } else { "there is no such folder" };
        Err(miette!(
            help = "give --out the folder in which the jobs were run",
            "{}: {problem}",
            self.0.display()
        ))
    }

    /// Returns the path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file in it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Report> {
        let path = self.path(name);
        files::write_unlinked(&path, bytes)
            .into_diagnostic()
            .wrap_err_with(|| path.display().to_string())
    }

    /// Returns the path of a job's checkpoint.
    pub fn checkpoint(&self, job: &Job) -> PathBuf {
        self.0.join(format!("jobs/{}.safetensors", job.name))
    }

    fn result(&self, job: &Job) -> PathBuf {
        self.0.join(format!("jobs/{}.json", job.name))
    }

    /// Returns the job's state. A result that cannot be used counts as none; [`Self::problem`] says
    /// why.
    pub fn state(&self, job: &Job) -> State {
        match self.read(job) {
            Ok(Some(result)) => State::Done(Box::new(result)),
            Ok(None) | Err(_) => describe(&self.checkpoint(job))
                .map_or(State::NotBegun, |found| State::Begun(found.updates)),
        }
    }

    /// Returns why the job's result cannot be used, if there is one that cannot.
    pub fn problem(&self, job: &Job) -> Option<String> {
        self.read(job)
            .err()
            .map(|problem| sanitized(&format!("{}: {problem}", self.result(job).display())))
    }

    /// Reads the job's result, if there is one.
    fn read(&self, job: &Job) -> Result<Option<JobResult>, ResultError> {
        match read_result(&self.result(job)) {
            Err(ResultError::Unreadable(error)) if error.kind() == ErrorKind::NotFound => Ok(None),
            Ok(result) if result.key != job.key => Err(ResultError::Other),
            result => result.map(Some),
        }
    }

    /// Returns the results of all jobs ever finished in it, sorted by name, and says why the others
    /// cannot be used.
    pub fn results(&self) -> (Vec<JobResult>, Vec<String>) {
        let entries = std::fs::read_dir(self.0.join("jobs")).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        paths.retain(|path| has_extension(path, "json") && !is_hidden(path));
        paths.sort();
        let (mut results, mut problems) = (Vec::new(), Vec::new());
        for path in paths {
            match read_result(&path) {
                Ok(result) => results.push(result),
                Err(problem) => {
                    problems.push(sanitized(&format!("{}: {problem}", path.display())));
                }
            }
        }
        (results, problems)
    }

    /// Checks that the job's result, checkpoint and picture can be written.
    ///
    /// # Errors
    /// One of the paths is a symbolic link, not a regular file, or must not be replaced.
    pub fn check_result_writable(&self, job: &Job) -> Result<(), Report> {
        let help = "move it away, or give --out another folder";
        let check = |path: PathBuf, what: &str| {
            files::check_replaceable(&path).map_err(|error| {
                miette!(help = help, "{}: the {what} cannot be saved: {error}", path.display())
            })
        };
        check(self.result(job), "result")?;
        check(self.path(&picture_name(&job.name)), "picture")?;
        let path = self.checkpoint(job);
        if path.is_file() && !is_checkpoint(&path) {
            let problem = "is not a checkpoint of gdg-tui and is not replaced";
            return Err(miette!(help = help, "{}: {problem}", path.display()));
        }
        check(path, "checkpoint")
    }

    /// Returns the job's result, if it is done.
    pub fn result_of(&self, job: &Job) -> Option<JobResult> {
        match self.state(job) {
            State::Done(result) => Some(*result),
            State::Begun(_) | State::NotBegun => None,
        }
    }

    /// Locks the job for this process until the lock is dropped; returns `None` if another process
    /// runs it. Where the file system has no locks, two processes may do the same work, with the
    /// same result.
    ///
    /// # Errors
    /// The lock file cannot be created, or something else is in its place.
    pub fn lock(&self, job: &Job) -> Result<Option<LockFile>, Report> {
        let path = self.0.join(format!("jobs/{}.lock", job.name));
        let locked =
            std::fs::create_dir_all(self.0.join("jobs")).and_then(|()| LockFile::try_at(&path));
        locked.map_err(|error| {
            let help = "move it away, or give --out another folder";
            miette!(help = help, "{}: the job cannot be locked: {error}", path.display())
        })
    }

    /// Writes the job's result and, if there is one, its picture, and removes its checkpoint unless
    /// `keep`.
    ///
    /// # Errors
    /// A file cannot be written. The result is kept if only the picture cannot.
    pub fn finish(
        &self,
        job: &Job,
        result: &JobResult,
        picture: Option<&[u8]>,
        keep: bool,
    ) -> Result<(), Report> {
        let stored = StoredResult { checksum: Some(checksum_of(result)), result: result.clone() };
        let json = serde_json::to_string_pretty(&stored).into_diagnostic()?;
        let json = escape_json_line(&json) + "\n";
        let drawn = picture.map_or(Ok(()), |picture| self.write(&picture_name(&job.name), picture));
        // The result last: it marks the job as done.
        self.write(&format!("jobs/{}.json", job.name), json.as_bytes())?;
        if !keep {
            let checkpoint = self.checkpoint(job);
            // A leftover checkpoint does no harm: the result counts.
            let _ = std::fs::remove_file(&checkpoint);
            elsewhere(&checkpoint).iter().for_each(|path| remove_own(path));
        }
        drawn.wrap_err("the result is kept, but its picture cannot be written")
    }
}

/// Returns the path of a job's picture within the folder.
pub fn picture_name(job: &str) -> String {
    format!("pictures/{job}.png")
}
