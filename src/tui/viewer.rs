//! What there is to see, computed off the trainer's and the screen's threads from copies of the networks: the
//! distance field, the bridge graph, the planned path, and an agent that walks to the goal.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tokio::sync::watch;

use super::raster::{Ground, Raster};
use crate::bridge::{BridgeGraph, Experience, Standing, Target, Walker};
use crate::env::{Environment, PointMaze};
use crate::learn::{Nets, Policy, Scratch};
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};
use crate::train::{Engine, Method, Phase, Snapshot};

/// Time between two steps of the walking agent.
const STEP: Duration = Duration::from_millis(70);

/// Field and graph are computed anew at most this often. They run beside training, but on the same cores: each rests
/// so many times as long as it took, less while training does not go on.
const RENEW_EVERY: Duration = Duration::from_millis(250);
const REST_WHILE_TRAINING: u32 = 80;
const REST_OTHERWISE: u32 = 3;

/// Steps that the walking agent rests at the goal before it starts from somewhere else.
const REST_STEPS: u32 = 15;

/// Steps of the trail that is kept.
const TRAIL_STEPS: usize = 12;

/// Which distance to the goal colours and contours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layer {
    /// D as the critics have it.
    #[default]
    Learned,
    /// D as the bridge graph composes it.
    Composed,
    /// The map's own steps.
    True,
}

impl Layer {
    /// What it is called on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learned => "D learned",
            Self::Composed => "D by the graph",
            Self::True => "true steps",
        }
    }

    /// The next one that there is for `method`.
    pub fn next(self, method: Method) -> Self {
        match self {
            Self::Learned if method.plans() => Self::Composed,
            Self::Learned | Self::Composed => Self::True,
            Self::True => Self::Learned,
        }
    }
}

/// Candidates that composed distances of the field consider at each pixel.
const LINKS_OF_A_PIXEL: usize = 6;

/// What the screen wants to see.
#[derive(Clone, Copy, Debug)]
pub enum Request {
    /// The goal that distances are shown to and the agent walks to.
    Goal(Cell),
    /// The walking agent starts from a random place.
    NewStart,
    /// The pixels that the map is shown by.
    Window(Raster),
    /// The distance to show.
    Layer(Layer),
}

/// What can be seen at one moment.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The goal.
    pub goal: Option<Cell>,
    /// Which distance the field holds.
    pub layer: Layer,
    /// The distance of each pixel to the goal in steps, row by row; NaN at walls.
    pub field: Arc<Vec<f32>>,
    /// The pixels of the field.
    pub raster: Option<Raster>,
    /// Bridge candidates, as positions.
    pub candidates: Arc<Vec<[f32; 2]>>,
    /// Edges of the bridge graph: all, those that practice confirmed, and those that it demoted.
    pub edges: (usize, usize, usize),
    /// Waypoints ahead of the walking agent, ending at the goal.
    pub path: Vec<[f32; 2]>,
    /// Where the walking agent is, and where it was.
    pub trail: Vec<[f32; 2]>,
    /// Its journey.
    pub walk: Walk,
}

