//! What the screen shows of a run, computed from copies of the networks on a separate thread:
//! distance fields, the bridge graph, the planned path, and an agent walking to the goal. `maze` is
//! about worlds with a map, `space` about the others; `pilot` is what their agents have in common.

pub mod maze;
mod pilot;
pub mod space;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::bridge::BridgeGraph;
use crate::engine::{Engine, Networks, Snapshot};
use crate::env::Scene;
use crate::learn::{Policy, Scratch};
use crate::train::FilmFrame;
pub use maze::MazeView;
use maze::MazeWorker;
pub use pilot::{Candidate, Graph, OnArrival, Reach};
pub use space::SpaceView;
use space::SpaceWorker;

/// Minimum interval between recomputations of field and graph, and the pause after each as a
/// multiple of its duration. They run concurrently with training, but on the same cores, so they
/// pause longer while it runs.
const REFRESH_INTERVAL: Duration = Duration::from_millis(250);
const TRAINING_PAUSE_FACTOR: u32 = 80;
const IDLE_PAUSE_FACTOR: u32 = 3;

/// Candidates considered at each pixel for D along the bridge graph.
const LINK_CANDIDATES_PER_PIXEL: usize = 6;

/// A request from the screen. Requests about another kind of scene than the run's date from before
/// another run was loaded, and are ignored.
#[derive(Clone, Debug)]
pub enum Request {
    /// What the walking agent does at the goal.
    OnArrival(OnArrival),
    /// The quantity to show by colours.
    Field(Field),
    /// The frame of the film to show instead of the present, if any.
    Past(Option<Arc<FilmFrame>>),
    /// About a maze.
    Maze(maze::Request),
    /// About a world without a map.
    Space(space::Request),
}

impl From<space::Request> for Request {
    fn from(request: space::Request) -> Self {
        Self::Space(request)
    }
}

impl From<maze::Request> for Request {
    fn from(request: maze::Request) -> Self {
        Self::Maze(request)
    }
}

/// What the screen shows at one moment.
#[derive(Clone, Debug)]
pub enum View {
    /// Of a maze.
    Maze(Arc<MazeView>),
    /// Of a world without a map.
    Space(Arc<SpaceView>),
}

impl Default for View {
    fn default() -> Self {
        Self::Maze(Arc::default())
    }
}

/// Computes what is shown of one kind of scene.
trait SceneWorker: Send {
    /// Returns whether it draws `scene`; otherwise another worker takes over.
    fn draws(&self, scene: &Scene) -> bool;

    /// Returns the time between two steps of the walking agent.
    fn step_interval(&self) -> Duration;

    /// Changes to the world of the latest snapshot, to which requests refer.
    fn enter(&mut self, _snapshot: &Snapshot) {}

    /// Returns the state that all kinds of scene share.
    fn shown(&mut self) -> &mut Shown;

    /// Handles a request about this kind of scene; ignores those about others.
    fn handle_own(&mut self, request: Request);

    fn handle(&mut self, request: Request) {
        let shown = self.shown();
        shown.changed = true;
        match request {
            Request::OnArrival(on_arrival) => shown.on_arrival = on_arrival,
            Request::Field(kind) => {
                shown.kind = kind;
                shown.timer.make_due();
            }
            Request::Past(past) => shown.look_at(past),
            Request::Maze(_) | Request::Space(_) => self.handle_own(request),
        }
    }

    /// Moves the walking agent by one step.
    fn walk(&mut self);

    /// Recomputes what is due from the latest snapshot.
    fn refresh(&mut self, snapshot: &Snapshot);

    /// Returns the view, if it has changed since the last call.
    fn changed_view(&mut self) -> Option<View>;
}

/// Returns the worker for the world of `snapshot`.
fn worker_for(snapshot: &Snapshot) -> Box<dyn SceneWorker> {
    match &snapshot.scene {
        Scene::Maze(scene) => Box::new(MazeWorker::new(scene, snapshot)),
        Scene::Arm(_) | Scene::Goals(_) => Box::new(SpaceWorker::new(snapshot)),
    }
}

/// Handle to the thread that computes views.
pub struct Viewer {
    requests: Sender<Request>,
    views: watch::Receiver<View>,
}

