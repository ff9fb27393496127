//! Worlds without a map: D on planes in the space of goals, and an agent that reaches for the goal
//! again and again. An arm is one whose goals are positions in space.

use std::any::Any;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::pilot::{Graph, Reach, Reacher};
use super::{Field, SceneWorker, Shown, View, distances, mean_distance};
use crate::draw::Raster;
use crate::engine::Snapshot;
use crate::env::fetch_reach::{Pose, ProbeLattice};
use crate::env::{ArmScene, FetchReach, Rendering, Scene};
use crate::learn::Scratch;
use crate::train::FilmFrame;

/// Time between two steps of the agent.
const STEP_INTERVAL: Duration = Duration::from_millis(90);

/// Most steps to a goal in worlds without an own limit, as in evaluation.
const REACH_STEPS: u32 = 500;

/// A request about a world without a map.
#[derive(Clone, Debug)]
pub enum Request {
    /// Goal of the displayed distances and of the agent, `(goal_dim)`, or a random one; and the
    /// number of this request.
    Goal(Option<Vec<f32>>, u64),
    /// Where an arm starts next, in metres; `None` for one of the world's own starts.
    Start(Option<Vec<f32>>),
    /// The planes to show D on.
    Planes(Arc<Vec<Plane>>),
    /// Render pictures of at most this width and height, or none.
    Picture(Option<(usize, usize)>),
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
    pub fn is_open(&self, i: usize, near: &[f32], scene: &Scene) -> bool {
        let at = || self.point(self.raster.middle_of(i), near);
        match scene {
            Scene::Arm(arm) => <[f32; 3]>::try_from(at()).is_ok_and(|at| arm.has_room(at)),
            Scene::Goals(space) => {
                // Only the first two components are positions in its maze.
                let is_position = |axis: &[f32]| axis.iter().take(2).any(|along| *along != 0.0);
                let are_both = is_position(&self.across) && is_position(&self.up);
                !are_both || !space.is_wall([at()[0], at()[1]])
            }
            Scene::Maze(_) => true,
        }
    }
}

/// What the screen shows of a world without a map at one moment.
#[derive(Clone, Debug, Default)]
pub struct SpaceView {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<Vec<f32>>, u64),
    /// The quantity that the fields show.
    pub kind: Field,
    /// The frame of the film that the fields show instead, if any.
    pub past: Option<Arc<FilmFrame>>,
    /// The planes of the fields.
    pub planes: Arc<Vec<Plane>>,
    /// The values on each plane, row by row; NaN where no agent can be.
    pub fields: Arc<Vec<Vec<f32>>>,
    /// The largest value, at least 1.
    pub farthest: f32,
    /// The bridge graph; its places are goals.
    pub graph: Arc<Graph>,
    /// The agent's reach.
    pub reach: Reach,
    /// The positions of an arm's parts.
    pub pose: Option<Pose>,
    /// The world's own picture of the agent, or why there is none; only if one is wanted.
    pub picture: Option<Result<Arc<Rendering>, String>>,
}

/// Computes what is shown of a world without a map.
pub(super) struct SpaceWorker {
    scene: Scene,
    reacher: Reacher,
    shown: Shown,
    planes: Arc<Vec<Plane>>,
    /// Width and height of the pictures wanted, and when the latest was begun and took how long.
    picture: Option<(usize, usize)>,
    rendered: Option<(Instant, Duration)>,
    /// State and goal of that picture.
    pictured: Vec<f32>,
    view: SpaceView,
    scratch: Scratch,
}

impl SpaceWorker {
    pub(super) fn new(snapshot: &Snapshot) -> Self {
        let world = match &snapshot.scene {
            Scene::Goals(space) => space.world(),
            Scene::Arm(_) => Ok(Box::new(FetchReach::new(1)) as _),
            Scene::Maze(maze) => Ok(Box::new(crate::env::PointMaze::new(maze.map.clone(), 1)) as _),
        };
        Self {
            scene: snapshot.scene.clone(),
            reacher: Reacher::new(world, snapshot),
            shown: Shown::new(snapshot),
            planes: Arc::default(),
            picture: None,
            rendered: None,
            pictured: Vec::new(),
            view: SpaceView::default(),
            scratch: Scratch::default(),
        }
    }

