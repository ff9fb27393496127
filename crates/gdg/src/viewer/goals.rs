//! A space of goals: D over two of its components, and an agent that reaches for the goal again and
//! again.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::pilot::NumberedEdge;
use super::reach::{Reach, Reacher};
use super::{Field, SceneWorker, Shown, View};
use crate::draw::Raster;
use crate::engine::Snapshot;
use crate::env::{GoalSpace, Rendering, Scene};
use crate::learn::Scratch;

/// Time between two steps of the agent.
const STEP_INTERVAL: Duration = Duration::from_millis(80);

/// Most steps to a goal in worlds without an own limit, as in evaluation.
const REACH_STEPS: u32 = 500;

/// Candidates considered at each pixel for D along the bridge graph.
const LINK_CANDIDATES_PER_PIXEL: usize = 6;

/// A request about a space of goals.
#[derive(Clone, Debug)]
pub enum Request {
    /// Goal of the displayed distances and of the agent, `(goal_dim)`, or a random one; and the
    /// number of this request.
    Goal(Option<Vec<f32>>, u64),
    /// Puts the agent at one of the world's own starts.
    Restart,
    /// What the pixels show.
    Slice(Slice),
    /// Render pictures of at most this width and height, or none.
    Picture(Option<(usize, usize)>),
}

/// Two components of goals, and the pixels that show them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slice {
    /// The component to the right, and the one upwards; the same for goals of a single number.
    pub axes: [usize; 2],
    /// How many units to the right are as long as one upwards.
    pub stretch: f32,
    /// The part shown: to the right and, against the component upwards, downwards.
    pub raster: Raster,
}

impl Slice {
    /// Returns where a place `(goal_dim)` is shown: to the right and downwards.
    pub fn flat(&self, at: &[f32]) -> [f32; 2] {
        let [across, up] = self.axes;
        [at[across], if across == up { 0.0 } else { -self.stretch * at[up] }]
    }

    /// Returns `near` `(goal_dim)` with both components as they are shown at `right`, `down`.
    pub fn point(&self, [right, down]: [f32; 2], near: &[f32]) -> Vec<f32> {
        let mut at = near.to_vec();
        // The component to the right comes last, as it may be the only one.
        at[self.axes[1]] = -down / self.stretch;
        at[self.axes[0]] = right;
        at
    }

    /// Returns whether pixel `i` shows a wall of the maze, if there is one.
    pub fn is_wall(&self, i: usize, space: &GoalSpace) -> bool {
        let are_positions = [[0, 1], [1, 0]].contains(&self.axes);
        are_positions && {
            let at = self.pixel(i, &[0.0; 2]);
            space.is_wall([at[0], at[1]])
        }
    }

    /// Returns `near` with both components as pixel `i` shows them.
    fn pixel(&self, i: usize, near: &[f32]) -> Vec<f32> {
        self.point(self.raster.middle_of(i), near)
    }
}

/// What the screen shows of a space of goals at one moment.
#[derive(Clone, Debug, Default)]
pub struct GoalsView {
    /// The goal, and the number of the request that set it.
    pub goal: (Option<Vec<f32>>, u64),
    /// The quantity that the field shows.
    pub kind: Field,
    /// What the field's pixels show.
    pub slice: Option<Slice>,
    /// The values, row by row.
    pub field: Arc<Vec<f32>>,
    /// The largest value, at least 1.
    pub farthest: f32,
    /// Bridge candidates, `(goal_dim)` each: where the agents have been.
    pub candidates: Arc<Vec<Vec<f32>>>,
    /// Edges of the bridge graph.
    pub edges: Arc<Vec<NumberedEdge>>,
    /// The agent's reach.
    pub reach: Reach,
    /// The world's own picture of the agent, or why there is none; only if one is wanted.
    pub picture: Option<Result<Arc<Rendering>, String>>,
}

/// Computes what is shown of a space of goals.
pub(super) struct GoalsWorker {
    space: GoalSpace,
    reacher: Reacher,
    shown: Shown,
    slice: Option<Slice>,
    /// Width and height of the pictures wanted, and when the latest was begun and took how long.
    picture: Option<(usize, usize)>,
    rendered: Option<(Instant, Duration)>,
    /// State and goal of that picture.
    pictured: Vec<f32>,
    view: GoalsView,
    scratch: Scratch,
}

