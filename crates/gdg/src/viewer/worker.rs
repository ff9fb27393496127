//! Computes the view of a run, and moves the agent in it.

use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::cells::{CellInfo, Exploration, cell_of, cell_of_goal, sees, way_along};
use super::interpolation::{FilmedMap, field_of_arm};
use super::pilot::{Ghost, OnArrival, Pilot, Reach, RefreshTimer};
use super::{Field, Plane, Request, View};
use crate::bridge::BridgeGraph;
use crate::engine::{Networks, Snapshot};
use crate::env::{Environment, FetchReach, PointMaze, WorldScene};
use crate::learn::{Policy, Scratch};
use crate::map::{Cell, Grid, PointSearch, StepSearch, UNREACHABLE};
use crate::train::FilmFrame;

/// Number of steps that the agent rests at the goal.
const REST_STEPS: u32 = 14;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 20;

/// Most steps to a goal in worlds without a limit of their own, as in evaluation; in mazes at least
/// these.
const WALK_STEPS: u32 = 500;

/// Candidates considered at each pixel for D along the bridge graph.
const LINK_CANDIDATES_PER_PIXEL: usize = 6;

/// What is shown of a run, and how it is computed.
pub struct ViewerWorker {
    scene: WorldScene,
    /// The agent's world; `None` if it has failed from the start.
    world: Option<Box<dyn Environment>>,
    /// The same maze, in which the actor walks alone.
    ghost_world: Option<PointMaze>,
    rng: ChaCha8Rng,
    pilot: Pilot,
    on_arrival: OnArrival,
    resting: u32,
    /// The networks that the fields are computed from, and when they were.
    networks: Arc<Networks>,
    timer: RefreshTimer,
    past: Option<Arc<FilmFrame>>,
    planes: Arc<Vec<Plane>>,
    /// Finds true distances in a maze; made when they are asked for.
    search: Option<PointSearch>,
    /// Visits that the exploration was derived from, and when.
    visits: Arc<Vec<u32>>,
    exploration_timer: RefreshTimer,
    /// The map as it is filmed, once it has been needed.
    filmed: Option<FilmedMap>,
    inspect: Option<Cell>,
    inspection_due: bool,
    view: View,
    /// Whether the view has changed since it was published.
    changed: bool,
    scratch: Scratch,
}

