//! The point maze: continuous positions on a grid map, the setting of SoRB (Eysenbach et al. 2019).

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Environment, Spec};
use crate::map::{Cell, Grid, StepSearch};

/// A step is so many sub-steps; in each, the axes move one after the other.
const SUBSTEPS: usize = 10;

/// Goal reached below this Euclidean distance, in cells.
const GOAL_RADIUS_CELLS: f32 = 1.0;

/// Places nearer than this are the same, in cells.
const SAME_PLACE_CELLS: f32 = 1e-3;

/// Agents as points on a map; state and goal are the position (x, y) in cells, y down.
#[derive(Clone)]
pub struct PointMaze {
    map: Arc<Grid>,
    spec: Spec,
    /// Standard deviation of the noise added to every action; 0 for none.
    action_noise: f32,
    /// `(agents, 2)`.
    positions: Vec<f32>,
    /// Free cells by connected component, and each cell's component: tasks are drawn within one component.
    components: Arc<Vec<Vec<Cell>>>,
    component_of: Arc<Vec<Option<u32>>>,
    largest: u32,
    /// Cells that agents restart in; anywhere in the largest component if there is none.
    starts: Vec<Cell>,
}

impl PointMaze {
    /// A maze of `agents` agents, all at the first free cell of the largest component.
    ///
    /// # Panics
    /// If the map has no free cell: parsers refuse such maps.
    pub fn new(map: Arc<Grid>, agents: usize, action_noise: f32) -> Self {
        let components = StepSearch::new(&map).components(&map);
        let mut cells = vec![Vec::new(); components.sizes.len()];
        for cell in map.free_cells() {
            if let Some(component) = components.of_cell[map.index(cell)] {
                cells[component as usize].push(cell);
            }
        }
        let largest = components.largest();
        let first = cells[largest as usize][0].centre();
        // One scale for both axes: a step is as long to the right as it is down.
        let half = map.width().max(map.height()) as f32 / 2.0;
        let spec = Spec {
            state_centre: vec![map.width() as f32 / 2.0, map.height() as f32 / 2.0],
            state_half_range: vec![half; 2],
            achieved: vec![0, 1],
            action_dim: 2,
            goal_radius: GOAL_RADIUS_CELLS,
            goals_are_positions: true,
        };
        Self {
            spec,
            action_noise,
            positions: first.repeat(agents),
            components: Arc::new(cells),
            component_of: Arc::new(components.of_cell),
            largest,
            starts: Vec::new(),
            map,
        }
    }

    /// The same world with all restarts in the map's starts.
    #[must_use]
    pub fn from_starts(self) -> Self {
        Self { starts: self.map.starts().to_vec(), ..self }
    }

    /// The same world for other agents, all at the first free cell.
    #[must_use]
    pub fn with_agents(&self, agents: usize) -> Self {
        let first = self.components[self.largest as usize][0].centre();
        Self { positions: first.repeat(agents), ..self.clone() }
    }

    /// The map that the agents move on.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Whether a step could have led from `state` by `action` to `next` here. With noise of the environment's own,
    /// whether both are free places.
    pub fn possible(&self, state: &[f32], action: &[f32], next: &[f32]) -> bool {
        let free = |at: &[f32]| self.map.is_free_at(at[0], at[1]);
        if !free(state) || !free(next) {
            return false;
        }
        let reached = slide(&self.map, [state[0], state[1]], [action[0], action[1]]);
        self.action_noise > 0.0 || (reached[0] - next[0]).abs().max((reached[1] - next[1]).abs()) < SAME_PLACE_CELLS
    }

    fn random_position(&self, component: u32, rng: &mut ChaCha8Rng) -> [f32; 2] {
        Self::random_position_in(&self.components[component as usize], rng)
    }

    fn random_position_in(cells: &[Cell], rng: &mut ChaCha8Rng) -> [f32; 2] {
        let cell = cells[rng.random_range(0..cells.len())];
        // Below 1 even after rounding to the precision of a coordinate of some thousands.
        let mut inside = || rng.random::<f32>() * 0.998 + 0.001;
        [cell.x as f32 + inside(), cell.y as f32 + inside()]
    }
}

/// Where a point at (`x`, `y`) comes to within one step of action (`ax`, `ay`): it slides along walls.
fn slide(map: &Grid, [mut x, mut y]: [f32; 2], [ax, ay]: [f32; 2]) -> [f32; 2] {
    let (dx, dy) = (ax / SUBSTEPS as f32, ay / SUBSTEPS as f32);
    for _ in 0..SUBSTEPS {
        if map.is_free_at(x + dx, y) {
            x += dx;
        }
        if map.is_free_at(x, y + dy) {
            y += dy;
        }
    }
    [x, y]
}

impl Environment for PointMaze {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn agents(&self) -> usize {
        self.positions.len() / 2
    }

    fn states(&self) -> &[f32] {
        &self.positions
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) {
        let position = match &self.starts[..] {
            [] => self.random_position(self.largest, rng),
            starts => Self::random_position_in(starts, rng),
        };
        self.positions[2 * agent..2 * agent + 2].copy_from_slice(&position);
    }

    fn place(&mut self, agent: usize, state: &[f32]) {
        let mut position = [state[0], state[1]];
        if !self.map.is_free_at(position[0], position[1]) {
            let cell = Cell::new(position[0].max(0.0) as usize, position[1].max(0.0) as usize);
            if let Some(free) = self.map.nearest_free(cell) {
                position = free.centre();
            }
        }
        self.positions[2 * agent..2 * agent + 2].copy_from_slice(&position);
    }

    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        let cell = Cell::new(self.positions[2 * agent] as usize, self.positions[2 * agent + 1] as usize);
        let component = self.component_of[self.map.index(cell)].unwrap_or(self.largest);
        goal.copy_from_slice(&self.random_position(component, rng));
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) {
        let noise = self.action_noise;
        for (position, action) in self.positions.chunks_exact_mut(2).zip(actions.chunks_exact(2)) {
            let mut a = [action[0].clamp(-1.0, 1.0), action[1].clamp(-1.0, 1.0)];
            if noise > 0.0 {
                for component in &mut a {
                    let sample: f32 = StandardNormal.sample(rng);
                    *component = (*component + noise * sample).clamp(-1.0, 1.0);
                }
            }
            position.copy_from_slice(&slide(&self.map, [position[0], position[1]], a));
        }
    }
}
