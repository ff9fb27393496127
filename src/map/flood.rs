//! Finds the cells farthest from a given cell, 64 cells at a time.
//!
//! On large maps a search that stores the distance to every cell is memory-bound. When only the last cells reached
//! matter, one bit per cell is enough, and neighbours in a row are reached together.

use super::grid::{Cell, Grid};

/// Cells per word.
const BITS: usize = u64::BITS as usize;

/// Flood fills over one map; reuses its buffers.
pub struct Flood {
    /// Bits from a cell to the one below it: one row plus a wall bit that separates it from the next row.
    stride: usize,
    /// Wall words before the first row; at least as many follow the last one.
    before: usize,
    cells: Vec<Word>,
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
}

/// Distance to another cell's bit: whole words plus bits.
#[derive(Clone, Copy)]
struct Offset {
    words: isize,
    bits: u32,
}

impl Offset {
    fn new(bits: isize) -> Self {
        Self { words: bits.div_euclid(BITS as isize), bits: bits.rem_euclid(BITS as isize) as u32 }
    }

    /// Returns the `free` bits at this distance from the bits of `word`.
    fn free(self, cells: &[Word], word: usize) -> u64 {
        let at = word.wrapping_add_signed(self.words);
        // Shifted in two steps because a single shift by 64 bits would overflow.
        cells[at].free >> self.bits | cells[at + 1].free << 1 << (BITS as u32 - 1 - self.bits)
    }
}

impl Flood {
    /// Prepares flood fills over `grid`.
    pub fn new(grid: &Grid) -> Self {
        let stride = grid.width() + 1;
        let before = (stride + 1) / BITS + 1;
        let words = (grid.height() * stride).div_ceil(BITS) + 2 * before + 1;
        let mut cells = vec![Word::default(); words];
        for (y, row) in grid.free().chunks_exact(grid.width()).enumerate() {
            for x in (0..row.len()).filter(|x| row[*x]) {
                let bit = before * BITS + y * stride + x;
                cells[bit / BITS].free |= 1 << (bit % BITS);
            }
        }
        Self { stride, before, cells, next: Vec::new(), ring: Vec::new() }
    }

    /// Returns the cell farthest from `cell` (on a tie, the first in row order) and its distance in steps.
    pub fn farthest(&mut self, cell: Cell) -> (Cell, u32) {
        let steps = self.flood(cell, u32::MAX, |_, _| {});
        let (word, bits) = *self.ring.iter().min().expect("a flood reaches at least its own start");
        (self.cell(word, bits), steps)
    }

    /// Returns the cells exactly `steps` away from `cell`, in row order.
    pub fn ring(&mut self, cell: Cell, steps: u32) -> Vec<Cell> {
        let reached = self.flood(cell, steps, |_, _| {});
        let mut ring = std::mem::take(&mut self.ring);
        ring.sort_unstable();
        if reached == steps { self.cells_of(&ring).collect() } else { Vec::new() }
    }

    /// Returns the cells more than `near` steps away from `cell`, with their distances: ring by ring from the outside
    /// in, in row order within a ring. Stops after the whole ring that brings the count above `enough`.
    pub fn outermost(&mut self, cell: Cell, near: u32, enough: usize) -> Vec<(u32, Cell)> {
        let mut rings = Vec::new();
        self.flood(cell, u32::MAX, |steps, ring| {
            if steps > near {
                rings.extend(ring.iter().map(|bits| (steps, *bits)));
            }
        });
        let mut found = Vec::new();
        for ring in rings.chunk_by_mut(|a, b| a.0 == b.0).rev() {
            if found.len() > enough {
                break;
            }
            ring.sort_unstable();
            for (steps, bits) in ring {
                found.extend(self.cells_of(&[*bits]).map(|cell| (*steps, cell)));
            }
        }
        found
    }

    /// Returns the cells whose bits are set.
    fn cells_of(&self, ring: &[(usize, u64)]) -> impl Iterator<Item = Cell> {
        ring.iter().flat_map(move |(word, bits)| {
            let rest = std::iter::successors(Some(*bits), |bits| Some(bits & (bits - 1)));
            rest.take_while(|bits| *bits != 0).map(move |bits| self.cell(*word, bits))
        })
    }

