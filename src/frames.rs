//! Pictures of single moments of a recording of the screen.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use serde::Deserialize;
use std::num::NonZero;

use crate::cli::FramesArgs;
use crate::files::{read_text, write_whole};
use crate::tui::{Paper, png_of};

/// The largest recording that is read: some hours of a large screen.
const MAX_BYTES: u64 = 1 << 30;

/// A recording's first line.
#[derive(Deserialize)]
struct Head {
    width: u16,
    height: u16,
}

/// Draws the moments that `args` ask for; what was written, line by line.
///
/// # Errors
/// A file that cannot be read or written, or is no recording: with its line.
pub fn run(args: &FramesArgs) -> Result<String, Report> {
    let name = args.cast.to_string_lossy();
    let text =
        read_text(&args.cast, MAX_BYTES).into_diagnostic().wrap_err_with(|| format!("{name}: cannot be read"))?;
    let mut moments = args.at.clone();
    moments.sort_by(f64::total_cmp);
    let mut screen = None;
    let mut moments = moments.into_iter().peekable();
    let mut told = String::new();
    for (number, line) in text.lines().enumerate() {
        let wrong = || format!("{name}:{}: is no line of an asciinema recording of version 2", number + 1);
        let Some(parser) = &mut screen else {
            let head: Head = serde_json::from_str(line).into_diagnostic().wrap_err_with(wrong)?;
            screen = Some(vt100::Parser::new(some(head.height), some(head.width), 0));
            continue;
        };
        let (seconds, kind, data): (f64, String, String) =
            serde_json::from_str(line).into_diagnostic().wrap_err_with(wrong)?;
        while let Some(at) = moments.next_if(|at| *at < seconds) {
            told += &write(parser.screen(), args, at)?;
        }
        match (kind.as_str(), data.split_once('x')) {
            ("o", _) => parser.process(data.as_bytes()),
            ("r", Some((columns, rows))) => {
                let number = |text: &str| text.parse::<u16>().into_diagnostic().wrap_err_with(wrong);
                let (columns, rows) = (number(columns)?, number(rows)?);
                parser.screen_mut().set_size(some(rows), some(columns));
            }
            _ => {}
        }
    }
    if let Some(parser) = &screen {
        for at in moments {
            told += &write(parser.screen(), args, at)?;
        }
    }
    Ok(told)
}

/// A size that a screen can have.
fn some(size: u16) -> NonZero<u16> {
    NonZero::new(size).unwrap_or(NonZero::<u16>::MIN)
}

fn write(screen: &vt100::Screen, args: &FramesArgs, at: f64) -> Result<String, Report> {
    let buffer = buffer_of(screen);
    let picture = png_of(&buffer, buffer.area, Paper::default()).into_diagnostic()?;
    let stem = args.cast.file_stem().map_or("cast".into(), |stem| stem.to_string_lossy());
    let path: PathBuf = Path::new(&args.out).join(format!("{stem}-{at}.png"));
    write_whole(&path, &picture)
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: cannot be written", path.display()))?;
    let mut told = String::new();
    let _ = writeln!(told, "{}", path.display());
    Ok(told)
}

/// What a terminal shows.
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
            for (set, modifier) in
                [(cell.bold(), Modifier::BOLD), (cell.dim(), Modifier::DIM), (cell.inverse(), Modifier::REVERSED)]
            {
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

    #[test]
    fn a_moment_shows_what_was_written_before_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let cast = folder.path().join("short.cast");
        let events = [
            r#"{"version":2,"width":4,"height":1}"#,
            r#"[1.0,"o","\u001b[31mab"]"#,
            r#"[2.0,"r","6x2"]"#,
            r#"[2.5,"o","cd"]"#,
        ];
        std::fs::write(&cast, events.join("\n")).expect("a file");
        let args = FramesArgs { cast, at: vec![1.5, 0.5, 9.0], out: folder.path().to_owned() };
        assert_eq!(run(&args).expect("pictures").lines().count(), 3);
        let size = |at: &str| {
            let file = std::fs::File::open(folder.path().join(format!("short-{at}.png"))).expect("a picture");
            let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
            (reader.info().width, reader.info().height)
        };
        assert_eq!((size("0.5"), size("1.5"), size("9")), ((32, 16), (32, 16), (48, 32)));
    }

    #[test]
    fn what_is_no_recording_is_told_with_its_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let cast = folder.path().join("wrong.cast");
        std::fs::write(&cast, "{\"version\":2,\"width\":4,\"height\":1}\nhello\n").expect("a file");
        let error = run(&FramesArgs { cast, at: vec![1.0], out: folder.path().to_owned() }).expect_err("a mistake");
        assert!(error.to_string().contains("wrong.cast:2:"), "{error}");
    }
}
