//! An arm: D on planes through the goal, and an arm that reaches for the goal again and again.

mod past;
mod plane;

use std::any::Any;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::pilot::{Candidate, ShownEdge, position};
use super::reach::{Reach, Reacher};
use super::{Field, SceneWorker, Shown, View};
use crate::engine::Snapshot;
use crate::env::fetch_reach::Pose;
use crate::env::{ArmScene, FetchReach, Scene};
use crate::learn::Scratch;
use crate::train::FilmFrame;
pub use past::{film_field, film_goal};
pub use plane::Plane;

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
    /// The current reach.
    pub reach: Reach,
}

/// Computes what is shown of an arm.
pub(super) struct ArmWorker {
    scene: ArmScene,
    reacher: Reacher,
    shown: Shown,
    planes: Arc<Vec<Plane>>,
    view: ArmView,
    scratch: Scratch,
}

impl ArmWorker {
    /// Creates the worker for the arm of `snapshot`.
    pub(super) fn new(scene: ArmScene, snapshot: &Snapshot) -> Self {
        Self {
            scene,
            reacher: Reacher::new(Ok(Box::new(scene.world(1))), snapshot),
            shown: Shown::new(snapshot),
            planes: Arc::default(),
            view: ArmView::default(),
            scratch: Scratch::default(),
        }
    }

    /// Returns the arm.
    fn arm(&self) -> Option<&FetchReach> {
        self.reacher.world().and_then(|world| (world as &dyn Any).downcast_ref())
    }

    /// Starts a reach with the grip near a position, or at one of the world's own starts.
    fn restart(&mut self, at: Option<[f32; 3]>) {
        let world = self.reacher.world_mut();
        let arm = world.and_then(|world| (world as &mut dyn Any).downcast_mut::<FetchReach>());
        match (at, arm) {
            (Some(at), Some(arm)) => {
                arm.put(0, at);
                self.reacher.begin();
            }
            _ => self.reacher.restart(),
        }
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
        } else if let Some(goal) = self.reacher.goal.as_deref().map(position) {
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
                self.view.goal.1 = number;
                self.reacher.reach_for(goal.to_vec());
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
        let (most, on_arrival) = (self.scene.episode_steps(), self.shown.on_arrival);
        if self.reacher.step(most, on_arrival) {
            self.shown.timer.make_due();
        }
        self.shown.changed |= self.reacher.goal.is_some();
    }

    fn refresh(&mut self, snapshot: &Snapshot) {
        if self.reacher.refresh(snapshot) {
            let (candidates, edges) = self.reacher.pilot.shown_graph();
            (self.view.candidates, self.view.edges) = (Arc::new(candidates), Arc::new(edges));
            self.shown.changed = true;
        }
        if self.shown.follow(snapshot) {
            self.refresh_fields();
        }
    }

    fn changed_view(&mut self) -> Option<View> {
        std::mem::take(&mut self.shown.changed).then(|| {
            self.view.kind = self.shown.kind;
            self.view.goal.0 = self.reacher.goal.as_deref().map(position);
            self.view.pose = self.arm().map(|arm| arm.pose(0)).unwrap_or_default();
            self.view.reach = self.reacher.reach.clone();
            View::Arm(Arc::new(self.view.clone()))
        })
    }
}
