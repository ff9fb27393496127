//! Renders frames of a screen recording as PNG files, or a part of it as an animation.

mod animation;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::num::NonZero;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use serde::Deserialize;

use crate::cli::FramesArgs;
use crate::host::outputs::refuse_existing;
use crate::host::waiting::Working;
use crate::tui::{LARGEST_SCREEN, PageColours, png_of};
use gdg::files::{self, Format, Mismatch, Wanted, write_atomically};
use gdg::pulse::Progress;

/// Maximum length of a line in a recording, in bytes: a frame on the largest screen with two
/// distinct colours in every cell takes half of that.
const MAX_LINE_BYTES: u64 = 64 << 20;

/// What is read as a recording.
const RECORDING: Wanted = Wanted {
    name: "a recording of asciinema's version 2",
    help: "give a recording made with --record",
    own: &[Format::Recording, Format::Json, Format::Text],
};

/// The first line of a recording.
#[derive(Deserialize)]
struct Header {
    version: u64,
    width: u64,
    height: u64,
}

/// The event on any other line of a recording.
enum Event {
    Output(String),
    Resize {
        columns: u16,
        rows: u16,
    },
    /// An event without a visible effect.
    Other,
}

/// A recording, read line by line because it may not fit into memory.
struct Cast {
    name: String,
    file: BufReader<File>,
    /// The current line, and its number from 1.
    line: Vec<u8>,
    number: usize,
    /// How many of the file's bytes have been read.
    read: u64,
    bytes: u64,
    progress: Progress,
}

/// Renders the moments that `args` ask for; returns the paths written, one per line.
///
/// # Errors
/// Fails if a file cannot be read or written, or is not a recording (naming the line). Fails
/// without writing anything if a moment is outside the recording or a picture already exists.
pub fn run(args: &FramesArgs) -> Result<String, Report> {
    if let Some(out) = &args.animate {
        return animation::write(args, out);
    }
    let mut moments = args.at.clone();
    moments.sort_by(f64::total_cmp);
    moments.dedup();
    let name = args.cast.to_string_lossy();
    let drawing = Working::begin("the frames to be drawn");
    let progress = drawing.progress();
    progress.begin(0, 2);
    let seconds = duration(&args.cast, progress)?;
    check_within(&name, moments.iter(), seconds)?;
    for at in &moments {
        refuse_existing(&picture_path(args, *at), args.overwrite)?;
    }
    let mut written = Vec::new();
    progress.begin(1, 2);
    play(&args.cast, moments, progress, |screen, at| {
        written.push(write(screen, args, at)?);
        Ok(())
    })?;
    Ok(written.iter().map(|path| format!("{}\n", path.display())).collect())
}

/// Plays a recording and calls `show` with the contents of its screen at each of `moments`, which
/// must be sorted. Says how far it is, as one stage of `progress`.
///
/// # Errors
/// Fails if the file cannot be read or is not a recording (naming the line), or if `show` fails.
pub fn play(
    cast: &Path,
    moments: Vec<f64>,
    progress: &Progress,
    mut show: impl FnMut(&vt100::Screen, f64) -> Result<(), Report>,
) -> Result<(), Report> {
    let mut moments = moments.into_iter().peekable();
    let (mut cast, mut screen) = Cast::open(cast, progress)?;
    while moments.peek().is_some() {
        let event = cast.event()?;
        // A moment includes everything written up to and at that time.
        let until = event.as_ref().map_or(f64::INFINITY, |(seconds, _)| *seconds);
        while let Some(at) = moments.next_if(|at| *at < until) {
            show(screen.screen(), at)?;
        }
        match event {
            Some((_, Event::Output(text))) => screen.process(text.as_bytes()),
            Some((_, Event::Resize { columns, rows })) => {
                screen.screen_mut().set_size(non_zero(rows), non_zero(columns));
            }
            Some((_, Event::Other)) | None => {}
        }
    }
    Ok(())
}

