//! The connected components of a map.

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
    ///
    /// Scans row by row; each cell takes the label of its left or upper neighbour (Rosenfeld and
    /// Pfaltz 1966, "Sequential operations in digital picture processing"). Diagonals need no
    /// check: without corner cutting they join nothing that the adjacent cells do not.
    pub fn of(grid: &Grid) -> Self {
        let mut of_cell: Vec<Option<u32>> = vec![None; grid.free().len()];
        // Parent of each label: merged labels point to an earlier one, roots to themselves.
        let mut part_of: Vec<u32> = Vec::new();
        for cell in grid.free_cells() {
            let i = grid.index(cell);
            let left = if cell.x > 0 { of_cell[i - 1] } else { None };
            let above = if cell.y > 0 { of_cell[i - grid.width()] } else { None };
            of_cell[i] = Some(match (left, above) {
                (Some(left), Some(above)) => {
                    let (a, b) = (root(&mut part_of, left), root(&mut part_of, above));
                    part_of[a.max(b) as usize] = a.min(b);
                    a.min(b)
                }
                (Some(label), None) | (None, Some(label)) => label,
                (None, None) => {
                    part_of.push(part_of.len() as u32);
                    part_of.len() as u32 - 1
                }
            });
        }
        let mut sizes = Vec::new();
        for label in 0..part_of.len() {
            let root = part_of[label] as usize;
            part_of[label] = if root == label { sizes.len() as u32 } else { part_of[root] };
            sizes.resize(sizes.len() + usize::from(root == label), 0);
        }
        for label in of_cell.iter_mut().flatten() {
            *label = part_of[*label as usize];
            sizes[*label as usize] += 1;
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

/// Returns the root of `label`, halving the path to it for later look-ups.
fn root(part_of: &mut [u32], mut label: u32) -> u32 {
    while part_of[label as usize] != label {
        part_of[label as usize] = part_of[part_of[label as usize] as usize];
        label = part_of[label as usize];
    }
    label
}
