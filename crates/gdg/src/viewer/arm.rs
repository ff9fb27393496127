//! An arm: D on planes through the goal, and an arm that reaches for the goal again and again.

mod past;
mod plane;
mod reach;

use std::sync::Arc;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::pilot::{Candidate, OnArrival, Pilot, ShownEdge};
use super::{Field, SceneWorker, Shown, View};
use crate::engine::Snapshot;
use crate::env::fetch_reach::Pose;
use crate::env::{ArmScene, Environment, FetchReach, Scene};
use crate::learn::Scratch;
use crate::train::FilmFrame;
pub use past::{film_field, film_goal};
pub use plane::Plane;
pub use reach::Reach;

/// Time between two steps of the arm: two and a half times slower than real time, since most
/// reaches take only a few steps.
const STEP_INTERVAL: Duration = Duration::from_millis(100);

/// A request about an arm.
#[derive(Clone, Debug)]
pub enum Request {
    /// Goal of the displayed distances and of the arm in metres, and the number of this request.
    Goal([f32; 3], u64),
    /// Where the arm starts next; `None` for one of the world's own starts.
    Start(Option<[f32; 3]>),
    /// The planes to show D on.
    Planes(Arc<Vec<Plane>>),
}

/// What the screen shows of an arm at one moment.
#[derive(Clone, Debug, Default)]
pub struct ArmView {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<[f32; 3]>, u64),
    /// The quantity that the fields show.
    pub kind: Field,
    /// The frame of the film that the fields show instead, if any.
    pub past: Option<Arc<FilmFrame>>,
    /// The planes of the fields.
    pub planes: Arc<Vec<Plane>>,
    /// The values on each plane, row by row; NaN where there is none.
    pub fields: Arc<Vec<Vec<f32>>>,
    /// The largest value, at least 1.
    pub farthest: f32,
    /// Bridge candidates.
    pub candidates: Arc<Vec<Candidate<3>>>,
    /// Edges of the bridge graph.
    pub edges: Arc<Vec<ShownEdge<3>>>,
    /// The positions of the arm's parts.
    pub pose: Pose,
    /// Waypoints ahead of the grip, ending at the goal.
    pub path: Vec<[f32; 3]>,
    /// Recent positions of the grip, the current one last.
    pub trail: Vec<[f32; 3]>,
    /// The current reach.
    pub reach: Reach,
}

/// Computes what is shown of an arm.
pub(super) struct ArmWorker {
    scene: ArmScene,
    world: FetchReach,
    rng: ChaCha8Rng,
    pilot: Pilot,
    shown: Shown,
    planes: Arc<Vec<Plane>>,
    resting: u32,
    view: ArmView,
    scratch: Scratch,
}

impl ArmWorker {
    /// Creates the worker for the arm of `snapshot`.
    pub(super) fn new(scene: ArmScene, snapshot: &Snapshot) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(snapshot.run.seed);
        // The screen draws its goals from the first stream.
        rng.set_stream(1);
        let mut worker = Self {
            scene,
            world: scene.world(1),
            rng,
            pilot: Pilot::new(snapshot),
            shown: Shown::new(snapshot),
            planes: Arc::default(),
            resting: 0,
            view: ArmView::default(),
            scratch: Scratch::default(),
        };
        worker.restart(None);
        worker
    }

    /// Returns the arm's state.
    fn state(&self) -> Vec<f32> {
        self.world.states().to_vec()
    }

    /// Recomputes D on all planes.
    fn refresh_fields(&mut self) {
        let began = Instant::now();
        self.view.farthest = 1.0;
        self.view.past = self.shown.past.clone();
        if let Some(frame) = &self.shown.past {
            let fields =
                self.planes.iter().map(|plane| film_field(&self.scene, frame, plane)).collect();
            (self.view.planes, self.view.fields) = (self.planes.clone(), Arc::new(fields));
            self.view.farthest = frame.farthest();
        } else if let Some(goal) = self.view.goal.0 {
            let planes = self.planes.clone();
            let fields: Vec<Vec<f32>> =
                planes.iter().map(|plane| self.field(plane, goal)).collect();
            self.view.farthest =
                fields.iter().flatten().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
            (self.view.planes, self.view.fields) = (planes, Arc::new(fields));
        }
        self.shown.timer.done(began);
        self.shown.changed = true;
    }
}

impl SceneWorker for ArmWorker {
    fn draws(&self, scene: &Scene) -> bool {
        matches!(scene, Scene::Arm(scene) if *scene == self.scene)
    }

    fn step_interval(&self) -> Duration {
        STEP_INTERVAL
    }

    fn shown(&mut self) -> &mut Shown {
        &mut self.shown
    }

    fn handle_own(&mut self, request: super::Request) {
        let super::Request::Arm(request) = request else { return };
        match request {
            Request::Goal(goal, number) => {
                self.view.goal = (Some(goal), number);
                self.start_reach();
                self.shown.timer.make_due();
            }
            Request::Start(at) => {
                self.restart(at);
                if self.shown.kind == Field::FromStart {
                    self.shown.timer.make_due();
                }
            }
            Request::Planes(planes) => {
                self.planes = planes;
                self.shown.timer.make_due();
            }
        }
    }

    fn walk(&mut self) {
        self.reach_on();
    }

    fn refresh(&mut self, snapshot: &Snapshot) {
        if self.pilot.refresh(snapshot, self.world.spec()) {
            let (candidates, edges) = self.pilot.shown_graph();
            (self.view.candidates, self.view.edges) = (Arc::new(candidates), Arc::new(edges));
            self.shown.changed = true;
        }
        if self.shown.follow(snapshot) {
            self.refresh_fields();
        }
    }

    fn changed_view(&mut self) -> Option<View> {
        self.view.kind = self.shown.kind;
        std::mem::take(&mut self.shown.changed).then(|| View::Arm(Arc::new(self.view.clone())))
    }
}
