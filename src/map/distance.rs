//! Shortest numbers of steps between cells: the truth, for evaluation and display alone.
//!
//! Breadth-first search on 8-connected cells without corner cutting; a diagonal is one step. A library's search
//! over hashed nodes is some thirty times slower here, and a map's diameter takes hundreds of searches.

use super::grid::{Cell, Grid};

/// Steps to a cell that cannot be reached.
pub const UNREACHABLE: u32 = u32::MAX;

/// Searches over one map, reusing its buffers.
#[derive(Clone)]
pub struct StepSearch {
    width: usize,
    /// Neighbours of each cell as a bit set over [`OFFSETS`].
    moves: Vec<u8>,
    steps: Vec<u32>,
    /// Cells that the latest search reached, in the order in which it did.
    reached: Vec<u32>,
}

const OFFSETS: [(isize, isize); 8] = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// The farthest distance between two cells that reach each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diameter {
    /// Steps of the farthest pair found.
    pub steps: u32,
    /// Whether no pair can be farther apart (else `steps` is what the search found before it gave up).
    pub exact: bool,
}

/// Cells that the searches for a diameter may visit: exact on the built-in maps, within a second on large ones.
const DIAMETER_CELLS: usize = 60_000_000;

impl Diameter {
    /// The diameter of `grid`, within a bounded time.
    pub fn of(grid: &Grid) -> Self {
        StepSearch::new(grid).diameter(grid, DIAMETER_CELLS / grid.free_count().max(1))
    }
}

/// The connected components of a map's free cells.
#[derive(Clone, Debug)]
pub struct Components {
    /// Component of each cell, row-major; walls have none.
    pub of_cell: Vec<Option<u32>>,
    /// Cells of each component.
    pub sizes: Vec<usize>,
}

impl Components {
    /// The component with the most cells (the first of equals).
    pub fn largest(&self) -> u32 {
        (0..self.sizes.len()).rev().max_by_key(|i| self.sizes[*i]).unwrap_or(0) as u32
    }
}

impl Components {
    /// The cells of `grid`'s largest component, row by row.
    pub fn largest_cells<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = Cell> + 'a {
        let largest = self.largest();
        grid.free_cells().filter(move |c| self.of_cell[grid.index(*c)] == Some(largest))
    }
}

impl StepSearch {
    /// Prepares searches over `grid`.
    pub fn new(grid: &Grid) -> Self {
        let mut moves = vec![0; grid.width() * grid.height()];
        for cell in grid.free_cells() {
            moves[grid.index(cell)] = grid.neighbours(cell).fold(0, |bits, n| {
                let offset = (n.x as isize - cell.x as isize, n.y as isize - cell.y as isize);
                bits | 1 << OFFSETS.iter().position(|o| *o == offset).unwrap_or(0)
            });
        }
        Self { width: grid.width(), moves, steps: vec![UNREACHABLE; grid.free().len()], reached: Vec::new() }
    }

    /// Steps from `cell` to every cell (row-major), [`UNREACHABLE`] where there is no way. As every step can be
    /// undone, these are the steps *to* `cell` as well.
    pub fn from(&mut self, cell: Cell) -> &[u32] {
        self.within(cell, UNREACHABLE)
    }

    /// The same as [`Self::from`] for cells up to `most` steps away, [`UNREACHABLE`] for all others.
    pub fn within(&mut self, cell: Cell, most: u32) -> &[u32] {
        let Self { width, moves, steps, reached } = self;
        for at in reached.drain(..) {
            steps[at as usize] = UNREACHABLE;
        }
        let start = cell.y * *width + cell.x;
        steps[start] = 0;
        reached.push(start as u32);
        let mut done = 0;
        while done < reached.len() {
            let at = reached[done] as usize;
            done += 1;
            let next_steps = steps[at] + 1;
            if next_steps > most {
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

    /// The connected components of the free cells.
    pub fn components(&mut self, grid: &Grid) -> Components {
        let mut of_cell = vec![None; grid.free().len()];
        let mut sizes = Vec::new();
        for cell in grid.free_cells() {
            if of_cell[grid.index(cell)].is_some() {
                continue;
            }
            let label = sizes.len() as u32;
            let mut size = 0;
            let mut pending = vec![cell];
            of_cell[grid.index(cell)] = Some(label);
            while let Some(at) = pending.pop() {
                size += 1;
                for next in grid.neighbours(at) {
                    let slot = &mut of_cell[grid.index(next)];
                    if slot.is_none() {
                        *slot = Some(label);
                        pending.push(next);
                    }
                }
            }
            sizes.push(size);
        }
        Components { of_cell, sizes }
    }

    /// The farthest distance within the largest component, by at most `searches` breadth-first searches.
    ///
    /// iFUB (Crescenzi et al. 2013, "On computing the diameter of real-world undirected graphs"): from the middle
    /// of a long path, cells are searched from the outside in; what lies within i steps of the middle can be at
    /// most 2 i apart.
    pub fn diameter(&mut self, grid: &Grid, searches: usize) -> Diameter {
        let components = self.components(grid);
        let Some(first) = components.largest_cells(grid).next() else {
            return Diameter { steps: 0, exact: true };
        };
        let (a, _) = self.farthest(grid, first);
        let (b, across) = self.farthest(grid, a);
        let from_a = self.from(a).to_vec();
        let to_b = self.from(b);
        // Of all cells half way between a and b, the one that is nearest to everything makes the best middle;
        // trying a few is cheaper than searching its rings.
        let halfway: Vec<usize> = (0..from_a.len())
            .filter(|i| from_a[*i] != UNREACHABLE && from_a[*i] + to_b[*i] == across && from_a[*i] == across / 2)
            .collect();
        let tried = halfway.iter().step_by(halfway.len().div_ceil(8).max(1)).map(|i| grid.cell(*i));
        let tried: Vec<Cell> = tried.collect();
        let middle = tried.into_iter().min_by_key(|c| self.farthest(grid, *c).1).unwrap_or(first);
        let rings = self.from(middle).to_vec();
        let mut order: Vec<usize> = (0..rings.len()).filter(|i| rings[*i] != UNREACHABLE).collect();
        order.sort_by_key(|i| std::cmp::Reverse(rings[*i]));
        let mut steps = across;
        for (count, i) in order.into_iter().enumerate() {
            if steps >= 2 * rings[i] {
                return Diameter { steps, exact: true };
            }
            if count >= searches {
                return Diameter { steps, exact: false };
            }
            steps = steps.max(self.farthest(grid, grid.cell(i)).1);
        }
        Diameter { steps, exact: true }
    }

    /// The cell farthest from `cell`, and how many steps away it is.
    fn farthest(&mut self, grid: &Grid, cell: Cell) -> (Cell, u32) {
        let steps = self.from(cell);
        let (i, steps) = steps
            .iter()
            .enumerate()
            .filter(|(_, s)| **s != UNREACHABLE)
            .max_by_key(|(i, s)| (**s, std::cmp::Reverse(*i)))
            .expect("a search reaches at least its own start");
        (grid.cell(i), *steps)
    }
}
