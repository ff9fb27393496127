//! The folder of an experiment: results, checkpoints and pictures of its jobs.
//!
//! ```text
//! jobs/NAME.json          the result of a finished job
//! jobs/NAME.safetensors   its checkpoint, from when it has begun
//! jobs/NAME.lock          held by the process that runs it
//! pictures/NAME.png
//! ```

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::{Deserialize, Serialize};

use super::spec::{JobResult, JobSpec};
use crate::host::outputs::elsewhere;
use gdg::files::{self, Format, LockFile, Mismatch, Wanted, has_extension, is_hidden};
use gdg::text::{escape_json_line, sanitized};
use gdg::train::{describe, is_checkpoint, remove_own};

/// Maximum size of a result file.
const MAX_RESULT_BYTES: u64 = 64 << 20;

const MOVE_AWAY: &str = "move it away, or give --out another folder";

const RESULT: Wanted =
    Wanted { name: "the result of a job", help: MOVE_AWAY, own: &[Format::Json, Format::Text] };

/// Why a result cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ResultError {
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// Its contents are not what was written: the job has to run again.
    #[error("is damaged: {0}")]
    Damaged(String),
    /// It is no result of this version: running the job again would replace it.
    #[error("{}", .0.problem)]
    Foreign(Mismatch),
    /// The beginning of the other job's key is the same.
    #[error("is the result of another job")]
    Other,
}

#[derive(Serialize, Deserialize)]
struct StoredResult {
    #[serde(flatten)]
    result: JobResult,
    /// CRC-32 of the result as compact JSON, in hexadecimal digits.
    checksum: Option<String>,
}

fn checksum_of(result: &JobResult) -> String {
    // A result that cannot be serialised matches no stored checksum.
    let json = serde_json::to_vec(result).unwrap_or_default();
    format!("{:08x}", crc32fast::hash(&json))
}

/// Reads a result without knowing its job.
pub fn read_result(path: &Path) -> Result<JobResult, ResultError> {
    let bytes = files::read(path, MAX_RESULT_BYTES)?;
    let damaged = |why: String| match RESULT.mismatch(path).filter(|_| !bytes.is_empty()) {
        Some(other) => ResultError::Foreign(other),
        None => ResultError::Damaged(why),
    };
    let StoredResult { result, checksum } =
        serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
    match checksum {
        Some(checksum) if checksum == checksum_of(&result) => Ok(result),
        Some(_) => Err(damaged("its checksum is wrong".to_owned())),
        None => Err(ResultError::Foreign(Mismatch {
            problem: "was written by an earlier version of gdg-tui".to_owned(),
            help: MOVE_AWAY.to_owned(),
        })),
    }
}

/// The folder of an experiment, which need not exist yet.
#[derive(Clone, Debug)]
pub struct Folder(pub PathBuf);

impl Folder {
    /// Checks that files called `names` can be written to it, and creates it if needed; refuses a
    /// folder that has never had jobs but already contains other files there.
    pub fn check_writable(&self, names: &[&str]) -> Result<(), Report> {
        let first_part =
            |name: &&str| Path::new(*name).components().next().map(|part| self.0.join(part));
        let is_used = |path: &PathBuf| {
            path.is_file() || path.read_dir().is_ok_and(|mut entries| entries.next().is_some())
        };
        if !self.0.join("jobs").exists()
            && let Some(other) = names.iter().filter_map(first_part).find(is_used)
        {
            let (help, other) = ("give --out a folder of its own", other.display());
            return Err(miette!(
                help = help,
                "{other}: was not written by gdg-tui and is not replaced"
            ));
        }
        names.iter().map(|name| self.0.join(name)).try_for_each(|path| {
            files::check_writable(&path).map_err(|error| {
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
        let path = self.path(name);
        let written = files::write_atomically(&path, bytes).into_diagnostic();
        written.wrap_err_with(|| path.display().to_string())
    }

    pub fn checkpoint(&self, job: &JobSpec) -> PathBuf {
        self.0.join(format!("jobs/{}.safetensors", job.name))
    }

    fn result_path(&self, job: &JobSpec) -> PathBuf {
        self.0.join(format!("jobs/{}.json", job.name))
    }

    /// Says how far the job is.
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
        self.read(job).ok().flatten()
    }

    /// Returns why the job's result cannot be used, if there is one that cannot but may be
    /// replaced.
    pub fn problem(&self, job: &JobSpec) -> Result<Option<String>, Report> {
        let said = |problem: &dyn std::fmt::Display| {
            sanitized(&format!("{}: {problem}", self.result_path(job).display()))
        };
        match self.read(job) {
            Ok(_) => Ok(None),
            Err(ResultError::Foreign(Mismatch { problem, help })) => {
                Err(miette!(help = help, "{}", said(&problem)))
            }
            Err(problem) => Ok(Some(said(&problem))),
        }
    }

    fn read(&self, job: &JobSpec) -> Result<Option<JobResult>, ResultError> {
        match read_result(&self.result_path(job)) {
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
                Err(error) => problems.push(sanitized(&format!("{}: {error}", path.display()))),
            }
        }
        (results, problems)
    }

    /// Checks that the job's result, checkpoint and picture can be written.
    pub fn check_result_writable(&self, job: &JobSpec) -> Result<(), Report> {
        let check = |path: PathBuf, what: &str| {
            files::check_name(&path).map_err(|error| {
                let path = path.display();
                miette!(help = MOVE_AWAY, "{path}: the {what} cannot be saved: {error}")
            })
        };
        check(self.result_path(job), "result")?;
        check(self.path(&picture_name(&job.name)), "picture")?;
        let path = self.checkpoint(job);
        if path.is_file() && !is_checkpoint(&path) {
            let problem = "is not a checkpoint of gdg-tui and is not replaced";
            return Err(miette!(help = MOVE_AWAY, "{}: {problem}", path.display()));
        }
        check(path, "checkpoint")
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

pub fn picture_name(job: &str) -> String {
    format!("pictures/{job}.png")
}
