//! Lengths of shortest paths as Moving AI states them: a diagonal counts sqrt 2, and cuts no
//! corner.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

use super::distance::{OFFSETS, StepSearch};
use super::grid::{Cell, Grid};

/// Lengths of a straight and a diagonal move, rounded down.
const STRAIGHT: u32 = 1000;
const DIAGONAL: u32 = 1414;

/// Searches for shortest paths over one map; reuses its buffers. A library search over hashed nodes
/// is many times slower.
pub struct OctileSearch {
    width: usize,
    /// Open neighbours of each cell, as a bit set over [`OFFSETS`].
    moves: Vec<u8>,
    /// Length of the shortest known path to each cell.
    lengths: Vec<u32>,
    /// Cells reached by the latest search.
    reached: Vec<u32>,
    /// Cells that may still be visited, over all searches.
    left: usize,
}

impl OctileSearch {
    /// Prepares searches over `grid` that visit `most_visits` cells altogether.
    pub fn new(grid: &Grid, most_visits: usize) -> Self {
        let lengths = vec![u32::MAX; grid.free().len()];
        let moves = StepSearch::new(grid).into_moves();
        Self { width: grid.width(), moves, lengths, reached: Vec::new(), left: most_visits }
    }

    /// Returns the length, in cells, of the shortest path from `start` to `goal` (A* over the
    /// cells); `None` if there is none, or the visits are used up.
    pub fn shortest(&mut self, start: Cell, goal: Cell) -> Option<f64> {
        for at in self.reached.drain(..) {
            self.lengths[at as usize] = u32::MAX;
        }
        let width = self.width;
        let to_goal = |at: usize| straight_length(Cell::new(at % width, at / width), goal);
        let first = start.y * width + start.x;
        self.lengths[first] = 0;
        self.reached.push(first as u32);
        // Of equally promising cells, the one nearest to the goal comes first.
        let mut open = BinaryHeap::from([Reverse((to_goal(first), to_goal(first), first as u32))]);
        while let Some(Reverse((promised, ahead, at))) = open.pop() {
            if ahead == 0 {
                return Some(self.length_to(at as usize));
            }
            let (at, length) = (at as usize, promised - ahead);
            if length > self.lengths[at] {
                continue;
            }
            self.left = self.left.checked_sub(1)?;
            let mut bits = self.moves[at];
            while bits != 0 {
                let (dx, dy) = OFFSETS[bits.trailing_zeros() as usize];
                bits &= bits - 1;
                let next = at.wrapping_add_signed(dy * width as isize + dx);
                let own =
                    length.saturating_add(if dx == 0 || dy == 0 { STRAIGHT } else { DIAGONAL });
                let promised = own.saturating_add(to_goal(next));
                if own < self.lengths[next] {
                    if self.lengths[next] == u32::MAX {
                        self.reached.push(next as u32);
                    }
                    self.lengths[next] = own;
                    open.push(Reverse((promised, promised - own, next as u32)));
                }
            }
        }
        None
    }

    /// Returns the length of the path to a cell that was found, with diagonals that are not rounded.
    fn length_to(&self, cell: usize) -> f64 {
        let (mut at, mut length) = (cell, 0.0);
        while self.lengths[at] > 0 {
            let mut steps = (0..OFFSETS.len()).filter(|i| self.moves[at] >> i & 1 == 1).map(|i| {
                let (dx, dy) = OFFSETS[i];
                (at.wrapping_add_signed(dy * self.width as isize + dx), dx == 0 || dy == 0)
            });
            let leads_here = |(from, is_straight): &(usize, bool)| {
                let own = if *is_straight { STRAIGHT } else { DIAGONAL };
                self.lengths[*from].checked_add(own) == Some(self.lengths[at])
            };
            let Some((from, is_straight)) = steps.find(leads_here) else { break };
            length += if is_straight { 1.0 } else { SQRT_2 };
            at = from;
        }
        length
    }
}

/// Returns the length of the shortest path without any wall.
fn straight_length(a: Cell, b: Cell) -> u32 {
    let (x, y) = (a.x.abs_diff(b.x) as u32, a.y.abs_diff(b.y) as u32);
    x.min(y).saturating_mul(DIAGONAL).saturating_add(x.abs_diff(y).saturating_mul(STRAIGHT))
}

/// Returns a lower bound on the length, in cells, of a path between two cells.
pub fn least_length((ax, ay): (usize, usize), (bx, by): (usize, usize)) -> f64 {
    let (x, y) = (ax.abs_diff(bx) as f64, ay.abs_diff(by) as f64);
    x.min(y) * SQRT_2 + (x - y).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    #[test]
    fn paths_go_around_walls_and_cut_no_corners() {
        let grid = parse_map("map", b"...#\n.#..\n...#\n####\n..#.\n").expect("a map");
        let mut search = OctileSearch::new(&grid, 1000);
        let (a, b) = (Cell::new(1, 0), Cell::new(1, 2));
        assert_eq!(search.shortest(a, b), Some(4.0));
        assert_eq!(search.shortest(a, Cell::new(0, 4)), None);
        assert_eq!(search.shortest(a, a), Some(0.0));
        search.left = 3;
        assert_eq!(search.shortest(a, b), None);
    }
}
