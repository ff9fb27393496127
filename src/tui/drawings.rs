//! Exports to files: a picture of the map, and curves as a drawing or a table.

use std::path::Path;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Modifier;

use super::characters::QUADRANTS;
use super::render;
use super::render::curves::{PaneCurve, Plot, along, axis, plots};
use super::scene::{Cache, Scene};
use super::screen::Screen;
use super::theme::{ColourDepth, Rgb, Theme, ThemeName, blend, rgb_of};
use crate::experiment::plot::Drawable;
use crate::figure::{
    Anchor, Chart, ChartPage, Curve, FigureFormat, MILLIMETRE, Mark, PIXEL, Point, Sheet, round_top,
};
use crate::headless::metrics::Curves;
use crate::setup::saves::EXPORTS;
use crate::tui::choices::ExportKind;
use gdg::draw::Picture;
use gdg::engine::Snapshot;
use gdg::files;

/// Why an export fails.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error("nothing to export: the map is hidden, or the window too small")]
    Empty,
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A drawing cannot be encoded.
    #[error("{0}")]
    Figure(miette::Report),
}

/// Encodes what has been drawn, which may take a second or two.
pub type Encode = Box<dyn FnOnce() -> Result<Vec<u8>, ExportError> + Send>;

/// Draws an export; returns what writes it to a new file and returns the notice for the user.
pub fn begin(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<impl FnOnce() -> Result<String, String> + Send + use<>, ExportError> {
    let (name, noun) = (name(kind, screen, scene), scene.noun());
    let encode = drawn(kind, screen, scene)?;
    Ok(move || {
        // A paused run may be exported several times.
        let end = format!("-{}.{}", kind.stem(noun), kind.file_type());
        let path = files::named(Path::new(EXPORTS), &name, &end);
        let written = encode().and_then(|bytes| Ok(files::write_to_unused(&path, &bytes)?));
        let written = written.map(|path| format!("wrote {}", path.display()));
        written.map_err(|error| format!("{} cannot be written: {error}", path.display()))
    })
}

/// Returns what a file's name begins with: world, method, and the update that is shown.
pub fn name(kind: ExportKind, screen: &Screen, scene: &Scene) -> String {
    // Curves are of the present, whatever the map shows.
    let past = screen.past.as_ref().filter(|_| ExportKind::PICTURES.contains(&kind));
    let updates = match past {
        Some(frame) => screen.snapshot.learned(frame.updates),
        None => screen.snapshot.updates(),
    };
    format!("{}-{}-{updates}", scene.title(&screen.snapshot), screen.run().method)
}

/// Captures the present screen as this kind of export; what takes long is left to the encoder.
pub fn drawn(kind: ExportKind, screen: &mut Screen, scene: &Scene) -> Result<Encode, ExportError> {
    Ok(match kind {
        ExportKind::MapPng | ExportKind::MapSvg => {
            // For readers, who have no keys, in all colours even if the terminal has fewer.
            let theme = screen.theme.in_full_colour();
            let own = std::mem::replace(&mut screen.theme, theme);
            screen.on_paper = true;
            let drawn = on_paper(screen, scene);
            (screen.theme, screen.on_paper) = (own, false);
            let (drawn, area) = drawn?;
            if area.is_empty() {
                return Err(ExportError::Empty);
            }
            let sheet = sheet_of(&drawn, area, &theme);
            let format =
                if kind == ExportKind::MapSvg { FigureFormat::Svg } else { FigureFormat::Png };
            Box::new(move || format.encode(&sheet).map_err(ExportError::Figure))
        }
        ExportKind::CurvesSvg | ExportKind::CurvesPdf => {
            let format =
                if kind == ExportKind::CurvesSvg { FigureFormat::Svg } else { FigureFormat::Pdf };
            let (world, run) = (scene.title(&screen.snapshot), screen.run());
            let title = format!("{world}, {}, seed {}", run.method, run.seed);
            let figure = curves_figure(screen, scene, &title);
            Box::new(move || format.encode(&figure).map_err(ExportError::Figure))
        }
        ExportKind::CurvesCsv => {
            let Snapshot { curve, evaluations, methods, run, .. } = &*screen.snapshot;
            let (points, moment) = (curve, &|_| None);
            let table = Curves { points, evaluations, moment, methods, run }.table();
            Box::new(|| Ok(table.into_bytes()))
        }
    })
}

/// Draws a screen in memory; returns it with the area of the map.
fn on_paper(screen: &Screen, scene: &Scene) -> std::io::Result<(Buffer, Rect)> {
    let size = screen.layout.screen;
    let backend = TestBackend::new(size.width.max(1), size.height.max(1));
    let mut terminal = Terminal::new(backend).map_err(std::io::Error::other)?;
    let mut area = Rect::default();
    let drawn = terminal.draw(|frame| {
        let pane = render::draw(frame, screen, scene, &mut Cache::default()).map_pane;
        // With the moment of the past above it.
        area = Rect { y: pane.y.saturating_sub(1), height: pane.height + 1, ..pane };
    });
    let mut drawn = drawn.map_err(std::io::Error::other)?.buffer.clone();
    let area = without_margins(&mut drawn, area);
    Ok((drawn, area))
}

/// Moves the line below the map to it; returns the area of both without what is blank around them.
fn without_margins(drawn: &mut Buffer, area: Rect) -> Rect {
    let area = area.intersection(drawn.area);
    let used = |area: Rect| {
        let used = area.positions().filter(|at| drawn[*at] != Cell::default());
        used.map(|at| Rect::new(at.x, at.y, 1, 1)).reduce(Rect::union).unwrap_or_default()
    };
    let [map, line] = Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(area);
    let [map, line] = [used(map), used(line).union(Rect { width: 1, ..line })];
    let text: Vec<Cell> = line.positions().map(|at| drawn[at].clone()).collect();
    let x = map.x.min(area.right().saturating_sub(line.width));
    for (i, cell) in text.into_iter().enumerate() {
        drawn[(x + i as u16, map.bottom())] = cell;
    }
    let width = (map.right() - x).max(line.width);
    if map.is_empty() { map } else { Rect { x, y: map.y, width, height: map.height + 1 } }
}

/// Size of a character, size of letters, and their baseline below the top of a character, in points.
const WIDTH: f32 = 16.0 * PIXEL;
const HEIGHT: f32 = 32.0 * PIXEL;
const LETTERS: f32 = 6.25;
const BASELINE: f32 = 6.0;

/// Columns and rows of pixels of a character: enough for all blocks and dots of braille.
const BLOCK: (usize, usize) = (8, 16);

/// Text and background of a page that a theme leaves to the terminal.
const PAGE: (Rgb, Rgb) = ((222, 222, 226), (16, 16, 20));

/// Draws letters as text, above a picture of grounds and blocks, which fonts draw with gaps.
fn sheet_of(screen: &Buffer, area: Rect, theme: &Theme) -> Sheet {
    let size = [f32::from(area.width) * WIDTH, f32::from(area.height) * HEIGHT];
    let columns = usize::from(area.width) * BLOCK.0;
    let mut blocks = Picture::new((columns, usize::from(area.height) * BLOCK.1), PAGE.1);
    let mut sheet = Sheet { size, title: "gdg-tui".to_owned(), marks: Vec::new() };
    for at in area.positions() {
        let (cell, column, row) = (&screen[at], at.x - area.x, at.y - area.y);
        let (front, back) = colours(cell, theme.page.unwrap_or(PAGE));
        let symbol = cell.symbol().chars().next().unwrap_or(' ');
        let first = usize::from(row) * BLOCK.1 * columns + usize::from(column) * BLOCK.0;
        for (x, y) in (0..BLOCK.0 * BLOCK.1).map(|i| (i % BLOCK.0, i / BLOCK.0)) {
            let is_front = covers(symbol, x, y) == Some(true);
            blocks.pixels_mut()[first + y * columns + x] = if is_front { front } else { back };
        }
        if covers(symbol, 0, 0).is_none() {
            let middle = [(f32::from(column) + 0.5) * WIDTH, f32::from(row) * HEIGHT + BASELINE];
            sheet.text(middle, cell.symbol(), LETTERS, Anchor::Middle, front);
        }
    }
    sheet.marks.insert(0, Mark::Picture { at: [0.0; 2], size, picture: blocks });
    sheet
}

/// Returns whether a block or a braille character covers one of its pixels; `None` for others.
fn covers(symbol: char, x: usize, y: usize) -> Option<bool> {
    /// The bits of a braille character's dots, column by column from the top.
    const BRAILLE: [[u32; 4]; 2] = [[0, 1, 2, 6], [3, 4, 5, 7]];
    if let Some(quadrants) = QUADRANTS.iter().position(|known| *known == symbol) {
        return Some(quadrants >> (y / 8 * 2 + x / 4) & 1 == 1);
    }
    if let Some(dots) = u32::from(symbol).checked_sub(0x2800).filter(|dots| *dots < 256) {
        let is_dot = [x, y].iter().all(|at| (1..3).contains(&(at % 4)));
        return Some(is_dot && dots >> BRAILLE[x / 4][y / 4] & 1 == 1);
    }
    // Lower blocks of an eighth to seven eighths.
    let eighths = u32::from(symbol).checked_sub(0x2580).filter(|n| (1..8).contains(n))?;
    Some(y + 2 * eighths as usize >= BLOCK.1)
}

/// Returns a character's front and back colours as displayed, given a page's.
fn colours(cell: &Cell, page: (Rgb, Rgb)) -> (Rgb, Rgb) {
    let (mut front, mut back) =
        (rgb_of(cell.fg).unwrap_or(page.0), rgb_of(cell.bg).unwrap_or(page.1));
    if cell.modifier.contains(Modifier::REVERSED) {
        std::mem::swap(&mut front, &mut back);
    }
    if cell.modifier.contains(Modifier::DIM) {
        front = blend(front, back, 0.4);
    }
    (front, back)
}

const FIGURE_WIDTH: f32 = 130.0 * MILLIMETRE;

/// Charts of the window, from its first one on, in a figure.
const CHARTS: usize = 3;

fn curves_figure(screen: &Screen, scene: &Scene, title: &str) -> Sheet {
    let x = [0.0, along(screen, screen.snapshot.counters.updates).max(1.0)];
    let chart = |plot: Plot| {
        let values = plot.curves.iter().flat_map(|curve| &curve.points).map(|(_, value)| *value);
        let top = plot.max.unwrap_or_else(|| round_top(values));
        let mut curves: Vec<Curve> = Vec::new();
        for PaneCurve { name, style, points, .. } in plot.curves {
            let before = curves.last().map(|curve| (curve.name.clone(), curve.marker));
            let (name, marker) = match before {
                Some(continued) if name.is_empty() => continued,
                Some((_, marker)) => (name, marker + 1),
                None if name.is_empty() => (plot.title.to_owned(), 0),
                None => (name, 0),
            };
            let points = points.into_iter().map(|(x, value)| Point::single(x, value)).collect();
            let colour = style.fg.and_then(rgb_of).unwrap_or_default();
            curves.push(Curve { name, colour, marker, points });
        }
        curves.retain(|curve| !curve.points.is_empty());
        let labels = [axis(screen).label(), plot.title].map(str::to_owned);
        Chart { title: String::new(), labels, x, top, curves }
    };
    let paper = Theme::new(ThemeName::Light, ColourDepth::True);
    let plots = plots(screen, &paper, scene.has_true_distances());
    let charts: Vec<Chart> = plots.into_iter().take(CHARTS).map(chart).collect();
    ChartPage { title, has_heading: true, charts: &charts, width: FIGURE_WIDTH, columns: 1 }.draw()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_pixels_and_letters_are_text() {
        let covered = |symbol| {
            let pixels = (0..BLOCK.0 * BLOCK.1).map(|i| covers(symbol, i % BLOCK.0, i / BLOCK.0));
            pixels
                .collect::<Option<Vec<bool>>>()
                .map(|all| all.into_iter().filter(|is| *is).count())
        };
        let found = ['\u{2580}', '\u{2583}', '\u{2801}', ' ', 'A'].map(covered);
        assert_eq!(found, [Some(64), Some(48), Some(4), Some(0), None]);
    }
}