/// Checks that all of `moments` are within a recording that lasts `seconds`.
fn check_within<'a>(
    name: &str,
    mut moments: impl Iterator<Item = &'a f64>,
    seconds: f64,
) -> Result<(), Report> {
    match moments.find(|at| !(0.0..=seconds).contains(*at)) {
        None => Ok(()),
        Some(at) => {
            let help = format!("give times from 0 to {seconds}");
            Err(miette!(
                help = help,
                "{name}: no frame at {at} s: the recording is {seconds} s long"
            ))
        }
    }
}

/// Returns the time of a recording's last event, in seconds from its start; reads all of its lines
/// and says how far it is.
fn duration(path: &Path, progress: &Progress) -> Result<f64, Report> {
    let (mut cast, _) = Cast::open(path, progress)?;
    let mut last = 0f64;
    while let Some((seconds, _)) = cast.event()? {
        last = last.max(seconds);
    }
    Ok(last)
}

impl Cast {
    /// Opens a recording, and creates a screen of its size.
    fn open(path: &Path, progress: &Progress) -> Result<(Self, vt100::Parser), Report> {
        let instead = |found: Mismatch| {
            miette!(help = found.help, "{}: {}", path.to_string_lossy(), found.problem)
        };
        Self::begin(path, progress).map_err(|error| RECORDING.mismatch(path).map_or(error, instead))
    }

    fn begin(path: &Path, progress: &Progress) -> Result<(Self, vt100::Parser), Report> {
        let name = path.to_string_lossy().into_owned();
        // The recording is read twice, which is impossible with a pipe.
        let file = files::open(path).map_err(|error| {
            miette!(help = "give a recording file", "{name}: cannot be read: {error}")
        })?;
        let bytes = file.metadata().map_or(0, |file| file.len());
        let (file, progress) = (BufReader::new(file), progress.clone());
        let mut cast = Self { name, file, line: Vec::new(), number: 0, read: 0, bytes, progress };
        if !cast.next_line()? {
            return Err(miette!(help = "--record makes recordings", "{}: is empty", cast.name));
        }
        let head: Header = cast.parse()?;
        if head.version != 2 {
            return Err(cast.invalid_line());
        }
        let (columns, rows) = cast.size(head.width, head.height)?;
        Ok((cast, vt100::Parser::new(non_zero(rows), non_zero(columns), 0)))
    }

    /// Returns the next event and its time, or `None` at the end.
    fn event(&mut self) -> Result<Option<(f64, Event)>, Report> {
        if !self.next_line()? {
            return Ok(None);
        }
        let (seconds, kind, data): (f64, String, String) = match self.parse() {
            Ok(event) => event,
            // The recording program was killed while writing this line, or is still writing it.
            Err(_) if self.line.starts_with(b"[") && !self.line.ends_with(b"\n") => {
                return Ok(None);
            }
            Err(error) => return Err(error),
        };
        let change = match kind.as_str() {
            "o" => Event::Output(data),
            "r" => {
                let (columns, rows) = data.split_once('x').ok_or_else(|| self.invalid_line())?;
                let number = |text: &str| text.parse().map_err(|_| self.invalid_line());
                let (columns, rows) = self.size(number(columns)?, number(rows)?)?;
                Event::Resize { columns, rows }
            }
            _ => Event::Other,
        };
        Ok(Some((seconds, change)))
    }

    /// Reads the next line; returns whether there was one.
    fn next_line(&mut self) -> Result<bool, Report> {
        self.line.clear();
        self.number += 1;
        let read = (&mut self.file).take(MAX_LINE_BYTES + 1).read_until(b'\n', &mut self.line);
        let read =
            read.into_diagnostic().wrap_err_with(|| format!("{}: cannot be read", self.name))?;
        if read as u64 > MAX_LINE_BYTES {
            return Err(miette!("{}: is longer than {MAX_LINE_BYTES} bytes", self.location()));
        }
        self.read += read as u64;
        self.progress.set(self.read as usize, self.bytes as usize);
        Ok(read > 0)
    }

    fn parse<T: for<'a> Deserialize<'a>>(&self) -> Result<T, Report> {
        serde_json::from_slice(&self.line).into_diagnostic().wrap_err_with(|| self.invalid_line())
    }

