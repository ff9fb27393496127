//! Maps and checkpoints read in the background: a slow disk or a large file does not hold up the
//! interface.

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jiff::tz::TimeZone;
use miette::Report;

use super::busy::{self, Lasting};
use super::dialog::Picker;
use crate::experiment::runs::SavedRun;
use gdg::map::{Grid, MapError};
use gdg::pulse::Progress;
use gdg::train::{CheckpointError, Description};

/// How often to look whether a thread has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// How long to wait before the interface goes on.
pub const READING_PATIENCE: Duration = Duration::from_millis(200);

/// Seconds between two notices.
const NOTICE_SECS: u64 = 2;

/// What has been read.
pub enum Read {
    /// A map, from this file.
    Map(PathBuf, Result<Grid, Box<MapError>>),
    /// A folder's files and folders (whether it is one) from which a map may be chosen, and recent
    /// maps, if asked for.
    Maps(PathBuf, Vec<(PathBuf, bool)>, Option<Vec<PathBuf>>),
    /// Checkpoints, and how they are listed.
    Checkpoints(Vec<Result<Description, CheckpointError>>, ListCheckpoints),
    /// The runs in a file.
    Runs(Result<Vec<SavedRun>, Report>),
}

/// Makes a list of checkpoints, with dates in a zone.
pub type ListCheckpoints = fn(Vec<Result<Description, CheckpointError>>, &TimeZone) -> Picker;

/// Something that is being read on its own thread.
pub struct Reading {
    /// What, as in "reading WHAT".
    what: String,
    since: Instant,
    /// The number of notices so far.
    told: u64,
    progress: Progress,
    thread: JoinHandle<Read>,
}

impl Reading {
    /// Starts to read `what`; `read` may say how far it is.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        what: String,
        read: impl FnOnce(&Progress) -> Read + Send + 'static,
    ) -> std::io::Result<Self> {
        let progress = Progress::default();
        let told = progress.clone();
        let read = move || read(&told);
        let thread = std::thread::Builder::new().name("reading".to_owned()).spawn(read)?;
        Ok(Self { what, since: Instant::now(), told: 0, progress, thread })
    }

    /// Waits for at most `patience`; returns whether all has been read.
    pub fn wait(&self, patience: Duration) -> bool {
        while !self.is_finished() && self.since.elapsed() < patience {
            std::thread::sleep(POLL_INTERVAL);
        }
        self.is_finished()
    }

    /// Returns whether all has been read.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Returns a notice that it takes a while, at once and then every few seconds.
    pub fn notice(&mut self) -> Option<String> {
        let seconds = self.since.elapsed().as_secs();
        if seconds < self.told * NOTICE_SECS {
            return None;
        }
        self.told = seconds / NOTICE_SECS + 1;
        let lasting = Lasting::now(self.since, &self.progress);
        Some(busy::notice(&format!("reading {}", self.what), lasting))
    }

    /// Returns what was read, or what could not be because of an internal error.
    pub fn finish(self) -> Result<Read, String> {
        self.thread
            .join()
            .map_err(|_| format!("reading {} failed with an internal error", self.what))
    }
}
