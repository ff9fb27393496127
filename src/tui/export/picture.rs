//! Characters as pixels, and as shapes and letters.

use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use unifont::get_glyph;

use crate::figure::{Anchor, Sheet};
use crate::tui::theme::{Rgb, blend, rgb_of_indexed};
use gdg::draw::Picture;

/// Size of a character, in pixels of the font and in points.
const WIDTH: usize = 8;
const HEIGHT: usize = 16;

/// Size of letters, and their baseline below the top of a character, in points.
const LETTERS: f32 = 13.0;
const BASELINE: f32 = 12.5;

/// By how much areas reach below those drawn later, in points: no gaps are left between them.
const OVERLAP: f32 = 0.3;

/// The colours that replace a terminal's default text and background.
#[derive(Clone, Copy, Debug)]
pub struct PageColours {
    /// Text.
    pub ink: Rgb,
    /// Background.
    pub ground: Rgb,
}

impl Default for PageColours {
    fn default() -> Self {
        Self { ink: (222, 222, 226), ground: (16, 16, 20) }
    }
}

/// Renders a part of the screen, 8 x 16 pixels a character.
pub fn picture_of(screen: &Buffer, area: Rect, page: PageColours) -> Picture {
    let (columns, rows) = (usize::from(area.width) * WIDTH, usize::from(area.height) * HEIGHT);
    let mut picture = Picture::new((columns, rows), page.ground);
    for at in area.positions() {
        let cell = &screen[at];
        let (front, back) = colours(cell, page);
        let symbol = cell.symbol().chars().next().unwrap_or(' ');
        let (glyph, braille) = (get_glyph(symbol), dots(symbol));
        let is_bold = cell.modifier.contains(Modifier::BOLD)
            && cell.symbol().chars().all(char::is_alphanumeric);
        let corner =
            (usize::from(at.y - area.y) * HEIGHT * columns) + usize::from(at.x - area.x) * WIDTH;
        for (row, column) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |x| (row, x))) {
            let dot = |column: usize| match braille {
                // The font would draw unset dots as rings.
                Some(dots) => {
                    let is_inside = [row, column].iter().all(|at| (1..3).contains(&(at % 4)));
                    is_inside && dots >> BRAILLE[column / 4][row / 4] & 1 == 1
                }
                None => glyph.is_some_and(|glyph| glyph.get_pixel(column, row)),
            };
            // Bold letters are drawn twice, a pixel apart.
            let is_set = dot(column) || is_bold && column > 0 && dot(column - 1);
            picture.pixels_mut()[corner + row * columns + column] =
                if is_set { front } else { back };
        }
    }
    picture
}

/// The bits of a braille character's dots, column by column from the top.
const BRAILLE: [[u32; 4]; 2] = [[0, 1, 2, 6], [3, 4, 5, 7]];

/// Returns the dots of a braille character.
fn dots(symbol: char) -> Option<u32> {
    u32::from(symbol).checked_sub(0x2800).filter(|dots| *dots < 256)
}

/// Draws a part of the screen with letters as text, and blocks, which fonts draw with gaps, as
/// areas.
pub fn sheet_of(screen: &Buffer, area: Rect, page: PageColours) -> Sheet {
    let size = [f32::from(area.width) * WIDTH as f32, f32::from(area.height) * HEIGHT as f32];
    let mut sheet = Sheet { size, title: "gdg-tui".to_owned(), marks: Vec::new() };
    for at in area.positions() {
        let cell = &screen[at];
        let (front, back) = colours(cell, page);
        let left = f32::from(at.x - area.x) * WIDTH as f32;
        let top = f32::from(at.y - area.y) * HEIGHT as f32;
        let mut rectangle = |[x, y, width, height]: [f32; 4], colour: Rgb| {
            let (x, y) = (left + x * WIDTH as f32, top + y * HEIGHT as f32);
            let right = (x + width * WIDTH as f32 + OVERLAP).min(size[0]);
            let bottom = (y + height * HEIGHT as f32 + OVERLAP).min(size[1]);
            sheet.area(vec![[x, y], [right, y], [right, bottom], [x, bottom]], colour);
        };
        rectangle([0.0, 0.0, 1.0, 1.0], back);
        if let Some(parts) = parts(cell.symbol()) {
            parts.into_iter().for_each(|part| rectangle(part, front));
        } else if cell.symbol() != " " {
            let middle = [left + 0.5 * WIDTH as f32, top + BASELINE];
            sheet.text(middle, cell.symbol(), LETTERS, Anchor::Middle, front);
        }
    }
    sheet
}

