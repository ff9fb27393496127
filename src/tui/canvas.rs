//! Pixels, and their rendering as characters.

use gdg::draw::positions_along;
use ratatui::buffer::Buffer;
use ratatui::layout::Position;
use ratatui::style::{Color, Style};

use super::raster::MapFrame;
use super::theme::{ColourDepth, Rgb, Theme, blend};
use crate::tui::marker::Marker;

/// The pen that draws a line.
#[derive(Clone, Copy, Debug)]
pub struct Pen {
    /// The colour.
    pub rgb: Rgb,
    /// The opacity.
    pub share: f32,
    /// The character without colours.
    pub mark: char,
}

/// The map as pixels, before it becomes characters.
#[derive(Clone, Debug)]
pub struct Canvas {
    columns: usize,
    /// Colour of each pixel; `None` outside the map.
    pixels: Vec<Option<Rgb>>,
    /// The character of each pixel on terminals without colours.
    marks: Vec<char>,
    /// Pixels of thin lines, which do not become backgrounds.
    thin: Vec<bool>,
    /// Pixels changed since the last full paint.
    changed: Vec<usize>,
}

/// The most pixels in a character.
const MAX_PIXELS: usize = 8;

/// A wall without colours.
pub const WALL_MARK: char = '#';

/// Free ground without colours, from near (or good) to far.
pub const SHADES: [char; 4] = [' ', '\u{2591}', '\u{2592}', '\u{2593}'];

/// An unvisited cell without colours.
pub const UNVISITED_MARK: char = '/';

/// A cell from which no path leads to the goal, without colours.
pub const CUT_OFF_MARK: char = '\\';

/// A bridge candidate without colours.
pub const CANDIDATE_MARK: char = '\u{2022}';

impl Canvas {
    /// Creates an empty canvas for `map_frame`.
    pub fn new(map_frame: &MapFrame) -> Self {
        let (columns, rows) = map_frame.raster.pixels;
        let count = columns * rows;
        let (pixels, marks, thin) = (vec![None; count], vec![' '; count], vec![false; count]);
        Self { columns, pixels, marks, thin, changed: Vec::new() }
    }

    /// Returns the number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Returns the number of pixels in a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the colour of pixel `i`, if it lies on the map.
    pub fn colour(&self, i: usize) -> Option<Rgb> {
        self.pixels[i]
    }

    /// Returns the character of pixel `i` on terminals without colours.
    pub fn mark(&self, i: usize) -> char {
        self.marks[i]
    }

    /// Sets pixel `i`.
    pub fn set(&mut self, i: usize, rgb: Option<Rgb>, mark: char) {
        (self.pixels[i], self.marks[i]) = (rgb, mark);
        self.changed.push(i);
    }

    /// Gives pixel `i` the colour of a thin line.
    pub fn set_thin(&mut self, i: usize, rgb: Option<Rgb>) {
        (self.pixels[i], self.thin[i]) = (rgb, true);
        self.changed.push(i);
    }

    /// Returns whether pixel `i` shows wall.
    pub fn is_wall(&self, i: usize) -> bool {
        self.marks[i] == WALL_MARK
    }

    /// Returns the pixel of a position on the map.
    pub fn at(&self, map_frame: &MapFrame, at: [f32; 2]) -> Option<usize> {
        map_frame.raster.pixel_of(at).map(|(column, row)| row * self.columns + column)
    }

    /// Draws a dot.
    pub fn dot(&mut self, map_frame: &MapFrame, at: [f32; 2], rgb: Rgb, mark: char) {
        if let Some(i) = self.at(map_frame, at) {
            self.set(i, Some(rgb), mark);
        }
    }

    /// Draws a dot unless its pixel shows wall.
    pub fn ground_dot(&mut self, map_frame: &MapFrame, at: [f32; 2], rgb: Rgb, mark: char) {
        if let Some(i) = self.at(map_frame, at).filter(|i| !self.is_wall(*i)) {
            self.set(i, Some(rgb), mark);
        }
    }

    /// Blends a dot into the ground with opacity `share`, unless its pixel shows wall. Without
    /// colours, it is not shown unless it has a mark.
    pub fn faint_dot(
        &mut self,
        map_frame: &MapFrame,
        at: [f32; 2],
        rgb: Rgb,
        share: f32,
        mark: Option<char>,
    ) {
        if let Some(i) = self.at(map_frame, at).filter(|i| !self.is_wall(*i)) {
            self.pixels[i] = self.pixels[i].map(|ground| blend(ground, rgb, share));
            self.marks[i] = mark.unwrap_or(self.marks[i]);
            self.changed.push(i);
        }
    }

