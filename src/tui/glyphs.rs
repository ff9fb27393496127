//! Letters and signs on top of the pixels.

use ratatui::buffer::Buffer;
use ratatui::layout::Position;
use ratatui::style::{Color, Modifier, Style};

use super::contours::Label;
use super::raster::MapFrame;
use super::theme::{ColourDepth, Rgb, Theme, ink, rgb_of_indexed};

/// Draws letters and signs.
pub struct Glyphs<'a> {
    /// Where it draws.
    pub map_frame: &'a MapFrame,
    /// Colours.
    pub theme: &'a Theme,
    /// The screen.
    pub buffer: &'a mut Buffer,
}

impl Glyphs<'_> {
    /// Draws a letter on its own background.
    pub fn letter(&mut self, at: [f32; 2], letter: char, rgb: Rgb) {
        let Some(cell) = self.map_frame.character_of(at).and_then(|at| self.buffer.cell_mut(at))
        else {
            return;
        };
        let style = match self.theme.depth {
            ColourDepth::Mono => Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD),
            _ => Style::new()
                .bg(self.theme.colour(rgb))
                .fg(self.theme.colour(ink(rgb)))
                .add_modifier(Modifier::BOLD),
        };
        cell.set_char(letter).set_style(style);
    }

    /// Draws a sign on the existing background.
    pub fn symbol(&mut self, at: [f32; 2], symbol: char, rgb: Option<Rgb>) {
        if let Some(at) = self.map_frame.character_of(at) {
            self.put(at, symbol, rgb);
        }
    }

    /// Writes a label on the existing background.
    pub fn label(&mut self, label: &Label) {
        label.text.chars().zip(label.area.positions()).for_each(|(c, at)| self.put(at, c, None));
    }

    fn put(&mut self, at: Position, symbol: char, rgb: Option<Rgb>) {
        let Some(cell) = self.buffer.cell_mut(at) else { return };
        if self.theme.depth == ColourDepth::Mono {
            cell.set_char(symbol);
            return;
        }
        // The background of a half block is the colour of its lower half.
        let ground = match cell.bg {
            Color::Rgb(r, g, b) => (r, g, b),
            Color::Indexed(i) => rgb_of_indexed(i),
            _ => self.theme.unknown,
        };
        let rgb = rgb.unwrap_or(ink(ground));
        cell.set_char(symbol).set_fg(self.theme.colour(rgb));
    }
}
