//! The grid itself: which cells are free, and which are marked as starts and goals.

use serde::{Deserialize, Serialize};

use super::ogbench::Ogbench;
use crate::text::grouped;

/// The maximum number of cells in a map (4096 x 4096).
pub const MAX_CELLS: usize = 1 << 24;

/// The maximum number of cells along a side: beyond it, single precision no longer resolves
/// positions within a cell.
pub const MAX_SIDE: usize = 1 << 15;

/// Returns whether a map can have this size.
pub fn is_size(width: usize, height: usize) -> bool {
    let is_side = |side| (1..=MAX_SIDE).contains(&side);
    is_side(width) && is_side(height) && width * height <= MAX_CELLS
}

/// Returns what sizes a map can have.
pub fn size_limits() -> String {
    let [cells, side] = [MAX_CELLS, MAX_SIDE].map(|n| grouped(n as u64));
    format!("a map may have up to {cells} cells, e.g. 4096 x 4096, and {side} along a side")
}

/// A cell at column `x` (rightwards) and row `y` (downwards), counted from the upper left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Cell {
    /// Column, from 0 at the left.
    pub x: usize,
    /// Row, from 0 at the top.
    pub y: usize,
}

impl Cell {
    /// Creates the cell at column `x`, row `y`.
    pub const fn new(x: usize, y: usize) -> Self {
        Self { x, y }
    }

    /// Returns the position of the cell's centre, in cells.
    pub fn centre(self) -> [f32; 2] {
        [self.x as f32 + 0.5, self.y as f32 + 0.5]
    }
}

/// How the cells of a map relate to the maze that it was read from and to the body that moves there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MapScale {
    /// Cells along each side of one of the maze's blocks.
    pub cell: usize,
    /// By how much walls are wider than the maze's: the body's radius, in cells.
    pub margin: f32,
    /// A goal is reached below this distance, in cells.
    pub goal_radius: f32,
    /// The benchmark that it is of, with tasks of its own, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<Ogbench>,
}

impl Default for MapScale {
    fn default() -> Self {
        Self { cell: 1, margin: 0.0, goal_radius: 1.0, benchmark: None }
    }
}

impl MapScale {
    /// Most cells along each side of a block.
    pub const MAX_CELL: usize = 256;

    /// The widest margin, in cells.
    pub const MAX_MARGIN: f32 = 100.0;

    /// The goal radii that a map can have, in cells.
    pub const GOAL_RADII: std::ops::RangeInclusive<f32> = 0.1..=100.0;

    /// Returns whether all values are within their ranges.
    pub fn is_valid(&self) -> bool {
        (1..=Self::MAX_CELL).contains(&self.cell)
            && (0.0..=Self::MAX_MARGIN).contains(&self.margin)
            && Self::GOAL_RADII.contains(&self.goal_radius)
    }
}

/// A rectangular map of free and wall cells; everything outside it is wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    name: String,
    width: usize,
    height: usize,
    /// Row-major, `true` where free.
    free: Vec<bool>,
    starts: Vec<Cell>,
    goals: Vec<Cell>,
    /// How its cells relate to the maze that it was read from.
    scale: MapScale,
}

impl Grid {
    /// Creates a grid from its cells in row-major order (`true` where free), with starts and goals
    /// sorted row by row.
    ///
    /// # Panics
    /// If `free` does not consist of whole rows, or a start or goal is not on a free cell; parsers
    /// check both first.
    pub fn new(
        name: &str,
        width: usize,
        free: Vec<bool>,
        starts: Vec<Cell>,
        goals: Vec<Cell>,
    ) -> Self {
        let height = free.len().checked_div(width).unwrap_or(0);
        assert_eq!(free.len(), width * height, "a grid needs whole rows");
        let (name, scale) = (name.to_owned(), MapScale::default());
        let grid = Self { name, width, height, free, starts, goals, scale };
        assert!(
            grid.starts.iter().chain(&grid.goals).all(|&c| grid.is_free(c)),
            "starts and goals must be on free cells"
        );
        grid
    }

    /// Returns the map's name: that of a built-in map, or a file stem.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the map under another name.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Returns the map with another scale, which changes no cell.
    #[must_use]
    pub fn with_scale(self, scale: MapScale) -> Self {
        Self { scale, ..self }
    }

