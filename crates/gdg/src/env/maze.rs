//! The point maze: continuous positions on a grid map, the setting of SoRB (Eysenbach et al. 2019).

mod probe_grid;
mod tasks;

use std::any::Any;
use std::sync::{Arc, OnceLock};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};

use super::{
    Abilities, Change, Drawn, Editable, EnvError, EnvSettings, Environment, Episodes, Evaluated,
    Explored, Goals, GroundTruth, MazeScene, Probes, Recorded, Region, Restart, Spec,
    StraightAction, Task, TaskSet, WorldKind, WorldScene,
};
use crate::map::{
    Cell, Components, Diameter, Grid, MapScale, Ogbench, ScenarioTask, fingerprint, parse_map,
    print_ascii,
};
use crate::store::{Store, StoreError};
use crate::text::{counted, safe_file_name};
pub use probe_grid::ProbeGrid;

pub const KIND: WorldKind = WorldKind {
    name: NAME,
    about: "a point on a grid map that slides along walls",
    create: None,
    open: None,
    load: |store, _| Ok(Box::new(PointMaze::load(store)?)),
    defaults: &[],
};

const NAME: &str = "maze";

/// Where checkpoints have the map's scale, unless that is the default.
const SCALE: &str = "map_scale";
const SCENARIO: &str = "scenario";

/// Sub-steps per step; each moves one axis after the other.
const SUBSTEPS: usize = 10;

/// Positions closer than this, in cells, count as the same.
const POSITION_TOLERANCE_CELLS: f32 = 1e-3;

/// Changed cells closer together than this share a box of the region of an edit.
const CHANGED_GAP_CELLS: f32 = 8.0;

/// Memory per cell: searches, visits, components, rendering.
const BYTES_PER_CELL: u64 = 120;

/// Agents as points on a map; state and goal are the position (x, y) in cells, y down.
#[derive(Clone)]
pub struct PointMaze {
    map: Arc<Grid>,
    spec: Spec,
    settings: EnvSettings,
    /// `(agents, 2)`.
    positions: Vec<f32>,
    /// Free cells by connected component, and each cell's component: tasks are drawn within one
    /// component.
    components: Arc<Vec<Vec<Cell>>>,
    component_of: Arc<Vec<Option<u32>>>,
    largest: u32,
    /// Cached diameter; computing it takes seconds on large maps.
    diameter: Arc<OnceLock<Diameter>>,
    /// Tasks to evaluate on instead of random ones.
    scenario: Arc<[ScenarioTask]>,
}

impl PointMaze {
    /// Creates a maze with `agents` agents, all at the first free cell of the largest component.
    ///
    /// # Panics
    /// Panics if the map has no free cell; parsers reject such maps.
    pub fn new(map: Arc<Grid>, agents: usize) -> Self {
        let components = Components::of(&map);
        let mut cells = vec![Vec::new(); components.sizes.len()];
        for cell in map.free_cells() {
            if let Some(component) = components.of_cell[map.index(cell)] {
                cells[component as usize].push(cell);
            }
        }
        let largest = components.largest();
        let first = cells[largest as usize][0].centre();
        // One scale for both axes, so that a step has the same length along both.
        let half = map.width().max(map.height()) as f32 / 2.0;
        let spec = Spec {
            state_centre: vec![map.width() as f32 / 2.0, map.height() as f32 / 2.0],
            state_half_range: vec![half; 2],
            change_scale: vec![1.0; 2],
            achieved: vec![0, 1],
            action_dim: 2,
            goal_radius: map.scale().goal_radius,
            position_scale: Some(map.scale().cell as f32),
            contacts: Vec::new(),
            time_limit: None,
        };
        Self {
            spec,
            settings: EnvSettings::default(),
            positions: first.repeat(agents),
            components: Arc::new(cells),
            component_of: Arc::new(components.of_cell),
            largest,
            diameter: Arc::default(),
            scenario: Arc::from([]),
            map,
        }
    }

    pub fn downcast_ref(world: &dyn Environment) -> Option<&Self> {
        (world as &dyn Any).downcast_ref()
    }

    pub fn downcast_mut(world: &mut dyn Environment) -> Option<&mut Self> {
        (world as &mut dyn Any).downcast_mut()
    }

    /// Sets the scenario whose tasks replace random ones in evaluation.
    pub fn set_scenario(&mut self, tasks: Vec<ScenarioTask>) {
        self.scenario = tasks.into();
    }

    /// Returns a replacement for this maze on another map, with the same settings and without
    /// agents; scenario and scale are kept if the map has the same size.
    #[must_use]
    pub fn with_map(&self, map: Arc<Grid>) -> Self {
        let scale = self.map.scale();
        let is_same_size = (map.width(), map.height()) == self.size();
        let map = if is_same_size && map.scale() != scale {
            Arc::new(Grid::clone(&map).with_scale(scale))
        } else {
            map
        };
        let scenario = if is_same_size { self.scenario.clone() } else { Arc::from([]) };
        Self { settings: self.settings, scenario, ..Self::new(map, 0) }
    }

