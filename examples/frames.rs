//! Draws moments of a screen recording, as the pictures of the documentation: each as a file of its
//! own, or all as an animation.
//!
//! ```sh
//! gdg-tui tour --record tour.cast
//! cargo run --release --example frames -- tour.cast 2 15 44              # tour-2.png, ...
//! cargo run --release --example frames -- tour.cast tour.png $(seq 20 0.5 45)
//! ```

use std::io::{BufRead, BufReader};
use std::num::NonZero;
use std::path::{Path, PathBuf};

use gdg::draw::Animation;
use gdg_tui::tui::{PageColours, picture_of};
use miette::{IntoDiagnostic, Result, miette};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};

/// How long the last frame of an animation is shown, in seconds.
const LAST_FRAME_SECONDS: f64 = 2.0;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1).peekable();
    let cast =
        args.next().ok_or_else(|| miette!("usage: frames FILE.cast [OUT.png] SECONDS..."))?;
    let cast = PathBuf::from(cast);
    let animation = args.next_if(|arg| Path::new(arg).extension().is_some_and(|end| end == "png"));
    let moments: Vec<f64> = args.map(|arg| arg.parse().into_diagnostic()).collect::<Result<_>>()?;
    let mut frames = frames(&cast, &moments)?;
    let picture = |screen: &Buffer| picture_of(screen, screen.area, PageColours::default());
    let Some(out) = animation else {
        for (at, screen) in frames {
            let out = format!("{}-{at}.png", cast.with_extension("").display());
            std::fs::write(out, picture(&screen).to_png("gdg-tui").into_diagnostic()?)
                .into_diagnostic()?;
        }
        return Ok(());
    };
    let end = moments.last().map_or(0.0, |last| last + LAST_FRAME_SECONDS);
    frames.dedup_by(|next, before| next.1 == before.1);
    let size = frames.first().map(|(_, screen)| picture(screen).size());
    let size = size.ok_or_else(|| miette!("give the seconds of the frames"))?;
    let mut bytes = Vec::new();
    let mut animation = Animation::begin(&mut bytes, size, frames.len()).into_diagnostic()?;
    for (i, (at, screen)) in frames.iter().enumerate() {
        let next = frames.get(i + 1).map_or(end, |(next, _)| *next);
        animation.add(picture(screen), next - at).into_diagnostic()?;
    }
    animation.finish().into_diagnostic()?;
    std::fs::write(out, bytes).into_diagnostic()
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