    /// Returns how the map's cells relate to the maze that it was read from.
    pub fn scale(&self) -> MapScale {
        self.scale
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the cells marked `S`, in row order.
    pub fn starts(&self) -> &[Cell] {
        &self.starts
    }

    /// Returns the cells marked `G`, in row order.
    pub fn goals(&self) -> &[Cell] {
        &self.goals
    }

    /// Returns the map with some cells changed to free (`true`) or wall (`false`), without the
    /// starts and goals that walls now cover. Ignores cells outside the map. Returns `None` if the
    /// map would have no free cell.
    #[must_use]
    pub fn with_cells(&self, changes: impl IntoIterator<Item = (Cell, bool)>) -> Option<Self> {
        let mut grid = self.clone();
        for (cell, free) in changes {
            if grid.contains(cell) {
                grid.free[cell.y * grid.width + cell.x] = free;
            }
        }
        let Self { free, width, starts, goals, .. } = &mut grid;
        for marks in [starts, goals] {
            marks.retain(|c| free[c.y * *width + c.x]);
        }
        grid.free.contains(&true).then_some(grid)
    }

    /// Returns the map with other starts and goals, dropping those that are not on free cells.
    #[must_use]
    pub fn with_marks(&self, starts: Vec<Cell>, goals: Vec<Cell>) -> Self {
        let on_floor = |mut marks: Vec<Cell>| {
            marks.retain(|cell| self.is_free(*cell));
            marks.sort_by_key(|cell| (cell.y, cell.x));
            marks.dedup();
            marks
        };
        Self { starts: on_floor(starts), goals: on_floor(goals), ..self.clone() }
    }

    /// Creates a map of free cells only.
    ///
    /// # Panics
    /// If no map can have this size ([`is_size`]).
    pub fn empty(name: &str, width: usize, height: usize) -> Self {
        assert!(is_size(width, height), "the size is out of range");
        Self::new(name, width, vec![true; width * height], Vec::new(), Vec::new())
    }

    /// Returns the map cropped, or extended with free cells, at its right and lower edges. Returns
    /// `None` if no free cell would remain.
    ///
    /// # Panics
    /// If no map can have this size ([`is_size`]).
    #[must_use]
    pub fn resized(&self, width: usize, height: usize) -> Option<Self> {
        let empty = Self::empty(&self.name, width, height);
        let cells: Vec<Cell> = empty.free_cells().collect();
        let grid = empty.with_cells(
            cells.into_iter().map(|cell| (cell, !self.contains(cell) || self.is_free(cell))),
        )?;
        Some(grid.with_marks(self.starts.clone(), self.goals.clone()).with_scale(self.scale))
    }

    pub fn contains(&self, cell: Cell) -> bool {
        cell.x < self.width && cell.y < self.height
    }

    /// Returns whether `cell` is on the map and free.
    pub fn is_free(&self, cell: Cell) -> bool {
        self.contains(cell) && self.free[cell.y * self.width + cell.x]
    }

    /// Returns whether the position (`x`, `y`) is on a free cell; positions outside the map are
    /// wall.
    #[inline]
    pub fn is_free_at(&self, x: f32, y: f32) -> bool {
        x >= 0.0 && y >= 0.0 && self.is_free(Cell::new(x as usize, y as usize))
    }

    /// Returns the row-major index of a cell on the map.
    pub fn index(&self, cell: Cell) -> usize {
        cell.y * self.width + cell.x
    }

    /// Returns the cell at a row-major index.
    pub fn cell(&self, index: usize) -> Cell {
        Cell::new(index % self.width, index / self.width)
    }

    /// Returns all cells in row-major order, `true` where free.
    pub fn free(&self) -> &[bool] {
        &self.free
    }

    /// Returns all free cells, in row order.
    pub fn free_cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.free.iter().enumerate().filter(|(_, free)| **free).map(|(i, _)| self.cell(i))
    }

    /// Returns the number of free cells.
    pub fn free_count(&self) -> usize {
        self.free.iter().filter(|free| **free).count()
    }

    /// Returns the free cell nearest to `cell` (Euclidean, between centres; on a tie, the first in
    /// row order).
    pub fn nearest_free(&self, cell: Cell) -> Option<Cell> {
        if self.is_free(cell) {
            return Some(cell);
        }
        self.free_cells().min_by_key(|c| c.x.abs_diff(cell.x).pow(2) + c.y.abs_diff(cell.y).pow(2))
    }

    /// Returns the cells one step away: 8-connected, diagonals only where both adjacent cells are
    /// free (no corner cutting).
    #[inline]
    pub fn neighbours(&self, cell: Cell) -> impl Iterator<Item = Cell> + use<> {
        let at = |dx: isize, dy: isize| {
            let (x, y) = (cell.x.wrapping_add_signed(dx), cell.y.wrapping_add_signed(dy));
            let c = Cell::new(x, y);
            self.is_free(c).then_some(c)
        };
        let (w, e, n, s) = (at(-1, 0), at(1, 0), at(0, -1), at(0, 1));
        let corner = |a: Option<Cell>, b: Option<Cell>, dx, dy| a.and(b).and_then(|_| at(dx, dy));
        let diagonal =
            [corner(n, w, -1, -1), corner(n, e, 1, -1), corner(s, w, -1, 1), corner(s, e, 1, 1)];
        [w, e, n, s].into_iter().chain(diagonal).flatten()
    }
}