    /// Draws straight lines, blended only once where several cross.
    pub fn lines(
        &mut self,
        map_frame: &MapFrame,
        ends: impl Iterator<Item = [[f32; 2]; 2]>,
        pen: Pen,
    ) {
        self.lines_via(map_frame, ends, pen, |at| at);
    }

    /// Draws straight lines whose positions are shown at `place` of them.
    pub fn lines_via(
        &mut self,
        map_frame: &MapFrame,
        ends: impl Iterator<Item = [[f32; 2]; 2]>,
        pen: Pen,
        place: impl Fn([f32; 2]) -> [f32; 2],
    ) {
        let mut covered = vec![false; self.pixels.len()];
        for at in ends.flat_map(|ends| samples(map_frame, ends)) {
            if let Some(i) = self.at(map_frame, place(at)) {
                covered[i] = true;
            }
        }
        for i in (0..covered.len()).filter(|i| covered[*i]) {
            self.pixels[i] = self.pixels[i].map(|ground| blend(ground, pen.rgb, pen.share));
            self.marks[i] = pen.mark;
            self.changed.push(i);
        }
    }

    /// Writes all pixels as characters.
    pub fn paint(&mut self, buffer: &mut Buffer, map_frame: &MapFrame, theme: &Theme) {
        self.changed.clear();
        for row in 0..map_frame.area.height {
            for column in 0..map_frame.area.width {
                self.paint_character(buffer, [column, row], map_frame, theme);
            }
        }
    }

    /// Writes the characters whose pixels have changed since the last full paint.
    pub fn paint_changes(&mut self, buffer: &mut Buffer, map_frame: &MapFrame, theme: &Theme) {
        let (across, down) = map_frame.marker.pixels();
        let character =
            |i: usize| [(i % self.columns / across) as u16, (i / self.columns / down) as u16];
        let mut characters: Vec<[u16; 2]> = self.changed.drain(..).map(character).collect();
        characters.sort_unstable();
        characters.dedup();
        for at in characters {
            self.paint_character(buffer, at, map_frame, theme);
        }
    }

    /// Writes one character, by its column and row within `map_frame`.
    fn paint_character(
        &self,
        buffer: &mut Buffer,
        [column, row]: [u16; 2],
        map_frame: &MapFrame,
        theme: &Theme,
    ) {
        let (across, down) = map_frame.marker.pixels();
        let first = down * usize::from(row) * self.columns + across * usize::from(column);
        let own = |n: usize| first + n / across * self.columns + n % across;
        let count = across * down;
        let at = Position::new(map_frame.area.x + column, map_frame.area.y + row);
        let Some(cell) = buffer.cell_mut(at) else { return };
        if theme.depth == ColourDepth::Mono {
            // Show the most informative mark.
            let marks = (0..count).map(|n| self.marks[own(n)]);
            cell.set_char(marks.max_by_key(|mark| mark_rank(*mark)).unwrap_or(' '));
            return;
        }
        let mut colours = [None; MAX_PIXELS];
        (0..count).for_each(|n| colours[n] = self.pixels[own(n)]);
        let merge = if theme.has_all_colours() { mean } else { most_frequent };
        let (mut mask, mut front, mut back) = two_colours(&colours[..count], merge);
        if map_frame.marker == Marker::Braille && back.is_some() {
            let thin = (0..count).fold(0, |thin, n| thin | u8::from(self.thin[own(n)]) << n);
            if is_inside_out(mask, thin) {
                (mask, front, back) = (!mask, back, front);
            }
        }
        let colour = |rgb: Option<Rgb>| rgb.map_or(Color::Reset, |rgb| theme.colour(rgb));
        if theme.prefers_in_front(colour(back), colour(front)) {
            let all = ((1u16 << count) - 1) as u8;
            (mask, front, back) = (!mask & all, back, front);
        }
        cell.set_char(glyph(map_frame.marker, mask))
            .set_style(Style::new().fg(colour(front)).bg(colour(back)));
    }
}

/// Returns positions along a straight line, at least one in each of its pixels.
fn samples(
    map_frame: &MapFrame,
    [from, to]: [[f32; 2]; 2],
) -> impl Iterator<Item = [f32; 2]> + use<> {
    let (across, down) = map_frame.marker.pixels();
    let pixels_a_cell = map_frame.scale() * across.max(down / 2) as f32;
    let cells = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
    positions_along([from, to], (cells * pixels_a_cell).ceil().max(1.0) as usize)
}

