//! Evaluation tasks: pairs of cells at known distances, in the steps of a point, and OGBench's own; and
//! the maze's true distances: the shortest paths of a point, by breadth-first search.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::full_state_at;
use crate::env::{
    BUDGET_FACTOR, GroundTruth, MAX_BUDGET_STEPS, NEAR_STEPS, Task, TaskSet, TruePairs,
};
use crate::map::{Cell, Diameter, Grid, Ogbench, PointSearch, ScenarioTask, UNREACHABLE};

const DISTANCE_GROUPS: usize = 6;

/// The farthest of these distances, as a share of the map's diameter.
const MAX_DISTANCE_SHARE: f64 = 0.9;

/// The largest of these distances, in steps: the budget of farther tasks would be too small.
const MAX_DISTANCE_STEPS: u32 = MAX_BUDGET_STEPS / BUDGET_FACTOR;

/// Goals tried per task before giving up on its distance.
const MAX_TRIES: usize = 400;

/// Returns the task from the centre of one cell to the centre of another.
fn task(start: Cell, goal: Cell, shortest: u32, group: usize) -> Task {
    Task {
        start: full_state_at(start.centre()).to_vec(),
        goal: goal.centre().to_vec(),
        shortest: Some(shortest),
        group,
    }
}

/// Returns the distances at which a map is evaluated, in steps: six, the farthest at 0.9 of the
/// diameter or 20,000 steps.
pub fn distances(diameter: Diameter) -> Vec<u32> {
    let farthest =
        (MAX_DISTANCE_SHARE * f64::from(diameter.steps)).min(f64::from(MAX_DISTANCE_STEPS));
    let distance = |i: usize| (farthest * i as f64 / DISTANCE_GROUPS as f64).round() as u32;
    (1..=DISTANCE_GROUPS).map(distance).collect()
}

/// Draws random tasks between `cells`, which are connected, at each of `distances` in steps, each
/// to within one step. A distance that does not occur has no tasks.
pub fn at(
    distances: &[u32],
    map: &Grid,
    cells: &[Cell],
    diameter: Diameter,
    per_distance: usize,
    rng: &mut ChaCha8Rng,
) -> TaskSet {
    let mut pairs = TaskPairs::new(map, cells, diameter);
    let mut set = TaskSet::default();
    for &distance in distances {
        if distance == 0 || set.distances.contains(&Some(f64::from(distance))) {
            continue;
        }
        let group = set.distances.len();
        let tasks = (0..per_distance).filter_map(|_| {
            let (start, goal, shortest) = pairs.draw(distance, rng)?;
            Some(task(start, goal, shortest, group))
        });
        set.tasks.extend(tasks);
        set.distances.push(Some(f64::from(distance)));
    }
    set
}

/// Picks tasks evenly spaced through a scenario, `per_group` in each of six ranges of shortest-path
/// length. Skips unsolvable tasks.
pub fn from_scenario(map: &Grid, scenario: &[ScenarioTask], per_group: usize) -> TaskSet {
    let mut search = PointSearch::new(map);
    let count = (DISTANCE_GROUPS * per_group).clamp(1, scenario.len());
    let chosen = (0..count).map(|i| scenario[i * scenario.len() / count]);
    let mut found: Vec<(u32, Cell, Cell)> = chosen
        .filter(|t| map.is_free(t.goal))
        .map(|t| (steps(&mut search, t.start, t.goal), t.start, t.goal))
        .filter(|(shortest, ..)| *shortest != UNREACHABLE)
        .collect();
    found.sort_by_key(|(shortest, ..)| *shortest);
    let groups = DISTANCE_GROUPS.min(found.len());
    let mut set = TaskSet::default();
    for group in 0..groups {
        let own = &found[group * found.len() / groups..(group + 1) * found.len() / groups];
        set.tasks.extend(
            own.iter().map(|(shortest, start, goal)| task(*start, *goal, *shortest, group)),
        );
        let mean =
            own.iter().map(|(shortest, ..)| f64::from(*shortest)).sum::<f64>() / own.len() as f64;
        set.distances.push(Some(mean));
    }
    set
}

/// Returns the task from the map's first start to its first goal, if it has both and a path between
/// them.
pub fn marked(map: &Grid) -> Option<Task> {
    let (start, goal) = (*map.starts().first()?, *map.goals().first()?);
    let steps = steps(&mut PointSearch::new(map), start, goal);
    (steps != UNREACHABLE).then(|| task(start, goal, steps, 0))
}

/// Returns the steps from the middle of one cell to that of another.
fn steps(search: &mut PointSearch, start: Cell, goal: Cell) -> u32 {
    search.steps_of(&[start.centre()], goal.centre())[0]
}

