//! Finds the cells at given distances, or the distances of given cells, 64 cells at a time: moves
//! lead to 8-connected cells without corner cutting, a diagonal is one move. A library search over
//! hashed nodes is about thirty times slower here.
//!
//! On large maps a search that stores the distance to every cell is memory-bound. When only some
//! rings or some cells matter, one bit per cell is enough, neighbours in a row are reached
//! together, and the search can end early.

use std::mem::{replace, swap, take};
use std::ops::{ControlFlow, Range, RangeInclusive};

use super::grid::{Cell, Grid};

/// Step count of a cell that cannot be reached.
pub const UNREACHABLE: u32 = u32::MAX;

/// Cells per word.
const BITS: usize = u64::BITS as usize;

/// Flood fills over one map; reuses its buffers.
pub struct Flood {
    /// Words per row. The last one has at least one wall bit, which separates the row from the
    /// next.
    row: usize,
    /// The cells that count have the coordinates `every / 2 + i * every`; the others are only ways.
    every: usize,
    /// Row by row, with a row of walls and one more word of walls before and after the map.
    cells: Vec<Word>,
    /// The words that the latest flood has reached, and those between.
    reached: Range<usize>,
    /// Words that contain cells of the next ring.
    next: Vec<usize>,
    /// The last ring reached: word indices and their bits.
    ring: Vec<(usize, u64)>,
}

/// Bits of 64 cells, adjacent in memory because they are accessed together.
#[derive(Clone, Copy, Default)]
struct Word {
    free: u64,
    /// Free cells that the latest flood has not reached.
    unreached: u64,
    /// Cells of the next ring; empty between floods.
    next_ring: u64,
    /// Cells that a search looks for; empty between searches.
    wanted: u64,
}

impl Flood {
    /// Prepares flood fills over `grid`, in which one of `every` cells along each axis counts: only
    /// those are found.
    pub fn new(grid: &Grid, every: usize) -> Self {
        let row = grid.width() / BITS + 1;
        let cells = vec![Word::default(); (grid.height() + 2) * row + 2];
        let mut flood =
            Self { row, every, reached: 0..cells.len(), cells, next: Vec::new(), ring: Vec::new() };
        for cell in grid.free_cells() {
            let (word, bit) = flood.place(cell);
            flood.cells[word].free |= bit;
        }
        flood
    }

    /// Returns the cell farthest from `cell` (on a tie, the first in row order) and its distance in
    /// steps.
    pub fn farthest(&mut self, cell: Cell) -> (Cell, u32) {
        // The last ring may have none that counts; the one before it then has.
        let (mut last, mut before) = (Vec::new(), Vec::new());
        let steps = self.flood(&[cell], |_, ring, _| {
            swap(&mut last, &mut before);
            last.clear();
            last.extend_from_slice(ring);
            ControlFlow::Continue(())
        });
        let first = |ring: &mut Vec<(usize, u64)>| {
            ring.sort_unstable();
            ring.iter().find_map(|(word, bits)| self.cells_of(*word, *bits).next())
        };
        match first(&mut last) {
            Some(cell) => (cell, steps),
            None => first(&mut before).map_or((cell, 0), |cell| (cell, steps - 1)),
        }
    }

