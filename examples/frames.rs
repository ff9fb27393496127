//! Draws moments of a screen recording, as the pictures of the documentation. Programs such as
//! `apngasm` join them.
//!
//! ```sh
//! gdg-tui tour --record tour.cast
//! cargo run --release --example frames -- tour.cast 2 15 44              # tour-2.png, ...
//! ```

use std::io::{BufRead, BufReader};
use std::num::NonZero;
use std::path::Path;

use gdg_tui::tui::{PageColours, picture_of};
use miette::{IntoDiagnostic, Result, miette};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let cast = args.next().ok_or_else(|| miette!("usage: frames FILE.cast SECONDS..."))?;
    let cast = Path::new(&cast);
    let moments: Vec<f64> = args.map(|arg| arg.parse().into_diagnostic()).collect::<Result<_>>()?;
    for (at, screen) in frames(cast, &moments)? {
        let out = format!("{}-{at}.png", cast.with_extension("").display());
        let picture = picture_of(&screen, screen.area, PageColours::default());
        std::fs::write(out, picture.to_png("gdg-tui").into_diagnostic()?).into_diagnostic()?;
    }
    Ok(())
}

/// Plays a recording; returns what its screen shows at each of `moments`, which ascend.
fn frames(cast: &Path, moments: &[f64]) -> Result<Vec<(f64, Buffer)>> {
    let mut lines = BufReader::new(std::fs::File::open(cast).into_diagnostic()?).lines();
    let head = lines.next().ok_or_else(|| miette!("{}: is empty", cast.display()))?;
    let head: serde_json::Value =
        serde_json::from_str(&head.into_diagnostic()?).into_diagnostic()?;
    let size = |name: &str| {
        let size = head[name].as_u64().and_then(|size| NonZero::new(size as u16));
        size.ok_or_else(|| miette!("{}: has no {name}", cast.display()))
    };
    let mut screen = vt100::Parser::new(size("height")?, size("width")?, 0);
    let mut moments = moments.iter().copied().peekable();
    let mut frames = Vec::new();
    for line in lines {
        let (seconds, kind, text): (f64, String, String) =
            serde_json::from_str(&line.into_diagnostic()?).into_diagnostic()?;
        while let Some(at) = moments.next_if(|at| *at < seconds) {
            frames.push((at, buffer_of(screen.screen())));
        }
        if kind != "o" {
            return Err(miette!("the window is resized after {seconds} s: record it in one size"));
        }
        screen.process(text.as_bytes());
    }
    frames.extend(moments.map(|at| (at, buffer_of(screen.screen()))));
    Ok(frames)
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
    for (column, row) in (0..rows.get()).flat_map(|y| (0..columns.get()).map(move |x| (x, y))) {
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
    buffer
}
