//! A maze: distance fields on its map, what has been explored, facts about cells, and an agent that
//! walks to a cell.

mod exploration;
mod past;
mod walk;

use std::sync::Arc;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::pilot::{Graph, OnArrival, Pilot};
use super::{Field, RefreshTimer, SceneWorker, Shown, View, distances, pause_factor};
use crate::draw::Raster;
use crate::engine::Snapshot;
use crate::env::{Environment, MazeScene, PointMaze, Scene};
use crate::learn::{Policy, Scratch};
use crate::map::{Cell, Grid, PointSearch, StepSearch, UNREACHABLE};
use crate::train::FilmFrame;
pub use exploration::{Exploration, Knowledge};
pub use past::FilmedMap;
pub use walk::Walk;

/// Time between two steps of the walking agent.
const STEP_INTERVAL: Duration = Duration::from_millis(70);

/// A request about a maze.
#[derive(Clone, Debug)]
pub enum Request {
    /// Goal of the displayed distances and of the walking agent, and the number of this request.
    Goal(Cell, u64),
    /// Start of the walking agent; `None` for a random one.
    Start(Option<Cell>),
    /// The pixels showing the map, and the positions at which to show the actor's directions.
    Frame(Raster, Arc<Vec<[f32; 2]>>),
    /// Whether to show the actor's directions.
    Directions(bool),
    /// The cell to inspect.
    Inspect(Option<Cell>),
}

/// Information about a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellInfo {
    /// The cell.
    pub cell: Cell,
    /// D from its centre to the goal.
    pub learned: f32,
    /// The true number of steps, if the goal is reachable.
    pub truth: Option<u32>,
    /// Number of visits by agents; not known of the past.
    pub visits: Option<u32>,
}

/// What the screen shows of a maze at one moment.
#[derive(Clone, Debug, Default)]
pub struct MazeView {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<Cell>, u64),
    /// The quantity that the field shows.
    pub kind: Field,
    /// The frame of the film that the field shows instead, if any.
    pub past: Option<Arc<FilmFrame>>,
    /// The value of each pixel, row by row; NaN at walls.
    pub field: Arc<Vec<f32>>,
    /// The largest value, at least 1.
    pub farthest: f32,
    /// The pixels of the field.
    pub raster: Option<Raster>,
    /// Positions and the actor's actions there.
    pub directions: Arc<Vec<([f32; 2], [f32; 2])>>,
    /// What the agents have explored.
    pub exploration: Arc<Exploration>,
    /// The bridge graph; its places are positions.
    pub graph: Arc<Graph>,
    /// The cells, row by row, from which no path leads to the goal, although they are free. Empty
    /// if there are none.
    pub cut_off: Arc<Vec<bool>>,
    /// Waypoints ahead of the walking agent, ending at the goal.
    pub path: Vec<[f32; 2]>,
    /// The way along them, from the agent, which no wall cuts; fewer than two positions without a
    /// plan.
    pub way: Vec<[f32; 2]>,
    /// Recent positions of the walking agent, the current one last.
    pub trail: Vec<[f32; 2]>,
    /// Its current walk.
    pub walk: Walk,
    /// Information about the cell under the cursor.
    pub inspected: Option<CellInfo>,
    /// True steps from the followed exploring agent to its goal, if it is reachable.
    pub followed_steps: Option<u32>,
}

impl MazeView {
    /// Sets the waypoints ahead of an agent at `at`, and the way along them on `map`.
    pub fn set_plan(&mut self, map: &Grid, at: [f32; 2], path: Vec<[f32; 2]>) {
        let stops: Vec<[f32; 2]> = [at].into_iter().chain(path.iter().copied()).collect();
        (self.way, self.path) = (walk::way_along(map, &stops), path);
    }
}

/// Computes what is shown of a maze.
pub(super) struct MazeWorker {
    world: PointMaze,
    search: StepSearch,
    /// Finds true distances; made when they are asked for.
    point_search: Option<PointSearch>,
    rng: ChaCha8Rng,
    pilot: Pilot,
    shown: Shown,
    /// Visits that the exploration was derived from.
    visits: Arc<Vec<u32>>,
    /// Visits of the latest snapshot.
    latest_visits: Arc<Vec<u32>>,
    frame: Option<(Raster, Arc<Vec<[f32; 2]>>)>,
    directions: bool,
    /// The map as it is filmed, once it has been needed.
    filmed: Option<FilmedMap>,
    inspect: Option<Cell>,
    inspection_due: bool,
    view: MazeView,
    resting: u32,
    scratch: Scratch,
    exploration_timer: RefreshTimer,
}

