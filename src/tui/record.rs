//! Screen recordings in asciinema's format (version 2: a JSON header line, then one JSON line per
//! event).
//!
//! A recording holds what changes between frames, not the bytes that went to the terminal: a few
//! frames per second, in fewer colours, so that it stays below [`BYTES_PER_SECOND`] however much is
//! going on.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use miette::{IntoDiagnostic, Report, WrapErr};
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Color;
use serde_json::json;

use crate::host::outputs::create;

/// Columns and rows of the largest screen that is recorded or drawn, more than any real terminal
/// has.
pub const LARGEST_SCREEN: (u16, u16) = (1000, 500);

/// Size of a recording: after a large frame, the next one waits, unless it answers the user.
const BYTES_PER_SECOND: f64 = 24_000.0;

/// Minimum time between two recorded frames.
const FRAME_INTERVAL: Duration = Duration::from_millis(100);

/// Recorded colours are multiples of this per channel: the learned distance changes everywhere all
/// the time, mostly by less than anyone sees.
const COLOUR_STEP: u8 = 8;

/// Hides the cursor, and clears the screen.
const CLEAR: &str = "\u{1b}[?25l\u{1b}[0m\u{1b}[2J";

/// A recording in progress.
pub struct Recorder {
    path: PathBuf,
    file: File,
    /// Bytes of all lines that are in the file.
    whole: u64,
    began: Instant,
    /// The screen as recorded so far.
    recorded: Buffer,
    /// The latest frame, if it has not been recorded, and its time.
    pending: Option<(Duration, Buffer)>,
    /// Whether the next frame answers the user.
    answers: bool,
    /// Time of the latest recorded frame.
    latest: Option<Duration>,
    /// Bytes of the latest frame.
    latest_size: usize,
}

impl Recorder {
    /// Starts a recording at the terminal's current size. An existing file is replaced only if
    /// `overwrite` is set.
    pub fn start(path: &Path, overwrite: bool) -> Result<Self, Report> {
        let file = create(path, overwrite)?;
        let size = crossterm::terminal::size().unwrap_or((80, 24));
        let message = || format!("{}: the recording cannot be written", path.display());
        Self::from_file(path, file, size).into_diagnostic().wrap_err_with(message)
    }

    fn from_file(path: &Path, file: File, size: (u16, u16)) -> std::io::Result<Self> {
        // Players handle no more, whatever the terminal claims.
        let (width, height) = (size.0.min(LARGEST_SCREEN.0), size.1.min(LARGEST_SCREEN.1));
        let term = std::env::var("TERM").unwrap_or_default();
        let env = json!({ "TERM": term });
        let head = json!({ "version": 2, "width": width, "height": height, "title": "gdg-tui",
            "env": env });
        let mut recorder = Self {
            path: path.to_owned(),
            file,
            whole: 0,
            began: Instant::now(),
            recorded: Buffer::empty(Rect::new(0, 0, width, height)),
            pending: None,
            answers: false,
            latest: None,
            latest_size: 0,
        };
        recorder.line(&head.to_string())?;
        Ok(recorder)
    }

    /// Records the screen. Right after another frame, or if the recording grows too fast, it is
    /// held back and recorded only if nothing follows.
    pub fn frame(&mut self, screen: &Buffer) -> std::io::Result<()> {
        self.frame_at(self.began.elapsed(), screen)
    }

    fn frame_at(&mut self, now: Duration, screen: &Buffer) -> std::io::Result<()> {
        // A frame held back is recorded if it stayed on the screen.
        if self.pending.as_ref().is_some_and(|(at, _)| now > *at + 2 * FRAME_INTERVAL)
            && self.is_due(now)
        {
            self.write_pending()?;
        }
        self.pending = Some((now, screen.clone()));
        if self.is_due(now) { self.write_pending() } else { Ok(()) }
    }