    fn size(&self) -> (usize, usize) {
        (self.map.width(), self.map.height())
    }

    fn benchmark(&self) -> Option<Ogbench> {
        self.map.scale().benchmark
    }

    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Returns the map's diameter; the first call takes seconds on large maps.
    pub fn diameter(&self) -> Diameter {
        *self.diameter.get_or_init(|| Diameter::compute(&self.map))
    }

    /// Draws `per_distance` random tasks at each of `distances` in steps, each to within one step;
    /// a distance that does not occur on the map has no tasks.
    pub fn tasks_at(
        &self,
        distances: &[u32],
        per_distance: usize,
        rng: &mut ChaCha8Rng,
    ) -> TaskSet {
        let cells = &self.components[self.largest as usize];
        tasks::at(distances, &self.map, cells, self.diameter(), per_distance, rng)
    }

    /// Returns the map's own task (see [`Episodes::default_task`]), or else one from its first
    /// start, or first free cell, to the cell farthest from it.
    pub fn longest_task(&self) -> Task {
        self.default_task().unwrap_or_else(|| tasks::longest(&self.map))
    }

    fn load(store: &Store) -> Result<Self, StoreError> {
        // The name comes from a file and becomes part of other file names, so it must not contain a
        // path.
        let name = safe_file_name(store.text("map_name")?);
        let map = parse_map(&name, store.text("map")?.as_bytes());
        let map = map.map_err(|e| StoreError::inconsistent(e.to_string()))?.named(&name);
        let scale: MapScale = store.json(SCALE)?;
        if !scale.is_valid() {
            return Err(StoreError::inconsistent("the map has an impossible scale"));
        }
        // Earlier checkpoints have none.
        let scenario: Vec<ScenarioTask> = store.json(SCENARIO).unwrap_or_default();
        let is_inside = |cell: Cell| cell.x < map.width() && cell.y < map.height();
        let fits = scenario.iter().all(|task| is_inside(task.start) && is_inside(task.goal));
        StoreError::unless(fits, "its scenario does not fit its map")?;
        let scenario = scenario.into();
        Ok(Self { scenario, ..Self::new(Arc::new(map.with_scale(scale)), 0) })
    }

    fn component_at(&self, agent: usize) -> Option<u32> {
        let cell =
            Cell::new(self.positions[2 * agent] as usize, self.positions[2 * agent + 1] as usize);
        self.component_of[self.map.index(cell)]
    }

    fn random_position(&self, component: u32, rng: &mut ChaCha8Rng) -> [f32; 2] {
        Self::random_position_in(&self.components[component as usize], rng)
    }

    fn random_position_in(cells: &[Cell], rng: &mut ChaCha8Rng) -> [f32; 2] {
        let cell = cells[rng.random_range(0..cells.len())];
        // Stays inside the cell even after rounding at coordinates of a few thousand.
        let mut inside = || rng.random::<f32>() * 0.998 + 0.001;
        [cell.x as f32 + inside(), cell.y as f32 + inside()]
    }

    /// Places an agent at a position, or in the free cell nearest to it.
    pub fn put(&mut self, agent: usize, [x, y]: [f32; 2]) {
        let near = || Some(self.map.nearest_free(Cell::new(x as usize, y as usize))?.centre());
        let free = self.map.is_free_at(x, y).then_some([x, y]).or_else(near);
        self.positions[2 * agent..2 * agent + 2].copy_from_slice(&free.unwrap_or([x, y]));
    }
}

/// Returns where one step of action (`ax`, `ay`) takes a point at (`x`, `y`); it slides along
/// walls.
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

fn full_state_at([x, y]: [f32; 2]) -> [f64; 2] {
    [f64::from(x), f64::from(y)]
}

