//! The log, and the notice of its latest entry.

use std::time::{Duration, Instant};

use super::clock;
use gdg::train::{LogEntry, MAX_LOG_ENTRIES};

/// How long a notice and an error are shown, and how long they then fade.
const NOTICE_DURATION: Duration = Duration::from_secs(4);
const ERROR_DURATION: Duration = Duration::from_secs(8);
const FADE_DURATION: Duration = Duration::from_secs(2);

/// A message to show.
#[derive(Clone, Copy, Debug)]
pub struct Notice<'a> {
    pub text: &'a str,
    /// Whether it is about to disappear.
    pub fades: bool,
    pub is_error: bool,
}

/// The event log, in training time: pauses do not count.
#[derive(Debug, Default)]
pub struct Log {
    entries: Vec<LogEntry>,
    /// The notice, and since when it is shown.
    notice: Option<(Instant, String)>,
    /// Whether the notice is an error.
    is_error: bool,
    /// Whether the notice was fading at the last tick.
    fading: bool,
}

impl Log {
    pub fn start_run(&mut self, past: &[LogEntry]) {
        if past.is_empty() {
            return;
        }
        self.notice = None;
        self.entries = past.to_vec();
    }

    /// Logs an event at a moment of the run, in seconds of training and updates, and shows it as a
    /// notice.
    pub fn add(&mut self, text: &str, seconds: f64, updates: u64, is_error: bool) {
        self.record(text, seconds, updates);
        self.show(text, is_error);
    }

    /// Shows a notice without logging it.
    pub fn show(&mut self, text: &str, is_error: bool) {
        (self.notice, self.is_error) = (Some((clock::now(), text.to_owned())), is_error);
    }

    /// Logs an event at a moment of the run, in seconds of training and updates.
    pub fn record(&mut self, text: &str, seconds: f64, updates: u64) {
        if self.entries.len() >= MAX_LOG_ENTRIES {
            self.entries.remove(0);
        }
        log::info!("{}", gdg::text::sanitized(text));
        self.entries.push(LogEntry::new(seconds, updates, text));
    }

    /// Returns all entries, oldest first.
    pub fn entries(&self) -> &[LogEntry] {
        &self.entries
    }

    pub fn notice(&self) -> Option<Notice<'_>> {
        let (since, text) = self.notice.as_ref()?;
        let fades = clock::now().duration_since(*since) > self.duration();
        Some(Notice { text, fades, is_error: self.is_error })
    }

    pub fn take(&mut self) -> Option<String> {
        self.notice.take().map(|(_, text)| text)
    }

    /// Dismisses the notice, unless it is an error.
    pub fn dismiss(&mut self) {
        self.notice.take_if(|_| !self.is_error);
    }

    /// Dismisses a notice or an error shown before `moment`.
    pub fn dismiss_before(&mut self, moment: Instant) {
        self.notice.take_if(|(since, _)| *since < moment);
    }

    fn duration(&self) -> Duration {
        if self.is_error { ERROR_DURATION } else { NOTICE_DURATION }
    }

    /// Handles the passing of time; returns whether the notice began to fade or disappeared.
    pub fn on_tick(&mut self) -> bool {
        let Some((since, _)) = &self.notice else { return false };
        let age = clock::now().duration_since(*since);
        if age > self.duration() + FADE_DURATION {
            self.notice = None;
            return true;
        }
        let fading = age > self.duration();
        std::mem::replace(&mut self.fading, fading) != fading
    }
}
