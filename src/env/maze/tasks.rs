//! Evaluation tasks: pairs of cells at known distances.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::full_state_at;
use crate::env::{Task, TaskSet};
use crate::map::{Cell, Grid, ScenarioTask, StepSearch, UNREACHABLE};

/// Number of distances at which a map is evaluated.
const DISTANCE_GROUPS: usize = 6;

/// The farthest of these distances, as a share of the map's diameter.
const MAX_DISTANCE_SHARE: f64 = 0.9;

/// Starts tried per task before giving up on its distance.
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

/// Draws `per_distance` random tasks at each of six distances, each to within one step, the farthest at 0.9 of the
/// diameter. Skips distances that do not occur on the map.
pub fn at_distances(map: &Grid, diameter: u32, per_distance: usize, rng: &mut ChaCha8Rng) -> TaskSet {
    let mut search = StepSearch::new(map);
    let components = search.components(map);
    let cells: Vec<Cell> = components.largest_cells(map).collect();
    let mut set = TaskSet::default();
    for i in 1..=DISTANCE_GROUPS {
        let distance = (MAX_DISTANCE_SHARE * f64::from(diameter) * i as f64 / DISTANCE_GROUPS as f64).round() as u32;
        if distance == 0 || set.distances.contains(&Some(f64::from(distance))) {
            continue;
        }
        let group = set.distances.len();
        let tasks = (0..per_distance).filter_map(|_| {
            let (start, goal, shortest) = draw(map, &mut search, &cells, distance, rng)?;
            Some(task(start, goal, shortest, group))
        });
        set.tasks.extend(tasks);
        set.distances.push(Some(f64::from(distance)));
    }
    set
}

/// Picks tasks evenly spaced through a scenario, `per_group` in each of six ranges of shortest-path length. Skips
/// unsolvable tasks.
pub fn from_scenario(map: &Grid, scenario: &[ScenarioTask], per_group: usize) -> TaskSet {
    let mut search = StepSearch::new(map);
    let count = (DISTANCE_GROUPS * per_group).clamp(1, scenario.len());
    let chosen = (0..count).map(|i| scenario[i * scenario.len() / count]);
    let mut found: Vec<(u32, Cell, Cell)> = chosen
        .map(|t| (search.steps_from(t.start)[map.index(t.goal)], t.start, t.goal))
        .filter(|(shortest, ..)| *shortest != UNREACHABLE)
        .collect();
    found.sort_by_key(|(shortest, ..)| *shortest);
    let groups = DISTANCE_GROUPS.min(found.len());
    let mut set = TaskSet::default();
    for group in 0..groups {
        let own = &found[group * found.len() / groups..(group + 1) * found.len() / groups];
        set.tasks.extend(own.iter().map(|(shortest, start, goal)| task(*start, *goal, *shortest, group)));
        let mean = own.iter().map(|(shortest, ..)| f64::from(*shortest)).sum::<f64>() / own.len() as f64;
        set.distances.push(Some(mean));
    }
    set
}

/// Returns the task from the map's first start to its first goal, if it has both and a path between them.
pub fn marked(map: &Grid) -> Option<Task> {
    let (start, goal) = (*map.starts().first()?, *map.goals().first()?);
    let steps = StepSearch::new(map).steps_from(goal)[map.index(start)];
    (steps != UNREACHABLE).then(|| task(start, goal, steps, 0))
}

/// Draws a random pair of cells whose distance is within one step of `distance`.
fn draw(
    map: &Grid,
    search: &mut StepSearch,
    cells: &[Cell],
    distance: u32,
    rng: &mut ChaCha8Rng,
) -> Option<(Cell, Cell, u32)> {
    for _ in 0..MAX_TRIES {
        let start = cells[rng.random_range(0..cells.len())];
        let steps = search.steps_from(start);
        let fitting: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].abs_diff(distance) <= 1).collect();
        if !fitting.is_empty() {
            let goal = fitting[rng.random_range(0..fitting.len())];
            return Some((start, map.cell(goal), steps[goal]));
        }
    }
    None
}
