//! Which part of the map each pixel of the map pane stands for, and where the pane lies.

use ratatui::layout::{Position, Rect};

use crate::map::{Cell, Grid};

/// A window on the map and the pixels that show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// The part of the map shown, in cells: left, top, width, height.
    pub window: [f32; 4],
    /// Columns and rows of pixels.
    pub pixels: (usize, usize),
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ground {
    /// Nothing: it lies beyond the map.
    Outside,
    /// At least half of what it covers is wall.
    Wall,
    /// Free; the free position nearest to its middle stands for it.
    Free([f32; 2]),
}

impl Raster {
    /// What the pixel at `column` and `row` shows.
    pub fn ground(&self, map: &Grid, column: usize, row: usize) -> Ground {
        let [left, top, width, height] = self.window;
        let (columns, rows) = self.pixels;
        let along = |i: usize, n: usize, from: f32, size: f32| {
            let at = |i: f32| from + i / n as f32 * size;
            (at(i as f32), at(i as f32 + 0.5), at(i as f32 + 1.0))
        };
        let (x0, x, x1) = along(column, columns, left, width);
        let (y0, y, y1) = along(row, rows, top, height);
        if x as usize >= map.width() || y as usize >= map.height() {
            return Ground::Outside;
        }
        if map.is_free_at(x, y) && x1 - x0 <= 1.0 {
            return Ground::Free([x, y]);
        }
        // A pixel covers the cells whose middles lie in it, and at least the one that its own middle lies in.
        let span = |from: f32, middle: f32, to: f32, most: usize| {
            let first = (from + 0.5) as usize;
            let end = ((to + 0.5) as usize).min(most);
            if first < end { first..end } else { middle as usize..middle as usize + 1 }
        };
        let xs = span(x0, x, x1, map.width());
        let ys = span(y0, y, y1, map.height());
        let all = xs.len() * ys.len();
        let cells = ys.flat_map(|y| xs.clone().map(move |x| Cell::new(x, y)));
        let free: Vec<[f32; 2]> = cells.filter(|c| map.is_free(*c)).map(Cell::centre).collect();
        let off = |c: &[f32; 2]| (c[0] - x).powi(2) + (c[1] - y).powi(2);
        match free.iter().min_by(|a, b| off(a).total_cmp(&off(b))) {
            Some(nearest) if 2 * free.len() > all => Ground::Free(*nearest),
            _ => Ground::Wall,
        }
    }

    /// The pixel of a position on the map, as column and row.
    pub fn pixel_of(&self, [x, y]: [f32; 2]) -> Option<(usize, usize)> {
        let [left, top, width, height] = self.window;
        let column = (x - left) / width * self.pixels.0 as f32;
        let row = (y - top) / height * self.pixels.1 as f32;
        let inside = column >= 0.0 && row >= 0.0 && (column as usize) < self.pixels.0 && (row as usize) < self.pixels.1;
        inside.then_some((column as usize, row as usize))
    }

    /// Pixels for each cell of the map, along one axis.
    pub fn scale(&self) -> f32 {
        self.pixels.0 as f32 / self.window[2]
    }
}

/// Where the map lies on the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct MapFrame {
    /// The characters it covers.
    pub area: Rect,
    /// What its pixels show.
    pub raster: Raster,
}

impl MapFrame {
    /// The whole map, as large as `area` allows without changing its proportions.
    pub fn fit(area: Rect, map: &Grid) -> Option<Self> {
        if area.width == 0 || area.height == 0 {
            return None;
        }
        let (width, height) = (map.width() as f32, map.height() as f32);
        let scale = (f32::from(area.width) / width).min(2.0 * f32::from(area.height) / height);
        // Whole pixels a cell look best, where that costs little room.
        let scale = if scale >= 1.0 && scale.floor() >= 0.9 * scale { scale.floor() } else { scale };
        let columns = ((width * scale).round() as u16).clamp(1, area.width);
        let rows = ((height * scale / 2.0).ceil() as u16).clamp(1, area.height);
        let pixels = (usize::from(columns), 2 * usize::from(rows));
        let area = Rect {
            x: area.x + (area.width - columns) / 2,
            y: area.y + (area.height - rows) / 2,
            width: columns,
            height: rows,
        };
        let shown = pixels.1 as f32 / scale;
        Some(Self { area, raster: Raster { window: [0.0, 0.0, width, shown], pixels } })
    }

    /// All cells that the character at a place on the screen stands for; at least one, none beside the map.
    pub fn cells_at(&self, at: Position, map: &Grid) -> Vec<Cell> {
        let Some(middle) = self.cell_at(at, map) else { return Vec::new() };
        let [left, top, width, height] = self.raster.window;
        // Cells whose middles lie within the character.
        let span = |i: u16, n: u16, from: f32, size: f32, most: usize, middle: usize| {
            let at = |i: u16| (from + f32::from(i) / f32::from(n) * size + 0.5).max(0.0) as usize;
            let (first, end) = (at(i), at(i + 1).min(most));
            if first < end { first..end } else { middle..middle + 1 }
        };
        let xs = span(at.x - self.area.x, self.area.width, left, width, map.width(), middle.x);
        let ys = span(at.y - self.area.y, self.area.height, top, height, map.height(), middle.y);
        ys.flat_map(|y| xs.clone().map(move |x| Cell::new(x, y))).collect()
    }

    /// The cell at a place on the screen.
    pub fn cell_at(&self, at: Position, map: &Grid) -> Option<Cell> {
        if !self.area.contains(at) {
            return None;
        }
        let [left, top, width, height] = self.raster.window;
        let share = |i: u16, n: u16| (f32::from(i) + 0.5) / f32::from(n);
        let x = left + share(at.x - self.area.x, self.area.width) * width;
        let y = top + share(at.y - self.area.y, self.area.height) * height;
        Some(Cell::new((x as usize).min(map.width() - 1), (y as usize).min(map.height() - 1)))
    }
}
