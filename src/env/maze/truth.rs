//! The maze's true distances, by breadth-first search.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::GOAL_RADIUS_CELLS;
use crate::env::{GroundTruth, NEAR_STEPS, TruePairs};
use crate::map::{Cell, Flood, Grid, StepSearch, UNREACHABLE};

/// Sample sizes for measuring D's error: goals, starts per goal, and near starts per goal.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

/// True step distances on a map.
pub struct MazeGroundTruth<'a> {
    map: &'a Grid,
    /// The cells that pairs are drawn from.
    cells: &'a [Cell],
    search: StepSearch,
    flood: Flood,
}

impl<'a> MazeGroundTruth<'a> {
    /// Creates the true distances of `map`; pairs are drawn from `cells`.
    pub fn new(map: &'a Grid, cells: &'a [Cell]) -> Self {
        Self { map, cells, search: StepSearch::new(map), flood: Flood::new(map) }
    }
}

/// Returns the cell that contains a position.
fn cell_of(at: &[f32]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}

/// Returns the free cells with a position from which `goal` counts as reached: also those behind a corner.
fn cells_within_reach(map: &Grid, goal: &[f32]) -> impl Iterator<Item = Cell> {
    let Cell { x, y } = cell_of(goal);
    // The radius is no longer than a cell.
    let around = (x.saturating_sub(1)..=x + 1).flat_map(move |x| (y.saturating_sub(1)..=y + 1).map(move |y| (x, y)));
    let off = move |at: f32, low: usize| (low as f32 - at).max(at - (low + 1) as f32).max(0.0);
    around.filter(move |(x, y)| off(goal[0], *x).hypot(off(goal[1], *y)) < GOAL_RADIUS_CELLS).filter_map(|(x, y)| {
        let cell = Cell::new(x, y);
        map.is_free(cell).then_some(cell)
    })
}

impl GroundTruth for MazeGroundTruth<'_> {
    fn steps(&mut self, from: &[f32], goals: &[f32], longest: u32) -> Option<Vec<Option<u32>>> {
        let from = cell_of(from);
        if !self.map.is_free(from) {
            return None;
        }
        let steps = self.search.steps_within(from, longest);
        let of = |goal: &[f32]| {
            let cells = cells_within_reach(self.map, goal).map(|cell| steps[self.map.index(cell)]);
            cells.min().filter(|steps| *steps != UNREACHABLE)
        };
        Some(goals.chunks_exact(2).map(of).collect())
    }

    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs> {
        let Self { cells, flood, .. } = self;
        let (goals, starts, near_starts) = ERROR_PAIRS;
        let mut draw = |count: usize| rng.random_range(0..count);
        let of_goal = |_| {
            let goal = cells[draw(cells.len())];
            let drawn: Vec<Cell> = (0..starts).map(|_| cells[draw(cells.len())]).collect();
            let around = flood.rings(goal, 1..=NEAR_STEPS);
            let near = (0..near_starts.min(around.len())).map(|_| around[draw(around.len())]);
            let far = drawn.iter().copied().zip(flood.steps_to(goal, &drawn)).filter(|(_, steps)| *steps > 0);
            let mut pairs = TruePairs { goal: goal.centre().to_vec(), ..TruePairs::default() };
            for ((cell, steps), near) in far.map(|pair| (pair, false)).chain(near.map(|pair| (pair, true))) {
                pairs.states.extend(cell.centre());
                pairs.steps.push(steps);
                pairs.near.push(near);
            }
            pairs
        };
        (0..goals).map(of_goal).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    #[test]
    fn a_goal_behind_a_corner_is_reached_from_this_side_but_not_through_a_wall() {
        let map = parse_map("corner", b"..#\n.#.\n...\n").expect("a map");
        let cells: Vec<Cell> = map.free_cells().collect();
        let mut truth = MazeGroundTruth::new(&map, &cells);
        // Around the wall from (1, 0) to the cell at the right it takes 6 steps, less the goal radius.
        let goals = [2.1, 1.1, 2.9, 1.9, 2.5, 2.5];
        let steps = truth.steps(&[1.5, 0.5], &goals, 100);
        assert_eq!(steps, Some(vec![Some(0), Some(4), Some(4)]));
        assert_eq!(truth.steps(&[1.5, 1.5], &goals, 100), None, "inside a wall");
        assert_eq!(truth.steps(&[0.5, 0.5], &[2.5, 2.5], 2), Some(vec![None]), "too far");
    }
}