/// Returns a block or a braille character as rectangles within it (left, top, width, height).
fn parts(symbol: &str) -> Option<Vec<[f32; 4]>> {
    // Bits of the index: upper left, upper right, lower left, lower right.
    const QUADRANTS: [char; 16] = [
        ' ', '\u{2598}', '\u{259d}', '\u{2580}', '\u{2596}', '\u{258c}', '\u{259e}', '\u{259b}',
        '\u{2597}', '\u{259a}', '\u{2590}', '\u{259c}', '\u{2584}', '\u{2599}', '\u{259f}',
        '\u{2588}',
    ];
    let symbol = symbol.chars().next()?;
    let halves = |i: usize| [(i % 2) as f32 / 2.0, (i / 2) as f32 / 2.0, 0.5, 0.5];
    if let Some(quadrants) = QUADRANTS.iter().position(|known| *known == symbol) {
        return Some((0..4).filter(|i| quadrants >> i & 1 == 1).map(halves).collect());
    }
    if let Some(dots) = dots(symbol) {
        let dot = |i: usize| {
            let (column, row) = (i / 4, i % 4);
            let at = [column as f32 / 2.0 + 0.125, row as f32 / 4.0 + 0.0625];
            (dots >> BRAILLE[column][row] & 1 == 1).then_some([at[0], at[1], 0.25, 0.125])
        };
        return Some((0..8).filter_map(dot).collect());
    }
    // Lower blocks of an eighth to seven eighths.
    let eighths = u32::from(symbol).checked_sub(0x2580).filter(|n| (1..8).contains(n))?;
    let height = eighths as f32 / 8.0;
    Some(vec![[0.0, 1.0 - height, 1.0, height]])
}

/// Returns a character's front and back colours as displayed.
fn colours(cell: &Cell, page: PageColours) -> (Rgb, Rgb) {
    let (mut front, mut back) = (rgb(cell.fg, page.ink), rgb(cell.bg, page.ground));
    if cell.modifier.contains(Modifier::REVERSED) {
        std::mem::swap(&mut front, &mut back);
    }
    if cell.modifier.contains(Modifier::DIM) {
        front = blend(front, back, 0.4);
    }
    (front, back)
}

/// Converts a terminal colour; `own` replaces the terminal's default.
fn rgb(colour: Color, own: Rgb) -> Rgb {
    const NAMED: [Color; 16] = [
        Color::Black,
        Color::Red,
        Color::Green,
        Color::Yellow,
        Color::Blue,
        Color::Magenta,
        Color::Cyan,
        Color::Gray,
        Color::DarkGray,
        Color::LightRed,
        Color::LightGreen,
        Color::LightYellow,
        Color::LightBlue,
        Color::LightMagenta,
        Color::LightCyan,
        Color::White,
    ];
    match colour {
        Color::Rgb(r, g, b) => (r, g, b),
        Color::Indexed(i) => rgb_of_indexed(i),
        _ => {
            let index = NAMED.iter().position(|named| *named == colour);
            index.map_or(own, |index| rgb_of_indexed(index as u8))
        }
    }
}

#[cfg(test)]
mod tests {
    use ratatui::style::Style;

    use super::*;

    #[test]
    fn half_blocks_become_two_coloured_halves() {
        let (mut screen, style) = (Buffer::empty(Rect::new(0, 0, 2, 1)), Style::new());
        let style = style.fg(Color::Rgb(200, 10, 20)).bg(Color::Rgb(1, 2, 3));
        screen.set_string(0, 0, "\u{2580}A", style);
        let mut picture = picture_of(&screen, screen.area, PageColours::default());
        assert_eq!(picture.size(), (16, 16));
        let pixels = picture.pixels_mut();
        let (front, back) = ((200, 10, 20), (1, 2, 3));
        assert_eq!([3, 7 * 16 + 3, 8 * 16 + 3].map(|at| pixels[at]), [front, front, back]);
        assert!(pixels[8 * 16 + 8..9 * 16].contains(&front), "the letter is drawn");
    }
}