/// Returns the task from the map's first start, or else its first free cell, to the cell farthest
/// from it.
pub fn longest(map: &Grid) -> Task {
    let first = map.starts().first().copied().or_else(|| map.free_cells().next());
    let start = first.unwrap_or(Cell::new(0, 0));
    let mut search = PointSearch::new(map);
    let goal = search.farthest(start);
    let steps = steps(&mut search, start, goal);
    task(start, goal, steps, 0)
}

/// Draws goals, and starts at a given distance from them.
struct TaskPairs<'a> {
    map: &'a Grid,
    cells: &'a [Cell],
    search: PointSearch,
    /// No fewer steps than lead to each cell from any other, row-major.
    most: Vec<u32>,
}

impl<'a> TaskPairs<'a> {
    fn new(map: &'a Grid, cells: &'a [Cell], diameter: Diameter) -> Self {
        let mut most = vec![UNREACHABLE; map.free().len()];
        let mut search = PointSearch::new(map);
        if let Some((middle, radius)) = diameter.middle {
            let steps = search.steps_to(middle.centre());
            // No way is longer than one through the middle, which is the goal radius farther away.
            let more = map.scale().goal_radius.ceil() as u32 + radius;
            cells.iter().for_each(|cell| {
                most[map.index(*cell)] = steps(cell.centre()).saturating_add(more);
            });
        }
        Self { map, cells, search, most }
    }

    /// Draws a random pair of cells, start and goal, whose distance is within one step of
    /// `distance`.
    fn draw(&mut self, distance: u32, rng: &mut ChaCha8Rng) -> Option<(Cell, Cell, u32)> {
        for _ in 0..MAX_TRIES {
            let goal = self.cells[rng.random_range(0..self.cells.len())];
            // Most goals without a start need no search.
            if self.most[self.map.index(goal)] < distance - 1 {
                continue;
            }
            let fitting = self.search.rings(goal, distance - 1..=distance + 1);
            if !fitting.is_empty() {
                let (start, steps) = fitting[rng.random_range(0..fitting.len())];
                return Some((start, goal, steps));
            }
        }
        None
    }
}

impl Ogbench {
    /// Draws `per_task` starts and goals of each of its tasks, every task a group.
    pub(super) fn draw_tasks(self, map: &Grid, per_task: usize, rng: &mut ChaCha8Rng) -> TaskSet {
        let mut set = TaskSet::default();
        let mut search = PointSearch::new(map);
        for (group, ends) in self.tasks().into_iter().enumerate() {
            let tasks: Vec<Task> = (0..per_task)
                .map(|_| {
                    let [start, goal] = ends.map(|block| {
                        let noise = -Self::NOISE_CELLS..=Self::NOISE_CELLS;
                        Self::middle(block).map(|middle| middle + rng.random_range(noise.clone()))
                    });
                    // Of paths through teleports, no length is known.
                    let shortest =
                        self.entries().is_empty().then(|| search.steps_of(&[start], goal)[0]);
                    let shortest = shortest.filter(|steps| *steps != UNREACHABLE);
                    Task {
                        start: full_state_at(start).to_vec(),
                        goal: goal.to_vec(),
                        shortest,
                        group,
                    }
                })
                .collect();
            let steps: Option<Vec<f64>> =
                tasks.iter().map(|task| task.shortest.map(f64::from)).collect();
            let mean = steps.map(|steps| steps.iter().sum::<f64>() / steps.len().max(1) as f64);
            set.distances.push(mean);
            set.tasks.extend(tasks);
        }
        set
    }

    /// Returns where a step from `position` may begin: at each of the exits, if an entry is there.
    /// OGBench moves the ball at the end of the step before, but after it was observed.
    pub(super) fn exits_from(self, position: [f32; 2]) -> &'static [[usize; 2]] {
        let is_near = |entry: &[usize; 2]| {
            let [x, y] = Self::middle(*entry);
            (position[0] - x).hypot(position[1] - y) <= Self::ENTRY_CELLS
        };
        if self.entries().iter().any(is_near) { self.exits() } else { &[] }
    }

    pub(super) fn begin_step(self, position: [f32; 2], rng: &mut ChaCha8Rng) -> [f32; 2] {
        match self.exits_from(position) {
            [] => position,
            exits => Self::middle(exits[rng.random_range(0..exits.len())]),
        }
    }
}