impl Environment for PointMaze {
    fn kind(&self) -> &'static str {
        NAME
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.positions
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        let anywhere = self.settings.restart == Restart::Anywhere;
        let position = match self.map.starts() {
            starts @ [_, ..] if !anywhere => Self::random_position_in(starts, rng),
            _ => self.random_position(self.largest, rng),
        };
        self.positions[2 * agent..2 * agent + 2].copy_from_slice(&position);
        Ok(())
    }

    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        let position = match self.map.goals() {
            [only] if self.settings.goals == Goals::Map => only.centre(),
            goals @ [_, ..] if self.settings.goals == Goals::Map => {
                goals[rng.random_range(0..goals.len())].centre()
            }
            _ => self.random_position(self.component_at(agent).unwrap_or(self.largest), rng),
        };
        goal.copy_from_slice(&position);
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        let (settings, benchmark) = (self.settings, self.benchmark());
        for (position, action) in self.positions.chunks_exact_mut(2).zip(actions.chunks_exact(2)) {
            let a = [action[0], action[1]].map(|component| settings.noisy(component, rng));
            let here = [position[0], position[1]];
            let begin = benchmark.map_or(here, |benchmark| benchmark.begin_step(here, rng));
            position.copy_from_slice(&slide(&self.map, begin, a));
        }
        Ok(())
    }

    /// Places all agents at the first free cell of the largest component.
    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        let first = self.components[self.largest as usize][0].centre();
        Ok(Box::new(Self { positions: first.repeat(agents), ..self.clone() }))
    }

    fn configure(&mut self, settings: &EnvSettings) {
        self.settings = *settings;
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool, EnvError> {
        self.put(agent, [full_state[0] as f32, full_state[1] as f32]);
        Ok(true)
    }

    fn abilities(&self) -> Abilities<'_> {
        Abilities {
            recorded: Some(self),
            episodes: Some(self),
            evaluated: Some(self),
            explored: Some(self),
            editable: Some(self),
            drawn: Some(self),
        }
    }
}

impl Recorded for PointMaze {
    fn title(&self) -> &str {
        self.map.name()
    }

    fn fingerprint(&self) -> Option<String> {
        Some(fingerprint(&self.map))
    }

    fn scenario(&self) -> Option<String> {
        let tasks = || crc32fast::hash(format!("{:?}", self.scenario).as_bytes());
        (!self.scenario.is_empty()).then(|| format!("{:08x}", tasks()))
    }

    fn facts(&self) -> Map<String, Value> {
        let (map, diameter) = (&self.map, self.diameter());
        let mut facts = json!({
            "name": map.name(),
            "width": map.width(),
            "height": map.height(),
            "free_cells": map.free_count(),
            "diameter_steps": diameter.steps,
            // Whether the diameter is exact, or only the farthest pair found.
            "diameter_exact": diameter.exact,
        });
        let scale = map.scale();
        if scale != MapScale::default() {
            facts["cells_per_block"] = json!(scale.cell);
            facts["margin_cells"] = json!(scale.margin);
            facts["goal_radius_cells"] = json!(scale.goal_radius);
        }
        if let Some(tasks) = Recorded::scenario(self) {
            facts["scenario"] = json!(tasks);
        }
        Map::from_iter([("map".to_owned(), facts)])
    }

    fn own_state(&self, state: &mut [f32]) {
        if self.benchmark().is_some() {
            let cells = |length: f32| (length - Ogbench::ORIGIN) / Ogbench::CELL_LENGTH;
            state.iter_mut().for_each(|component| *component = cells(*component));
        }
    }

    fn recorded_state(&self, state: &mut [f32]) {
        if self.benchmark().is_some() {
            let length = |cells: f32| cells * Ogbench::CELL_LENGTH + Ogbench::ORIGIN;
            state.iter_mut().for_each(|component| *component = length(*component));
        }
    }

    fn save(&self, store: &mut Store) {
        store.put_text("map_name", self.map.name());
        store.put_text("map", print_ascii(&self.map));
        store.put_text(SCALE, json!(self.map.scale()).to_string());
        store.put_text(SCENARIO, json!(self.scenario).to_string());
    }

    fn memory_bytes(&self) -> u64 {
        self.map.free().len() as u64 * BYTES_PER_CELL
    }
}

impl Episodes for PointMaze {
    fn stays(&self, agent: usize) -> bool {
        let component = self.component_at(agent);
        self.map.starts().iter().any(|start| self.component_of[self.map.index(*start)] == component)
    }

    fn episode_steps(&self) -> Option<u32> {
        self.benchmark().map(|_| Ogbench::EPISODE_STEPS)
    }

    /// Returns the task from the map's first start to its first goal.
    fn default_task(&self) -> Option<Task> {
        tasks::marked(&self.map)
    }
}

impl Evaluated for PointMaze {
    /// Returns tasks of the scenario if there is one: six times `per_group`, evenly spaced through
    /// it. Otherwise draws `per_group` of each of the benchmark's, or random tasks at six distances,
    /// the farthest at 0.9 of the map's diameter.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet, EnvError> {
        if !self.scenario.is_empty() {
            return Ok(tasks::from_scenario(&self.map, &self.scenario, per_group));
        }
        Ok(match self.benchmark() {
            Some(benchmark) => benchmark.draw_tasks(&self.map, per_group, rng),
            None => self.tasks_at(&tasks::distances(self.diameter()), per_group, rng),
        })
    }

    /// Returns those of paths on the map; none if there are teleports.
    fn ground_truth(&self) -> Option<Box<dyn GroundTruth + '_>> {
        if self.benchmark().is_some_and(|benchmark| !benchmark.exits().is_empty()) {
            return None;
        }
        Some(Box::new(tasks::MazeGroundTruth::new(
            &self.map,
            &self.components[self.largest as usize],
        )))
    }

    fn straight_action(&self) -> Option<StraightAction> {
        Some(|state, goal, action| {
            let way = [goal[0] - state[0], goal[1] - state[1]];
            let longer = way[0].abs().max(way[1].abs()).max(1.0);
            action.copy_from_slice(&way.map(|along| along / longer));
        })
    }
}

