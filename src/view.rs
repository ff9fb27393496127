//! What there is to see, computed off the trainer's and the screen's threads from copies of the networks: fields of
//! distances, the bridge graph, the planned path, and an agent that walks to the goal.

mod field;
mod raster;
mod walk;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tokio::sync::watch;

use crate::bridge::{BridgeGraph, BridgeSettings, Standing, Walker};
use crate::env::{Environment, MazeScene, PointMaze};
use crate::learn::Scratch;
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};
use crate::train::{Engine, Networks, Run, Snapshot};
pub use field::Field;
pub use raster::{Ground, Raster};
pub use walk::{Tour, Walk};

/// Time between two steps of the walking agent.
const STEP: Duration = Duration::from_millis(70);

/// Field and graph are computed anew at most this often. They run beside training, but on the same cores: each rests
/// so many times as long as it took, less while training does not go on.
const RENEW_EVERY: Duration = Duration::from_millis(250);
const REST_WHILE_TRAINING: u32 = 80;
const REST_OTHERWISE: u32 = 3;

/// What the screen wants to see.
#[derive(Clone, Debug)]
pub enum Request {
    /// The goal that distances are shown to and the agent walks to, and the number of this request.
    Goal(Cell, u64),
    /// The walking agent starts from there, or from a random place.
    Start(Option<Cell>),
    /// What it does at the goal.
    Tour(Tour),
    /// The pixels that the map is shown by, and the positions at which the actor's directions are.
    Frame(Raster, Arc<Vec<[f32; 2]>>),
    /// What colours are to stand for.
    Field(Field),
    /// Whether the actor's directions are shown.
    Directions(bool),
    /// The cell to tell about.
    Inspect(Option<Cell>),
}

/// A bridge candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Where it is.
    pub at: [f32; 2],
    /// Edges that leave it, as a share of the most that leave any.
    pub degree: f32,
}

/// An edge between two places, and what practice says of it.
pub type ShownEdge = ([[f32; 2]; 2], Standing);

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inspected {
    /// The cell.
    pub cell: Cell,
    /// D from its middle to the goal.
    pub learned: f32,
    /// The true number of steps, if there is a way.
    pub truth: Option<u32>,
    /// How often agents were there.
    pub visits: u32,
}

/// What can be seen at one moment.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The goal, and the number of the request that it goes back to.
    pub goal: (Option<Cell>, u64),
    /// What the field's values are.
    pub kind: Field,
    /// The value of each pixel, row by row; NaN at walls.
    pub field: Arc<Vec<f32>>,
    /// The largest of them, at least 1.
    pub farthest: f32,
    /// The pixels of the field.
    pub raster: Option<Raster>,
    /// The actor's actions at some places.
    pub directions: Arc<Vec<([f32; 2], [f32; 2])>>,
    /// Bridge candidates.
    pub candidates: Arc<Vec<Candidate>>,
    /// Edges of the bridge graph.
    pub edges: Arc<Vec<ShownEdge>>,
    /// Waypoints ahead of the walking agent, ending at the goal.
    pub path: Vec<[f32; 2]>,
    /// Where the walking agent is, and where it was.
    pub trail: Vec<[f32; 2]>,
    /// Its journey.
    pub walk: Walk,
    /// What is known of the cell under the cursor.
    pub inspected: Option<Inspected>,
    /// True steps from the exploring agent that is followed to its goal, if there is a way.
    pub followed_steps: Option<u32>,
}

/// The thread that computes views.
pub struct Viewer {
    requests: Sender<Request>,
    views: watch::Receiver<Arc<View>>,
}

impl Viewer {
    /// Starts on what `engine` publishes.
    ///
    /// # Errors
    /// That the thread cannot be started.
    pub fn start(engine: &Engine) -> std::io::Result<Self> {
        let (requests, inbox) = channel();
        let (publish, views) = watch::channel(Arc::new(View::default()));
        let worker = Worker::new(engine.snapshots(), (inbox, publish));
        std::thread::Builder::new().name("viewer".to_owned()).spawn(|| worker.run())?;
        Ok(Self { requests, views })
    }

