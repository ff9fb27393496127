//! What happened, and the notice of what happened last.

use std::time::{Duration, Instant};

/// How long a notice is shown, and for how long it then fades.
const SHOWN: Duration = Duration::from_secs(4);
const FADING: Duration = Duration::from_secs(2);

/// Entries kept.
const MOST: usize = 1000;

/// Something that happened.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Seconds since the program began.
    pub seconds: f64,
    /// Updates done by then.
    pub updates: u64,
    /// What it was.
    pub text: String,
}

/// Everything that happened.
#[derive(Debug)]
pub struct Log {
    began: Instant,
    entries: Vec<Entry>,
    /// Entries ever made.
    count: usize,
    /// Since when a notice is shown, and how many entries there were with it.
    notice: Option<(Instant, usize)>,
    /// Whether it was seen to fade.
    fades: bool,
}

impl Default for Log {
    fn default() -> Self {
        Self { began: Instant::now(), entries: Vec::new(), count: 0, notice: None, fades: false }
    }
}

impl Log {
    /// Takes note of something that is worth a notice.
    pub fn add(&mut self, text: String, updates: u64) {
        self.note(text, updates);
        self.notice = Some((Instant::now(), self.count));
    }

    /// Takes note of something.
    pub fn note(&mut self, text: String, updates: u64) {
        if self.entries.len() >= MOST {
            self.entries.remove(0);
        }
        self.entries.push(Entry { seconds: self.began.elapsed().as_secs_f64(), updates, text });
        self.count += 1;
    }

    /// All entries, oldest first.
    pub fn entries(&self) -> &[Entry] {
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