impl SceneWorker for MazeWorker {
    fn draws(&self, scene: &Scene) -> bool {
        matches!(scene, Scene::Maze(_))
    }

    fn step_interval(&self) -> Duration {
        STEP_INTERVAL
    }

    fn shown(&mut self) -> &mut Shown {
        &mut self.shown
    }

    fn handle_own(&mut self, request: super::Request) {
        if let super::Request::Maze(request) = request {
            self.handle_request(request);
        }
    }

    fn walk(&mut self) {
        self.walk_on();
    }

    fn enter(&mut self, snapshot: &Snapshot) {
        let Some(MazeScene { map, visits }) = snapshot.scene.maze() else { return };
        if !Arc::ptr_eq(map, self.world.map()) {
            self.change_map(map.clone());
        }
        self.latest_visits = visits.clone();
    }

    /// Recomputes graph and field from the latest networks if they are due.
    fn refresh(&mut self, snapshot: &Snapshot) {
        if let Some(followed) = &snapshot.followed {
            let at = |numbers: &[f32]| [numbers[0], numbers[1]];
            self.view.followed_steps = self.true_steps(at(&followed.state), at(&followed.goal));
            self.shown.changed = true;
        }
        self.refresh_exploration(pause_factor(snapshot));
        if self.pilot.refresh(snapshot) {
            self.view.graph = Arc::new(self.pilot.shown_graph());
            self.shown.changed = true;
        }
        if self.shown.follow(snapshot) {
            self.refresh_field();
            self.inspection_due = true;
        }
        // Once for all cells that the mouse has passed over in the meantime.
        if std::mem::take(&mut self.inspection_due) {
            self.inspect_cell();
        }
    }

    fn changed_view(&mut self) -> Option<View> {
        self.view.kind = self.shown.kind;
        std::mem::take(&mut self.shown.changed).then(|| View::Maze(Arc::new(self.view.clone())))
    }
}

impl MazeWorker {
    pub(super) fn new(scene: &MazeScene, snapshot: &Snapshot) -> Self {
        let world = PointMaze::new(scene.map.clone(), 1);
        let mut worker = Self {
            search: StepSearch::new(world.map()),
            point_search: None,
            rng: ChaCha8Rng::seed_from_u64(snapshot.run.seed),
            pilot: Pilot::new(snapshot),
            shown: Shown::new(snapshot),
            visits: Arc::default(),
            latest_visits: Arc::default(),
            frame: None,
            directions: false,
            filmed: None,
            inspect: None,
            inspection_due: false,
            view: MazeView::default(),
            resting: 0,
            scratch: Scratch::default(),
            exploration_timer: RefreshTimer::default(),
            world,
        };
        worker.restart_at_start();
        worker
    }

    fn handle_request(&mut self, request: Request) {
        // A map may have become smaller since the request was sent.
        let map = self.world.map().clone();
        let is_outside = |cell| !map.contains(cell);
        match request {
            Request::Goal(cell, _) | Request::Start(Some(cell)) | Request::Inspect(Some(cell))
                if is_outside(cell) => {}
            Request::Goal(cell, number) => {
                self.view.goal = (Some(cell), number);
                self.refresh_cut_off();
                self.start_walk();
                self.shown.timer.make_due();
            }
            Request::Start(cell) => {
                self.restart(cell);
                if self.shown.kind.depends_on_start() {
                    self.shown.timer.make_due();
                }
            }
            Request::Frame(raster, arrows) => {
                self.frame = Some((raster, arrows));
                self.shown.timer.make_due();
            }
            Request::Directions(shown) => {
                self.directions = shown;
                self.shown.timer.make_due();
            }
            Request::Inspect(cell) => {
                self.inspect = cell;
                self.inspection_due = true;
            }
        }
    }

