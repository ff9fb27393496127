//! The log, and the notice of its latest entry.

use std::time::{Duration, Instant};

use gdg::train::{LogEntry, MAX_LOG_ENTRIES};

const NOTICE_DURATION: Duration = Duration::from_secs(6);
const ERROR_DURATION: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, Debug)]
pub struct Notice<'a> {
    pub text: &'a str,
    pub is_error: bool,
}

/// The event log, in training time: pauses do not count.
#[derive(Debug, Default)]
pub struct Log {
    entries: Vec<LogEntry>,
    /// The notice, and since when it is shown.
    pub notice: Option<(Instant, String)>,
    is_error: bool,
}

impl Log {
    pub fn start_run(&mut self, past: &[LogEntry]) {
        if past.is_empty() {
            return;
        }
        self.notice = None;
        self.entries = past.to_vec();
    }

    /// Logs an event, in seconds of training and updates, and shows it as a notice.
    pub fn add(&mut self, text: &str, seconds: f64, updates: u64, is_error: bool) {
        self.record(text, seconds, updates);
        self.show(text, is_error);
    }

    /// Shows a notice without logging it.
    pub fn show(&mut self, text: &str, is_error: bool) {
        (self.notice, self.is_error) = (Some((Instant::now(), text.to_owned())), is_error);
    }

    /// Logs an event at a moment of the run, in seconds of training and updates.
    pub fn record(&mut self, text: &str, seconds: f64, updates: u64) {
        if self.entries.len() >= MAX_LOG_ENTRIES {
            self.entries.remove(0);
        }
        log::info!("{}", gdg::text::sanitized(text));
        self.entries.push(LogEntry::new(seconds, updates, text));
    }

    pub fn entries(&self) -> &[LogEntry] {
        &self.entries
    }

    pub fn notice(&self) -> Option<Notice<'_>> {
        let (_, text) = self.notice.as_ref()?;
        Some(Notice { text, is_error: self.is_error })
    }

    pub fn take(&mut self) -> Option<String> {
        self.notice.take().map(|(_, text)| text)
    }

    pub fn dismiss(&mut self) {
        self.notice.take_if(|_| !self.is_error);
    }

    /// Handles the passing of time; returns whether the notice disappears.
    pub fn on_tick(&mut self) -> bool {
        let longest = if self.is_error { ERROR_DURATION } else { NOTICE_DURATION };
        self.notice.take_if(|(since, _)| since.elapsed() > longest).is_some()
    }
}
