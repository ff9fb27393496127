//! Distances along the walls of a maze that somebody else simulates, to compare D with.

use std::iter::repeat_with;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Walls;
use crate::env::{GroundTruth, Spec, TruePairs};
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};

/// Sample sizes for measuring D's error: goals, and starts per goal.
const ERROR_PAIRS: (usize, usize) = (48, 32);

/// Moves along the side of a cell; fewer in mazes of more than this number of moves.
const MOVES: usize = 8;
const MOST_PLACES: usize = 1 << 18;

/// True distances in moves, along, across or diagonally, of a fraction of a cell. How many steps an
/// agent takes for one is not known.
pub struct WallsTruth<'a> {
    walls: &'a Walls,
    spec: &'a Spec,
    /// Moves along the side of a cell.
    moves: usize,
    search: StepSearch,
    width: usize,
    /// Where bodies have room: in the middle of cells.
    places: Vec<Cell>,
}

impl<'a> WallsTruth<'a> {
    /// Creates the true distances of a maze in which the first two components of goals are
    /// positions; `None` if it has no free cell.
    pub fn new(walls: &'a Walls, spec: &'a Spec) -> Option<Self> {
        let moves = (MOST_PLACES / walls.cells()).isqrt().clamp(1, MOVES);
        let width = moves * walls.columns();
        let count = width * moves * walls.is_wall.len();
        let is_free = |i: usize| !walls.is_wall[i / width / moves][i % width / moves];
        let free: Vec<bool> = (0..count).map(is_free).collect();
        let is_middle = |at: usize| (moves / 4..moves - moves / 4).contains(&(at % moves));
        let places: Vec<Cell> = (0..count)
            .filter(|i| free[*i] && is_middle(i % width) && is_middle(i / width))
            .map(|i| Cell::new(i % width, i / width))
            .collect();
        let has_place = !places.is_empty();
        has_place.then(|| {
            let map = Grid::new("walls", width, free, Vec::new(), Vec::new());
            Self { walls, spec, moves, search: StepSearch::new(&map), width, places }
        })
    }

    /// Returns the goal in the middle of a place, with the other components as usual.
    fn goal(&self, place: Cell) -> Vec<f32> {
        let usual = self.spec.achieved.iter().map(|i| self.spec.state_centre[*i]);
        let at = [place.x, place.y].map(|at| (at as f32 + 0.5) / self.moves as f32 - 0.5);
        let position = (0..2).map(|axis| self.walls.first[axis] + at[axis] * self.walls.cell[axis]);
        position.chain(usual.skip(2)).collect()
    }

    /// Returns the usual state at a place.
    fn state(&self, place: Cell) -> Vec<f32> {
        let mut state = self.spec.state_centre.clone();
        self.spec.achieved.iter().zip(self.goal(place)).for_each(|(i, value)| state[*i] = value);
        state
    }
}

impl GroundTruth for WallsTruth<'_> {
    fn is_in_steps(&self) -> bool {
        false
    }

    /// Nothing, as steps are not known.
    fn steps(&mut self, _: &[f32], _: &[f32], _: u32) -> Option<Vec<Option<u32>>> {
        None
    }

    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs> {
        let (goals, starts) = ERROR_PAIRS;
        let side = self.walls.cell_size() / self.moves as f32;
        let reached = (self.spec.goal_radius / side) as u32;
        let mut of_goal = || {
            let draw = |rng: &mut ChaCha8Rng| self.places[rng.random_range(0..self.places.len())];
            let goal = draw(rng);
            let starts: Vec<Cell> = (0..starts).map(|_| draw(rng)).collect();
            let moves = self.search.steps_from(goal);
            let far = starts.iter().map(|at| (*at, moves[at.y * self.width + at.x]));
            let far: Vec<(Cell, u32)> =
                far.filter(|(_, moves)| (reached + 1..UNREACHABLE).contains(moves)).collect();
            TruePairs {
                goal: self.goal(goal),
                states: far.iter().flat_map(|(at, _)| self.state(*at)).collect(),
                steps: far.iter().map(|(_, moves)| moves - reached).collect(),
                near: vec![false; far.len()],
            }
        };
        repeat_with(&mut of_goal).take(goals).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::tests::positions;

    #[test]
    fn distances_lead_around_the_walls() {
        // A wall between two long corridors, which are joined at the right; y points upwards.
        let wall = [true, true, true, true, false];
        let walls = Walls {
            is_wall: vec![vec![false; 5], wall.to_vec(), vec![false; 5]],
            first: [-4.0, 2.0],
            cell: [2.0, -2.0],
        };
        let spec = positions(&[(0.0, 6.0), (0.0, 4.0)]);
        let mut truth = WallsTruth::new(&walls, &spec).expect("it has free cells");
        let pairs = truth.pairs(&mut ChaCha8Rng::seed_from_u64(0));
        assert_eq!(pairs.len(), ERROR_PAIRS.0);
        let mut around = 0;
        for TruePairs { goal, states, steps, .. } in &pairs {
            assert!(walls.cell_at([goal[0], goal[1]]).is_some_and(|cell| !walls.is_wall(cell)));
            for (state, moves) in states.chunks_exact(2).zip(steps) {
                let [across, along] = [0, 1].map(|i| (state[i] - goal[i]).abs() / 0.25);
                let straight = across.max(along) - 4.0;
                assert!(*moves as f32 >= straight, "{state:?} {goal:?}: {moves}");
                if state[0] < -3.0 && goal[0] < -3.0 && state[1] * goal[1] < 0.0 {
                    // To the fifth column and back.
                    assert!((50..70).contains(moves), "{state:?} {goal:?}: {moves}");
                    around += 1;
                }
            }
        }
        assert!(around > 10, "{around}");
        let full = Walls { is_wall: vec![vec![true; 3]; 3], ..walls.clone() };
        assert!(WallsTruth::new(&full, &spec).is_none());
    }
}
