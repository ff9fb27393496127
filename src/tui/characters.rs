//! A canvas as characters: each shows two colours, or a sign without colours.

use ratatui::buffer::Buffer;
use ratatui::layout::Position;
use ratatui::style::{Color, Modifier, Style};

use super::canvas::{Canvas, Ground, Sign};
use super::theme::{ColourDepth, Rgb, Theme, ink, rgb_of};
use crate::tui::choices::Marker;

const MAX_PIXELS: usize = 4;

pub const WALL_MARK: char = '#';

pub const UNVISITED_MARK: char = '/';

/// A cell from which no path leads to the goal, without colours.
pub const CUT_OFF_MARK: char = '\\';

pub const CANDIDATE_MARK: char = '\u{2022}';

/// Blocks of two by two; bits of the index: upper left, upper right, lower left, lower right.
pub const QUADRANTS: [char; 16] = [
    ' ', '\u{2598}', '\u{259d}', '\u{2580}', '\u{2596}', '\u{258c}', '\u{259e}', '\u{259b}',
    '\u{2597}', '\u{259a}', '\u{2590}', '\u{259c}', '\u{2584}', '\u{2599}', '\u{259f}', '\u{2588}',
];

impl Canvas {
    pub fn paint(&mut self, buffer: &mut Buffer, theme: &Theme) {
        self.changed.clear();
        for row in 0..self.frame.area.height {
            (0..self.frame.area.width).for_each(|x| self.paint_character(buffer, [x, row], theme));
        }
    }

    /// Writes the characters whose pixels have changed since the last full paint.
    pub fn paint_changes(&mut self, buffer: &mut Buffer, theme: &Theme) {
        let ((across, down), columns) = (self.character, self.columns());
        let character = |i: usize| [(i % columns / across) as u16, (i / columns / down) as u16];
        let mut characters: Vec<[u16; 2]> = self.changed.drain(..).map(character).collect();
        characters.sort_unstable();
        characters.dedup();
        characters.into_iter().for_each(|at| self.paint_character(buffer, at, theme));
    }

    fn paint_character(&self, buffer: &mut Buffer, [column, row]: [u16; 2], theme: &Theme) {
        let ((across, down), columns) = (self.character, self.columns());
        let first = down * usize::from(row) * columns + across * usize::from(column);
        let own = |n: usize| first + n / across * columns + n % across;
        let count = across * down;
        let at = Position::new(self.frame.area.x + column, self.frame.area.y + row);
        let Some(cell) = buffer.cell_mut(at) else { return };
        if theme.depth == ColourDepth::Mono {
            cell.set_char(self.marks[first]);
            return;
        }
        let mut colours = [None; MAX_PIXELS];
        for (n, colour) in colours[..count].iter_mut().enumerate() {
            let shown = self.grounds[own(n)] != Ground::Outside;
            *colour = shown.then(|| self.pixels[own(n)].into());
        }
        let merge = if theme.depth == ColourDepth::Indexed { most_frequent } else { mean };
        let (mask, front, back) = two_colours(&colours[..count], merge);
        let marker = self.frame.marker;
        let colour = |rgb: Option<Rgb>| rgb.map_or(Color::Reset, |rgb| theme.colour(rgb));
        cell.set_char(glyph(marker, mask))
            .set_style(Style::new().fg(colour(front)).bg(colour(back)));
    }

    /// Writes signs without a colour, and then other signs and letters.
    pub fn paint_signs(&self, buffer: &mut Buffer, theme: &Theme) {
        let is_plain = |sign: &&Sign| matches!(sign, Sign::Symbol(_, _, None));
        let (plain, other): (Vec<&Sign>, Vec<&Sign>) = self.signs.iter().partition(is_plain);
        for sign in plain.into_iter().chain(other) {
            let (Sign::Letter(at, ..) | Sign::Symbol(at, ..)) = sign;
            let Some(at) = self.frame.character_of(*at) else { continue };
            match sign {
                Sign::Letter(_, letter, rgb) => put_letter(buffer, at, *letter, *rgb, theme),
                Sign::Symbol(_, symbol, rgb) => put(buffer, at, *symbol, *rgb, theme),
            }
        }
    }
}

/// Writes a letter on its own background.
pub fn put_letter(buffer: &mut Buffer, at: Position, letter: char, rgb: Rgb, theme: &Theme) {
    let style = match theme.depth {
        ColourDepth::Mono => Style::new().add_modifier(Modifier::REVERSED),
        _ => Style::new().bg(theme.colour(rgb)).fg(theme.colour(ink(rgb))),
    };
    if let Some(cell) = buffer.cell_mut(at) {
        cell.set_char(letter).set_style(style.add_modifier(Modifier::BOLD));
    }
}

