//! The log, and the notice of its latest entry.

use std::time::{Duration, Instant};

use crate::train::{LogEntry, MAX_LOG_ENTRIES};

/// How long a notice and an error are shown, and how long they then fade.
const NOTICE_DURATION: Duration = Duration::from_secs(4);
const ERROR_DURATION: Duration = Duration::from_secs(12);
const FADE_DURATION: Duration = Duration::from_secs(2);

/// A message to show.
#[derive(Clone, Copy, Debug)]
pub struct Notice<'a> {
    /// The text.
    pub text: &'a str,
    /// Whether it is about to disappear.
    pub fades: bool,
    /// Whether something went wrong.
    pub is_error: bool,
}

/// The event log.
#[derive(Debug)]
pub struct Log {
    began: Instant,
    /// Seconds covered by the run's log before this program resumed it.
    before: f64,
    entries: Vec<LogEntry>,
    /// Number of entries ever made.
    count: usize,
    /// Since when a notice is shown, and the number of entries including it.
    notice: Option<(Instant, usize)>,
    /// Whether the notice is an error.
    is_error: bool,
    /// Whether the notice was fading at the last tick.
    fading: bool,
}

impl Default for Log {
    fn default() -> Self {
        Self {
            began: Instant::now(),
            before: 0.0,
            entries: Vec::new(),
            count: 0,
            notice: None,
            is_error: false,
            fading: false,
        }
    }
}

impl Log {
    /// Starts the log of a run, with its past entries.
    pub fn start_run(&mut self, past: &[LogEntry]) {
        if past.is_empty() {
            return;
        }
        self.before = past.last().map_or(0.0, |entry| entry.seconds);
        (self.began, self.notice) = (Instant::now(), None);
        self.entries = past.to_vec();
        self.count = self.entries.len();
    }

    /// Logs an event and shows it as a notice.
    pub fn add(&mut self, text: &str, updates: u64, is_error: bool) {
        self.record(text, updates);
        (self.notice, self.is_error) = (Some((Instant::now(), self.count)), is_error);
    }

    /// Logs an event.
    pub fn record(&mut self, text: &str, updates: u64) {
        if self.entries.len() >= MAX_LOG_ENTRIES {
            self.entries.remove(0);
        }
        tracing::info!("{}", crate::text::sanitized(text));
        self.entries.push(LogEntry::new(self.before + self.began.elapsed().as_secs_f64(), updates, text));
        self.count += 1;
    }

    /// Returns all entries, oldest first.
    pub fn entries(&self) -> &[LogEntry] {
        &self.entries
    }

    /// Returns the current notice.
    pub fn notice(&self) -> Option<Notice<'_>> {
        let (since, count) = self.notice?;
        let entry = self.entries.len().checked_sub(1 + self.count - count).map(|i| &self.entries[i])?;
        let fades = since.elapsed() > self.duration();
        Some(Notice { text: &entry.text, fades, is_error: self.is_error })
    }

    /// Takes the notice away, unless something went wrong: the user goes on.
    pub fn dismiss(&mut self) {
        self.notice.take_if(|_| !self.is_error);
    }

    /// Returns how long the notice is shown before it fades.
    fn duration(&self) -> Duration {
        if self.is_error { ERROR_DURATION } else { NOTICE_DURATION }
    }

    /// Handles the passing of time; returns whether the notice began to fade or disappeared.
    pub fn on_tick(&mut self) -> bool {
        let Some((since, _)) = self.notice else { return false };
        let age = since.elapsed();
        if age > self.duration() + FADE_DURATION {
            self.notice = None;
            return true;
        }
        let fading = age > self.duration();
        std::mem::replace(&mut self.fading, fading) != fading
    }
}
