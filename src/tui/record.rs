//! Screen recordings in asciinema's format (version 2: a JSON header line, then one JSON line per event).

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use miette::{IntoDiagnostic, Report, WrapErr};
use serde_json::json;

use crate::setup::create;

/// Columns and rows of the largest screen that is recorded or drawn, more than any real terminal has.
pub const LARGEST_SCREEN: (u16, u16) = (1000, 500);

/// A recording in progress.
pub struct Recorder {
    file: BufWriter<File>,
    began: Instant,
    /// Bytes written since the last event.
    frame: Vec<u8>,
}

impl Recorder {
    /// Starts a recording at the terminal's current size. An existing file is replaced only if `overwrite` is set.
    ///
    /// # Errors
    /// The file exists already or cannot be written.
    pub fn start(path: &Path, overwrite: bool) -> Result<Self, Report> {
        let file = create(path, overwrite)?;
        let size = crossterm::terminal::size().unwrap_or((80, 24));
        let message = || format!("{}: the recording cannot be written", path.display());
        Self::from_file(file, size).into_diagnostic().wrap_err_with(message)
    }

    fn from_file(file: File, size: (u16, u16)) -> std::io::Result<Self> {
        let (width, height) = clamp_size(size);
        let term = std::env::var("TERM").unwrap_or_default();
        let head =
            json!({ "version": 2, "width": width, "height": height, "title": "gdg-tui", "env": { "TERM": term } });
        let mut recorder = Self { file: BufWriter::new(file), began: Instant::now(), frame: Vec::new() };
        recorder.line(&head)?;
        Ok(recorder)
    }

    /// Adds bytes written to the terminal.
    pub fn add(&mut self, bytes: &[u8]) {
        self.frame.extend(bytes);
    }

    /// Writes the bytes added so far as one event.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn end_frame(&mut self) -> std::io::Result<()> {
        if self.frame.is_empty() {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&std::mem::take(&mut self.frame)).into_owned();
        self.event("o", &text)
    }

    /// Records a change of the terminal's size.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn resize(&mut self, size: (u16, u16)) -> std::io::Result<()> {
        let (width, height) = clamp_size(size);
        self.event("r", &format!("{width}x{height}"))
    }

    fn event(&mut self, kind: &str, text: &str) -> std::io::Result<()> {
        let seconds = (self.began.elapsed().as_secs_f64() * 1e6).round() / 1e6;
        self.line(&json!([seconds, kind, text]))
    }

    fn line(&mut self, value: &serde_json::Value) -> std::io::Result<()> {
        serde_json::to_writer(&mut self.file, value)?;
        self.file.write_all(b"\n")?;
        // Keep the file complete at any moment, as the program may be killed.
        self.file.flush()
    }
}

/// Limits a size to what players can handle, whatever the terminal claims.
fn clamp_size((width, height): (u16, u16)) -> (u16, u16) {
    (width.min(LARGEST_SCREEN.0), height.min(LARGEST_SCREEN.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_never_larger_than_the_largest_screen() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.cast");
        let mut recorder = Recorder::from_file(File::create(&path).expect("a file"), (65535, 65535)).expect("written");
        recorder.resize((200, 60)).and_then(|()| recorder.resize((65535, 65535))).expect("written");
        let text = std::fs::read_to_string(&path).expect("a recording");
        let lines: Vec<serde_json::Value> =
            text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        assert_eq!((&lines[0]["width"], &lines[0]["height"]), (&1000.into(), &500.into()));
        assert_eq!((&lines[1][2], &lines[2][2]), (&"200x60".into(), &"1000x500".into()));
    }

    #[test]
    fn a_recording_replaces_a_file_only_with_overwrite() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.cast");
        std::fs::write(&path, b"mine").expect("a file");
        let error = Recorder::start(&path, false).err().expect("it is there");
        assert!(error.to_string().contains("run.cast: the file already exists"), "{error}");
        assert_eq!(std::fs::read(&path).expect("kept"), b"mine");
        assert!(Recorder::start(&path, true).is_ok());
        assert!(std::fs::read_to_string(&path).expect("a recording").starts_with("{\"version\":2"));
    }
}