    /// Checks that a screen can have this size: an arbitrary one could exhaust the memory.
    fn size(&self, columns: u64, rows: u64) -> Result<(u16, u16), Report> {
        let (most_columns, most_rows) = LARGEST_SCREEN;
        match (u16::try_from(columns), u16::try_from(rows)) {
            (Ok(columns), Ok(rows)) if columns <= most_columns && rows <= most_rows => {
                Ok((columns, rows))
            }
            _ => Err(miette!(
                help = format!("a screen can have up to {most_columns} x {most_rows} characters"),
                "{}: a screen of {columns} x {rows} characters is too large",
                self.location()
            )),
        }
    }

    fn location(&self) -> String {
        format!("{}:{}", self.name, self.number)
    }

    fn invalid_line(&self) -> Report {
        miette!("{}: is not a line of an asciinema version 2 recording", self.location())
    }
}

/// Converts a size, raising 0 to the minimum of 1.
fn non_zero(size: u16) -> NonZero<u16> {
    NonZero::new(size).unwrap_or(NonZero::<u16>::MIN)
}

/// Returns the path of a moment's picture.
fn picture_path(args: &FramesArgs, at: f64) -> PathBuf {
    files::named(&args.out, args.cast.file_stem().unwrap_or("cast".as_ref()), &format!("-{at}.png"))
}

fn write(screen: &vt100::Screen, args: &FramesArgs, at: f64) -> Result<PathBuf, Report> {
    let buffer = buffer_of(screen);
    let pixels = png_of(&buffer, buffer.area, PageColours::default()).into_diagnostic()?;
    let path = picture_path(args, at);
    write_atomically(&path, &pixels)
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: cannot be written", path.display()))?;
    Ok(path)
}

