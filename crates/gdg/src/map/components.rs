//! The connected components of a map.

use super::flood::Flood;
use super::grid::{Cell, Grid};

/// The connected components of a map's free cells.
#[derive(Clone, Debug)]
pub struct Components {
    /// Component of each cell, row-major, in the order of their first cells; `None` for walls.
    pub of_cell: Vec<Option<u32>>,
    /// Number of cells in each component.
    pub sizes: Vec<usize>,
}

impl Components {
    /// Finds the components of `grid`.
    pub fn of(grid: &Grid) -> Self {
        let (mut of_cell, mut sizes) = (vec![None; grid.free().len()], Vec::new());
        let mut flood = Flood::new(grid, 1);
        for cell in grid.free_cells() {
            if of_cell[grid.index(cell)].is_none() {
                let (component, mut size) = (sizes.len() as u32, 0);
                flood.each(&[cell], grid.width(), |i, _| {
                    of_cell[i] = Some(component);
                    size += 1;
                });
                sizes.push(size);
            }
        }
        Self { of_cell, sizes }
    }

    /// Returns the component with the most cells (the first on a tie).
    pub fn largest(&self) -> u32 {
        (0..self.sizes.len()).rev().max_by_key(|i| self.sizes[*i]).unwrap_or(0) as u32
    }

    /// Returns the cells of `grid`'s largest component, in row order.
    pub fn largest_cells<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = Cell> + 'a {
        let largest = self.largest();
        grid.free_cells().filter(move |c| self.of_cell[grid.index(*c)] == Some(largest))
    }
}