impl GoalsWorker {
    /// Creates the worker for the world of `snapshot`.
    pub(super) fn new(space: GoalSpace, snapshot: &Snapshot) -> Self {
        Self {
            reacher: Reacher::new(space.world(), snapshot),
            space,
            shown: Shown::new(snapshot),
            slice: None,
            picture: None,
            rendered: None,
            pictured: Vec::new(),
            view: GoalsView::default(),
            scratch: Scratch::default(),
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

    /// Recomputes the field.
    fn refresh_field(&mut self) {
        let began = Instant::now();
        let (Some(slice), Some(goal)) = (self.slice, self.reacher.goal.clone()) else { return };
        let mut field = match self.shown.kind {
            Field::Plain => vec![f32::NAN; slice.raster.len()],
            _ => self.distances(&slice, &goal),
        };
        // No agent can be in a wall: D is nothing there.
        for (i, steps) in field.iter_mut().enumerate() {
            if slice.is_wall(i, &self.space) {
                *steps = f32::NAN;
            }
        }
        self.view.farthest =
            field.iter().copied().filter(|steps| steps.is_finite()).fold(1.0, f32::max);
        (self.view.slice, self.view.field) = (Some(slice), Arc::new(field));
        self.shown.timer.done(began);
        self.shown.changed = true;
    }

    /// Returns the value at every pixel: from the agent's start to goals that differ from `goal` in
    /// the components shown; or to `goal`, from states that differ in them from the agent's.
    fn distances(&mut self, slice: &Slice, goal: &[f32]) -> Vec<f32> {
        let policy = &*self.shown.networks.policy;
        let pixels = 0..slice.raster.len();
        let mut distances = vec![0.0; pixels.len()];
        let Some(world) = self.reacher.world() else { return vec![f32::NAN; distances.len()] };
        if self.shown.kind == Field::FromStart {
            let goals: Vec<f32> = pixels.flat_map(|i| slice.pixel(i, goal)).collect();
            let starts = self.reacher.reach.start_state.repeat(distances.len());
            policy.distances(&starts, &goals, &mut distances, &mut self.scratch);
            return distances;
        }
        let state = world.states();
        let mut states = state.repeat(pixels.len());
        for (i, state) in pixels.zip(states.chunks_exact_mut(state.len())) {
            let place = slice.pixel(i, &self.reacher.reach.at);
            self.space.spec().achieved.iter().zip(place).for_each(|(n, value)| state[*n] = value);
        }
        if let (Field::Composed, Some(graph)) = (self.shown.kind, self.reacher.pilot.graph()) {
            let route = graph.route(goal, policy, &mut self.scratch);
            let links = LINK_CANDIDATES_PER_PIXEL;
            return graph.composed_distances(&states, &route, links, policy, &mut self.scratch);
        }
        let goals = goal.repeat(distances.len());
        policy.distances(&states, &goals, &mut distances, &mut self.scratch);
        distances
    }
}

impl SceneWorker for GoalsWorker {
    fn draws(&self, scene: &Scene) -> bool {
        matches!(scene, Scene::Goals(space) if *space == self.space)
    }

    fn step_interval(&self) -> Duration {
        STEP_INTERVAL
    }

    fn shown(&mut self) -> &mut Shown {
        &mut self.shown
    }

    fn handle_own(&mut self, request: super::Request) {
        let super::Request::Goals(request) = request else { return };
        match request {
            Request::Goal(goal, number) => {
                match goal {
                    Some(goal) => self.reacher.reach_for(goal),
                    None => self.reacher.reach_for_any(),
                }
                self.view.goal.1 = number;
            }
            Request::Restart => self.reacher.restart(),
            Request::Slice(slice) => self.slice = Some(slice),
            Request::Picture(most) => {
                (self.picture, self.rendered) = (most, None);
                self.view.picture = None;
                return self.render();
            }
        }
        self.shown.timer.make_due();
    }

    fn walk(&mut self) {
        let most = self.space.episode_steps().unwrap_or(REACH_STEPS);
        if self.reacher.step(most, self.shown.on_arrival) {
            self.shown.timer.make_due();
        }
        self.shown.changed |= self.reacher.goal.is_some();
        self.render();
    }

    fn refresh(&mut self, snapshot: &Snapshot) {
        if self.reacher.refresh(snapshot) {
            let (candidates, edges) = self.reacher.pilot.candidates_and_edges();
            (self.view.candidates, self.view.edges) = (Arc::new(candidates), Arc::new(edges));
            self.shown.changed = true;
        }
        if self.shown.follow(snapshot) {
            self.refresh_field();
        }
    }

    fn changed_view(&mut self) -> Option<View> {
        std::mem::take(&mut self.shown.changed).then(|| {
            self.view.kind = self.shown.kind;
            self.view.goal.0.clone_from(&self.reacher.goal);
            self.view.reach = self.reacher.reach.clone();
            View::Goals(Arc::new(self.view.clone()))
        })
    }
}
