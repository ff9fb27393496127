//! The folder of an experiment: results, checkpoints and pictures of its jobs.
//!
//! ```text
//! jobs/NAME.json          the result of a finished job
//! jobs/NAME.safetensors   the checkpoint of one that has begun
//! jobs/NAME.lock          held by the process that runs it
//! pictures/NAME.png
//! ```

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::job::{Job, JobResult};
use crate::files::{self, backup_path, write_atomically};
use crate::train::describe;

/// Maximum size of a result file.
const MAX_RESULT_BYTES: u64 = 64 << 20;

/// A job's state on disk.
#[derive(Clone, Debug)]
pub enum State {
    /// Nothing is stored.
    NotBegun,
    /// Begun: the checkpoint's number of updates.
    Begun(u64),
    /// There is a result.
    Done(Box<JobResult>),
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
    /// They cannot.
    pub fn check_writable(&self, names: &[&str]) -> Result<(), Report> {
        let report = self.0.join("report.md");
        if report.exists() && !self.0.join("jobs").exists() {
            let help = "give --out a folder of its own";
            return Err(miette!(help = help, "{}: is not of gdg-tui and is not replaced", report.display()));
        }
        let paths: Vec<PathBuf> = names.iter().map(|name| self.0.join(name)).collect();
        paths.iter().try_for_each(|path| files::check_writable(path)).map_err(|error| {
            let help = "give --out a writable folder";
            miette!(help = help, "{}: results cannot be saved here: {error}", self.0.display())
        })
    }

    /// Checks that jobs have been run in it.
    ///
    /// # Errors
    /// There is no such folder, or it has no jobs.
    pub fn check_has_jobs(&self) -> Result<(), Report> {
        if self.0.join("jobs").is_dir() {
            return Ok(());
        }
        let problem = if self.0.is_dir() { "this folder has no jobs" } else { "there is no such folder" };
        Err(miette!(help = "give --out the folder in which the jobs were run", "{}: {problem}", self.0.display()))
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
        write_atomically(&path, bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
    }

    /// Returns the path of a job's checkpoint.
    pub fn checkpoint(&self, job: &Job) -> PathBuf {
        self.0.join(format!("jobs/{}.safetensors", job.name))
    }

    fn result(&self, job: &Job) -> PathBuf {
        self.0.join(format!("jobs/{}.json", job.name))
    }

    /// Returns the job's state. A result that is damaged or belongs to another job counts as none.
    pub fn state(&self, job: &Job) -> State {
        let bytes = files::read(&self.result(job), MAX_RESULT_BYTES).unwrap_or_default();
        match serde_json::from_slice::<JobResult>(&bytes) {
            Ok(result) if result.key == job.key => State::Done(Box::new(result)),
            _ => describe(&self.checkpoint(job)).map_or(State::NotBegun, |found| State::Begun(found.updates)),
        }
    }

    /// Returns the job's result, if it is done.
    pub fn result_of(&self, job: &Job) -> Option<JobResult> {
        match self.state(job) {
            State::Done(result) => Some(*result),
            State::Begun(_) | State::NotBegun => None,
        }
    }

    /// Locks the job for this process until the lock is dropped; returns `None` if another process runs it. Where the
    /// file system has no locks, two processes may do the same work, with the same result.
    ///
    /// # Errors
    /// The lock file cannot be created.
    pub fn lock(&self, job: &Job) -> Result<Option<Lock>, Report> {
        let path = self.0.join(format!("jobs/{}.lock", job.name));
        let file = File::create(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Ok(None),
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Some(Lock { path, _file: file })),
        }
    }

    /// Writes the job's result and, if there is one, its picture, and removes its checkpoint unless it is to be kept.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn finish(&self, job: &Job, result: &JobResult, picture: Option<&[u8]>, keep: bool) -> Result<(), Report> {
        let json = serde_json::to_string_pretty(result).into_diagnostic()? + "\n";
        if let Some(picture) = picture {
            self.write(&picture_name(job), picture)?;
        }
        // The result last: it marks the job as done.
        self.write(&format!("jobs/{}.json", job.name), json.as_bytes())?;
        if !keep {
            let checkpoint = self.checkpoint(job);
            // What cannot be removed does no harm: the result counts.
            let _ = (std::fs::remove_file(backup_path(&checkpoint)), std::fs::remove_file(checkpoint));
        }
        Ok(())
    }
}

/// Returns the path of a job's picture within the folder.
pub fn picture_name(job: &Job) -> String {
    format!("pictures/{}.png", job.name)
}

/// A job locked for this process.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    _file: File,
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}
