//! Shortest step counts between cells: the ground truth, used for evaluation and display only.
//!
//! Breadth-first search on 8-connected cells without corner cutting; a diagonal is one step. A
//! library search over hashed nodes is about thirty times slower here, and a map's diameter takes
//! hundreds of searches.

use super::flood::{Flood, UNREACHABLE};
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
pub(super) const OFFSETS: [(isize, isize); 8] =
    [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

const WEST: u8 = 0b0001;
const NORTH: u8 = 0b0100;

/// The two sides adjacent to each corner, as bits.
const ADJACENT_SIDES: [u8; 4] = [0b0101, 0b0110, 0b1001, 0b1010];

/// The largest distance between two connected cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diameter {
    /// Distance of the farthest pair found, in steps.
    pub steps: u32,
    /// Whether no pair can be farther apart; if not, `steps` is the largest distance found before
    /// the search gave up.
    pub exact: bool,
    /// A central cell, and a distance from it that no cell connected to it exceeds; `None` on a map
    /// without free cells.
    pub middle: Option<(Cell, u32)>,
}

/// Cell visits allowed for a diameter: enough to be exact on the built-in maps, and seconds on the
/// largest ones.
const DIAMETER_CELL_BUDGET: usize = 60_000_000;

/// Candidate middles to try; fewer on large maps, where their searches would dominate.
const MAX_MIDDLES: usize = 8;
const SEARCHES_PER_MIDDLE: usize = 25;

impl Diameter {
    /// Computes the diameter of `grid` in bounded time.
    pub fn compute(grid: &Grid) -> Self {
        Self::compute_from(grid, &StepSearch::new(grid).components(grid))
    }

    /// Like [`Self::compute`], for a map whose components are known.
    pub fn compute_from(grid: &Grid, components: &Components) -> Self {
        Self::bounded(DIAMETER_CELL_BUDGET / grid.free_count().max(1), grid, components)
    }

    /// Runs iFUB (Crescenzi et al. 2013, "On computing the diameter of real-world undirected
    /// graphs"): searches from the cells farthest from the middle of a long path, working inwards;
    /// cells within i steps of the middle are at most 2 i apart.
    fn bounded(searches: usize, grid: &Grid, components: &Components) -> Self {
        let Some(first) = components.largest_cells(grid).next() else {
            return Self { steps: 0, exact: true, middle: None };
        };
        let mut flood = Flood::new(grid);
        let (a, _) = flood.farthest(first);
        let (b, across) = flood.farthest(a);
        // Of all cells halfway between a and b, the most central one makes the best middle; trying
        // a few is cheaper than searching from more rings.
        let mut ring = |from, steps| {
            flood.rings(from, steps..=steps).into_iter().map(|(cell, _)| cell).collect::<Vec<_>>()
        };
        let (mut halfway, to_b) = (ring(a, across / 2), ring(b, across - across / 2));
        halfway.retain(|cell| to_b.binary_search_by_key(&(cell.y, cell.x), |c| (c.y, c.x)).is_ok());
        let middles = (searches / SEARCHES_PER_MIDDLE).clamp(1, MAX_MIDDLES);
        let tried: Vec<Cell> =
            halfway.iter().step_by(halfway.len().div_ceil(middles).max(1)).copied().collect();
        let middle = match tried[..] {
            [only] => only,
            _ => tried.into_iter().min_by_key(|cell| flood.farthest(*cell).1).unwrap_or(first),
        };
        let outermost = flood.outermost(middle, across / 2, searches);
        let radius = outermost.first().map_or(across / 2, |(ring, _)| *ring);
        let (mut steps, mut exact) = (across, true);
        for (count, (ring, cell)) in outermost.into_iter().enumerate() {
            if steps >= 2 * ring {
                break;
            }
            if count >= searches {
                exact = false;
                break;
            }
            steps = steps.max(flood.farthest(cell).1);
        }
        Self { steps, exact, middle: Some((middle, radius)) }
    }
}

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
}

impl Components {
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

    /// Returns the open neighbours of each cell, as a bit set over [`OFFSETS`].
    pub(super) fn into_moves(self) -> Vec<u8> {
        self.moves
    }

    /// Returns the steps from `cell` to every cell (row-major), [`UNREACHABLE`] where there is no
    /// path. Steps are reversible, so these are also the steps *to* `cell`.
    pub fn steps_from(&mut self, cell: Cell) -> &[u32] {
        self.steps_within(cell, UNREACHABLE)
    }

    /// Like [`Self::steps_from`], but only up to `max_steps` steps; farther cells are
    /// [`UNREACHABLE`] too.
    pub fn steps_within(&mut self, cell: Cell, max_steps: u32) -> &[u32] {
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

    /// Returns the largest distance within the largest component, using at most `searches`
    /// breadth-first searches after the few that find the middle.
    pub fn diameter(&self, grid: &Grid, searches: usize) -> Diameter {
        Diameter::bounded(searches, grid, &self.components(grid))
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