/// Sample sizes for measuring D's error: goals, starts per goal, and near starts per goal.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

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
    use rand::SeedableRng;

    use super::*;
    use crate::map::{RandomMapKind, random};

    /// Draws a pair by searching the whole map from every goal.
    fn draw_from_whole_maps(
        map: &Grid,
        cells: &[Cell],
        distance: u32,
        rng: &mut ChaCha8Rng,
    ) -> Option<Task> {
        let mut search = PointSearch::new(map);
        for _ in 0..MAX_TRIES {
            let goal = cells[rng.random_range(0..cells.len())];
            let steps = search.steps_to(goal.centre());
            let all = map.free_cells().map(|start| (start, steps(start.centre())));
            let fitting: Vec<_> = all.filter(|(_, steps)| steps.abs_diff(distance) <= 1).collect();
            if !fitting.is_empty() {
                let (start, steps) = fitting[rng.random_range(0..fitting.len())];
                return Some(task(start, goal, steps, 0));
            }
        }
        None
    }

    #[test]
    fn bounded_searches_draw_the_same_tasks_as_searches_of_the_whole_map() {
        for (kind, size) in
            [(RandomMapKind::City, 70), (RandomMapKind::Maze, 70), (RandomMapKind::Perfect, 71)]
        {
            let map = random(kind, Some(size), 3);
            let cells: Vec<Cell> = map.free_cells().collect();
            let diameter = Diameter::compute(&map);
            // Beyond the diameter there are no tasks; just below it, few goals have a start.
            for distance in [1, 2, diameter.steps / 2, diameter.steps - 3, diameter.steps + 2] {
                let mut pairs = TaskPairs::new(&map, &cells, diameter);
                let rngs = || ChaCha8Rng::seed_from_u64(u64::from(distance));
                let (mut own, mut other) = (rngs(), rngs());
                for _ in 0..5 {
                    let drawn = pairs.draw(distance, &mut own);
                    let drawn = drawn.map(|(start, goal, steps)| task(start, goal, steps, 0));
                    let is_beyond = distance > diameter.steps + 1;
                    assert_eq!(drawn.is_none(), is_beyond, "{kind:?}, {distance}");
                    assert_eq!(drawn, draw_from_whole_maps(&map, &cells, distance, &mut other));
                    assert_eq!(own, other, "both have drawn as many random numbers");
                }
            }
        }
    }

    #[test]
    fn tasks_are_no_farther_than_their_budgets_allow() {
        let map = Grid::empty("line", 1 << 15, 1);
        let cells: Vec<Cell> = map.free_cells().collect();
        let (diameter, mut rng) = (Diameter::compute(&map), ChaCha8Rng::seed_from_u64(1));
        let set = at(&distances(diameter), &map, &cells, diameter, 2, &mut rng);
        assert_eq!(set.distances.last(), Some(&Some(f64::from(MAX_DISTANCE_STEPS))));
        assert_eq!(set.tasks.len(), 2 * DISTANCE_GROUPS);
        assert!(set.tasks.iter().all(|task| task.budget() <= MAX_BUDGET_STEPS));
        let far = task(cells[0], cells[30_000], 30_000, 0);
        assert_eq!(far.budget(), MAX_BUDGET_STEPS, "as in scenarios, and from S to G");
    }

    #[test]
    fn the_longest_task_leads_to_the_farthest_cell_within_reach() {
        let of = |text: &str| {
            let task = longest(&crate::map::parse_map("map", text.as_bytes()).expect("a map"));
            (task.start, task.goal, task.shortest)
        };
        assert_eq!(of(".S...#...\n"), (vec![1.5, 0.5], vec![4.5, 0.5], Some(3)));
        assert_eq!(of("#S#G\n"), (vec![1.5, 0.5], vec![1.5, 0.5], Some(0)));
    }

    #[test]
    fn scenarios_skip_tasks_that_an_edit_has_made_impossible() {
        let map = crate::map::parse_map("map", b"..#.\n..#.\n").expect("a map");
        let task = |start, goal| ScenarioTask { start, goal, optimal_octile: Some(1.0) };
        let (inside, wall, beyond) = (Cell::new(0, 0), Cell::new(2, 0), Cell::new(3, 1));
        let ends = [(inside, Cell::new(1, 1)), (inside, wall), (wall, inside), (inside, beyond)];
        let scenario = ends.map(|(start, goal)| task(start, goal));
        let set = from_scenario(&map, &scenario, 1);
        assert_eq!(set.tasks.len(), 1);
        assert_eq!(set.tasks[0].shortest, Some(1));
    }

    #[test]
    fn a_goal_behind_a_corner_is_reached_from_this_side_but_not_through_a_wall() {
        let map = crate::map::parse_map("corner", b"..#\n.#.\n...\n").expect("a map");
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