/// The walking agent's journey.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Walk {
    /// Where it started.
    pub start: [f32; 2],
    /// Steps taken.
    pub steps: u32,
    /// The shortest possible number, if there is a way.
    pub shortest: Option<u32>,
    /// D to the goal.
    pub distance: f32,
    /// Whether it has arrived.
    pub arrived: bool,
    /// Journeys that ended at the goal, and all that ended.
    pub journeys: (u32, u32),
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
        let world = PointMaze::new(engine.map().clone(), 1, 0.0);
        let worker = Worker::new(world, engine, (inbox, publish));
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
    method: Method,
    bridge: crate::bridge::BridgeSettings,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    inbox: Receiver<Request>,
    publish: watch::Sender<Arc<View>>,
    /// What the graph was built of and the agent walks by.
    networks: Arc<(Policy, Arc<Experience>)>,
    /// What the field was computed by.
    shown: Arc<(Policy, Arc<Experience>)>,
    graph: Option<BridgeGraph>,
    walker: Option<Walker>,
    window: Option<Raster>,
    view: View,
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
    fn new(world: PointMaze, engine: &Engine, (inbox, publish): (Receiver<Request>, watch::Sender<Arc<View>>)) -> Self {
        let snapshots = engine.snapshots();
        let networks = snapshots.borrow().networks.clone();
        let mut worker = Self {
            search: StepSearch::new(world.map()),
            rng: ChaCha8Rng::seed_from_u64(engine.run().seed),
            method: engine.run().method,
            bridge: engine.run().bridge(),
            graph: None,
            walker: None,
            window: None,
            view: View::default(),
            resting: 0,
            scratch: Scratch::default(),
            field: Renewal::default(),
            graph_age: Renewal::default(),
            world,
            snapshots,
            inbox,
            publish,
            shown: networks.clone(),
            networks,
        };
        worker.restart();
        worker
    }

    fn run(mut self) {
        let mut stepped = Instant::now();
        loop {
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
            self.publish.send_replace(Arc::new(self.view.clone()));
        }
    }

    fn take(&mut self, request: Request) {
        match request {
            Request::Goal(cell) => {
                self.view.goal = Some(cell);
                self.begin_journey();
                self.field.ask();
            }
            Request::NewStart => self.restart(),
            Request::Layer(layer) => {
                self.view.layer = layer;
                self.field.ask();
            }
            Request::Window(raster) => {
                self.window = Some(raster);
                self.field.ask();
            }
        }
    }

    /// Computes graph and field of the latest networks where they are due.
    fn renew(&mut self) {
        let (latest, training, map) = {
            let snapshot = self.snapshots.borrow();
            (snapshot.networks.clone(), snapshot.phase == Phase::Running, snapshot.map.clone())
        };
        if !Arc::ptr_eq(&map, self.world.map()) {
            self.enter(map);
        }
        let times = if training { REST_WHILE_TRAINING } else { REST_OTHERWISE };
        let renewed = !Arc::ptr_eq(&latest, &self.networks);
        if self.graph_age.0.is_none() || renewed && self.graph_age.is_due(times) {
            self.networks = latest.clone();
            self.renew_graph();
        }
        let shown = Arc::ptr_eq(&latest, &self.shown);
        if self.field.0.is_none() || !shown && self.field.is_due(times) {
            self.shown = latest;
            self.renew_field();
        }
    }

    /// Goes on with a map that has been edited.
    fn enter(&mut self, map: Arc<Grid>) {
        let at = self.position();
        self.world = PointMaze::new(map, 1, 0.0);
        self.world.place(0, &at);
        self.search = StepSearch::new(self.world.map());
        self.view.goal = self.view.goal.and_then(|goal| self.world.map().nearest_free(goal));
        self.view.trail.clear();
        self.graph = None;
        self.begin_journey();
        self.graph_age.ask();
        self.field.ask();
    }

    fn renew_graph(&mut self) {
        let began = Instant::now();
        let networks = self.networks.clone();
        let nets = networks.0.nets();
        if self.method.plans() {
            let graph = BridgeGraph::build(self.world.spec(), &self.bridge, &networks.1, &nets, &mut self.scratch);
            let of = |standing: Standing| graph.edges().iter().filter(|e| e.standing == standing).count();
            self.view.edges = (graph.edges().len(), of(Standing::Confirmed), of(Standing::Demoted));
            self.view.candidates = Arc::new(networks.1.points().chunks_exact(2).map(|p| [p[0], p[1]]).collect());
            // Candidates may have changed places: the walk is planned anew.
            if let (Some(goal), false) = (self.view.goal, self.view.walk.arrived) {
                self.walker = Some(Walker::new(graph.route(&goal.centre(), &nets, &mut self.scratch)));
            }
            self.graph = Some(graph);
        }
        self.graph_age.done(began);
    }

    fn renew_field(&mut self) {
        let began = Instant::now();
        if let (Some(goal), Some(raster)) = (self.view.goal, self.window) {
            let shown = self.shown.clone();
            self.view.field = Arc::new(self.field(raster, goal.centre(), &shown.0.nets()));
            self.view.raster = Some(raster);
        }
        self.field.done(began);
    }

    /// D(pixel, goal) of every pixel that shows free ground.
    fn field(&mut self, raster: Raster, goal: [f32; 2], nets: &Nets) -> Vec<f32> {
        let (columns, rows) = raster.pixels;
        let map = self.world.map();
        let shown = (0..columns * rows).filter_map(|i| match raster.ground(map, i % columns, i / columns) {
            Ground::Free(position) => Some((i, position)),
            _ => None,
        });
        let (shown, positions): (Vec<usize>, Vec<[f32; 2]>) = shown.unzip();
        let states = positions.as_flattened();
        let distances = match (self.view.layer, &self.graph) {
            (Layer::True, _) => {
                let steps = self.search.from(Cell::new(goal[0] as usize, goal[1] as usize));
                let of = |at: &[f32; 2]| match steps[map.index(Cell::new(at[0] as usize, at[1] as usize))] {
                    UNREACHABLE => f32::NAN,
                    steps => steps as f32,
                };
                positions.iter().map(of).collect()
            }
            (Layer::Composed, Some(graph)) => {
                let route = graph.route(&goal, nets, &mut self.scratch);
                graph.composed(states, &route, LINKS_OF_A_PIXEL, nets, &mut self.scratch)
            }
            _ => {
                let mut distances = vec![0.0; shown.len()];
                nets.distances(states, &goal.repeat(shown.len()), &mut distances, &mut self.scratch);
                distances
            }
        };
        let mut field = vec![f32::NAN; columns * rows];
        shown.iter().zip(distances).for_each(|(i, d)| field[*i] = d);
        field
    }

    /// The walking agent at a random place.
    fn restart(&mut self) {
        self.world.restart(0, &mut self.rng);
        self.view.trail.clear();
        self.begin_journey();
    }

    /// A journey from where the agent stands to the goal.
    fn begin_journey(&mut self) {
        let at = self.position();
        self.resting = 0;
        self.view.walk = Walk { start: at, journeys: self.view.walk.journeys, distance: f32::NAN, ..Walk::default() };
        self.walker = None;
        self.view.path.clear();
        if let Some(goal) = self.view.goal {
            let map = self.world.map();
            let steps = self.search.from(goal)[map.index(Cell::new(at[0] as usize, at[1] as usize))];
            self.view.walk.shortest = (steps != UNREACHABLE).then_some(steps);
        }
    }

    fn position(&self) -> [f32; 2] {
        [self.world.states()[0], self.world.states()[1]]
    }

    /// One step of the walking agent.
    fn walk(&mut self) {
        let Some(goal) = self.view.goal else { return };
        if self.view.walk.arrived {
            self.resting += 1;
            if self.resting > REST_STEPS {
                self.restart();
            }
            return;
        }
        let (goal, at) = (goal.centre(), self.position());
        let networks = self.networks.clone();
        let nets = networks.0.nets();
        self.view.walk.distance = nets.distance(&at, &goal, &mut self.scratch);
        if self.world.spec().reached(&at, &goal) {
            self.view.walk.arrived = true;
            self.view.walk.journeys = (self.view.walk.journeys.0 + 1, self.view.walk.journeys.1 + 1);
            self.view.path.clear();
            return;
        }
        // As long as evaluation would let it.
        if self.view.walk.steps >= self.view.walk.shortest.map_or(500, |s| (3 * s).max(500)) {
            self.view.walk.journeys.1 += 1;
            self.restart();
            return;
        }
        let aim = self.aim(at, goal, &nets);
        let mut action = [0.0; 2];
        nets.actions(&at, &aim, &mut action, &mut self.scratch);
        self.world.step(&action, &mut self.rng);
        self.view.walk.steps += 1;
        self.view.trail.push(at);
        if self.view.trail.len() > TRAIL_STEPS {
            self.view.trail.remove(0);
        }
    }

    /// Where the agent heads for next; renews the path that is shown.
    fn aim(&mut self, at: [f32; 2], goal: [f32; 2], nets: &Nets) -> [f32; 2] {
        let Some(graph) = &self.graph else {
            self.view.path = vec![goal];
            return goal;
        };
        let scratch = &mut self.scratch;
        let walker = self.walker.get_or_insert_with(|| Walker::new(graph.route(&goal, nets, scratch)));
        let aim = walker.step(&at, graph, nets, scratch);
        let aim = [aim[0], aim[1]];
        self.view.path = match walker.target() {
            Some(Target::Candidate(_)) => {
                walker.ahead().into_iter().map(|i| [graph.point(i)[0], graph.point(i)[1]]).collect()
            }
            _ => Vec::new(),
        };
        self.view.path.push(goal);
        aim
    }
}
