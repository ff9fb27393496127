//! Evaluation tasks: pairs of cells at known distances.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::map::{Cell, Grid, ScenarioTask, StepSearch, UNREACHABLE};

/// Distances at which a map is evaluated.
const DISTANCES: usize = 6;

/// The farthest of them, as a share of the map's diameter.
const FARTHEST: f64 = 0.9;

/// Starts tried for one task before its distance is given up.
const TRIES: usize = 400;

/// From a cell to another, and how far that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Task {
    /// Where the agent starts (in the cell's middle).
    pub start: Cell,
    /// Where it has to go (the cell's middle).
    pub goal: Cell,
    /// Shortest number of steps.
    pub shortest: u32,
    /// Which distance it belongs to.
    pub group: usize,
}

impl Task {
    /// Steps within which the goal has to be reached.
    pub fn budget(&self) -> u32 {
        (3 * self.shortest).max(500)
    }
}

/// Tasks in groups of one distance each.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSet {
    /// Steps that stand for each group.
    pub distances: Vec<f64>,
    /// The tasks, group by group.
    pub tasks: Vec<Task>,
}

impl TaskSet {
    /// `per_distance` random tasks at each of six distances, the farthest at 0.9 of the diameter, each to within one
    /// step. Distances that the map does not have are left out.
    pub fn sample(map: &Grid, diameter: u32, per_distance: usize, rng: &mut ChaCha8Rng) -> Self {
        let mut search = StepSearch::new(map);
        let components = search.components(map);
        let cells: Vec<Cell> = components.largest_cells(map).collect();
        let mut set = Self { distances: Vec::new(), tasks: Vec::new() };
        for i in 1..=DISTANCES {
            let distance = (FARTHEST * f64::from(diameter) * i as f64 / DISTANCES as f64).round() as u32;
            if distance == 0 || set.distances.contains(&f64::from(distance)) {
                continue;
            }
            let group = set.distances.len();
            let tasks = (0..per_distance).filter_map(|_| {
                let (start, goal, shortest) = draw(map, &mut search, &cells, distance, rng)?;
                Some(Task { start, goal, shortest, group })
            });
            set.tasks.extend(tasks);
            set.distances.push(f64::from(distance));
        }
        set
    }

    /// `count` tasks of a scenario, evenly spaced through it, in six ranges of shortest steps. Tasks without a way are
    /// left out.
    pub fn from_scenario(map: &Grid, scenario: &[ScenarioTask], count: usize) -> Self {
        let mut search = StepSearch::new(map);
        let count = count.clamp(1, scenario.len());
        let chosen = (0..count).map(|i| scenario[i * scenario.len() / count]);
        let mut tasks: Vec<Task> = chosen
            .map(|t| Task { start: t.start, goal: t.goal, shortest: search.from(t.start)[map.index(t.goal)], group: 0 })
            .filter(|t| t.shortest != UNREACHABLE)
            .collect();
        tasks.sort_by_key(|t| t.shortest);
        let groups = DISTANCES.min(tasks.len());
        let mut distances = Vec::new();
        for group in 0..groups {
            let range = group * tasks.len() / groups..(group + 1) * tasks.len() / groups;
            let own = &mut tasks[range];
            own.iter_mut().for_each(|t| t.group = group);
            distances.push(own.iter().map(|t| f64::from(t.shortest)).sum::<f64>() / own.len() as f64);
        }
        Self { distances, tasks }
    }
}

/// A random pair of cells whose distance is `distance` to within one step.
fn draw(
    map: &Grid,
    search: &mut StepSearch,
    cells: &[Cell],
    distance: u32,
    rng: &mut ChaCha8Rng,
) -> Option<(Cell, Cell, u32)> {
    for _ in 0..TRIES {
        let start = cells[rng.random_range(0..cells.len())];
        let steps = search.from(start);
        let fitting: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].abs_diff(distance) <= 1).collect();
        if !fitting.is_empty() {
            let goal = fitting[rng.random_range(0..fitting.len())];
            return Some((start, map.cell(goal), steps[goal]));
        }
    }
    None
}