impl Explored for PointMaze {
    fn places(&self) -> usize {
        self.map.free().len()
    }

    fn place(&self, state: &[f32]) -> usize {
        self.map.index(Cell::new(state[0] as usize, state[1] as usize))
    }

    /// Returns the visited share of the cells of all components that have been visited at all: of
    /// what is within reach.
    fn coverage(&self, visits: &[u32]) -> f64 {
        let seen =
            |cells: &[Cell]| cells.iter().filter(|cell| visits[self.map.index(**cell)] > 0).count();
        let counts = self.components.iter().map(|cells| (seen(cells), cells.len()));
        let begun = counts.filter(|(seen, _)| *seen > 0);
        let (seen, all) = begun.fold((0, 0), |(seen, all), (own, of)| (seen + own, all + of));
        seen as f64 / all.max(1) as f64
    }
}

impl Editable for PointMaze {
    fn change_from(&self, before: &dyn Environment) -> Result<Change, EnvError> {
        let kind = before.kind();
        let other = || EnvError::Unfit(format!("the run uses a world of kind {kind}, not {NAME}"));
        let before = Self::downcast_ref(before).ok_or_else(other)?;
        let [own, of_run] =
            [self, before].map(|maze| format!("{} x {}", maze.size().0, maze.size().1));
        if own != of_run {
            return Err(EnvError::Unfit(format!(
                "the map is {own}, but the run's map is {of_run}"
            )));
        }
        let cells = || self.map.free().iter().zip(before.map.free());
        let changed = |to: bool| cells().filter(|(new, old)| new != old && **new == to).count();
        let (walled, opened, pieces) = (changed(false), changed(true), self.components.len());
        let mut region = Region::nothing();
        for (i, _) in cells().enumerate().filter(|(_, (new, old))| new != old) {
            let (x, y) = ((i % self.map.width()) as f32, (i / self.map.width()) as f32);
            region.add(&[x, y], &[x + 1.0, y + 1.0], CHANGED_GAP_CELLS);
        }
        Ok(Change {
            may_lengthen: walled > 0,
            region,
            summary: match (walled as u64, opened as u64) {
                // Only starts or goals changed.
                (0, 0) => [(self.map.starts(), "start"), (self.map.goals(), "goal")]
                    .map(|(cells, what)| counted(cells.len() as u64, what))
                    .join(", "),
                (0, opened) => format!("{} opened", counted(opened, "cell")),
                (walled, 0) => format!("{} walled", counted(walled, "cell")),
                (walled, opened) => format!("{} walled, {opened} opened", counted(walled, "cell")),
            },
            warning: (pieces > 1).then(|| format!("{pieces} disconnected components")),
            facts: Map::from_iter([
                ("map".to_owned(), json!(self.map.name())),
                ("walled".to_owned(), json!(walled)),
                ("opened".to_owned(), json!(opened)),
            ]),
        })
    }

    /// Checks that the step reproduces `next`; with action noise, only that both positions are
    /// free.
    fn is_possible(&self, state: &[f32], action: &[f32], next: &[f32]) -> bool {
        let free = |at: &[f32]| self.map.is_free_at(at[0], at[1]);
        if !free(state) || !free(next) {
            return false;
        }
        if self.settings.noise > 0.0 {
            return true;
        }
        let leads = |begin: [f32; 2]| {
            let reached = slide(&self.map, begin, [action[0], action[1]]);
            let off = (reached[0] - next[0]).abs().max((reached[1] - next[1]).abs());
            off < POSITION_TOLERANCE_CELLS
        };
        let here = [state[0], state[1]];
        match self.benchmark().map_or(&[][..], |benchmark| benchmark.exits_from(here)) {
            [] => leads(here),
            exits => exits.iter().any(|exit| leads(Ogbench::middle(*exit))),
        }
    }
}

impl Drawn for PointMaze {
    fn scene(&self, visits: &Arc<Vec<u32>>) -> WorldScene {
        WorldScene::Maze(MazeScene { map: self.map.clone(), visits: visits.clone() })
    }

    fn probes(&self, goal_before: Option<&[f32]>) -> Option<Probes> {
        Some(probe_grid::points(&self.map, goal_before))
    }
}