    /// Asks for something to be seen; it ends with the program, so that nothing is left to report.
    pub fn ask(&self, request: Request) {
        let _ = self.requests.send(request);
    }

    /// Views, always the latest.
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
    /// What the graph was built of and the agent walks by.
    networks: Arc<Networks>,
    /// What the field was computed by.
    shown: Arc<Networks>,
    graph: Option<BridgeGraph>,
    walker: Option<Walker>,
    frame: Option<(Raster, Arc<Vec<[f32; 2]>>)>,
    directions: bool,
    inspect: Option<Cell>,
    inspects_anew: bool,
    tour: Tour,
    view: View,
    /// Whether the view has changed since it was published.
    changed: bool,
    resting: u32,
    scratch: Scratch,
    field: Renewal,
    graph_age: Renewal,
}

/// When something was computed, and how long that took.
#[derive(Clone, Copy, Default)]
struct Renewal(Option<(Instant, Duration)>);

impl Renewal {
    /// Whether it may be computed again, resting `times` as long as it took.
    fn is_due(self, times: u32) -> bool {
        self.0.is_none_or(|(at, took)| at.elapsed() >= RENEW_EVERY.max(took * times))
    }

    /// Notes that it was computed since `began`.
    fn done(&mut self, began: Instant) {
        self.0 = Some((Instant::now(), began.elapsed()));
    }