    /// Returns the cells at a distance of `steps` from the nearest of `from`, with their distances,
    /// in row order.
    pub fn rings(&mut self, from: &[Cell], steps: RangeInclusive<u32>) -> Vec<(Cell, u32)> {
        let mut found = Vec::new();
        self.flood(from, |at, ring, _| {
            if steps.contains(&at) {
                found.extend(ring.iter().map(|(word, bits)| (*word, *bits, at)));
            }
            if at < *steps.end() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        let cells = found
            .into_iter()
            .flat_map(|(word, bits, at)| self.cells_of(word, bits).map(move |cell| (cell, at)));
        let mut cells: Vec<(Cell, u32)> = cells.collect();
        cells.sort_unstable_by_key(|(cell, _)| (cell.y, cell.x));
        cells
    }

    /// Returns the steps from the nearest of `from` to the nearest cell of each of `targets`,
    /// [`UNREACHABLE`] where there is no path, or only one longer than `longest`. Searches no
    /// farther than the farthest of them.
    pub fn steps_to(&mut self, from: &[Cell], targets: &[Vec<Cell>], longest: u32) -> Vec<u32> {
        let mut steps = vec![UNREACHABLE; targets.len()];
        let places = targets.iter().enumerate().flat_map(|(i, cells)| {
            let places = cells.iter().map(|cell| self.place(*cell));
            places.map(move |(word, bit)| (i, word, bit))
        });
        let places: Vec<(usize, usize, u64)> = places.collect();
        let mut left = places.clone();
        left.retain(|(_, word, bit)| self.cells[*word].free & bit != 0);
        left.iter().for_each(|(_, word, bit)| self.cells[*word].wanted |= bit);
        self.flood(from, |at, ring, cells| {
            // There may be millions of rings: targets are checked only in those that reach one.
            if ring.iter().any(|(word, bits)| cells[*word].wanted & bits != 0) {
                for (i, word, bit) in &left {
                    if cells[*word].unreached & bit == 0 {
                        steps[*i] = at;
                    }
                }
                left.retain(|(i, ..)| steps[*i] == UNREACHABLE);
            }
            let is_over = left.is_empty() || at >= longest;
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        places.iter().for_each(|(_, word, _)| self.cells[*word].wanted = 0);
        steps
    }

    /// Returns the steps from the nearest of `from` to every cell of a map of this width,
    /// [`UNREACHABLE`] where there is no path, row-major, in `steps`.
    pub fn steps_everywhere(&mut self, from: &[Cell], width: usize, steps: &mut [u32]) {
        steps.fill(UNREACHABLE);
        self.each(from, width, |i, at| steps[i] = at);
    }

    /// Passes the index of each cell that can be reached from `from`, of a map of this width, and
    /// its steps from the nearest of those to `pass`, the nearest cells first.
    pub fn each(&mut self, from: &[Cell], width: usize, mut pass: impl FnMut(usize, u32)) {
        let row = self.row;
        self.flood(from, |at, ring, _| {
            for (word, bits) in ring {
                let first = ((word - 1) / row - 1) * width + (word - 1) % row * BITS;
                let mut bits = *bits;
                while bits != 0 {
                    pass(first + bits.trailing_zeros() as usize, at);
                    bits &= bits - 1;
                }
            }
            ControlFlow::Continue(())
        });
    }

    /// Returns the cells more than `near` steps away from `cell`, with their distances: ring by
    /// ring from the outside in, in row order within a ring. Stops after the whole ring that brings
    /// the count above `enough`.
    pub fn outermost(&mut self, cell: Cell, near: u32, enough: usize) -> Vec<(u32, Cell)> {
        let mut rings = Vec::new();
        self.flood(&[cell], |steps, ring, _| {
            if steps > near {
                rings.extend(ring.iter().map(|bits| (steps, *bits)));
            }
            ControlFlow::Continue(())
        });
        let mut found = Vec::new();
        for ring in rings.chunk_by_mut(|a, b| a.0 == b.0).rev() {
            if found.len() > enough {
                break;
            }
            ring.sort_unstable();
            for &mut (steps, (word, bits)) in ring {
                found.extend(self.cells_of(word, bits).map(|cell| (steps, cell)));
            }
        }
        found
    }

    /// Returns the cells that count whose bits are set in a word.
    fn cells_of(&self, word: usize, bits: u64) -> impl Iterator<Item = Cell> {
        let (every, y) = (self.every, (word - 1) / self.row - 1);
        let counts = move |at: usize| at % every == every / 2;
        let bits = if counts(y) { bits } else { 0 };
        let rest = std::iter::successors(Some(bits), |bits| Some(bits & (bits - 1)));
        let cells = rest.take_while(|bits| *bits != 0).map(move |bits| self.cell(word, bits));
        cells.filter(move |cell| counts(cell.x))
    }

    /// Returns a cell's word and its bit in there.
    fn place(&self, cell: Cell) -> (usize, u64) {
        (1 + (cell.y + 1) * self.row + cell.x / BITS, 1 << (cell.x % BITS))
    }

    /// Returns the cell of the lowest set bit of a word.
    fn cell(&self, word: usize, bits: u64) -> Cell {
        let (y, in_row) = ((word - 1) / self.row - 1, (word - 1) % self.row);
        Cell::new(in_row * BITS + bits.trailing_zeros() as usize, y)
    }

    /// Floods from `from` ring by ring and passes each ring and all cells to `pass`, until that
    /// breaks. Returns the distance of the last ring.
    fn flood(
        &mut self,
        from: &[Cell],
        mut pass: impl FnMut(u32, &[(usize, u64)], &[Word]) -> ControlFlow<()>,
    ) -> u32 {
        // Searches in a small part of a large map leave the rest alone.
        let nothing = Range { start: usize::MAX, end: 0 };
        let reached = replace(&mut self.reached, nothing);
        let reached = self.cells.get_mut(reached).unwrap_or_default();
        reached.iter_mut().for_each(|word| word.unreached = word.free);
        for cell in from {
            let (word, bit) = self.place(*cell);
            self.reach(word, bit);
        }
        let mut ring = take(&mut self.ring);
        let mut steps = 0;
        loop {
            ring.clear();
            ring.extend(
                self.next.drain(..).map(|word| (word, take(&mut self.cells[word].next_ring))),
            );
            if pass(steps, &ring, &self.cells).is_continue() {
                for (word, bits) in &ring {
                    self.spread(*word, *bits);
                }
            }
            if self.next.is_empty() {
                self.ring = ring;
                return steps;
            }
            steps += 1;
        }
    }

    /// Reaches the neighbours of the given cells of a word.
    #[inline]
    fn spread(&mut self, word: usize, bits: u64) {
        const LAST: u32 = u64::BITS - 1;
        let free = |word: usize| self.cells[word].free;
        let (north, south) = (word - self.row, word + self.row);
        // Cells whose neighbour on that side is free.
        let west = bits & (free(word) << 1 | free(word - 1) >> LAST);
        let east = bits & (free(word) >> 1 | free(word + 1) << LAST);
        for (ways, to) in [(bits, word), (bits & free(north), north), (bits & free(south), south)] {
            // Spread left and right within that row too: a diagonal needs both adjacent sides free
            // (no corner cutting).
            let (left, right) = (ways & west, ways & east);
            self.reach(to, ways | left >> 1 | right << 1);
            if left & 1 != 0 {
                self.reach(to - 1, 1 << LAST);
            }
            if right >> LAST != 0 {
                self.reach(to + 1, 1);
            }
        }
    }

    /// Marks the given cells of a word as reached, except walls and cells already reached.
    #[inline]
    fn reach(&mut self, word: usize, bits: u64) {
        let cells = &mut self.cells[word];
        let new = bits & cells.unreached;
        if new != 0 {
            cells.unreached ^= new;
            if cells.next_ring == 0 {
                self.next.push(word);
                self.reached = self.reached.start.min(word)..self.reached.end.max(word + 1);
            }
            cells.next_ring |= new;
        }
    }
}

/// Searches from cell to cell over one map; reuses its buffers.
pub struct StepSearch {
    width: usize,
    flood: Flood,
    steps: Vec<u32>,
}

impl StepSearch {
    /// Prepares searches over `grid`.
    pub fn new(grid: &Grid) -> Self {
        let (flood, steps) = (Flood::new(grid, 1), vec![UNREACHABLE; grid.free().len()]);
        Self { width: grid.width(), flood, steps }
    }

    /// Returns the steps from `cell` to every cell (row-major), [`UNREACHABLE`] where there is no
    /// path. Steps are reversible, so these are also the steps *to* `cell`.
    pub fn steps_from(&mut self, cell: Cell) -> &[u32] {
        self.flood.steps_everywhere(&[cell], self.width, &mut self.steps);
        &self.steps
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Searches cell by cell.
    fn steps_from(grid: &Grid, start: Cell) -> Vec<u32> {
        let mut steps = vec![UNREACHABLE; grid.free().len()];
        let (mut ring, mut at) = (vec![start], 0);
        while !ring.is_empty() {
            ring.retain(|cell| {
                let own = &mut steps[grid.index(*cell)];
                std::mem::replace(own, at.min(*own)) == UNREACHABLE
            });
            ring = ring.iter().flat_map(|cell| grid.neighbours(*cell)).collect();
            at += 1;
        }
        steps
    }

    /// Covers all widths around a word's size, and maps from open to fragmented.
    #[test]
    fn a_flood_fill_agrees_with_breadth_first_search() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for width in 1..200 {
            let (height, walls) = (rng.random_range(1..40), rng.random_range(0.0..0.6));
            let mut free: Vec<bool> =
                (0..width * height).map(|_| rng.random::<f32>() > walls).collect();
            let start = rng.random_range(0..free.len());
            free[start] = true;
            let grid = Grid::new("random", width, free, Vec::new(), Vec::new());
            let start = grid.cell(start);
            let steps = steps_from(&grid, start);
            assert_eq!(StepSearch::new(&grid).steps_from(start), steps);
            let mut cells: Vec<(u32, Cell)> =
                steps.iter().enumerate().map(|(i, s)| (*s, grid.cell(i))).collect();
            cells.retain(|(steps, _)| *steps != UNREACHABLE);
            // Outermost ring first, in row order within a ring.
            cells.sort_by_key(|(steps, _)| std::cmp::Reverse(*steps));
            let mut flood = Flood::new(&grid, 1);
            let (max_steps, first) = cells[0];
            assert_eq!(flood.farthest(start), (first, max_steps), "{width} x {height}");
            for last in [0, max_steps / 2, max_steps, max_steps + 2] {
                let rings = last.saturating_sub(2)..=last;
                let of_cell = |i: usize| (grid.cell(i), steps[i]);
                let expected: Vec<(Cell, u32)> =
                    (0..steps.len()).map(of_cell).filter(|c| rings.contains(&c.1)).collect();
                assert_eq!(
                    flood.rings(&[start], rings),
                    expected,
                    "rings up to {last} of {width} x {height}"
                );
            }
            // Some may be walls, unreachable, the start itself or the same cell twice.
            let targets: Vec<usize> =
                (0..rng.random_range(0..9)).map(|_| rng.random_range(0..steps.len())).collect();
            let expected: Vec<u32> = targets.iter().map(|i| steps[*i]).collect();
            let single: Vec<Vec<Cell>> = targets.iter().map(|i| vec![grid.cell(*i)]).collect();
            let found = flood.steps_to(&[start], &single, UNREACHABLE);
            assert_eq!(found, expected, "{width} x {height}");
            let from_nowhere = flood.steps_to(&[], &single, UNREACHABLE);
            assert!(from_nowhere.iter().all(|steps| *steps == UNREACHABLE));
            let nearest = expected.iter().min().copied().unwrap_or(UNREACHABLE);
            let together = [single.concat()];
            assert_eq!(flood.steps_to(&[start], &together, UNREACHABLE), [nearest]);
            if let Some(less) = nearest.checked_sub(1).filter(|_| nearest != UNREACHABLE) {
                assert_eq!(flood.steps_to(&[start], &together, less), [UNREACHABLE]);
            }
            let near = max_steps / 3;
            cells.retain(|(steps, _)| *steps > near);
            assert_eq!(flood.outermost(start, near, usize::MAX), cells);
            let some = flood.outermost(start, near, 5);
            assert_eq!(some, cells[..some.len()]);
            assert!(some.len() > 5 || some.len() == cells.len());
        }
    }
}