    /// Marks the next frame as an answer to the user, which is recorded soon.
    pub fn expect_answer(&mut self) {
        self.answers = true;
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    fn is_due(&self, now: Duration) -> bool {
        let pause = Duration::from_secs_f64(self.latest_size as f64 / BYTES_PER_SECOND);
        let pause = if self.answers { FRAME_INTERVAL } else { pause.max(FRAME_INTERVAL) };
        self.latest.is_none_or(|latest| now >= latest + pause)
    }

    /// Writes the pending frame, if there is one, as one event.
    fn write_pending(&mut self) -> std::io::Result<()> {
        let Some((at, mut screen)) = self.pending.take() else { return Ok(()) };
        self.answers = false;
        let mut text = String::new();
        if self.latest.is_none() || screen.area != self.recorded.area {
            let (width, height) = (screen.area.width, screen.area.height);
            if screen.area != self.recorded.area {
                self.event(at, "r", &format!("{width}x{height}"))?;
            }
            self.recorded = Buffer::empty(screen.area);
            text.push_str(CLEAR);
        }
        screen
            .content
            .iter_mut()
            .for_each(|cell| (cell.fg, cell.bg) = (coarse(cell.fg), coarse(cell.bg)));
        let changes = self.recorded.diff(&screen);
        if !changes.is_empty() {
            let mut bytes = Vec::new();
            let mut backend = CrosstermBackend::new(&mut bytes);
            backend.draw(changes.into_iter())?;
            text.push_str(&String::from_utf8_lossy(&bytes));
        }
        self.recorded = screen;
        self.latest = Some(at);
        if !text.is_empty() {
            self.event(at, "o", &text)?;
        }
        Ok(())
    }

    fn event(&mut self, at: Duration, kind: &str, text: &str) -> std::io::Result<()> {
        let seconds = (at.as_secs_f64() * 1e3).round() / 1e3;
        let line = json!([seconds, kind, text]).to_string();
        self.latest_size = line.len();
        self.line(&line)
    }

    /// Adds a line at once, as the program may be killed. Where it cannot be written as a whole,
    /// as on a full disk, its beginning is removed: players refuse files that end within a line.
    fn line(&mut self, line: &str) -> std::io::Result<()> {
        let line = format!("{line}\n");
        let result = self.file.write_all(line.as_bytes());
        match result {
            Ok(()) => self.whole += line.len() as u64,
            // Pipes have no length to set.
            Err(_) => _ = self.file.set_len(self.whole),
        }
        result
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Write the last screen; errors can no longer be reported.
        let _ = self.write_pending();
    }
}

fn coarse(colour: Color) -> Color {
    let round = |v: u8| v - v % COLOUR_STEP;
    match colour {
        Color::Rgb(r, g, b) => Color::Rgb(round(r), round(g), round(b)),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use ratatui::style::Style;

    use super::*;

    /// Starts a recording in a new folder.
    fn recorder(size: (u16, u16)) -> (tempfile::TempDir, PathBuf, Recorder) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.cast");
        let recorder = Recorder::from_file(&path, File::create(&path).expect("a file"), size)
            .expect("written");
        (folder, path, recorder)
    }

    fn screen(size: (u16, u16), text: &str, colour: u8) -> Buffer {
        let mut screen = Buffer::empty(Rect::new(0, 0, size.0, size.1));
        screen.set_string(0, 0, text, Style::new().fg(Color::Rgb(colour, colour, colour)));
        screen
    }

    /// Returns the events of a recording: time, kind, text.
    fn events(path: &Path) -> Vec<(f64, String, String)> {
        let text = std::fs::read_to_string(path).expect("a recording");
        text.lines().skip(1).map(|line| serde_json::from_str(line).expect("an event")).collect()
    }

    #[test]
    fn changes_that_nobody_sees_and_frames_in_quick_succession_are_left_out() {
        let (size, ms) = ((4, 1), Duration::from_millis);
        let (_folder, path, mut recorder) = recorder(size);
        for (at, text, colour) in
            [(0, "ab", 80), (200, "ab", 83), (400, "ax", 80), (410, "ay", 80), (420, "az", 80)]
        {
            recorder.frame_at(ms(at), &screen(size, text, colour)).expect("written");
        }
        drop(recorder);
        let events = events(&path);
        assert_eq!(events.iter().map(|(at, ..)| *at).collect::<Vec<_>>(), [0.0, 0.4, 0.42]);
        assert!(events[1].2.contains('x') && !events[1].2.contains('a'), "{events:?}");
        assert!(events[2].2.contains('z'), "the last frame is recorded");
    }

    #[test]
    fn a_recording_stays_below_its_rate_however_much_changes() {
        let size = (200, 60);
        let (_folder, path, mut recorder) = recorder(size);
        for frame in 0..600 {
            let mut screen = Buffer::empty(Rect::new(0, 0, size.0, size.1));
            for (i, cell) in screen.content.iter_mut().enumerate() {
                let colour = Color::Rgb((i * 40 + frame * 16) as u8, (i * 24) as u8, 0);
                cell.set_char('x').set_fg(colour);
            }
            recorder.frame_at(Duration::from_millis(100 * frame as u64), &screen).expect("written");
        }
        drop(recorder);
        let bytes = std::fs::metadata(&path).expect("a file").len();
        assert!((1_000_000..2_500_000).contains(&bytes), "{bytes} in a minute");
        let last = events(&path).last().expect("frames").0;
        assert!((last - 59.9).abs() < 1e-9, "the last frame is recorded");
    }

    #[test]
    fn a_new_size_clears_the_screen() {
        let (_folder, path, mut recorder) = recorder((4, 1));
        recorder.frame_at(Duration::ZERO, &screen((4, 1), "ab", 80)).expect("written");
        recorder.frame_at(Duration::from_secs(1), &screen((6, 2), "ab", 80)).expect("written");
        drop(recorder);
        let events = events(&path);
        assert_eq!((events[1].1.as_str(), events[1].2.as_str()), ("r", "6x2"));
        assert!(events[2].2.starts_with(CLEAR) && events[2].2.contains("ab"));
    }
}