    /// Switches to another map or to an edited version of this one.
    fn change_map(&mut self, map: Arc<Grid>) {
        let at = self.position();
        let same_size =
            (map.width(), map.height()) == (self.world.map().width(), self.world.map().height());
        self.world = PointMaze::new(map, 1);
        self.search = StepSearch::new(self.world.map());
        self.point_search = None;
        self.view.goal.0 = self.view.goal.0.and_then(|goal| self.world.map().nearest_free(goal));
        self.view.trail.clear();
        self.refresh_cut_off();
        self.pilot.forget_graph();
        if same_size {
            self.put_at(at);
            self.start_walk();
        } else {
            self.view.walk.finished_walks = (0, 0);
            self.restart_at_start();
        }
        self.shown.timer.make_due();
        self.exploration_timer.make_due();
    }

    fn position(&self) -> [f32; 2] {
        [self.world.states()[0], self.world.states()[1]]
    }

    fn point_search(&mut self) -> &mut PointSearch {
        self.point_search.get_or_insert_with(|| PointSearch::new(self.world.map()))
    }

    /// Returns the true steps from a place until a goal is reached, if there is a path.
    fn true_steps(&mut self, from: [f32; 2], goal: [f32; 2]) -> Option<u32> {
        let steps = self.point_search().steps_to(goal)(from);
        (steps != UNREACHABLE).then_some(steps)
    }

    /// Finds the cells from which no path leads to the goal.
    fn refresh_cut_off(&mut self) {
        let map = self.world.map();
        let steps = self.view.goal.0.map(|goal| self.search.steps_from(goal));
        let cut_off = |steps: &[u32]| -> Vec<bool> {
            steps
                .iter()
                .zip(map.free())
                .map(|(steps, free)| *free && *steps == UNREACHABLE)
                .collect()
        };
        let cut_off = steps.map(cut_off).filter(|cells| cells.contains(&true)).unwrap_or_default();
        // While nothing changes, the screen reuses what it has drawn.
        if cut_off != *self.view.cut_off {
            self.view.cut_off = Arc::new(cut_off);
        }
    }

    fn refresh_field(&mut self) {
        let began = Instant::now();
        self.view.past = self.shown.past.clone();
        if let (Some(frame), Some((raster, _))) = (self.shown.past.clone(), &self.frame) {
            let raster = *raster;
            self.view.field = Arc::new(self.filmed_map().field(&frame, raster));
            (self.view.farthest, self.view.raster) = (frame.farthest(), Some(raster));
            self.view.directions = Arc::default();
        } else if let (Some(goal), Some((raster, arrows))) = (self.view.goal.0, self.frame.clone())
        {
            let shown = self.shown.networks.clone();
            let policy = &*shown.policy;
            self.view.field = Arc::new(self.field(raster, goal.centre(), policy));
            self.view.farthest =
                self.view.field.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
            self.view.raster = Some(raster);
            self.view.directions = Arc::default();
            if self.directions {
                let map = self.world.map();
                let free = arrows.iter().filter(|at| map.is_free_at(at[0], at[1]));
                let at: Vec<[f32; 2]> = free.copied().collect();
                let mut actions = vec![0.0; 2 * at.len()];
                let goals = goal.centre().repeat(at.len());
                policy.actions(at.as_flattened(), &goals, &mut actions, &mut self.scratch);
                let (actions, _) = actions.as_chunks::<2>();
                self.view.directions =
                    Arc::new(at.into_iter().zip(actions.iter().copied()).collect());
            }
        }
        self.shown.timer.done(began);
        self.shown.changed = true;
    }

    fn filmed_map(&mut self) -> &FilmedMap {
        let map = self.world.map();
        let known = self.filmed.take().filter(|filmed| Arc::ptr_eq(filmed.map(), map));
        self.filmed.insert(known.unwrap_or_else(|| FilmedMap::new(map.clone())))
    }

