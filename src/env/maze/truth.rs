//! The maze's true distances, by breadth-first search.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::{GroundTruth, NEAR_STEPS, TruePairs};
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};

/// Sample sizes for measuring D's error: goals, starts per goal, and near starts per goal.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

/// True step distances on a map.
pub struct MazeGroundTruth<'a> {
    map: &'a Grid,
    /// The cells that pairs are drawn from.
    cells: &'a [Cell],
    search: StepSearch,
}

impl<'a> MazeGroundTruth<'a> {
    /// Creates the true distances of `map`; pairs are drawn from `cells`.
    pub fn new(map: &'a Grid, cells: &'a [Cell]) -> Self {
        Self { map, cells, search: StepSearch::new(map) }
    }
}

/// Returns the cell that contains a position.
fn cell_of(at: &[f32]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}

impl GroundTruth for MazeGroundTruth<'_> {
    fn steps(&mut self, from: &[f32], goals: &[f32], longest: u32) -> Option<Vec<Option<u32>>> {
        let from = cell_of(from);
        if !self.map.is_free(from) {
            return None;
        }
        let steps = self.search.steps_within(from, longest);
        let of = |goal: &[f32]| Some(steps[self.map.index(cell_of(goal))]).filter(|steps| *steps != UNREACHABLE);
        Some(goals.chunks_exact(2).map(of).collect())
    }

    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs> {
        let Self { map, cells, search } = self;
        let (goals, starts, near_starts) = ERROR_PAIRS;
        let of_goal = |_| {
            let goal = cells[rng.random_range(0..cells.len())];
            let steps = search.steps_from(goal);
            let around: Vec<usize> = (0..steps.len()).filter(|i| (1..=NEAR_STEPS).contains(&steps[*i])).collect();
            let mut pairs = TruePairs { goal: goal.centre().to_vec(), ..TruePairs::default() };
            let mut push = |i: usize, near: bool| {
                if steps[i] > 0 {
                    pairs.states.extend(map.cell(i).centre());
                    pairs.steps.push(steps[i]);
                    pairs.near.push(near);
                }
            };
            (0..starts).for_each(|_| push(map.index(cells[rng.random_range(0..cells.len())]), false));
            (0..near_starts.min(around.len())).for_each(|_| push(around[rng.random_range(0..around.len())], true));
            pairs
        };
        (0..goals).map(of_goal).collect()
    }
}
