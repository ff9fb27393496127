//! The log, and the notice of its latest entry.

use std::time::{Duration, Instant};

use crate::train::{LogEntry, MAX_LOG_ENTRIES};

/// How long a notice is shown, and how long it then fades.
const NOTICE_DURATION: Duration = Duration::from_secs(4);
const FADE_DURATION: Duration = Duration::from_secs(2);

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
    /// Whether the notice was fading at the last tick.
    fading: bool,
}

impl Default for Log {
    fn default() -> Self {
        Self { began: Instant::now(), before: 0.0, entries: Vec::new(), count: 0, notice: None, fading: false }
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
    pub fn add(&mut self, text: &str, updates: u64) {
        self.record(text, updates);
        self.notice = Some((Instant::now(), self.count));
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

    /// Returns the current notice, and whether it is fading.
    pub fn notice(&self) -> Option<(&str, bool)> {
        let (since, count) = self.notice?;
        let entry = self.entries.len().checked_sub(1 + self.count - count).map(|i| &self.entries[i])?;
        Some((&entry.text, since.elapsed() > NOTICE_DURATION))
    }

    /// Handles the passing of time; returns whether the notice began to fade or disappeared.
    pub fn on_tick(&mut self) -> bool {
        let Some((since, _)) = self.notice else { return false };
        let age = since.elapsed();
        if age > NOTICE_DURATION + FADE_DURATION {
            self.notice = None;
            return true;
        }
        let fading = age > NOTICE_DURATION;
        std::mem::replace(&mut self.fading, fading) != fading
    }
}
