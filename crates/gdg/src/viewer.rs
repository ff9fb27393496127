//! What the screen shows of a run, computed from copies of the networks on a separate thread:
//! distance fields, the bridge graph, the planned path, and an agent walking to the goal.
//!
//! `worker` computes it; `pilot` leads the agent, `cells` has the facts about maps, and
//! `interpolation` gives D of the past.

mod cells;
mod interpolation;
mod pilot;
mod worker;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::draw::Raster;
use crate::engine::{Engine, Snapshot};
use crate::env::WorldScene;
use crate::env::fetch_reach::Pose;
use crate::map::Cell;
use crate::train::FilmFrame;
pub use cells::{CellInfo, Exploration, Knowledge, cell_of_goal, way_along};
pub use interpolation::FilmedMap;
pub use pilot::{Candidate, Ghost, Graph, OnArrival, Reach};
use worker::ViewerWorker;

/// Time between two steps of the walking agent.
const STEP_INTERVAL: Duration = Duration::from_millis(75);

/// A request from the screen. Those that do not fit the world date from before another run was
/// loaded, and are ignored. Goals and places are `(goal_dim)`.
#[derive(Clone, Debug)]
pub enum Request {
    /// What the walking agent does at the goal.
    OnArrival(OnArrival),
    /// The quantity to show by colours.
    Field(Field),
    /// The frame of the film to show instead of the present, if any.
    Past(Option<Arc<FilmFrame>>),
    /// Goal of the displayed distances and of the walking agent, or a random one; and the number of
    /// this request.
    Goal(Option<Vec<f32>>, u64),
    /// Where the agent of a maze or an arm starts next; `None` for one of the world's own starts.
    Start(Option<Vec<f32>>),
    /// The planes to show D on.
    Planes(Arc<Vec<Plane>>),
    Inspect(Option<Cell>),
}

/// What the screen shows at one moment. Goals and places are `(goal_dim)`.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<Vec<f32>>, u64),
    /// The quantity that the fields show.
    pub kind: Field,
    /// The frame of the film that the fields show instead, if any.
    pub past: Option<Arc<FilmFrame>>,
    /// The planes of the fields; a maze has one.
    pub planes: Arc<Vec<Plane>>,
    /// The values on each plane, row by row; NaN at walls and where no agent can be.
    pub fields: Arc<Vec<Vec<f32>>>,
    /// The largest value, at least 1.
    pub farthest: f32,
    pub graph: Arc<Graph>,
    pub reach: Reach,
    /// The positions of an arm's parts.
    pub pose: Option<Pose>,
    /// What the agents have explored of a maze.
    pub exploration: Arc<Exploration>,
    /// The cells, row by row, from which no path leads to the goal, although they are free. Empty
    /// if there are none.
    pub cut_off: Arc<Vec<bool>>,
    /// Information about the cell under the cursor.
    pub inspected: Option<CellInfo>,
}

impl View {
    /// Returns the only field of a maze, and its pixels.
    pub fn field(&self) -> Option<(&[f32], Raster)> {
        Some((self.fields.first()?, self.planes.first()?.raster))
    }
}

/// A plane in the space of goals, and the pixels that show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The part shown: to the right and downwards.
    pub raster: Raster,
    /// The direction to the right, `(goal_dim)`, of length 1.
    pub across: Vec<f32>,
    /// The direction upwards, of length 1 and at right angles to `across`; 0 for goals of a single
    /// number.
    pub up: Vec<f32>,
    /// How many units to the right are as long as one upwards.
    pub stretch: f32,
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Plane {
    /// The plane of a maze: y is down.
    pub fn of_maze(raster: Raster) -> Self {
        Self { raster, across: vec![1.0, 0.0], up: vec![0.0, -1.0], stretch: 1.0 }
    }

    /// Returns where a place is shown: to the right and downwards.
    pub fn flat(&self, at: &[f32]) -> [f32; 2] {
        [dot(at, &self.across), -self.stretch * dot(at, &self.up)]
    }

    /// Returns where the line of sight to a point on the screen, to the right and downwards, meets
    /// the plane through `near`.
    pub fn point(&self, [right, down]: [f32; 2], near: &[f32]) -> Vec<f32> {
        let by = [right - dot(near, &self.across), -down / self.stretch - dot(near, &self.up)];
        let axes = self.across.iter().zip(&self.up);
        near.iter().zip(axes).map(|(at, (x, y))| at + by[0] * x + by[1] * y).collect()
    }

    /// Returns whether an agent may be at what pixel `i` shows of the plane through `near`.
    pub fn is_open(&self, i: usize, near: &[f32], scene: &WorldScene) -> bool {
        let at = || self.point(self.raster.middle_of(i), near);
        match scene {
            WorldScene::Arm(arm) => <[f32; 3]>::try_from(at()).is_ok_and(|at| arm.has_room(at)),
            WorldScene::Goals(space) => {
                // Only the first two components are positions in its maze.
                let is_position = |axis: &[f32]| axis.iter().take(2).any(|along| *along != 0.0);
                let are_both = is_position(&self.across) && is_position(&self.up);
                !are_both || !space.is_wall([at()[0], at()[1]])
            }
            WorldScene::Maze(_) => true,
        }
    }
}