impl Viewer {
    /// Starts the thread on the snapshots of `engine`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(engine: &Engine) -> std::io::Result<Self> {
        let (requests, inbox) = channel();
        let (publish, views) = watch::channel(View::default());
        let snapshots = engine.snapshots();
        let view = move || {
            // A world in another process takes seconds to start; the engine publishes meanwhile.
            let snapshot = snapshots.borrow().clone();
            let scene = worker_for(&snapshot);
            Worker { snapshots, inbox, publish, scene }.run();
        };
        std::thread::Builder::new().name("viewer".to_owned()).spawn(view)?;
        Ok(Self::new(requests, views))
    }

    /// Connects with what takes `requests` and publishes `views`, as [`Self::start`] does.
    pub fn new(requests: Sender<Request>, views: watch::Receiver<View>) -> Self {
        Self { requests, views }
    }

    /// Sends a request. Errors are ignored: the thread ends only with the program.
    pub fn request(&self, request: impl Into<Request>) {
        let _ = self.requests.send(request.into());
    }

    /// Returns a receiver of the latest view.
    pub fn views(&self) -> watch::Receiver<View> {
        self.views.clone()
    }
}

struct Worker {
    snapshots: watch::Receiver<Arc<Snapshot>>,
    inbox: Receiver<Request>,
    publish: watch::Sender<View>,
    scene: Box<dyn SceneWorker>,
}

impl Worker {
    fn run(mut self) {
        let mut stepped = Instant::now();
        loop {
            crate::faults::point("viewer");
            let wait = self.scene.step_interval().saturating_sub(stepped.elapsed());
            match self.inbox.recv_timeout(wait) {
                Ok(request) => {
                    // Handles all queued requests before computing anything for them.
                    let mut next = Some(request);
                    while let Some(request) = next {
                        self.enter_scene();
                        self.scene.handle(request);
                        next = self.inbox.try_recv().ok();
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    stepped = Instant::now();
                    self.scene.walk();
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let snapshot = self.enter_scene();
            self.scene.refresh(&snapshot);
            if let Some(view) = self.scene.changed_view() {
                self.publish.send_replace(view);
            }
        }
    }

    /// Returns the latest snapshot, after switching to its world's scene: requests refer to the
    /// world that is shown.
    fn enter_scene(&mut self) -> Arc<Snapshot> {
        let snapshot = self.snapshots.borrow().clone();
        if !self.scene.draws(&snapshot.scene) {
            self.scene = worker_for(&snapshot);
        }
        self.scene.enter(&snapshot);
        snapshot
    }
}

/// Returns the pause after a recomputation, as a multiple of its duration.
fn pause_factor(snapshot: &Snapshot) -> u32 {
    if snapshot.phase.is_training() { TRAINING_PAUSE_FACTOR } else { IDLE_PAUSE_FACTOR }
}

/// When something was last computed, and how long it took.
#[derive(Clone, Copy, Default)]
struct RefreshTimer(Option<(Instant, Duration)>);

impl RefreshTimer {
    /// Whether it may be recomputed, after a pause of `pause_factor` its duration.
    fn is_due(self, pause_factor: u32) -> bool {
        self.0.is_none_or(|(at, took)| at.elapsed() >= REFRESH_INTERVAL.max(took * pause_factor))
    }

    fn is_urgent(self) -> bool {
        self.0.is_none()
    }

    /// Records a computation that started at `began`.
    fn done(&mut self, began: Instant) {
        self.0 = Some((Instant::now(), began.elapsed()));
    }

    fn make_due(&mut self) {
        self.0 = None;
    }
}

/// What is shown of any scene: the choices of the user, and the networks behind a field.
struct Shown {
    kind: Field,
    /// The networks that the field is computed from.
    networks: Arc<Networks>,
    /// When the field was last computed.
    timer: RefreshTimer,
    /// The frame of the film that is shown instead.
    past: Option<Arc<FilmFrame>>,
    on_arrival: OnArrival,
    /// Whether the view has changed since it was published.
    changed: bool,
}

impl Shown {
    fn new(snapshot: &Snapshot) -> Self {
        Self {
            kind: Field::default(),
            networks: snapshot.networks.clone(),
            timer: RefreshTimer::default(),
            past: None,
            on_arrival: OnArrival::default(),
            changed: true,
        }
    }

    /// Takes the networks of `snapshot` if the field is due; returns whether it is.
    fn follow(&mut self, snapshot: &Snapshot) -> bool {
        let changed = !Arc::ptr_eq(&snapshot.networks, &self.networks);
        // The past does not change.
        let changed = changed && self.past.is_none();
        let due = self.timer.is_urgent() || changed && self.timer.is_due(pause_factor(snapshot));
        if due {
            self.networks = snapshot.networks.clone();
        }
        due
    }

    /// Changes to a frame of the film, or back to the networks.
    fn look_at(&mut self, past: Option<Arc<FilmFrame>>) {
        self.past = past;
        self.timer.make_due();
    }
}

/// Appends a place to a trail that keeps the latest `most`.
fn push_to_trail<T>(trail: &mut Vec<T>, at: T, most: usize) {
    trail.push(at);
    if trail.len() > most {
        trail.remove(0);
    }
}

/// The quantity shown by colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Field {
    /// D(., g) to the goal, by the critics.
    #[default]
    Learned,
    /// D(s, .) from the start of the walking agent.
    FromStart,
    /// D(s, .) + D(., g), from the start to the goal over each place: low at good bridge points, as in
    /// Figure 2 of the paper.
    OverEach,
    /// D(., g) along the bridge graph.
    Composed,
    /// True steps to the goal.
    True,
    /// Signed error of D(., g), relative to the true steps.
    Error,
    /// Number of visits by agents.
    Visits,
    /// Nothing.
    Plain,
}

impl Field {
    /// All fields.
    pub const ALL: [Self; 8] = [
        Self::Learned,
        Self::FromStart,
        Self::OverEach,
        Self::Composed,
        Self::True,
        Self::Error,
        Self::Visits,
        Self::Plain,
    ];

    /// Returns its name on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learned => "D to G",
            Self::FromStart => "D from S",
            Self::OverEach => "D(S,.)+D(.,G)",
            Self::Composed => "D via graph",
            Self::True => "true steps",
            Self::Error => "error of D",
            Self::Visits => "visits",
            Self::Plain => "map only",
        }
    }