    /// Asks for it at once.
    fn ask(&mut self) {
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
            graph: None,
            walker: None,
            frame: None,
            directions: false,
            inspect: None,
            inspects_anew: false,
            tour: Tour::default(),
            view: View::default(),
            changed: true,
            resting: 0,
            scratch: Scratch::default(),
            field: Renewal::default(),
            graph_age: Renewal::default(),
            world,
            snapshots,
            inbox,
            publish,
            shown: first.networks.clone(),
            networks: first.networks.clone(),
        };
        worker.restart(None);
        worker
    }

    fn run(mut self) {
        let mut stepped = Instant::now();
        loop {
            crate::faults::point("viewer");
            let wait = STEP.saturating_sub(stepped.elapsed());
            match self.inbox.recv_timeout(wait) {
                Ok(request) => {
                    self.take(request);
                    // Everything that has come meanwhile, before anything is computed for it.
                    while let Ok(request) = self.inbox.try_recv() {
                        self.take(request);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    stepped = Instant::now();
                    self.walk();
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.renew();
            if std::mem::take(&mut self.changed) {
                self.publish.send_replace(Arc::new(self.view.clone()));
            }
        }
    }

    fn take(&mut self, request: Request) {
        self.changed = true;
        match request {
            Request::Goal(cell, number) => {
                self.view.goal = (Some(cell), number);
                self.begin_journey();
                self.field.ask();
            }
            Request::Start(cell) => {
                self.restart(cell);
                if self.view.kind == Field::FromStart {
                    self.field.ask();
                }
            }
            Request::Tour(tour) => self.tour = tour,
            Request::Field(kind) => {
                self.view.kind = kind;
                self.field.ask();
            }
            Request::Frame(raster, arrows) => {
                self.frame = Some((raster, arrows));
                self.field.ask();
            }
            Request::Directions(shown) => {
                self.directions = shown;
                self.field.ask();
            }
            Request::Inspect(cell) => {
                self.inspect = cell;
                self.inspects_anew = true;
            }
        }
    }

    /// Computes graph and field of the latest networks where they are due.
    fn renew(&mut self) {
        let snapshot = self.snapshots.borrow().clone();
        if !Arc::ptr_eq(&snapshot.run, &self.run) {
            (self.run, self.bridge) = (snapshot.run.clone(), snapshot.run.bridge());
            (self.graph, self.walker) = (None, None);
            self.graph_age.ask();
        }
        let MazeScene { map, .. } = snapshot.scene.maze();
        if !Arc::ptr_eq(&map, self.world.map()) {
            self.enter(map);
        }
        if let Some(followed) = &snapshot.followed {
            let at = |numbers: &[f32]| cell_of([numbers[0], numbers[1]]);
            self.view.followed_steps = self.true_steps(at(&followed.state), at(&followed.goal));
            self.changed = true;
        }
        let latest = snapshot.networks.clone();
        let times = if snapshot.phase.trains() { REST_WHILE_TRAINING } else { REST_OTHERWISE };
        let renewed = !Arc::ptr_eq(&latest, &self.networks);
        if self.graph_age.0.is_none() || renewed && self.graph_age.is_due(times) {
            self.networks = latest.clone();
            self.renew_graph();
        }
        let shown = Arc::ptr_eq(&latest, &self.shown);
        if self.field.0.is_none() || !shown && self.field.is_due(times) {
            self.shown = latest;
            self.renew_field(&snapshot);
            self.inspects_anew = true;
        }
        // Once for all that the mouse has passed over meanwhile.
        if std::mem::take(&mut self.inspects_anew) {
            self.inspect_cell();
        }
    }

    /// Goes on with another map, or with this one as it was edited.
    fn enter(&mut self, map: Arc<Grid>) {
        let at = self.position();
        let same_size = (map.width(), map.height()) == (self.world.map().width(), self.world.map().height());
        self.world = PointMaze::new(map, 1);
        self.search = StepSearch::new(self.world.map());
        self.view.goal.0 = self.view.goal.0.and_then(|goal| self.world.map().nearest_free(goal));
        self.view.trail.clear();
        self.graph = None;
        if same_size {
            self.world.place(0, &at.map(f64::from));
            self.begin_journey();
        } else {
            self.view.walk.journeys = (0, 0);
            self.restart(None);
        }
        self.graph_age.ask();
        self.field.ask();
    }

    fn renew_graph(&mut self) {
        let began = Instant::now();
        let networks = self.networks.clone();
        let policy = &*networks.policy;
        (self.view.edges, self.view.candidates) = (Arc::default(), Arc::default());
        if self.run.method.plans() {
            let graph =
                BridgeGraph::build(self.world.spec(), &self.bridge, &networks.candidates, policy, &mut self.scratch);
            let at = |i: usize| [graph.point(i)[0], graph.point(i)[1]];
            let edge = |e: &crate::bridge::Edge| ([at(e.from), at(e.to)], e.standing);
            self.view.edges = Arc::new(graph.edges().iter().map(edge).collect());
            let mut degrees = vec![0u32; networks.candidates.len()];
            graph.edges().iter().for_each(|e| degrees[e.from] += 1);
            let most = degrees.iter().copied().max().unwrap_or(0).max(1) as f32;
            let candidate = |(i, degree): (usize, &u32)| Candidate { at: at(i), degree: *degree as f32 / most };
            self.view.candidates = Arc::new(degrees.iter().enumerate().map(candidate).collect());
            // Candidates may have changed places: the walk is planned anew.
            if let (Some(goal), false) = (self.view.goal.0, self.view.walk.arrived) {
                self.walker = Some(Walker::new(graph.route(&goal.centre(), policy, &mut self.scratch)));
            }
            self.graph = Some(graph);
        }
        self.graph_age.done(began);
        self.changed = true;
    }

    fn position(&self) -> [f32; 2] {
        [self.world.states()[0], self.world.states()[1]]
    }

    /// True steps between two cells, if there is a way.
    fn true_steps(&mut self, from: Cell, to: Cell) -> Option<u32> {
        let map = self.world.map();
        let steps = self.search.from(to)[map.index(from)];
        (steps != UNREACHABLE).then_some(steps)
    }

    /// Finds out about the cell that is asked about.
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
        self.view.inspected = Some(Inspected { cell, learned, truth, visits });
    }
}

/// The cell that a position lies in.
fn cell_of(at: [f32; 2]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}
