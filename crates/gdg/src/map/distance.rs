//! Breadth-first search on 8-connected cells without corner cutting; a diagonal is one move. A
//! library search over hashed nodes is about thirty times slower here.
//!
//! A point's shortest paths are searched for over half cells: see
//! [`half_cells`](super::half_cells).

use super::flood::UNREACHABLE;
use super::grid::{Cell, Grid};

/// Breadth-first searches over one map; reuses its buffers.
#[derive(Clone)]
pub struct StepSearch {
    width: usize,
    /// Open neighbours of each cell, as a bit set over [`OFFSETS`].
    moves: Vec<u8>,
    steps: Vec<u32>,
    /// Cells reached by the latest search, in the order of their discovery.
    reached: Vec<u32>,
}

/// The four sides, then the corners.
const OFFSETS: [(isize, isize); 8] =
    [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

const WEST: u8 = 0b0001;
const NORTH: u8 = 0b0100;

/// The two sides adjacent to each corner, as bits.
const ADJACENT_SIDES: [u8; 4] = [0b0101, 0b0110, 0b1001, 0b1010];

/// The connected components of a map's free cells.
#[derive(Clone, Debug)]
pub struct Components {
    /// Component of each cell, row-major; `None` for walls.
    pub of_cell: Vec<Option<u32>>,
    /// Number of cells in each component.
    pub sizes: Vec<usize>,
}

impl Components {
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

impl StepSearch {
    /// Prepares searches over `grid`.
    pub fn new(grid: &Grid) -> Self {
        let mut moves = vec![0; grid.free().len()];
        for cell in grid.free_cells() {
            let way = |i: usize| {
                let (dx, dy) = OFFSETS[i];
                let next =
                    Cell::new(cell.x.wrapping_add_signed(dx), cell.y.wrapping_add_signed(dy));
                u8::from(grid.is_free(next)) << i
            };
            let sides = (0..4).fold(0, |bits, i| bits | way(i));
            // No corner cutting: both cells adjacent to a diagonal must be free.
            let open = (4..8).filter(|i| sides & ADJACENT_SIDES[i - 4] == ADJACENT_SIDES[i - 4]);
            moves[grid.index(cell)] = open.fold(sides, |bits, i| bits | way(i));
        }
        Self {
            width: grid.width(),
            moves,
            steps: vec![UNREACHABLE; grid.free().len()],
            reached: Vec::new(),
        }
    }

    /// Returns the steps from `cell` to every cell (row-major), [`UNREACHABLE`] where there is no
    /// path. Steps are reversible, so these are also the steps *to* `cell`.
    pub fn steps_from(&mut self, cell: Cell) -> &[u32] {
        self.steps_within(cell, UNREACHABLE)
    }

    /// Like [`Self::steps_from`], but only up to `max_steps` steps; farther cells are
    /// [`UNREACHABLE`] too.
    pub fn steps_within(&mut self, cell: Cell, max_steps: u32) -> &[u32] {
        self.steps_from_any(&[cell], max_steps)
    }

    /// Like [`Self::steps_within`], from the nearest of several cells.
    pub(super) fn steps_from_any(&mut self, cells: &[Cell], max_steps: u32) -> &[u32] {
        let Self { width, moves, steps, reached } = self;
        for at in reached.drain(..) {
            steps[at as usize] = UNREACHABLE;
        }
        for cell in cells {
            let start = cell.y * *width + cell.x;
            steps[start] = 0;
            reached.push(start as u32);
        }
        let mut done = 0;
        while done < reached.len() {
            let at = reached[done] as usize;
            done += 1;
            let next_steps = steps[at] + 1;
            if next_steps > max_steps {
                break;
            }
            let mut bits = moves[at];
            while bits != 0 {
                let (dx, dy) = OFFSETS[bits.trailing_zeros() as usize];
                bits &= bits - 1;
                let next = at.wrapping_add_signed(dy * *width as isize + dx);
                if steps[next] == UNREACHABLE {
                    steps[next] = next_steps;
                    reached.push(next as u32);
                }
            }
        }
        steps
    }

    /// Returns the connected components of the free cells, ordered by their first cells.
    ///
    /// Scans row by row; each cell takes the label of its left or upper neighbour (Rosenfeld and
    /// Pfaltz 1966, "Sequential operations in digital picture processing"). Diagonals need no
    /// check: without corner cutting they join nothing that the adjacent cells do not.
    pub fn components(&self, grid: &Grid) -> Components {
        let mut of_cell = vec![None; grid.free().len()];
        // Parent of each label: merged labels point to an earlier one, roots to themselves.
        let mut part_of: Vec<u32> = Vec::new();
        for i in (0..of_cell.len()).filter(|i| grid.free()[*i]) {
            let neighbour = |side: u8, back: usize| {
                if self.moves[i] & side == 0 { None } else { of_cell[i - back] }
            };
            let label = match (neighbour(WEST, 1), neighbour(NORTH, self.width)) {
                (Some(left), Some(above)) => merge(&mut part_of, left, above),
                (Some(label), None) | (None, Some(label)) => label,
                (None, None) => {
                    part_of.push(part_of.len() as u32);
                    part_of.len() as u32 - 1
                }
            };
            of_cell[i] = Some(label);
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
        Components { of_cell, sizes }
    }
}

/// Merges two components and returns the label of the earlier one.
fn merge(part_of: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (find_root(part_of, a), find_root(part_of, b));
    part_of[a.max(b) as usize] = a.min(b);
    a.min(b)
}

/// Returns the root of `label`, halving the path to it for later look-ups.
fn find_root(part_of: &mut [u32], mut label: u32) -> u32 {
    while part_of[label as usize] != label {
        part_of[label as usize] = part_of[part_of[label as usize] as usize];
        label = part_of[label as usize];
    }
    label
}