    /// Returns the cell of the lowest set bit of a word.
    fn cell(&self, word: usize, bits: u64) -> Cell {
        let bit = (word - self.before) * BITS + bits.trailing_zeros() as usize;
        Cell::new(bit % self.stride, bit / self.stride)
    }

    /// Floods ring by ring, up to `max_steps` steps away, and passes each ring to `pass`. Returns the distance of the
    /// last ring.
    fn flood(&mut self, cell: Cell, max_steps: u32, mut pass: impl FnMut(u32, &[(usize, u64)])) -> u32 {
        self.cells.iter_mut().for_each(|word| word.unreached = word.free);
        let bit = self.before * BITS + cell.y * self.stride + cell.x;
        self.reach(bit / BITS, 1 << (bit % BITS));
        let row = self.stride as isize;
        let [here, west, east, north, south] = [0, -1, 1, -row, row].map(Offset::new);
        let mut ring = std::mem::take(&mut self.ring);
        let mut steps = 0;
        loop {
            ring.clear();
            ring.extend(self.next.drain(..).map(|word| (word, std::mem::take(&mut self.cells[word].next_ring))));
            pass(steps, &ring);
            if steps < max_steps {
                for &(word, bits) in &ring {
                    // Cells whose neighbour on that side is free.
                    let [w, e, n, s] = [west, east, north, south].map(|side| bits & side.free(&self.cells, word));
                    for (ways, to) in [(bits, here), (n, north), (s, south)] {
                        // Spread left and right within that row too: a diagonal needs both adjacent sides free (no
                        // corner cutting).
                        let (left, right) = (ways & w, ways & e);
                        self.reach_from(word, ways | left >> 1 | right << 1, to);
                        if left & 1 != 0 {
                            self.reach_from(word - 1, 1 << (BITS - 1), to);
                        }
                        if right >> (BITS - 1) != 0 {
                            self.reach_from(word + 1, 1, to);
                        }
                    }
                }
            }
            if self.next.is_empty() {
                self.ring = ring;
                return steps;
            }
            steps += 1;
        }
    }

    /// Marks the cells at distance `offset` from the given bits of a word as reached.
    #[inline]
    fn reach_from(&mut self, word: usize, bits: u64, offset: Offset) {
        let at = word.wrapping_add_signed(offset.words);
        self.reach(at, bits << offset.bits);
        self.reach(at + 1, bits >> 1 >> (BITS as u32 - 1 - offset.bits));
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
            }
            cells.next_ring |= new;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::map::{StepSearch, UNREACHABLE};

    /// Covers all widths around a word's size, and maps from open to fragmented.
    #[test]
    fn a_flood_fill_agrees_with_breadth_first_search() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for width in 1..200 {
            let (height, walls) = (rng.random_range(1..40), rng.random_range(0.0..0.6));
            let mut free: Vec<bool> = (0..width * height).map(|_| rng.random::<f32>() > walls).collect();
            let start = rng.random_range(0..free.len());
            free[start] = true;
            let grid = Grid::new("random", width, free, Vec::new(), Vec::new());
            let start = grid.cell(start);
            let mut search = StepSearch::new(&grid);
            let steps = search.steps_from(start);
            let mut cells: Vec<(u32, Cell)> = steps.iter().enumerate().map(|(i, s)| (*s, grid.cell(i))).collect();
            cells.retain(|(steps, _)| *steps != UNREACHABLE);
            // Outermost ring first, in row order within a ring.
            cells.sort_by_key(|(steps, _)| std::cmp::Reverse(*steps));
            let mut flood = Flood::new(&grid);
            let (max_steps, first) = cells[0];
            assert_eq!(flood.farthest(start), (first, max_steps), "{width} x {height}");
            for ring in [0, max_steps / 2, max_steps, max_steps + 1] {
                let expected: Vec<Cell> = cells.iter().filter(|c| c.0 == ring).map(|c| c.1).collect();
                assert_eq!(flood.ring(start, ring), expected, "ring {ring} of {width} x {height}");
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
