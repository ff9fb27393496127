//! Recordings of the screen over time, in asciinema's format (version 2: a line of JSON about the recording, then one
//! for each event), and pictures of single moments of them.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use miette::{IntoDiagnostic, Report, WrapErr};
use serde_json::json;

/// Columns and rows of the largest screen that is recorded or drawn: more than any real terminal has.
pub const LARGEST_SCREEN: (u16, u16) = (1000, 500);

/// A recording in progress.
pub struct Recorder {
    file: BufWriter<File>,
    began: Instant,
    /// What was written since the last event.
    frame: Vec<u8>,
}

impl Recorder {
    /// Begins a recording, on a terminal of the size that this one has now.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn begin(path: &Path) -> Result<Self, Report> {
        let what = || format!("{}: the recording cannot be written", path.display());
        let file = File::create(path).into_diagnostic().wrap_err_with(what)?;
        let (width, height) = crossterm::terminal::size().unwrap_or((80, 24));
        let term = std::env::var("TERM").unwrap_or_default();
        let head =
            json!({ "version": 2, "width": width, "height": height, "title": "gdg-tui", "env": { "TERM": term } });
        let mut recorder = Self { file: BufWriter::new(file), began: Instant::now(), frame: Vec::new() };
        recorder.line(&head).into_diagnostic().wrap_err_with(what)?;
        Ok(recorder)
    }

    /// Takes note of what goes to the terminal.
    pub fn add(&mut self, bytes: &[u8]) {
        self.frame.extend(bytes);
    }

    /// What was noted becomes one event.
    ///
    /// # Errors
    /// What the file system reports.
    pub fn end_frame(&mut self) -> std::io::Result<()> {
        if self.frame.is_empty() {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&std::mem::take(&mut self.frame)).into_owned();
        self.event("o", &text)
    }

    /// The terminal has another size.
    ///
    /// # Errors
    /// What the file system reports.
    pub fn resize(&mut self, (width, height): (u16, u16)) -> std::io::Result<()> {
        self.event("r", &format!("{width}x{height}"))
    }

    fn event(&mut self, kind: &str, text: &str) -> std::io::Result<()> {
        let seconds = (self.began.elapsed().as_secs_f64() * 1e6).round() / 1e6;
        self.line(&json!([seconds, kind, text]))
    }

    fn line(&mut self, value: &serde_json::Value) -> std::io::Result<()> {
        serde_json::to_writer(&mut self.file, value)?;
        self.file.write_all(b"\n")?;
        // What is on disk is whole at any moment, as the program may be killed.
        self.file.flush()
    }
}