    /// Computes the value of every pixel that shows free ground; the others are NaN.
    fn field(&mut self, raster: Raster, goal: [f32; 2], policy: &dyn Policy) -> Vec<f32> {
        let (columns, rows) = raster.pixels;
        let map = self.world.map();
        let (free, positions) = raster.free_ground(map);
        let states = positions.as_flattened();
        let values = match self.shown.kind {
            Field::Plain => return vec![f32::NAN; columns * rows],
            Field::Visits => {
                let of = |at: &[f32; 2]| {
                    self.latest_visits.get(map.index(cell_of(*at))).copied().unwrap_or(0)
                };
                positions.iter().map(|at| of(at) as f32).collect()
            }
            Field::True => self.true_distances(&positions, goal),
            kind => {
                let graph = self.pilot.graph();
                let ends = [&self.view.walk.start[..], &goal];
                let scratch = &mut self.scratch;
                let mut values = distances(kind, policy, graph, [states; 2], ends, scratch);
                if kind == Field::Error {
                    let truth = self.true_distances(&positions, goal);
                    values.iter_mut().zip(truth).for_each(|(d, t)| *d = (*d - t) / t.max(1.0));
                }
                values
            }
        };
        let mut field = vec![f32::NAN; columns * rows];
        free.iter().zip(values).for_each(|(i, value)| field[*i] = value);
        field
    }

    /// Returns the true steps to the goal; NaN where it is unreachable.
    fn true_distances(&mut self, positions: &[[f32; 2]], goal: [f32; 2]) -> Vec<f32> {
        let steps = self.point_search().steps_to(goal);
        let of = |at: &[f32; 2]| match steps(*at) {
            UNREACHABLE => f32::NAN,
            steps => steps as f32,
        };
        positions.iter().map(of).collect()
    }

    fn inspect_cell(&mut self) {
        self.shown.changed = true;
        self.view.inspected = None;
        let (Some(cell), Some(goal)) = (self.inspect, self.view.goal.0) else { return };
        if !self.world.map().is_free(cell) {
            return;
        }
        if let Some(frame) = self.shown.past.clone() {
            let learned = self.filmed_map().distance(&frame, cell.centre());
            let goal =
                film_goal(&frame, self.world.map()).filter(|goal| self.world.map().is_free(*goal));
            let truth = goal.and_then(|goal| self.true_steps(cell.centre(), goal.centre()));
            self.view.inspected = Some(CellInfo { cell, learned, truth, visits: None });
            return;
        }
        let truth = self.true_steps(cell.centre(), goal.centre());
        let learned =
            self.shown.networks.policy.distance(&cell.centre(), &goal.centre(), &mut self.scratch);
        let visits = self.latest_visits.get(self.world.map().index(cell)).copied().or(Some(0));
        self.view.inspected = Some(CellInfo { cell, learned, truth, visits });
    }
}

/// Returns the cell of a frame's goal, if it is on the map.
pub fn film_goal(frame: &FilmFrame, map: &Grid) -> Option<Cell> {
    cell_of_goal(&frame.goal, map)
}

/// Returns the cell of a goal, `(goal_dim)`, if it is on the map.
pub fn cell_of_goal(goal: &[f32], map: &Grid) -> Option<Cell> {
    let cell = cell_of(goal.try_into().ok()?);
    map.contains(cell).then_some(cell)
}

fn cell_of(at: [f32; 2]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}

#[cfg(test)]
mod tests {
    use super::super::{Request as ViewRequest, worker_for};
    use super::*;
    use crate::train::{Method, Preset, Registry, Run, Settings, Trainer};

    fn snapshot(width: usize) -> Snapshot {
        let map = Arc::new(Grid::new("hall", width, vec![true; 5 * width], Vec::new(), Vec::new()));
        let run = Run {
            method: Method::default(),
            preset: Preset::Default,
            seed: 1,
            settings: Settings::default(),
        };
        let trainer =
            Trainer::new(run, &PointMaze::new(map, 0), &Registry::builtin(), 1).expect("a trainer");
        Snapshot::capture(&trainer).expect("a snapshot")
    }

    #[test]
    fn requests_refer_to_the_map_that_is_shown() {
        let [small, large] = [4, 40].map(snapshot);
        let mut worker = worker_for(&small);
        let mut goal_after = |snapshot: &Snapshot, cell: Cell| {
            worker.enter(snapshot);
            worker.handle(ViewRequest::Maze(Request::Goal(cell, 1)));
            worker.refresh(snapshot);
            let Some(View::Maze(view)) = worker.changed_view() else { panic!("a view") };
            view.goal.0
        };
        let far = Cell::new(39, 4);
        assert_eq!(goal_after(&large, far), Some(far));
        let goal = goal_after(&small, far);
        assert!(goal.is_none_or(|cell| cell.x < 4), "no cell outside of the map: {goal:?}");
    }
}