    /// Returns other words that users may search for.
    pub fn words(self) -> &'static str {
        match self {
            Self::Learned => "distance to goal learned value function q_values critic",
            Self::FromStart => "distance from start",
            Self::OverEach => "bridges sum of distances over each place figure 2",
            Self::Composed => "distance along bridge graph planned",
            Self::True => "true distance ground truth shortest path optimal exact",
            Self::Error => "wrong mistakes accuracy difference",
            Self::Visits => "visit counts exploration density heatmap",
            Self::Plain => "map alone plain no colours off",
        }
    }

    /// Returns the next (or previous) field that is `available`; [`Self::Plain`] always has to be.
    #[must_use]
    pub fn cycle(self, forward: bool, available: impl Fn(Self) -> bool) -> Self {
        let count = Self::ALL.len();
        let mut at = self as usize;
        loop {
            at = (at + if forward { 1 } else { count - 1 }) % count;
            if available(Self::ALL[at]) {
                return Self::ALL[at];
            }
        }
    }

    /// Whether its values are numbers of steps.
    pub fn is_distance(self) -> bool {
        matches!(
            self,
            Self::Learned | Self::FromStart | Self::OverEach | Self::Composed | Self::True
        )
    }

    /// Whether its values depend on where the agent starts.
    pub fn depends_on_start(self) -> bool {
        matches!(self, Self::FromStart | Self::OverEach)
    }

    /// Whether its values mean nothing where no agent has been.
    pub fn fades(self) -> bool {
        self.depends_on_start() || matches!(self, Self::Learned | Self::Composed | Self::Plain)
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

/// Returns the mean of D in a film's frame over places, each with a weight; NaN if it is not known
/// at any place with a positive weight.
fn mean_distance(frame: &FilmFrame, places: impl IntoIterator<Item = (usize, f32)>) -> f32 {
    let weighted = places.into_iter().filter(|(_, weight)| *weight > 0.0);
    let (sum, weights) = weighted
        .map(|(place, weight)| (frame.distance(place), weight))
        .filter(|(distance, _)| distance.is_finite())
        .fold((0.0, 0.0), |(sum, weights), (distance, weight)| {
            (sum + weight * distance, weights + weight)
        });
    if weights > 0.0 { sum / weights } else { f32::NAN }
}
