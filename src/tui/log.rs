//! What happened, and the notice of what happened last.

use std::time::{Duration, Instant};

use crate::train::{LogEntry, MOST_ENTRIES};

/// How long a notice is shown, and for how long it then fades.
const SHOWN: Duration = Duration::from_secs(4);
const FADING: Duration = Duration::from_secs(2);

/// Everything that happened.
#[derive(Debug)]
pub struct Log {
    began: Instant,
    /// Seconds of the run's log before this program went on with it.
    before: f64,
    entries: Vec<LogEntry>,
    /// Entries ever made.
    count: usize,
    /// Since when a notice is shown, and how many entries there were with it.
    notice: Option<(Instant, usize)>,
    /// Whether it was seen to fade.
    fades: bool,
}

impl Default for Log {
    fn default() -> Self {
        Self { began: Instant::now(), before: 0.0, entries: Vec::new(), count: 0, notice: None, fades: false }
    }
}

impl Log {
    /// Turns to a run, of which this happened before.
    pub fn begin(&mut self, past: &[LogEntry]) {
        if past.is_empty() {
            return;
        }
        self.before = past.last().map_or(0.0, |entry| entry.seconds);
        (self.began, self.notice) = (Instant::now(), None);
        self.entries = past.to_vec();
        self.count = self.entries.len();
    }

    /// Takes note of something that is worth a notice.
    pub fn add(&mut self, text: &str, updates: u64) {
        self.note(text, updates);
        self.notice = Some((Instant::now(), self.count));
    }

    /// Takes note of something.
    pub fn note(&mut self, text: &str, updates: u64) {
        if self.entries.len() >= MOST_ENTRIES {
            self.entries.remove(0);
        }
        tracing::info!("{}", crate::text::plain(text));
        self.entries.push(LogEntry::new(self.before + self.began.elapsed().as_secs_f64(), updates, text));
        self.count += 1;
    }

    /// All entries, oldest first.
    pub fn entries(&self) -> &[LogEntry] {
        &self.entries
    }

    /// The notice shown now, and whether it fades.
    pub fn notice(&self) -> Option<(&str, bool)> {
        let (since, count) = self.notice?;
        let entry = self.entries.len().checked_sub(1 + self.count - count).map(|i| &self.entries[i])?;
        Some((&entry.text, since.elapsed() > SHOWN))
    }

    /// Time has passed; whether the notice began to fade or went.
    pub fn on_tick(&mut self) -> bool {
        let Some((since, _)) = self.notice else { return false };
        let age = since.elapsed();
        if age > SHOWN + FADING {
            self.notice = None;
            return true;
        }
        let fades = age > SHOWN;
        std::mem::replace(&mut self.fades, fades) != fades
    }
}