    /// Starts a reach with an arm's grip near a position, or at one of the world's own starts.
    fn restart(&mut self, at: Option<Vec<f32>>) {
        let world = self.reacher.world_mut();
        let arm = world.and_then(|world| (world as &mut dyn Any).downcast_mut::<FetchReach>());
        match (at.and_then(|at| <[f32; 3]>::try_from(at).ok()), arm) {
            (Some(at), Some(arm)) => {
                arm.put(0, at);
                self.reacher.begin();
            }
            _ => self.reacher.restart(),
        }
    }

    /// Renders the world's own picture, if one is wanted: for at most half of the time.
    fn render(&mut self) {
        let (Some(most), Some(goal)) = (self.picture, &self.reacher.goal) else { return };
        if self.rendered.is_some_and(|(began, took)| began.elapsed() < 2 * took) {
            return;
        }
        let Some(world) = self.reacher.world() else { return };
        let shown = [world.states(), goal].concat();
        if self.view.picture.is_some() && self.pictured == shown {
            return;
        }
        let began = Instant::now();
        let picture = match world.abilities().rendered {
            Some(rendered) => rendered.picture(goal, most).map(Arc::new),
            None => Err("this world renders no pictures".to_owned()),
        };
        (self.view.picture, self.pictured) = (Some(picture), shown);
        self.rendered = Some((began, began.elapsed()));
        self.shown.changed = true;
    }

    fn refresh_fields(&mut self) {
        let began = Instant::now();
        let planes = self.planes.clone();
        let past = (self.shown.past.clone(), &self.scene);
        let fields: Vec<Vec<f32>> = if let (Some(frame), Scene::Arm(arm)) = past {
            planes.iter().map(|plane| film_field(*arm, &frame, plane)).collect()
        } else {
            let Some(goal) = self.reacher.goal.clone() else { return };
            planes.iter().map(|plane| self.field(plane, &goal)).collect()
        };
        let values = fields.iter().flatten().copied().filter(|value| value.is_finite());
        self.view.past = self.shown.past.clone();
        let farthest = self.view.past.as_ref().map(|frame| frame.farthest());
        self.view.farthest = farthest.unwrap_or_else(|| values.fold(1.0, f32::max));
        (self.view.planes, self.view.fields) = (planes, Arc::new(fields));
        self.shown.timer.done(began);
        self.shown.changed = true;
    }

    /// Computes the value at every pixel of a plane: from the agent's start to goals on the plane
    /// through `goal`; or to `goal`, from states on the plane through it, of an arm at rest, or
    /// else from states like the agent's.
    fn field(&mut self, plane: &Plane, goal: &[f32]) -> Vec<f32> {
        let mut field = vec![f32::NAN; plane.raster.len()];
        let kind = self.shown.kind;
        let Some(world) = self.reacher.world() else { return field };
        let is_arm = matches!(self.scene, Scene::Arm(_));
        let like_agent = !is_arm && kind != Field::FromStart;
        let near = if like_agent { &*self.reacher.reach.at } else { goal };
        if near.len() != goal.len() {
            return field;
        }
        let open: Vec<usize> =
            (0..field.len()).filter(|i| plane.is_open(*i, near, &self.scene)).collect();
        if kind == Field::Plain || open.is_empty() {
            return field;
        }
        let places: Vec<f32> =
            open.iter().flat_map(|i| plane.point(plane.raster.middle_of(*i), near)).collect();
        let policy = &*self.shown.networks.policy;
        let spec = world.spec();
        let state = if is_arm { vec![0.0; spec.state_dim()] } else { world.states().to_vec() };
        let mut states = state.repeat(open.len());
        let each = states.chunks_exact_mut(state.len()).zip(places.chunks_exact(near.len()));
        for (state, place) in each {
            spec.achieved.iter().zip(place).for_each(|(i, value)| state[*i] = *value);
        }
        let (graph, ends) = (self.reacher.pilot.graph(), [&*self.reacher.reach.start_state, goal]);
        let values = distances(kind, policy, graph, [&states, &places], ends, &mut self.scratch);
        open.into_iter().zip(values).for_each(|(i, value)| field[i] = value);
        field
    }
}

