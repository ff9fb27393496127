//! Characters as text and rectangles (SVG).

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Modifier;
use svg::Document;
use svg::node::element::{Rectangle, Text};

use super::PageColours;
use super::picture::colours;
use crate::tui::theme::Rgb;
use gdg::draw::hex;

/// Size of a character.
const WIDTH: f32 = 8.0;
const HEIGHT: f32 = 16.0;

/// Text baseline, measured from the top of a character.
const BASELINE: f32 = 12.5;

/// Renders a part of the screen as an SVG document.
pub fn svg_of(screen: &Buffer, area: Rect, page: PageColours) -> String {
    let size = (f32::from(area.width) * WIDTH, f32::from(area.height) * HEIGHT);
    let mut document = Document::new()
        .set("viewBox", (0.0, 0.0, size.0, size.1))
        .set("font-family", "DejaVu Sans Mono, Menlo, Consolas, monospace")
        .set("font-size", 13)
        .set("shape-rendering", "crispEdges")
        .set("xml:space", "preserve")
        .add(block((0.0, 0.0), size, page.ground));
    for row in 0..area.height {
        for column in 0..area.width {
            let cell = &screen[(area.x + column, area.y + row)];
            let (front, back) = colours(cell, page);
            let at = (f32::from(column) * WIDTH, f32::from(row) * HEIGHT);
            if back != page.ground {
                document = document.add(block(at, (WIDTH, HEIGHT), back));
            }
            let symbol = cell.symbol();
            if let Some(parts) = parts(symbol) {
                for (x, y, w, h) in parts {
                    let at = (at.0 + x * WIDTH, at.1 + y * HEIGHT);
                    document = document.add(block(at, (w * WIDTH, h * HEIGHT), front));
                }
            } else if symbol != " " {
                let weight = if cell.modifier.contains(Modifier::BOLD) { "bold" } else { "normal" };
                let text = Text::new(symbol)
                    .set("x", at.0)
                    .set("y", at.1 + BASELINE)
                    .set("fill", hex(front))
                    .set("font-weight", weight);
                document = document.add(text);
            }
        }
    }
    document.to_string()
}

fn block((x, y): (f32, f32), (width, height): (f32, f32), rgb: Rgb) -> Rectangle {
    Rectangle::new()
        .set("x", x)
        .set("y", y)
        .set("width", width)
        .set("height", height)
        .set("fill", hex(rgb))
}

/// Returns a block element as rectangles within a character (left, top, width, height), since fonts
/// draw it with gaps.
fn parts(symbol: &str) -> Option<Vec<(f32, f32, f32, f32)>> {
    const QUADRANTS: [(char, u8); 15] = [
        ('\u{2598}', 1),
        ('\u{259d}', 2),
        ('\u{2580}', 3),
        ('\u{2596}', 4),
        ('\u{258c}', 5),
        ('\u{259e}', 6),
        ('\u{259b}', 7),
        ('\u{2597}', 8),
        ('\u{259a}', 9),
        ('\u{2590}', 10),
        ('\u{259c}', 11),
        ('\u{2584}', 12),
        ('\u{2599}', 13),
        ('\u{259f}', 14),
        ('\u{2588}', 15),
    ];
    let c = symbol.chars().next()?;
    if let Some((_, mask)) = QUADRANTS.iter().find(|(q, _)| *q == c) {
        let own = (0..4u8).filter(|i| mask >> i & 1 == 1);
        return Some(
            own.map(|i| (f32::from(i % 2) / 2.0, f32::from(i / 2) / 2.0, 0.5, 0.5)).collect(),
        );
    }
    // Lower blocks of an eighth to seven eighths.
    let eighths = u32::from(c).checked_sub(0x2580).filter(|n| (1..8).contains(n))? as f32 / 8.0;
    Some(vec![(0.0, 1.0 - eighths, 1.0, eighths)])
}
