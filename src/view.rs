//! What the screen shows of a run, computed from copies of the networks on a separate thread: distance fields, what has
//! been explored, the bridge graph, the planned path, and an agent walking to the goal. Colours, contours and pictures
//! serve all front ends.

mod colour;
mod contour;
mod exploration;
mod field;
mod picture;
mod raster;
mod walk;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tokio::sync::watch;

use crate::bridge::{BridgeGraph, BridgeSettings, EdgeStatus, Walker};
use crate::env::{Environment, MazeScene, PointMaze};
use crate::learn::Scratch;
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};
use crate::train::{Engine, Networks, Run, Snapshot};
pub use colour::{Rgb, blend, contour, distance_colour, lightness, sample};
pub use contour::{contour_at, contour_interval};
pub use exploration::{Exploration, Knowledge};
pub use field::Field;
pub use picture::Picture;
pub use raster::{Ground, Raster};
pub use walk::{OnArrival, Walk};

/// Time between two steps of the walking agent.
const STEP_INTERVAL: Duration = Duration::from_millis(70);

/// Minimum interval between recomputations of field and graph, and the pause after each as a multiple of its duration.
/// They run concurrently with training, but on the same cores, so they pause longer while it runs.
const REFRESH_INTERVAL: Duration = Duration::from_millis(250);
const TRAINING_PAUSE_FACTOR: u32 = 80;
const IDLE_PAUSE_FACTOR: u32 = 3;

/// A request from the screen.
#[derive(Clone, Debug)]
pub enum Request {
    /// Goal of the displayed distances and of the walking agent, and the number of this request.
    Goal(Cell, u64),
    /// Start of the walking agent; `None` for a random one.
    Start(Option<Cell>),
    /// What the walking agent does at the goal.
    OnArrival(OnArrival),
    /// The pixels showing the map, and the positions at which to show the actor's directions.
    Frame(Raster, Arc<Vec<[f32; 2]>>),
    /// The quantity to show by colours.
    Field(Field),
    /// Whether to show the actor's directions.
    Directions(bool),
    /// The cell to inspect.
    Inspect(Option<Cell>),
}

/// A bridge candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Its position.
    pub at: [f32; 2],
    /// Its out-degree, relative to the largest of any candidate.
    pub degree: f32,
}

/// An edge between two positions, and its record in practice.
pub type ShownEdge = ([[f32; 2]; 2], EdgeStatus);

/// Information about a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellInfo {
    /// The cell.
    pub cell: Cell,
    /// D from its centre to the goal.
    pub learned: f32,
    /// The true number of steps, if the goal is reachable.
    pub truth: Option<u32>,
    /// Number of visits by agents.
    pub visits: u32,
}

/// What the screen shows at one moment.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<Cell>, u64),
    /// The quantity that the field shows.
    pub kind: Field,
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
    /// Bridge candidates.
    pub candidates: Arc<Vec<Candidate>>,
    /// Edges of the bridge graph.
    pub edges: Arc<Vec<ShownEdge>>,
    /// The cells, row by row, from which no path leads to the goal, although they are free. Empty if there are none.
    pub cut_off: Arc<Vec<bool>>,
    /// Waypoints ahead of the walking agent, ending at the goal.
    pub path: Vec<[f32; 2]>,
    /// Recent positions of the walking agent, the current one last.
    pub trail: Vec<[f32; 2]>,
    /// Its current walk.
    pub walk: Walk,
    /// Information about the cell under the cursor.
    pub inspected: Option<CellInfo>,
    /// True steps from the followed exploring agent to its goal, if it is reachable.
    pub followed_steps: Option<u32>,
}

/// Handle to the thread that computes views.
pub struct Viewer {
    requests: Sender<Request>,
    views: watch::Receiver<Arc<View>>,
}

impl Viewer {
    /// Starts the thread on the snapshots of `engine`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(engine: &Engine) -> std::io::Result<Self> {
        let (requests, inbox) = channel();
        let (publish, views) = watch::channel(Arc::new(View::default()));
        let worker = Worker::new(engine.snapshots(), (inbox, publish));
        std::thread::Builder::new().name("viewer".to_owned()).spawn(|| worker.run())?;
        Ok(Self { requests, views })
    }

    /// Sends a request. Errors are ignored: the thread ends only with the program.
    pub fn request(&self, request: Request) {
        let _ = self.requests.send(request);
    }

    /// Returns a receiver of the latest view.
    pub fn views(&self) -> watch::Receiver<Arc<View>> {
        self.views.clone()
    }
}