/// Converts what a terminal shows to a buffer.
fn buffer_of(screen: &vt100::Screen) -> Buffer {
    let (rows, columns) = screen.size();
    let mut buffer = Buffer::empty(Rect::new(0, 0, columns.get(), rows.get()));
    let colour = |colour| match colour {
        vt100::Color::Default => Color::Reset,
        vt100::Color::Idx(i) => Color::Indexed(i),
        vt100::Color::Rgb(r, g, b) => Color::Rgb(r, g, b),
    };
    for row in 0..rows.get() {
        for column in 0..columns.get() {
            let Some(cell) = screen.cell(row, column) else { continue };
            let mut style = Style::new().fg(colour(cell.fgcolor())).bg(colour(cell.bgcolor()));
            for (set, modifier) in [
                (cell.bold(), Modifier::BOLD),
                (cell.dim(), Modifier::DIM),
                (cell.inverse(), Modifier::REVERSED),
            ] {
                style = if set { style.add_modifier(modifier) } else { style };
            }
            let text = if cell.contents().is_empty() { " " } else { cell.contents() };
            buffer[(column, row)].set_symbol(text).set_style(style);
        }
    }
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    pub const HEADER: &str = r#"{"version":2,"width":4,"height":1}"#;

    /// Creates a folder with a recording of these lines, and arguments that draw moments of it.
    pub fn recording(lines: &str, at: &[f64]) -> (tempfile::TempDir, FramesArgs) {
        let folder = tempfile::tempdir().expect("a folder");
        let cast = folder.path().join("short.cast");
        std::fs::write(&cast, lines).expect("a file");
        let args = FramesArgs {
            cast,
            at: at.to_vec(),
            animate: None,
            from: 0.0,
            to: None,
            fps: 5,
            speed: 1.0,
            out: folder.path().join("out"),
            overwrite: false,
        };
        (folder, args)
    }

    /// Returns the error for such a recording; checks that nothing is written.
    fn error(lines: &str, at: &[f64]) -> String {
        let (_folder, args) = recording(lines, at);
        let error = run(&args).expect_err("a mistake");
        assert!(!args.out.exists(), "nothing is written");
        error.to_string()
    }

    #[test]
    fn a_frame_shows_all_output_up_to_its_time() {
        let events =
            [HEADER, r#"[1.0,"o","\u001b[31mab"]"#, r#"[2.0,"r","6x2"]"#, r#"[2.5,"o","cd"]"#];
        let (_folder, args) = recording(&events.join("\n"), &[1.5, 0.5, 2.5, 1.5]);
        assert_eq!(run(&args).expect("pictures").lines().count(), 3);
        let size = |at: &str| {
            let file = File::open(args.out.join(format!("short-{at}.png"))).expect("a picture");
            let reader = png::Decoder::new(BufReader::new(file)).read_info().expect("a PNG");
            (reader.info().width, reader.info().height)
        };
        assert_eq!((size("0.5"), size("1.5"), size("2.5")), ((32, 16), (32, 16), (48, 32)));
    }

    #[test]
    fn invalid_recordings_are_reported_with_their_line() {
        for (lines, location) in [
            (format!("{HEADER}\nhello\n"), "short.cast:2:"),
            (format!("{HEADER}\n[1,\"r\",\"wide\"]\n"), "short.cast:2:"),
            ("[1,\"o\",\"\"]\n".to_owned(), "short.cast:1:"),
            (
                HEADER.replace("\"version\":2", "\"version\":1"),
                "short.cast: is an asciinema recording of version 1",
            ),
            (String::new(), "short.cast: is empty"),
        ] {
            let error = error(&lines, &[0.0]);
            assert!(error.contains(location), "{error} is not at {location}");
        }
    }

    #[test]
    fn oversized_screens_are_refused() {
        let head = |columns: u32, rows: u32| {
            format!("{{\"version\":2,\"width\":{columns},\"height\":{rows}}}\n")
        };
        let resize =
            |columns: u32, rows: u32| format!("{HEADER}\n[0,\"r\",\"{columns}x{rows}\"]\n");
        for (lines, location, found) in [
            (head(65535, 65535), "short.cast:1:", "65535 x 65535"),
            (head(1_000_000, 1), "short.cast:1:", "1000000 x 1"),
            (resize(1001, 500), "short.cast:2:", "1001 x 500"),
            (resize(1000, 501), "short.cast:2:", "1000 x 501"),
        ] {
            let error = error(&lines, &[0.0]);
            assert!(error.contains(location) && error.contains(found), "{error}");
        }
        let (_folder, args) = recording(&resize(1000, 500), &[0.0]);
        assert!(run(&args).is_ok(), "the largest one");
    }

    #[test]
    fn times_outside_the_recording_are_refused() {
        let lines = format!("{HEADER}\n[2.5,\"o\",\"ab\"]\n");
        for at in [2.6, 500.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(error(&lines, &[1.0, at]).contains("2.5 s long"), "{at}");
        }
        let (_folder, args) = recording(&lines, &[0.0, 2.5]);
        assert!(run(&args).is_ok());
    }

    #[test]
    fn pictures_are_replaced_only_with_overwrite() {
        let lines = format!("{HEADER}\n[2.5,\"o\",\"ab\"]\n");
        let (_folder, mut args) = recording(&lines, &[1.0, 2.0]);
        std::fs::create_dir(&args.out).expect("a folder");
        let (one, two) = (args.out.join("short-1.png"), args.out.join("short-2.png"));
        std::fs::write(&two, b"mine").expect("a file");
        let error = run(&args).expect_err("one is there");
        assert!(error.to_string().contains("short-2.png"), "{error}");
        assert!(
            !one.exists() && std::fs::read(&two).expect("kept") == b"mine",
            "nothing is written"
        );
        args.overwrite = true;
        assert_eq!(run(&args).expect("pictures").lines().count(), 2);
        assert!(one.exists() && std::fs::read(&two).expect("replaced") != b"mine");
    }

    #[test]
    fn a_truncated_recording_is_drawn_up_to_its_last_event() {
        let lines = format!("{HEADER}\n[1,\"o\",\"ab\"]\n[2,\"o\",\"c");
        let (_folder, args) = recording(&lines, &[1.0]);
        assert!(run(&args).is_ok());
        assert!(error(&lines, &[2.0]).contains("1 s long"));
    }
}
