//! The maze's true distances: the shortest paths of a point, by breadth-first search.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::{GroundTruth, NEAR_STEPS, TruePairs};
use crate::map::{Cell, Grid, PointSearch, UNREACHABLE};

/// Sample sizes for measuring D's error: goals, starts per goal, and near starts per goal.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

/// True step distances on a map.
pub struct MazeGroundTruth<'a> {
    map: &'a Grid,
    /// The cells that pairs are drawn from.
    cells: &'a [Cell],
    search: PointSearch,
}

impl<'a> MazeGroundTruth<'a> {
    /// Creates the true distances of `map`; pairs are drawn from `cells`.
    pub fn new(map: &'a Grid, cells: &'a [Cell]) -> Self {
        Self { map, cells, search: PointSearch::new(map) }
    }
}

/// Returns the position of a goal or a state.
fn position(at: &[f32]) -> [f32; 2] {
    [at[0], at[1]]
}

impl GroundTruth for MazeGroundTruth<'_> {
    fn steps(&mut self, from: &[f32], goals: &[f32], longest: u32) -> Option<Vec<Option<u32>>> {
        let from = position(from);
        if !self.map.is_free_at(from[0], from[1]) {
            return None;
        }
        let goals: Vec<[f32; 2]> = goals.chunks_exact(2).map(position).collect();
        let steps = self.search.steps_from(from, &goals, longest).into_iter();
        Some(steps.map(|steps| Some(steps).filter(|steps| *steps != UNREACHABLE)).collect())
    }

    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs> {
        let Self { cells, search, .. } = self;
        let (goals, starts, near_starts) = ERROR_PAIRS;
        let mut draw = |count: usize| rng.random_range(0..count);
        let of_goal = |_| {
            let goal = cells[draw(cells.len())];
            let drawn: Vec<Cell> = (0..starts).map(|_| cells[draw(cells.len())]).collect();
            let around = search.rings(goal, 1..=NEAR_STEPS);
            let near =
                (0..near_starts.min(around.len())).map(|_| (around[draw(around.len())].0, true));
            let starts: Vec<(Cell, bool)> =
                drawn.into_iter().map(|cell| (cell, false)).chain(near).collect();
            let places: Vec<[f32; 2]> = starts.iter().map(|(cell, _)| cell.centre()).collect();
            let steps = search.steps_of(&places, goal.centre());
            let mut pairs = TruePairs { goal: goal.centre().to_vec(), ..TruePairs::default() };
            for ((cell, near), steps) in
                starts.into_iter().zip(steps).filter(|(_, steps)| *steps > 0)
            {
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
        // Round the corners (1, 1) and (1, 2) it is 0.5 + 1 + 1 to (2, 2), near enough to both
        // places at the right.
        let goals = [2.1, 1.1, 2.9, 1.9, 2.5, 2.5];
        let steps = truth.steps(&[1.5, 0.5], &goals, 100);
        assert_eq!(steps, Some(vec![Some(0), Some(3), Some(3)]));
        assert_eq!(truth.steps(&[1.5, 1.5], &goals, 100), None, "inside a wall");
        assert_eq!(truth.steps(&[0.5, 0.5], &[2.5, 2.5], 2), Some(vec![None]), "too far");
    }
}