struct Worker {
    world: PointMaze,
    search: StepSearch,
    rng: ChaCha8Rng,
    run: Arc<Run>,
    bridge: BridgeSettings,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    inbox: Receiver<Request>,
    publish: watch::Sender<Arc<View>>,
    /// Networks that the graph was built from and the walking agent uses.
    networks: Arc<Networks>,
    /// Networks that the field was computed from.
    shown: Arc<Networks>,
    /// Visits that the exploration was derived from.
    visits: Arc<Vec<u32>>,
    graph: Option<BridgeGraph>,
    walker: Option<Walker>,
    frame: Option<(Raster, Arc<Vec<[f32; 2]>>)>,
    directions: bool,
    inspect: Option<Cell>,
    inspection_due: bool,
    on_arrival: OnArrival,
    view: View,
    /// Whether the view has changed since it was published.
    changed: bool,
    resting: u32,
    scratch: Scratch,
    field_timer: RefreshTimer,
    graph_timer: RefreshTimer,
    exploration_timer: RefreshTimer,
}

/// When something was last computed, and how long it took.
#[derive(Clone, Copy, Default)]
struct RefreshTimer(Option<(Instant, Duration)>);

impl RefreshTimer {
    /// Whether it may be recomputed, after a pause of `pause_factor` its duration.
    fn is_due(self, pause_factor: u32) -> bool {
        self.0.is_none_or(|(at, took)| at.elapsed() >= REFRESH_INTERVAL.max(took * pause_factor))
    }

    /// Records a computation that started at `began`.
    fn done(&mut self, began: Instant) {
        self.0 = Some((Instant::now(), began.elapsed()));
    }

    /// Makes it due at once.
    fn make_due(&mut self) {
        self.0 = None;
    }
}

impl Worker {
    fn new(
        snapshots: watch::Receiver<Arc<Snapshot>>,
        (inbox, publish): (Receiver<Request>, watch::Sender<Arc<View>>),
    ) -> Self {
        let first = snapshots.borrow().clone();
        let scene = first.scene.maze();
        let world = PointMaze::new(scene.map.clone(), 1);
        let mut worker = Self {
            search: StepSearch::new(world.map()),
            rng: ChaCha8Rng::seed_from_u64(first.run.seed),
            run: first.run.clone(),
            bridge: first.run.bridge(),
            visits: Arc::default(),
            graph: None,
            walker: None,
            frame: None,
            directions: false,
            inspect: None,
            inspection_due: false,
            on_arrival: OnArrival::default(),
            view: View::default(),
            changed: true,
            resting: 0,
            scratch: Scratch::default(),
            field_timer: RefreshTimer::default(),
            graph_timer: RefreshTimer::default(),
            exploration_timer: RefreshTimer::default(),
            world,
            snapshots,
            inbox,
            publish,
            shown: first.networks.clone(),
            networks: first.networks.clone(),
        };
        worker.restart_at_start();
        worker
    }

