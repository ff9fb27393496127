//! Placement of the map on the screen, and the visible part of it.

use gdg::draw::Raster;
use gdg::map::{Cell, Grid};
use ratatui::layout::{Position, Rect};

use crate::tui::marker::Marker;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewport {
    /// Magnification compared to showing the whole map; 1 for the whole map.
    pub zoom: f32,
    /// The position in the middle, if only a part is shown.
    pub centre: [f32; 2],
}

impl Default for Viewport {
    fn default() -> Self {
        Self { zoom: 1.0, centre: [0.0; 2] }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct MapFrame {
    pub area: Rect,
    pub raster: Raster,
    pub marker: Marker,
}

impl MapFrame {
    /// Fits the part of the map that `view` shows into `area`.
    pub fn fit(area: Rect, map: &Grid, marker: Marker, view: Viewport) -> Option<Self> {
        if area.width == 0 || area.height == 0 {
            return None;
        }
        let (width, height) = (map.width() as f32, map.height() as f32);
        // A character is twice as high as wide.
        let fitting = (f32::from(area.width) / width).min(2.0 * f32::from(area.height) / height);
        // A whole number of half blocks per cell looks best, if it costs little room.
        let whole = fitting >= 1.0 && fitting.floor() >= 0.9 * fitting;
        let scale = view.zoom * if whole { fitting.floor() } else { fitting };
        let columns = ((width * scale).round() as u16).clamp(1, area.width);
        let rows = ((height * scale / 2.0).ceil() as u16).clamp(1, area.height);
        let per_character = marker.resolved(scale).pixels();
        let pixels = (usize::from(columns) * per_character.0, usize::from(rows) * per_character.1);
        let shown = [f32::from(columns) / scale, 2.0 * f32::from(rows) / scale];
        let shown = if view.zoom > 1.0 { shown } else { [width, shown[1]] };
        // Stay within the map.
        let from =
            |middle: f32, shown: f32, all: f32| (middle - shown / 2.0).min(all - shown).max(0.0);
        let [x, y] = view.centre;
        let window = if view.zoom > 1.0 {
            [from(x, shown[0], width), from(y, shown[1], height), shown[0], shown[1]]
        } else {
            [0.0, 0.0, shown[0], shown[1]]
        };
        let area = Rect {
            x: area.x + (area.width - columns) / 2,
            y: area.y + (area.height - rows) / 2,
            width: columns,
            height: rows,
        };
        Some(Self { area, raster: Raster { window, pixels }, marker: marker.resolved(scale) })
    }

    pub fn scale(&self) -> f32 {
        f32::from(self.area.width) / self.raster.window[2]
    }

    /// Returns the character that shows a position on the map.
    pub fn character_of(&self, at: [f32; 2]) -> Option<Position> {
        let (column, row) = self.raster.pixel_of(at)?;
        let (across, down) = self.marker.pixels();
        Some(Position::new(
            self.area.x + (column / across) as u16,
            self.area.y + (row / down) as u16,
        ))
    }

    /// Returns the position on the map at the middle of a character.
    pub fn middle_of(&self, at: Position) -> [f32; 2] {
        let [left, top, width, height] = self.raster.window;
        let share = |i: u16, n: u16| (f32::from(i) + 0.5) / f32::from(n);
        [
            left + share(at.x.saturating_sub(self.area.x), self.area.width) * width,
            top + share(at.y.saturating_sub(self.area.y), self.area.height) * height,
        ]
    }

    /// Returns all cells that a character shows: at least one, or none outside the map.
    pub fn cells_at(&self, at: Position, map: &Grid) -> Vec<Cell> {
        let Some(middle) = self.cell_at(at, map) else { return Vec::new() };
        let [left, top, width, height] = self.raster.window;
        // Cells whose centres lie within the character.
        let span = |i: u16, n: u16, from: f32, size: f32, max: usize, middle: usize| {
            let at = |i: u16| (from + f32::from(i) / f32::from(n) * size + 0.5).max(0.0) as usize;
            let (first, end) = (at(i), at(i + 1).min(max));
            if first < end { first..end } else { middle..middle + 1 }
        };
        let xs = span(at.x - self.area.x, self.area.width, left, width, map.width(), middle.x);
        let ys = span(at.y - self.area.y, self.area.height, top, height, map.height(), middle.y);
        ys.flat_map(|y| xs.clone().map(move |x| Cell::new(x, y))).collect()
    }

    pub fn cell_at(&self, at: Position, map: &Grid) -> Option<Cell> {
        if !self.area.contains(at) {
            return None;
        }
        let [x, y] = self.middle_of(at);
        Some(Cell::new((x as usize).min(map.width() - 1), (y as usize).min(map.height() - 1)))
    }
}
