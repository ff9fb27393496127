//! Characters as pixels (PNG).

use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use unifont::get_glyph;

use super::PageColours;
use crate::tui::theme::{Rgb, blend, rgb_of_indexed};
use gdg::draw::Picture;

/// Size of a character in the font, in pixels.
const WIDTH: usize = 8;
const HEIGHT: usize = 16;

/// Renders a part of the screen, 8 x 16 pixels a character.
pub fn picture_of(screen: &Buffer, area: Rect, page: PageColours) -> Picture {
    let (columns, rows) = (usize::from(area.width) * WIDTH, usize::from(area.height) * HEIGHT);
    let mut picture = Picture::new((columns, rows), page.ground);
    for y in 0..area.height {
        for x in 0..area.width {
            let cell = &screen[(area.x + x, area.y + y)];
            let (front, back) = colours(cell, page);
            let symbol = cell.symbol().chars().next().unwrap_or(' ');
            let glyph = get_glyph(symbol);
            let bold = cell.modifier.contains(Modifier::BOLD);
            for row in 0..HEIGHT {
                for column in 0..WIDTH {
                    let dot = |column: usize| match braille(symbol) {
                        Some(dots) => dots.has(column, row),
                        None => glyph.is_some_and(|g| g.get_pixel(column, row)),
                    };
                    // Bold letters are drawn twice, a pixel apart.
                    let letter = cell.symbol().chars().all(char::is_alphanumeric);
                    let set = dot(column) || bold && letter && column > 0 && dot(column - 1);
                    let at =
                        (usize::from(y) * HEIGHT + row) * columns + usize::from(x) * WIDTH + column;
                    picture.pixels_mut()[at] = if set { front } else { back };
                }
            }
        }
    }
    picture
}

/// The dots of a braille character. The font is not used for these, as it draws unset dots as
/// rings.
struct Dots(u32);

impl Dots {
    /// Returns whether a pixel belongs to a set dot.
    fn has(&self, column: usize, row: usize) -> bool {
        // The left column's dots are bits 0, 1, 2 and 6, the right one's 3, 4, 5 and 7.
        const BITS: [[u32; 4]; 2] = [[0, 1, 2, 6], [3, 4, 5, 7]];
        let inside = (1..3).contains(&(column % 4)) && (1..3).contains(&(row % 4));
        inside && self.0 >> BITS[column / 4][row / 4] & 1 == 1
    }
}

fn braille(symbol: char) -> Option<Dots> {
    u32::from(symbol).checked_sub(0x2800).filter(|dots| *dots < 256).map(Dots)
}

/// Returns a character's front and back colours as displayed.
pub fn colours(cell: &Cell, page: PageColours) -> (Rgb, Rgb) {
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
    match colour {
        Color::Rgb(r, g, b) => (r, g, b),
        Color::Indexed(i) => rgb_of_indexed(i),
        Color::Reset => own,
        Color::Black => rgb_of_indexed(0),
        Color::Red => rgb_of_indexed(1),
        Color::Green => rgb_of_indexed(2),
        Color::Yellow => rgb_of_indexed(3),
        Color::Blue => rgb_of_indexed(4),
        Color::Magenta => rgb_of_indexed(5),
        Color::Cyan => rgb_of_indexed(6),
        Color::Gray => rgb_of_indexed(7),
        Color::DarkGray => rgb_of_indexed(8),
        Color::LightRed => rgb_of_indexed(9),
        Color::LightGreen => rgb_of_indexed(10),
        Color::LightYellow => rgb_of_indexed(11),
        Color::LightBlue => rgb_of_indexed(12),
        Color::LightMagenta => rgb_of_indexed(13),
        Color::LightCyan => rgb_of_indexed(14),
        Color::White => rgb_of_indexed(15),
    }
}

#[cfg(test)]
mod tests {
    use ratatui::style::Style;

    use super::*;

    #[test]
    fn half_blocks_become_two_coloured_halves() {
        let mut screen = Buffer::empty(Rect::new(0, 0, 2, 1));
        let style = Style::new().fg(Color::Rgb(200, 10, 20)).bg(Color::Rgb(1, 2, 3));
        screen.set_string(0, 0, "\u{2580}A", style);
        let file = picture_of(&screen, screen.area, PageColours::default())
            .to_png("gdg-tui")
            .expect("a picture");
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let frame = reader.next_frame(&mut pixels).expect("pixels");
        assert_eq!((frame.width, frame.height), (16, 16));
        let at = |x: usize, y: usize| &pixels[3 * (y * 16 + x)..3 * (y * 16 + x) + 3];
        assert_eq!(
            (at(3, 0), at(3, 7), at(3, 8)),
            (&[200, 10, 20][..], &[200, 10, 20][..], &[1, 2, 3][..])
        );
        assert!((8..16).any(|x| at(x, 8) == [200, 10, 20]), "the letter is drawn");
    }
}