    fn run(mut self) {
        let mut stepped = Instant::now();
        loop {
            crate::faults::point("viewer");
            let wait = STEP_INTERVAL.saturating_sub(stepped.elapsed());
            match self.inbox.recv_timeout(wait) {
                Ok(request) => {
                    self.handle(request);
                    // Handles all queued requests before computing anything for them.
                    while let Ok(request) = self.inbox.try_recv() {
                        self.handle(request);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    stepped = Instant::now();
                    self.walk();
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.refresh();
            if std::mem::take(&mut self.changed) {
                self.publish.send_replace(Arc::new(self.view.clone()));
            }
        }
    }

    fn handle(&mut self, request: Request) {
        self.changed = true;
        match request {
            Request::Goal(cell, number) => {
                self.view.goal = (Some(cell), number);
                self.refresh_cut_off();
                self.start_walk();
                self.field_timer.make_due();
            }
            Request::Start(cell) => {
                self.restart(cell);
                if self.view.kind == Field::FromStart {
                    self.field_timer.make_due();
                }
            }
            Request::OnArrival(on_arrival) => self.on_arrival = on_arrival,
            Request::Field(kind) => {
                self.view.kind = kind;
                self.field_timer.make_due();
            }
            Request::Frame(raster, arrows) => {
                self.frame = Some((raster, arrows));
                self.field_timer.make_due();
            }
            Request::Directions(shown) => {
                self.directions = shown;
                self.field_timer.make_due();
            }
            Request::Inspect(cell) => {
                self.inspect = cell;
                self.inspection_due = true;
            }
        }
    }

    /// Recomputes graph and field from the latest networks if they are due.
    fn refresh(&mut self) {
        let snapshot = self.snapshots.borrow().clone();
        if !Arc::ptr_eq(&snapshot.run, &self.run) {
            (self.run, self.bridge) = (snapshot.run.clone(), snapshot.run.bridge());
            (self.graph, self.walker) = (None, None);
            self.graph_timer.make_due();
        }
        let MazeScene { map, .. } = snapshot.scene.maze();
        if !Arc::ptr_eq(&map, self.world.map()) {
            self.change_map(map);
        }
        if let Some(followed) = &snapshot.followed {
            let at = |numbers: &[f32]| cell_of([numbers[0], numbers[1]]);
            self.view.followed_steps = self.true_steps(at(&followed.state), at(&followed.goal));
            self.changed = true;
        }
        let latest = snapshot.networks.clone();
        let pause_factor = if snapshot.phase.is_training() { TRAINING_PAUSE_FACTOR } else { IDLE_PAUSE_FACTOR };
        self.refresh_exploration(&snapshot, pause_factor);
        let changed_networks = !Arc::ptr_eq(&latest, &self.networks);
        if self.graph_timer.0.is_none() || changed_networks && self.graph_timer.is_due(pause_factor) {
            self.networks = latest.clone();
            self.refresh_graph();
        }
        let shown = Arc::ptr_eq(&latest, &self.shown);
        if self.field_timer.0.is_none() || !shown && self.field_timer.is_due(pause_factor) {
            self.shown = latest;
            self.refresh_field(&snapshot);
            self.inspection_due = true;
        }
        // Once for all cells that the mouse has passed over in the meantime.
        if std::mem::take(&mut self.inspection_due) {
            self.inspect_cell();
        }
    }

    /// Switches to another map or to an edited version of this one.
    fn change_map(&mut self, map: Arc<Grid>) {
        let at = self.position();
        let same_size = (map.width(), map.height()) == (self.world.map().width(), self.world.map().height());
        self.world = PointMaze::new(map, 1);
        self.search = StepSearch::new(self.world.map());
        self.view.goal.0 = self.view.goal.0.and_then(|goal| self.world.map().nearest_free(goal));
        self.view.trail.clear();
        self.refresh_cut_off();
        self.graph = None;
        if same_size {
            self.world.set_full_state(0, &at.map(f64::from));
            self.start_walk();
        } else {
            self.view.walk.finished_walks = (0, 0);
            self.restart_at_start();
        }
        self.graph_timer.make_due();
        self.field_timer.make_due();
        self.exploration_timer.make_due();
    }

    fn refresh_graph(&mut self) {
        let began = Instant::now();
        let networks = self.networks.clone();
        let policy = &*networks.policy;
        (self.view.edges, self.view.candidates) = (Arc::default(), Arc::default());
        if self.run.method.plans() {
            let graph =
                BridgeGraph::build(self.world.spec(), &self.bridge, &networks.candidates, policy, &mut self.scratch);
            let at = |i: usize| [graph.point(i)[0], graph.point(i)[1]];
            let edge = |e: &crate::bridge::Edge| ([at(e.from), at(e.to)], e.status);
            self.view.edges = Arc::new(graph.edges().iter().map(edge).collect());
            let mut degrees = vec![0u32; networks.candidates.len()];
            graph.edges().iter().for_each(|e| degrees[e.from] += 1);
            let most = degrees.iter().copied().max().unwrap_or(0).max(1) as f32;
            let candidate = |(i, degree): (usize, &u32)| Candidate { at: at(i), degree: *degree as f32 / most };
            self.view.candidates = Arc::new(degrees.iter().enumerate().map(candidate).collect());
            // Candidates may have moved, so the walk is replanned.
            if let (Some(goal), false) = (self.view.goal.0, self.view.walk.arrived) {
                self.walker = Some(Walker::new(graph.route(&goal.centre(), policy, &mut self.scratch)));
            }
            self.graph = Some(graph);
        }
        self.graph_timer.done(began);
        self.changed = true;
    }

    fn position(&self) -> [f32; 2] {
        [self.world.states()[0], self.world.states()[1]]
    }

    /// Returns the true steps between two cells, if there is a path.
    fn true_steps(&mut self, from: Cell, to: Cell) -> Option<u32> {
        let map = self.world.map();
        let steps = self.search.steps_from(to)[map.index(from)];
        (steps != UNREACHABLE).then_some(steps)
    }

    /// Finds the cells from which no path leads to the goal.
    fn refresh_cut_off(&mut self) {
        let map = self.world.map();
        let steps = self.view.goal.0.map(|goal| self.search.steps_from(goal));
        let cut_off = |steps: &[u32]| -> Vec<bool> {
            steps.iter().zip(map.free()).map(|(steps, free)| *free && *steps == UNREACHABLE).collect()
        };
        let cut_off = steps.map(cut_off).filter(|cells| cells.contains(&true)).unwrap_or_default();
        // While nothing changes, the screen reuses what it has drawn.
        if cut_off != *self.view.cut_off {
            self.view.cut_off = Arc::new(cut_off);
        }
    }

    /// Updates the information about the inspected cell.
    fn inspect_cell(&mut self) {
        self.changed = true;
        self.view.inspected = None;
        let (Some(cell), Some(goal)) = (self.inspect, self.view.goal.0) else { return };
        if !self.world.map().is_free(cell) {
            return;
        }
        let truth = self.true_steps(cell, goal);
        let shown = self.shown.clone();
        let learned = shown.policy.distance(&cell.centre(), &goal.centre(), &mut self.scratch);
        let visits = self.snapshots.borrow().scene.maze().visits;
        let visits = visits.get(self.world.map().index(cell)).copied().unwrap_or(0);
        self.view.inspected = Some(CellInfo { cell, learned, truth, visits });
    }
}

/// Returns the cell that contains a position.
fn cell_of(at: [f32; 2]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}