/// Ranks a mark by how informative it is: shades, unvisited cells, wall, anything else.
fn mark_rank(mark: char) -> u8 {
    match mark {
        shade if SHADES.contains(&shade) => 0,
        UNVISITED_MARK | CUT_OFF_MARK => 1,
        WALL_MARK => 2,
        _ => 3,
    }
}

/// Returns the character that stands for a share (from 0 to 1) of the largest value without
/// colours.
pub fn shade(share: f32) -> char {
    SHADES[((share.clamp(0.0, 1.0) * SHADES.len() as f32) as usize).min(SHADES.len() - 1)]
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
        return (mask, merge(colours, mask, None), None);
    };
    let apart = |a: Rgb, b: Rgb| {
        let squared = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
        squared(a.0, b.0) + squared(a.1, b.1) + squared(a.2, b.2)
    };
    let other = colours.iter().flatten().copied().max_by_key(|c| apart(*c, first)).unwrap_or(first);
    let mask = bits(&|c| c.is_some_and(|c| apart(c, first) <= apart(c, other)));
    (mask, merge(colours, mask, Some(first)), merge(colours, all & !mask, Some(other)))
}

/// Makes one colour of those in a mask, among them the most typical one of its group, if there are
/// groups.
type Merge = fn(&[Option<Rgb>], u8, Option<Rgb>) -> Option<Rgb>;

/// Returns the colours in `mask`.
fn in_mask(colours: &[Option<Rgb>], mask: u8) -> impl Iterator<Item = Rgb> + Clone {
    colours.iter().enumerate().filter(move |(i, _)| mask >> i & 1 == 1).filter_map(|(_, c)| *c)
}

/// Returns the mean of the colours in `mask`.
fn mean(colours: &[Option<Rgb>], mask: u8, _: Option<Rgb>) -> Option<Rgb> {
    let (sum, n) = in_mask(colours, mask).fold(((0u32, 0u32, 0u32), 0u32), |((r, g, b), n), c| {
        ((r + u32::from(c.0), g + u32::from(c.1), b + u32::from(c.2)), n + 1)
    });
    (n > 0).then(|| ((sum.0 / n) as u8, (sum.1 / n) as u8, (sum.2 / n) as u8))
}

/// Returns the most frequent of the colours in `mask`, preferably the `typical` one: with few
/// colours, a mean of two kinds of ground may look like a third.
fn most_frequent(colours: &[Option<Rgb>], mask: u8, typical: Option<Rgb>) -> Option<Rgb> {
    let own = in_mask(colours, mask);
    let count = |colour: &Rgb| own.clone().filter(|other| other == colour).count();
    own.clone().max_by_key(|colour| (count(colour), Some(*colour) == typical))
}

/// Returns whether a dot pattern, which has gaps, looks better with front and back swapped: the
/// back should be the colour of most dots or, in a tie, the one that is not `thin`.
fn is_inside_out(mask: u8, thin: u8) -> bool {
    let count = |mask: u8| mask.count_ones();
    count(mask) > 4 && mask != u8::MAX
        || count(mask) == 4 && count(thin & !mask) > count(thin & mask)
}

/// Returns the character with the parts in `mask` in front: row by row, bit 0 at the upper left.
fn glyph(marker: Marker, mask: u8) -> char {
    const QUADRANTS: [char; 16] = [
        ' ', '\u{2598}', '\u{259d}', '\u{2580}', '\u{2596}', '\u{258c}', '\u{259e}', '\u{259b}',
        '\u{2597}', '\u{259a}', '\u{2590}', '\u{259c}', '\u{2584}', '\u{2599}', '\u{259f}',
        '\u{2588}',
    ];
    match marker {
        Marker::Auto | Marker::Pixels | Marker::HalfBlock => {
            [' ', '\u{2580}', '\u{2584}', '\u{2588}'][usize::from(mask & 3)]
        }
        Marker::Quadrant => QUADRANTS[usize::from(mask & 15)],
        Marker::Braille => {
            // Unicode numbers the dots of the left column first, and the bottom row last.
            const DOTS: [u32; 8] = [0x01, 0x08, 0x02, 0x10, 0x04, 0x20, 0x40, 0x80];
            let dots: u32 = (0..8).filter(|i| mask >> i & 1 == 1).map(|i| DOTS[i]).sum();
            char::from_u32(0x2800 + dots).unwrap_or(' ')
        }
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
        assert_eq!(glyph(Marker::Braille, 0b1100_0001), '\u{28c1}');
    }
}