/// Handle to the thread that computes views.
pub struct Viewer {
    requests: Sender<Request>,
    views: watch::Receiver<Arc<View>>,
}

impl Viewer {
    /// Starts the thread on the snapshots of `engine`.
    pub fn start(engine: &Engine) -> std::io::Result<Self> {
        let (requests, inbox) = channel();
        let (publish, views) = watch::channel(Arc::default());
        let snapshots = engine.snapshots();
        // A world in another process takes seconds to start; the engine publishes meanwhile.
        let view = move || run(&snapshots, &inbox, &publish);
        std::thread::Builder::new().name("viewer".to_owned()).spawn(view)?;
        Ok(Self::new(requests, views))
    }

    /// Connects with what takes `requests` and publishes `views`, as [`Self::start`] does.
    pub fn new(requests: Sender<Request>, views: watch::Receiver<Arc<View>>) -> Self {
        Self { requests, views }
    }

    /// Sends a request. Errors are ignored: the thread ends only with the program.
    pub fn request(&self, request: Request) {
        let _ = self.requests.send(request);
    }

    pub fn views(&self) -> watch::Receiver<Arc<View>> {
        self.views.clone()
    }
}

fn run(
    snapshots: &watch::Receiver<Arc<Snapshot>>,
    inbox: &Receiver<Request>,
    publish: &watch::Sender<Arc<View>>,
) {
    let latest = || snapshots.borrow().clone();
    let mut worker = ViewerWorker::new(&latest());
    let mut stepped = Instant::now();
    loop {
        crate::faults::point("viewer");
        match inbox.recv_timeout(STEP_INTERVAL.saturating_sub(stepped.elapsed())) {
            Ok(request) => {
                // Handles all queued requests before computing anything for them.
                let mut next = Some(request);
                while let Some(request) = next {
                    worker.enter(&latest());
                    worker.handle(request);
                    next = inbox.try_recv().ok();
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                stepped = Instant::now();
                worker.walk();
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let snapshot = latest();
        worker.enter(&snapshot);
        worker.refresh(&snapshot);
        if let Some(view) = worker.changed_view() {
            publish.send_replace(Arc::new(view));
        }
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
    Plain,
}

impl Field {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_plane_keep_the_other_coordinates_of_the_goal() {
        let raster = Raster { window: [0.0; 4], pixels: (1, 1) };
        let of = |across: [f32; 3], up: [f32; 3], stretch| Plane {
            raster,
            across: across.to_vec(),
            up: up.to_vec(),
            stretch,
        };
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let goal = [1.3, 0.7, 0.5];
        for (plane, expected) in [
            (of(x, z, 1.0), [1.2, 0.7, 0.6]),
            (of(y, z, 1.0), [1.3, 1.2, 0.6]),
            (of(x, y, 2.0), [1.2, 0.3, 0.5]),
        ] {
            let at = plane.point([1.2, -0.6], &goal);
            assert!((0..3).all(|i| (at[i] - expected[i]).abs() < 1e-6), "{at:?}");
            let flat = plane.flat(&at);
            assert!((flat[0] - 1.2).abs() < 1e-6 && (flat[1] + 0.6).abs() < 1e-6, "{flat:?}");
        }
    }
}