/// Writes a sign on the existing background.
pub fn put(buffer: &mut Buffer, at: Position, symbol: char, rgb: Option<Rgb>, theme: &Theme) {
    let Some(cell) = buffer.cell_mut(at) else { return };
    if theme.depth == ColourDepth::Mono {
        cell.set_char(symbol);
        return;
    }
    // The background of a half block is the colour of its lower half.
    let ground = rgb_of(cell.bg).unwrap_or(theme.unknown);
    cell.set_char(symbol).set_fg(theme.colour(rgb.unwrap_or(ink(ground))));
}

/// Reduces a character's pixels to two colours; returns a mask of the pixels in front (bit 0 is the
/// first pixel), the front colour and the back colour.
///
/// Pixels are grouped around the first one and the one most different from it, and each group is
/// shown by the colour that `merge` makes of it. Pixels outside the map, if any, are the background.
fn two_colours(colours: &[Option<Rgb>], merge: Merge) -> (u8, Option<Rgb>, Option<Rgb>) {
    let first = colours[0];
    let all = ((1u16 << colours.len()) - 1) as u8;
    if colours.iter().all(|c| *c == first) {
        return if first.is_some() { (all, first, first) } else { (0, None, None) };
    }
    if let [Some(above), Some(below)] = colours {
        return (1, Some(*above), Some(*below));
    }
    let bits = |front: &dyn Fn(Option<Rgb>) -> bool| {
        colours.iter().enumerate().fold(0u8, |mask, (i, c)| mask | u8::from(front(*c)) << i)
    };
    let Some(first) = first.filter(|_| colours.iter().all(Option::is_some)) else {
        let mask = bits(&|c| c.is_some());
        return (mask, merge(colours, mask), None);
    };
    let apart = |a: Rgb, b: Rgb| {
        let squared = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
        squared(a.0, b.0) + squared(a.1, b.1) + squared(a.2, b.2)
    };
    let other = colours.iter().flatten().copied().max_by_key(|c| apart(*c, first)).unwrap_or(first);
    let mask = bits(&|c| c.is_some_and(|c| apart(c, first) <= apart(c, other)));
    (mask, merge(colours, mask), merge(colours, all & !mask))
}

/// Makes one colour of those in a mask.
type Merge = fn(&[Option<Rgb>], u8) -> Option<Rgb>;

fn in_mask(colours: &[Option<Rgb>], mask: u8) -> impl Iterator<Item = Rgb> + Clone {
    colours.iter().enumerate().filter(move |(i, _)| mask >> i & 1 == 1).filter_map(|(_, c)| *c)
}

fn mean(colours: &[Option<Rgb>], mask: u8) -> Option<Rgb> {
    let (sum, n) = in_mask(colours, mask).fold(((0u32, 0u32, 0u32), 0u32), |((r, g, b), n), c| {
        ((r + u32::from(c.0), g + u32::from(c.1), b + u32::from(c.2)), n + 1)
    });
    (n > 0).then(|| ((sum.0 / n) as u8, (sum.1 / n) as u8, (sum.2 / n) as u8))
}

/// Returns the most frequent of the colours in `mask`: with few colours, a mean of two kinds of ground
/// may look like a third.
fn most_frequent(colours: &[Option<Rgb>], mask: u8) -> Option<Rgb> {
    let own = in_mask(colours, mask);
    let count = |colour: &Rgb| own.clone().filter(|other| other == colour).count();
    own.clone().max_by_key(count)
}

/// Returns the character with the parts in `mask` in front: row by row, bit 0 at the upper left.
fn glyph(marker: Marker, mask: u8) -> char {
    match marker {
        Marker::Quadrant => QUADRANTS[usize::from(mask & 15)],
        _ => [' ', '\u{2580}', '\u{2584}', '\u{2588}'][usize::from(mask & 3)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pixels_keep_their_colours() {
        let (a, b) = ((10, 20, 30), (200, 100, 0));
        let (mask, front, back) = two_colours(&[Some(a), Some(b)], mean);
        assert_eq!((mask, front, back), (1, Some(a), Some(b)));
        assert_eq!(glyph(Marker::HalfBlock, mask), '\u{2580}');
        assert_eq!(two_colours(&[Some(a), Some(a)], mean), (3, Some(a), Some(a)));
        assert_eq!(two_colours(&[Some(a), None], mean), (1, Some(a), None));
        assert_eq!(two_colours(&[None, None], mean), (0, None, None));
    }
}
