//! The part of the map that each pixel of a picture shows.

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
    /// Nothing: it lies outside the map.
    Outside,
    /// At least half of what it covers is wall.
    Wall,
    /// Free; represented by the free position nearest to its centre.
    Free([f32; 2]),
}

impl Raster {
    /// Returns what the pixel at `column` and `row` shows.
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
        // A pixel covers the cells whose centres lie in it, and at least the one that contains its own centre.
        let span = |from: f32, middle: f32, to: f32, max: usize| {
            let first = (from + 0.5) as usize;
            let end = ((to + 0.5) as usize).min(max);
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

    /// Returns the pixels that show free ground, by index row by row, and the position that represents each.
    pub fn free_ground(&self, map: &Grid) -> (Vec<usize>, Vec<[f32; 2]>) {
        let (columns, rows) = self.pixels;
        let free = (0..columns * rows).filter_map(|i| match self.ground(map, i % columns, i / columns) {
            Ground::Free(position) => Some((i, position)),
            _ => None,
        });
        free.unzip()
    }

    /// Returns the column and row of the pixel that shows a position, if any does.
    pub fn pixel_of(&self, [x, y]: [f32; 2]) -> Option<(usize, usize)> {
        let [left, top, width, height] = self.window;
        let column = (x - left) / width * self.pixels.0 as f32;
        let row = (y - top) / height * self.pixels.1 as f32;
        let inside = column >= 0.0 && row >= 0.0 && (column as usize) < self.pixels.0 && (row as usize) < self.pixels.1;
        inside.then_some((column as usize, row as usize))
    }
}
