//! Work on a thread of its own, such as reading and writing files: a slow disk or a large file does
//! not hold up the interface.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::busy::{self, Lasting};
use gdg::pulse::Progress;

/// How often to look whether a thread has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// How long to wait before the interface goes on.
pub const PATIENCE: Duration = Duration::from_millis(200);

/// Seconds between two notices.
const NOTICE_SECS: u64 = 2;

/// Work that returns a `T`.
pub struct Background<T> {
    /// What it does, as in "reading a.map".
    what: String,
    since: Instant,
    /// The number of notices so far.
    told: u64,
    progress: Progress,
    thread: JoinHandle<T>,
}

impl<T: Send + 'static> Background<T> {
    /// Starts `work`, which may say how far it is.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        what: String,
        work: impl FnOnce(&Progress) -> T + Send + 'static,
    ) -> std::io::Result<Self> {
        let progress = Progress::default();
        let told = progress.clone();
        let thread = std::thread::Builder::new().name("background".to_owned());
        let thread = thread.spawn(move || work(&told))?;
        Ok(Self { what, since: Instant::now(), told: 0, progress, thread })
    }

    /// Waits for at most `patience`; returns whether it is done.
    pub fn wait(&self, patience: Duration) -> bool {
        while !self.is_finished() && self.since.elapsed() < patience {
            std::thread::sleep(POLL_INTERVAL);
        }
        self.is_finished()
    }

    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    pub fn what(&self) -> &str {
        &self.what
    }

    /// Returns a notice that it takes a while, at once and then every few seconds.
    pub fn notice(&mut self) -> Option<String> {
        let seconds = self.since.elapsed().as_secs();
        if seconds < self.told * NOTICE_SECS {
            return None;
        }
        self.told = seconds / NOTICE_SECS + 1;
        Some(busy::notice(&self.what, Lasting::now(self.since, &self.progress)))
    }

    /// Waits for the result, or what has failed because of an internal error.
    pub fn finish(self) -> Result<T, String> {
        let Self { thread, what, .. } = self;
        thread.join().map_err(|_| format!("{what} failed with an internal error"))
    }
}