impl SceneWorker for SpaceWorker {
    fn draws(&self, scene: &Scene) -> bool {
        match (scene, &self.scene) {
            (Scene::Arm(other), Scene::Arm(own)) => other == own,
            (Scene::Goals(other), Scene::Goals(own)) => other == own,
            _ => false,
        }
    }

    fn step_interval(&self) -> Duration {
        STEP_INTERVAL
    }

    fn shown(&mut self) -> &mut Shown {
        &mut self.shown
    }

    fn handle_own(&mut self, request: super::Request) {
        let super::Request::Space(request) = request else { return };
        match request {
            Request::Goal(goal, number) => {
                self.view.goal.1 = number;
                match goal {
                    Some(goal) => self.reacher.reach_for(goal),
                    None => self.reacher.reach_for_any(),
                }
            }
            Request::Start(at) => {
                self.restart(at);
                if self.shown.kind != Field::FromStart {
                    return;
                }
            }
            Request::Planes(planes) => self.planes = planes,
            Request::Picture(most) => {
                (self.picture, self.rendered) = (most, None);
                self.view.picture = None;
                return self.render();
            }
        }
        self.shown.timer.make_due();
    }

    fn walk(&mut self) {
        let most = match &self.scene {
            Scene::Arm(arm) => Some(arm.episode_steps()),
            Scene::Goals(space) => space.episode_steps(),
            Scene::Maze(_) => None,
        };
        if self.reacher.step(most.unwrap_or(REACH_STEPS), self.shown.on_arrival) {
            self.shown.timer.make_due();
        }
        self.shown.changed |= self.reacher.goal.is_some();
        self.render();
    }

    fn refresh(&mut self, snapshot: &Snapshot) {
        if self.reacher.refresh(snapshot) {
            self.view.graph = Arc::new(self.reacher.pilot.shown_graph());
            self.shown.changed = true;
        }
        if self.shown.follow(snapshot) {
            self.refresh_fields();
        }
    }

    fn changed_view(&mut self) -> Option<View> {
        std::mem::take(&mut self.shown.changed).then(|| {
            self.view.kind = self.shown.kind;
            self.view.goal.0.clone_from(&self.reacher.goal);
            let arm = self.reacher.world();
            let arm = arm.and_then(|world| (world as &dyn Any).downcast_ref::<FetchReach>());
            self.view.pose = arm.map(|arm| arm.pose(0));
            self.view.reach = self.reacher.reach.clone();
            View::Space(Arc::new(self.view.clone()))
        })
    }
}

/// Returns D in a film's frame at every pixel of a plane through the frame's goal, from the points
/// in space that were filmed; NaN where the grip cannot be.
fn film_field(scene: ArmScene, frame: &FilmFrame, plane: &Plane) -> Vec<f32> {
    let lattice = ProbeLattice::new(&scene);
    let value = |i: usize| {
        let at = plane.point(plane.raster.middle_of(i), &frame.goal);
        // Beside the table, only some of the points have a value.
        let at = <[f32; 3]>::try_from(at).ok().filter(|at| scene.has_room(*at));
        let around = at.and_then(|at| lattice.around(at));
        around.map_or(f32::NAN, |around| mean_distance(frame, around))
    };
    (0..plane.raster.len()).map(value).collect()
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
