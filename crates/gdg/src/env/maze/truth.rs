//! The maze's true distances: the shortest paths of a point, by breadth-first search.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::{GroundTruth, NEAR_STEPS, TruePairs};
use crate::map::{Cell, Grid, PointFlood, UNREACHABLE};

/// Sample sizes for measuring D's error: goals, starts per goal, and near starts per goal.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

/// True step distances on a map.
pub struct MazeGroundTruth<'a> {
    map: &'a Grid,
    /// The cells that pairs are drawn from.
    cells: &'a [Cell],
    flood: PointFlood,
}

impl<'a> MazeGroundTruth<'a> {
    /// Creates the true distances of `map`; pairs are drawn from `cells`.
    pub fn new(map: &'a Grid, cells: &'a [Cell]) -> Self {
        Self { map, cells, flood: PointFlood::new(map) }
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
        let steps = self.flood.steps_from(from, &goals, longest).into_iter();
        Some(steps.map(|steps| Some(steps).filter(|steps| *steps != UNREACHABLE)).collect())
    }

    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs> {
        let Self { cells, flood, .. } = self;
        let (goals, starts, near_starts) = ERROR_PAIRS;
        let mut draw = |count: usize| rng.random_range(0..count);
        let of_goal = |_| {
            let goal = cells[draw(cells.len())];
            let drawn: Vec<Cell> = (0..starts).map(|_| cells[draw(cells.len())]).collect();
            let around = flood.rings(goal, 1..=NEAR_STEPS);
            let near =
                (0..near_starts.min(around.len())).map(|_| (around[draw(around.len())].0, true));
            let starts: Vec<(Cell, bool)> =
                drawn.into_iter().map(|cell| (cell, false)).chain(near).collect();
            let places: Vec<[f32; 2]> = starts.iter().map(|(cell, _)| cell.centre()).collect();
            let steps = flood.steps_to(goal.centre(), &places);
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
    use rand::SeedableRng;

    use super::super::full_state_at;
    use super::*;
    use crate::env::{Environment, PointMaze};
    use crate::map::{HalfCells, RandomMapKind, StepSearch, parse_map, random};

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

    #[test]
    fn a_point_walks_as_far_as_the_true_distance_and_less_far_than_from_cell_to_cell() {
        let map = random(RandomMapKind::Perfect, Some(21), 1);
        let cells: Vec<Cell> = map.free_cells().collect();
        let mut truth = MazeGroundTruth::new(&map, &cells);
        let half_cells = HalfCells::new(&map);
        let goal = cells[0];
        let mut search = StepSearch::new(half_cells.points());
        let moves = search.steps_from(half_cells.middle(goal));
        let mut around = StepSearch::new(half_cells.points());
        let by_cells = StepSearch::new(&map).steps_from(goal).to_vec();
        let mut env = PointMaze::new(std::sync::Arc::new(map.clone()), 1);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let [goal_x, goal_y] = goal.centre();
        let (mut walked, mut true_steps, mut cell_steps) = (0, 0, 0);
        for start in cells.iter().filter(|cell| by_cells[map.index(**cell)] > 20) {
            env.set_full_state(0, &full_state_at(start.centre()));
            let mut steps = 0;
            while (env.states()[0] - goal_x).hypot(env.states()[1] - goal_y) >= 1.0 {
                // To the point nearest to the goal of those two moves from here, which a step
                // reaches.
                let [x, y] = [env.states()[0], env.states()[1]];
                let here = Cell::new((2.0 * x).round() as usize, (2.0 * y).round() as usize);
                let around = around.steps_within(here, 2);
                let next = (0..around.len())
                    .filter(|point| around[*point] != UNREACHABLE)
                    .min_by_key(|i| moves[*i]);
                let next = half_cells.points().cell(next.expect("a point"));
                // Not onto the walls themselves: a little towards the free cells around.
                let touching = |at: usize| (at.saturating_sub(1) / 2)..=(at / 2);
                let free =
                    touching(next.y).flat_map(|y| touching(next.x).map(move |x| Cell::new(x, y)));
                let free: Vec<[f32; 2]> =
                    free.filter(|cell| map.is_free(*cell)).map(Cell::centre).collect();
                let aim = |axis: usize, at: usize| {
                    let mean =
                        free.iter().map(|centre| centre[axis]).sum::<f32>() / free.len() as f32;
                    0.9 * at as f32 / 2.0 + 0.1 * mean
                };
                env.step(&[aim(0, next.x) - x, aim(1, next.y) - y], &mut rng);
                steps += 1;
                assert!(steps < 1_000, "{start:?}");
            }
            let shortest = truth.steps(&start.centre(), &goal.centre(), UNREACHABLE);
            let shortest = shortest.expect("it is free")[0].expect("a path leads there");
            assert!(steps + 1 >= shortest, "{steps} steps instead of {shortest} from {start:?}");
            (walked, true_steps) = (walked + steps, true_steps + shortest);
            cell_steps += by_cells[map.index(*start)];
        }
        let share = |steps: u32| f64::from(walked) / f64::from(steps);
        assert!(
            share(true_steps) < 1.1 && share(cell_steps) < 0.85,
            "{} {}",
            share(true_steps),
            share(cell_steps)
        );
    }
}