impl ViewerWorker {
    pub fn new(snapshot: &Snapshot) -> Self {
        let world: Result<Box<dyn Environment>, _> = match &snapshot.scene {
            WorldScene::Goals(space) => space.world(),
            WorldScene::Arm(_) => Ok(Box::new(FetchReach::new(1))),
            WorldScene::Maze(maze) => Ok(Box::new(PointMaze::new(maze.map.clone(), 1))),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(snapshot.run.seed);
        // The screen draws its goals from the first stream.
        rng.set_stream(1);
        let failure = world.as_ref().err().map(ToString::to_string);
        let mut worker = Self {
            scene: snapshot.scene.clone(),
            world: world.ok(),
            ghost_world: None,
            rng,
            pilot: Pilot::new(snapshot),
            on_arrival: OnArrival::default(),
            resting: 0,
            networks: snapshot.networks.clone(),
            timer: RefreshTimer::default(),
            past: None,
            planes: Arc::default(),
            search: None,
            visits: Arc::default(),
            exploration_timer: RefreshTimer::default(),
            filmed: None,
            inspect: None,
            inspection_due: false,
            view: View { reach: Reach { failure, ..Reach::default() }, ..View::default() },
            changed: true,
            scratch: Scratch::default(),
        };
        worker.restart();
        worker
    }

    fn map(&self) -> Option<&Arc<Grid>> {
        self.scene.maze().map(|maze| &maze.map)
    }

    /// Changes to the world of the latest snapshot, to which requests refer.
    pub fn enter(&mut self, snapshot: &Snapshot) {
        let stays = match (&self.scene, &snapshot.scene) {
            (WorldScene::Arm(own), WorldScene::Arm(other)) => own == other,
            (WorldScene::Goals(own), WorldScene::Goals(other)) => own == other,
            (WorldScene::Maze(own), WorldScene::Maze(other)) => {
                let before = own.map.clone();
                self.scene = snapshot.scene.clone();
                if !Arc::ptr_eq(&before, &other.map) {
                    self.change_map(&before, &other.map);
                }
                true
            }
            _ => false,
        };
        if !stays {
            *self = Self::new(snapshot);
        }
    }

    /// Switches to another map or to an edited version of this one.
    fn change_map(&mut self, before: &Grid, map: &Arc<Grid>) {
        let at = self.world.as_ref().map_or(Vec::new(), |world| world.states().to_vec());
        self.world = Some(Box::new(PointMaze::new(map.clone(), 1)));
        self.search = None;
        let goal = self.view.goal.0.take();
        let goal = goal.and_then(|goal| map.nearest_free(cell_of([goal[0], goal[1]])));
        self.view.goal.0 = goal.map(|goal| goal.centre().to_vec());
        self.pilot.forget_graph();
        self.refresh_cut_off();
        if (map.width(), map.height()) == (before.width(), before.height()) {
            self.put(&at);
        } else {
            self.view.reach.finished = (0, 0);
            self.restart();
        }
        (self.timer, self.exploration_timer) = Default::default();
    }

    pub fn handle(&mut self, request: Request) {
        self.changed = true;
        match request {
            Request::OnArrival(on_arrival) => return self.on_arrival = on_arrival,
            Request::Field(kind) => self.view.kind = kind,
            Request::Past(past) => self.past = past,
            Request::Goal(Some(goal), _) | Request::Start(Some(goal)) if !self.fits(&goal) => {
                return;
            }
            Request::Goal(goal, number) => {
                self.view.goal.1 = number;
                self.walk_to(goal);
            }
            Request::Start(at) => {
                match at {
                    Some(at) => self.put(&at),
                    None => self.restart(),
                }
                if !self.view.kind.depends_on_start() {
                    return;
                }
            }
            Request::Planes(planes) => {
                let count = self.world.as_ref().map_or(0, |world| world.spec().goal_dim());
                if planes.iter().any(|plane| plane.across.len() != count) {
                    return;
                }
                self.planes = planes;
            }
            Request::Inspect(cell) => {
                // Once for all cells that the mouse passes over.
                (self.inspect, self.inspection_due) = (cell, true);
                return;
            }
        }
        self.timer.0 = None;
    }

    /// Returns whether a place belongs to this world: another may have been loaded since.
    fn fits(&self, place: &[f32]) -> bool {
        let count = self.world.as_ref().map(|world| world.spec().goal_dim());
        count == Some(place.len())
            && self.map().is_none_or(|map| cell_of_goal(place, map).is_some())
    }

    /// Starts a walk from one of the world's own starts.
    fn restart(&mut self) {
        let Some(world) = &mut self.world else { return };
        match world.restart(0, &mut self.rng) {
            Ok(()) => self.begin(),
            Err(error) => self.view.reach.failure = Some(error.to_string()),
        }
    }

    /// Starts a walk with the agent of a maze or an arm's grip near a place, or at one of the world's
    /// own starts.
    fn put(&mut self, at: &[f32]) {
        let Some(world) = &mut self.world else { return };
        let world: &mut dyn Any = &mut **world;
        if let (Some(maze), Ok(at)) = (world.downcast_mut::<PointMaze>(), at.try_into()) {
            maze.put(0, at);
            self.begin();
        } else if let (Some(arm), Ok(at)) = (world.downcast_mut::<FetchReach>(), at.try_into()) {
            arm.put(0, at);
            self.begin();
        } else {
            self.restart();
        }
    }

    /// Starts a walk from where the agent is.
    fn begin(&mut self) {
        let Some(world) = &self.world else { return };
        let (state, spec) = (world.states(), world.spec());
        let at: Vec<f32> = spec.achieved(state).collect();
        let goal = self.view.goal.0.clone();
        let left = goal.as_ref().map_or(f32::NAN, |goal| spec.goal_distance(state, goal));
        self.view.reach = Reach {
            start: at.clone(),
            start_state: state.to_vec(),
            at: at.clone(),
            left,
            distances: (f32::NAN, f32::NAN),
            along: f32::NAN,
            finished: self.view.reach.finished,
            ..Reach::default()
        };
        self.ghost_world = self.map().map(|map| {
            let mut maze = PointMaze::new(map.clone(), 1);
            maze.put(0, [at[0], at[1]]);
            maze
        });
        self.view.reach.ghost = self.ghost_world.as_ref().map(|_| Ghost::new(at.clone()));
        self.view.reach.shortest = goal.and_then(|goal| self.true_steps(&at, &goal));
        self.pilot.forget_plan();
        (self.resting, self.changed) = (0, true);
    }

    /// Starts a walk to a goal, or to a random one.
    fn walk_to(&mut self, goal: Option<Vec<f32>>) {
        let Some(world) = &self.world else { return };
        let mut goal = goal.unwrap_or_else(|| {
            let mut goal = vec![0.0; world.spec().goal_dim()];
            world.sample_goal(0, &mut self.rng, &mut goal);
            goal
        });
        if let Some(cell) = self.map().and_then(|map| cell_of_goal(&goal, map)) {
            goal = cell.centre().to_vec();
        }
        self.view.goal.0 = Some(goal);
        self.refresh_cut_off();
        let trail = std::mem::take(&mut self.view.reach.trail);
        self.begin();
        self.view.reach.trail = trail;
        self.timer.0 = None;
    }

    /// Moves the agent by one step; gives up after too many. At the goal it rests, and then does what
    /// [`OnArrival`] says.
    pub fn walk(&mut self) {
        let (Some(goal), Some(world)) = (self.view.goal.0.clone(), &mut self.world) else { return };
        let reach = &mut self.view.reach;
        if reach.failure.is_some() || reach.gave_up {
            return;
        }
        self.changed = true;
        if let (Some(ghost), Some(own)) = (&mut reach.ghost, &mut self.ghost_world)
            && !ghost.arrived
            && self.pilot.step_alone(own, &goal, &mut self.rng).is_ok()
        {
            ghost.note(own, &goal);
        }
        if reach.arrived {
            self.resting += 1;
            match self.on_arrival {
                OnArrival::Again if self.resting > REST_STEPS => self.restart(),
                OnArrival::Visit if self.resting > REST_STEPS => self.walk_to(None),
                _ => {}
            }
            return;
        }
        if world.spec().reached(world.states(), &goal) {
            (reach.arrived, reach.waypoint) = (true, None);
            reach.finished = (reach.finished.0 + 1, reach.finished.1 + 1);
            (reach.path, reach.way) = Default::default();
            return;
        }
        let most = match &self.scene {
            WorldScene::Arm(arm) => arm.episode_steps(),
            WorldScene::Goals(space) => space.episode_steps().unwrap_or(WALK_STEPS),
            WorldScene::Maze(_) => (3 * reach.shortest.unwrap_or(0)).max(WALK_STEPS),
        };
        if reach.steps >= most || world.has_ended(0) {
            reach.finished.1 += 1;
            if self.on_arrival == OnArrival::Wait {
                reach.gave_up = true;
            } else {
                self.restart();
            }
            return;
        }
        let mut path = match self.pilot.step(&mut **world, &goal, &mut self.rng) {
            Ok(path) => path,
            Err(error) => return reach.failure = Some(error.to_string()),
        };
        let (state, target) = (world.states(), &path[0]);
        reach.at = world.spec().achieved(state).collect();
        reach.left = world.spec().goal_distance(state, &goal);
        reach.distances = (self.pilot.distance(state, &goal), self.pilot.distance(state, target));
        reach.waypoint = (*target != goal).then(|| target.clone());
        reach.trail.push(reach.at.clone());
        if reach.trail.len() > TRAIL_STEPS {
            reach.trail.remove(0);
        }
        reach.steps += 1;
        reach.way = [std::slice::from_ref(&reach.at), &path].concat();
        if let WorldScene::Maze(maze) = &self.scene {
            let positions: Vec<[f32; 2]> = reach.way.iter().map(|at| [at[0], at[1]]).collect();
            // The straight line to a goal is no plan if no path leads there, or only one around
            // walls that the actor alone has to find.
            if reach.shortest.is_none()
                || path.len() == 1 && !sees(&maze.map, positions[0], positions[1])
            {
                path.clear();
            }
            let hops = reach.way.windows(2).take(path.len());
            let hops = hops.map(|ends| self.pilot.distance(&ends[0], &ends[1]));
            reach.along = hops.reduce(|sum, hop| sum + hop).unwrap_or(f32::NAN);
            let way = way_along(&maze.map, &positions[..=path.len()]);
            reach.way = way.into_iter().map(|at| at.to_vec()).collect();
        }
        reach.path = path;
    }

    /// Recomputes what is due from the latest snapshot.
    pub fn refresh(&mut self, snapshot: &Snapshot) {
        self.refresh_exploration(snapshot);
        if self.world.is_none() {
            return;
        }
        if self.pilot.refresh(snapshot) {
            self.view.graph = Arc::new(self.pilot.shown_graph());
            self.changed = true;
        }
        // The past does not change.
        let changed = self.past.is_none() && !Arc::ptr_eq(&snapshot.networks, &self.networks);
        if self.timer.must(changed, snapshot) {
            self.networks = snapshot.networks.clone();
            self.refresh_fields();
            self.inspection_due = true;
        }
        if std::mem::take(&mut self.inspection_due) {
            self.view.inspected = self.inspected();
            self.changed = true;
        }
    }

    /// Returns the view, if it has changed since the last call.
    pub fn changed_view(&mut self) -> Option<View> {
        std::mem::take(&mut self.changed).then(|| {
            let world = self.world.as_ref().map(|world| &**world as &dyn Any);
            let arm = world.and_then(|world| world.downcast_ref::<FetchReach>());
            self.view.pose = arm.map(|arm| arm.pose(0));
            self.view.clone()
        })
    }

    fn refresh_fields(&mut self) {
        let began = Instant::now();
        let planes = self.planes.clone();
        let past = self.past.clone().filter(|_| !matches!(self.scene, WorldScene::Goals(_)));
        let fields: Vec<Vec<f32>> = if let Some(frame) = &past {
            planes.iter().map(|plane| self.field_of_past(frame, plane)).collect()
        } else {
            let Some(goal) = self.view.goal.0.clone() else { return };
            planes.iter().map(|plane| self.field(plane, &goal)).collect()
        };
        let values = fields.iter().flatten().copied().filter(|value| value.is_finite());
        self.view.farthest = match &past {
            Some(frame) => frame.farthest(),
            None => values.fold(1.0, f32::max),
        };
        (self.view.planes, self.view.fields, self.view.past) = (planes, Arc::new(fields), past);
        self.timer.done(began);
        self.changed = true;
    }

    fn field_of_past(&mut self, frame: &FilmFrame, plane: &Plane) -> Vec<f32> {
        match &self.scene {
            WorldScene::Arm(arm) => field_of_arm(*arm, frame, plane),
            _ => self.filmed().map_or(Vec::new(), |filmed| filmed.field(frame, plane.raster)),
        }
    }

    fn filmed(&mut self) -> Option<&FilmedMap> {
        let map = self.map()?.clone();
        let known = self.filmed.take().filter(|filmed| Arc::ptr_eq(filmed.map(), &map));
        Some(self.filmed.insert(known.unwrap_or_else(|| FilmedMap::new(map))))
    }

    /// Computes the value at every pixel of a plane: from the agent's start to goals on the plane
    /// through `goal`; or to `goal`, from states on the plane through it, of an arm at rest, or
    /// else from states like the agent's.
    fn field(&mut self, plane: &Plane, goal: &[f32]) -> Vec<f32> {
        let (mut field, kind) = (vec![f32::NAN; plane.raster.len()], self.view.kind);
        let Some(world) = self.world.as_ref().filter(|_| kind != Field::Plain) else {
            return field;
        };
        let (spec, mut state) = (world.spec(), world.states().to_vec());
        let mut near = goal;
        let (shown, places) = match &self.scene {
            WorldScene::Maze(maze) => {
                let (shown, positions) = plane.raster.free_ground(&maze.map);
                (shown, positions.as_flattened().to_vec())
            }
            scene => {
                if matches!(scene, WorldScene::Arm(_)) {
                    state.fill(0.0);
                } else if kind != Field::FromStart {
                    near = &self.view.reach.at;
                }
                let is_open = |i: &usize| plane.is_open(*i, near, scene);
                let shown: Vec<usize> = (0..field.len()).filter(is_open).collect();
                let place = |i: &usize| plane.point(plane.raster.middle_of(*i), near);
                let places = shown.iter().flat_map(place).collect();
                (shown, places)
            }
        };
        if shown.is_empty() || near.len() != goal.len() {
            return field;
        }
        let mut states = state.repeat(shown.len());
        let each = states.chunks_exact_mut(state.len()).zip(places.chunks_exact(near.len()));
        for (state, place) in each {
            spec.achieved.iter().zip(place).for_each(|(i, value)| state[*i] = *value);
        }
        let (positions, _) = places.as_chunks::<2>();
        let values = match (kind, &self.scene) {
            (Field::Visits, WorldScene::Maze(maze)) => {
                let of = |at: &[f32; 2]| maze.visits.get(maze.map.index(cell_of(*at)));
                positions.iter().map(|at| of(at).copied().unwrap_or(0) as f32).collect()
            }
            (Field::True, WorldScene::Maze(_)) => self.true_distances(positions, goal),
            _ => {
                let (graph, start) = (self.pilot.graph(), &*self.view.reach.start_state);
                let (policy, scratch) = (&*self.networks.policy, &mut self.scratch);
                let ends = [start, goal];
                let mut values = distances(kind, policy, graph, [&states, &places], ends, scratch);
                if kind == Field::Error {
                    let truth = self.true_distances(positions, goal);
                    values.iter_mut().zip(truth).for_each(|(d, t)| *d = (*d - t) / t.max(1.0));
                }
                values
            }
        };
        shown.into_iter().zip(values).for_each(|(i, value)| field[i] = value);
        field
    }

    fn search(&mut self) -> Option<&mut PointSearch> {
        let map = self.scene.maze().map(|maze| &maze.map)?;
        Some(self.search.get_or_insert_with(|| PointSearch::new(map)))
    }

    /// Returns the true steps in a maze from a place until a goal is reached, if there is a path.
    fn true_steps(&mut self, from: &[f32], goal: &[f32]) -> Option<u32> {
        let steps = self.search()?.steps_to([goal[0], goal[1]])([from[0], from[1]]);
        (steps != UNREACHABLE).then_some(steps)
    }

    /// Returns the true steps to the goal; NaN where it is unreachable.
    fn true_distances(&mut self, positions: &[[f32; 2]], goal: &[f32]) -> Vec<f32> {
        let Some(search) = self.search() else { return vec![f32::NAN; positions.len()] };
        let steps = search.steps_to([goal[0], goal[1]]);
        let of = |at: &[f32; 2]| match steps(*at) {
            UNREACHABLE => f32::NAN,
            steps => steps as f32,
        };
        positions.iter().map(of).collect()
    }

    /// Finds the cells of a maze from which no path leads to the goal.
    fn refresh_cut_off(&mut self) {
        let (Some(map), Some(goal)) = (self.map(), &self.view.goal.0) else { return };
        let mut search = StepSearch::new(map);
        let steps = search.steps_from(cell_of([goal[0], goal[1]])).iter().zip(map.free());
        let mut cut_off: Vec<bool> =
            steps.map(|(steps, free)| *free && *steps == UNREACHABLE).collect();
        if !cut_off.contains(&true) {
            cut_off.clear();
        }
        // While nothing changes, the screen reuses what it has drawn.
        if cut_off != *self.view.cut_off {
            self.view.cut_off = Arc::new(cut_off);
        }
    }

    /// Derives what has been explored from the latest visits, if they are new.
    fn refresh_exploration(&mut self, snapshot: &Snapshot) {
        let WorldScene::Maze(maze) = &self.scene else { return };
        if Arc::ptr_eq(&maze.visits, &self.visits) || !self.exploration_timer.is_due(snapshot) {
            return;
        }
        let began = Instant::now();
        let exploration = Exploration::new(&maze.map, &maze.visits);
        self.visits = maze.visits.clone();
        // While nothing changes, the screen reuses what it has drawn.
        if exploration != *self.view.exploration {
            self.view.exploration = Arc::new(exploration);
            self.changed = true;
        }
        self.exploration_timer.done(began);
    }

    fn inspected(&mut self) -> Option<CellInfo> {
        let (cell, goal) = (self.inspect?, self.view.goal.0.clone()?);
        let WorldScene::Maze(maze) = self.scene.clone() else { return None };
        let (map, at) = (&maze.map, cell.centre());
        if !map.contains(cell) || !map.is_free(cell) {
            return None;
        }
        if let Some(frame) = self.past.clone() {
            let learned = self.filmed()?.distance(&frame, at);
            let goal = cell_of_goal(&frame.goal, map).filter(|goal| map.is_free(*goal));
            let truth = goal.and_then(|goal| self.true_steps(&at, &goal.centre()));
            return Some(CellInfo { cell, learned, truth, visits: None });
        }
        let truth = self.true_steps(&at, &goal);
        let learned = self.networks.policy.distance(&at, &goal, &mut self.scratch);
        let visits = maze.visits.get(map.index(cell)).copied().or(Some(0));
        Some(CellInfo { cell, learned, truth, visits })
    }
}

/// Returns the distances that `kind` shows at `states`, which are at `places`, with a start state
/// and a goal: those of D, unless they lead from the start or along the graph.
fn distances(
    kind: Field,
    policy: &dyn Policy,
    graph: Option<&BridgeGraph>,
    [states, places]: [&[f32]; 2],
    [start, goal]: [&[f32]; 2],
    scratch: &mut Scratch,
) -> Vec<f32> {
    if let (Field::Composed, Some(graph)) = (kind, graph) {
        let route = graph.route(goal, policy, scratch);
        return graph.composed_distances(
            states,
            &route,
            LINK_CANDIDATES_PER_PIXEL,
            policy,
            scratch,
        );
    }
    let count = places.len() / goal.len();
    let mut of = |from: &[f32], to: &[f32]| {
        let mut distances = vec![0.0; count];
        policy.distances(from, to, &mut distances, scratch);
        distances
    };
    match kind {
        Field::FromStart => of(&start.repeat(count), places),
        Field::OverEach => {
            let before = of(&start.repeat(count), places);
            let after = of(states, &goal.repeat(count));
            before.into_iter().zip(after).map(|(before, after)| before + after).collect()
        }
        _ => of(states, &goal.repeat(count)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::Planner;
    use crate::env::GoalSpace;
    use crate::train::{Method, Preset, Registry, Run, Settings, Trainer};

    fn snapshot(width: usize) -> Snapshot {
        snapshot_of(width, Method::default())
    }

    fn snapshot_of(width: usize, method: Method) -> Snapshot {
        let map = Arc::new(Grid::new("hall", width, vec![true; 5 * width], Vec::new(), Vec::new()));
        let run = Run { method, preset: Preset::Default, seed: 1, settings: Settings::default() };
        let trainer =
            Trainer::new(run, &PointMaze::new(map, 0), &Registry::builtin(), 1).expect("a trainer");
        Snapshot::capture(&trainer).expect("a snapshot")
    }

    #[test]
    fn requests_refer_to_the_map_that_is_shown() {
        let [small, large] = [4, 40].map(snapshot);
        let mut worker = ViewerWorker::new(&small);
        let mut goal_after = |snapshot: &Snapshot, cell: Cell| {
            worker.enter(snapshot);
            worker.handle(Request::Goal(Some(cell.centre().to_vec()), 1));
            worker.refresh(snapshot);
            worker.changed_view().expect("a view").goal.0
        };
        let far = Cell::new(39, 4);
        assert_eq!(goal_after(&large, far), Some(far.centre().to_vec()));
        let goal = goal_after(&small, far);
        assert!(goal.as_ref().is_none_or(|at| at[0] < 4.0), "no cell outside of the map: {goal:?}");
    }

    #[test]
    fn a_walk_goes_on_where_the_scales_of_its_world_change() {
        let mut snapshot = snapshot(4);
        let mut space = Box::new(GoalSpace::of(&FetchReach::new(0), None));
        snapshot.scene = WorldScene::Goals(space.clone());
        let mut worker = ViewerWorker::new(&snapshot);
        let goal = vec![1.3, 0.7, 0.5];
        worker.handle(Request::Goal(Some(goal.clone()), 1));
        space.spec.change_scale[9] += 1.0;
        snapshot.scene = WorldScene::Goals(space.clone());
        worker.enter(&snapshot);
        assert_eq!(worker.view.goal.0, Some(goal));
        space.spec.goal_radius *= 2.0;
        snapshot.scene = WorldScene::Goals(space);
        worker.enter(&snapshot);
        assert_eq!(worker.view.goal.0, None, "another world");
    }

    #[test]
    fn the_actor_walks_alone_beside_an_agent_that_plans() {
        let none = Method { planner: Planner::None, ..Method::default() };
        for method in [Method::default(), none] {
            let snapshot = snapshot_of(40, method);
            let mut worker = ViewerWorker::new(&snapshot);
            worker.handle(Request::Goal(Some(Cell::new(39, 4).centre().to_vec()), 1));
            worker.handle(Request::Start(Some(vec![1.5, 2.5])));
            worker.refresh(&snapshot);
            (0..30).for_each(|_| worker.walk());
            let reach = worker.changed_view().expect("a view").reach.clone();
            let ghost = reach.ghost.as_ref().expect("the actor alone");
            assert!(ghost.steps == 30 && ghost.at != reach.start && reach.steps == 30);
        }
    }
}
