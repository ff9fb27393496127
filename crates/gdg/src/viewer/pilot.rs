//! Leads the agent on the screen through any world, by the current policy and a plan through the
//! bridge graph.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;

use crate::bridge::{BridgeGraph, EdgeStatus, Guide, Walker};
use crate::engine::{Networks, Snapshot};
use crate::env::{EnvError, Environment};
use crate::learn::Scratch;
use crate::train::Run;

/// What the walking agent does after arriving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnArrival {
    #[default]
    Again,
    /// Continues to another goal.
    Visit,
    Stay,
    /// Waits for another start or goal, also where it gives up.
    Wait,
}

impl OnArrival {
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Again => Self::Visit,
            Self::Visit => Self::Stay,
            Self::Stay => Self::Again,
            Self::Wait => Self::Wait,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Again => "restart",
            Self::Visit => "visit other goals",
            Self::Stay => "stay",
            Self::Wait => "wait",
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Its place, `(goal_dim)`.
    pub at: Vec<f32>,
    /// Its out-degree, relative to the largest of any candidate.
    pub degree: f32,
}

/// The bridge graph as it is shown.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// The candidates: where agents have been.
    pub candidates: Vec<Candidate>,
    /// The edges between two candidates, by their numbers, and their records in practice.
    pub edges: Vec<([usize; 2], EdgeStatus)>,
}

impl Graph {
    pub fn count(&self, status: EdgeStatus) -> usize {
        self.edges.iter().filter(|(_, own)| *own == status).count()
    }
}

/// Policy and plan of the walking agent.
pub(super) struct Pilot {
    run: Arc<Run>,
    /// Networks that the graph was built from and the agent uses.
    networks: Arc<Networks>,
    graph: Option<BridgeGraph>,
    walker: Option<Walker>,
    timer: RefreshTimer,
    scratch: Scratch,
}

impl Pilot {
    pub fn new(snapshot: &Snapshot) -> Self {
        Self {
            run: snapshot.run.clone(),
            networks: snapshot.networks.clone(),
            graph: None,
            walker: None,
            timer: RefreshTimer::default(),
            scratch: Scratch::default(),
        }
    }

    /// Changes to the run and the networks of `snapshot` and rebuilds the graph, if that is due;
    /// returns whether it did.
    pub fn refresh(&mut self, snapshot: &Snapshot) -> bool {
        if !Arc::ptr_eq(&snapshot.run, &self.run) {
            self.run = snapshot.run.clone();
            self.forget_graph();
        }
        let changed = !Arc::ptr_eq(&snapshot.networks, &self.networks);
        let due = self.timer.must(changed, snapshot);
        if due {
            let began = Instant::now();
            self.networks = snapshot.networks.clone();
            let Networks { policy, candidates } = &*self.networks;
            let plans = self.run.method.plans();
            self.graph =
                plans.then(|| BridgeGraph::build(candidates, &**policy, &mut self.scratch));
            // Candidates may have moved, so the walk is replanned.
            self.walker = None;
            self.timer.done(began);
        }
        due
    }

    /// Forgets the graph, which the next refresh rebuilds.
    pub fn forget_graph(&mut self) {
        (self.graph, self.walker, self.timer.0) = (None, None, None);
    }

    /// Forgets the plan: another walk begins.
    pub fn forget_plan(&mut self) {
        self.walker = None;
    }

    /// Returns the bridge graph, if the method plans.
    pub fn graph(&self) -> Option<&BridgeGraph> {
        self.graph.as_ref()
    }

    /// Returns the graph to show; empty if the method does not plan.
    pub fn shown_graph(&self) -> Graph {
        let Some(graph) = &self.graph else { return Graph::default() };
        let edges = graph.edges().iter().map(|edge| ([edge.from, edge.to], edge.status)).collect();
        let mut degrees = vec![0u32; self.networks.candidates.len()];
        graph.edges().iter().for_each(|edge| degrees[edge.from] += 1);
        let most = degrees.iter().copied().max().unwrap_or(0).max(1) as f32;
        let candidate = |(i, degree): (usize, &u32)| Candidate {
            at: graph.point(i).to_vec(),
            degree: *degree as f32 / most,
        };
        Graph { candidates: degrees.iter().enumerate().map(candidate).collect(), edges }
    }

    pub fn distance(&mut self, state: &[f32], goal: &[f32]) -> f32 {
        self.networks.policy.distance(state, goal, &mut self.scratch)
    }

    /// Moves the agent of `world` by one step towards `goal`; returns the waypoints that were ahead
    /// of it, the next one first and the goal last.
    pub fn step(
        &mut self,
        world: &mut dyn Environment,
        goal: &[f32],
        rng: &mut ChaCha8Rng,
    ) -> Result<Vec<Vec<f32>>, EnvError> {
        let guide = Guide { policy: &*self.networks.policy, graph: self.graph.as_ref() };
        let (walker, scratch) = (&mut self.walker, &mut self.scratch);
        if walker.is_none() {
            *walker = guide.plan(goal, scratch);
        }
        let aim = guide.aim(walker.as_mut(), world.states(), goal, scratch).to_vec();
        let mut action = vec![0.0; world.spec().action_dim];
        let walkers = std::iter::once(walker.as_ref());
        guide.act(walkers, world.states(), &aim, &mut action, scratch);
        world.step(&action, rng)?;
        let mut waypoints = match (walker, guide.graph) {
            (Some(walker), Some(graph)) => {
                walker.waypoints_ahead().into_iter().map(|i| graph.point(i).to_vec()).collect()
            }
            _ => Vec::new(),
        };
        waypoints.push(goal.to_vec());
        Ok(waypoints)
    }
}

impl Pilot {
    /// Moves the agent of `world` by one step of the actor alone towards `goal`.
    pub fn step_alone(
        &mut self,
        world: &mut dyn Environment,
        goal: &[f32],
        rng: &mut ChaCha8Rng,
    ) -> Result<(), EnvError> {
        let mut action = vec![0.0; world.spec().action_dim];
        self.networks.policy.actions(world.states(), goal, &mut action, &mut self.scratch);
        world.step(&action, rng)
    }
}

/// The agent's walk to the goal. Places are goals, `(goal_dim)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reach {
    pub start: Vec<f32>,
    pub start_state: Vec<f32>,
    /// Place of the agent.
    pub at: Vec<f32>,
    pub steps: u32,
    /// Shortest possible number of steps, if it is known and the goal is reachable.
    pub shortest: Option<u32>,
    /// Straight-line distance to the goal, in the world's unit; NaN without a goal.
    pub left: f32,
    /// D to the goal, and to the current waypoint.
    pub distances: (f32, f32),
    /// In a maze, D along the plan: from here to the first waypoint, from each to the next, and to
    /// the goal. NaN without a plan.
    pub along: f32,
    /// Current waypoint, if it is not the goal.
    pub waypoint: Option<Vec<f32>>,
    /// Waypoints ahead, ending at the goal.
    pub path: Vec<Vec<f32>>,
    /// The way along them, from the agent: in a maze, around walls.
    pub way: Vec<Vec<f32>>,
    /// Recent places, the current one last.
    pub trail: Vec<Vec<f32>>,
    /// Whether the agent has been at the goal.
    pub arrived: bool,
    /// Whether it has taken too many steps and waits.
    pub gave_up: bool,
    /// Walks that arrived, and all finished ones.
    pub finished: (u32, u32),
    /// Why the agent does not move, if its world has failed.
    pub failure: Option<String>,
    /// In a maze: the actor alone.
    pub ghost: Option<Ghost>,
}

/// Distance from a place, in goal radii, within which the actor counts as standing there: as it still
/// learns, it may move a little.
const STANDS_WITHIN: f32 = 3.0;

/// The actor alone on its way from the same start to the same goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Ghost {
    pub at: Vec<f32>,
    pub steps: u32,
    /// Whether it has been at the goal, where it stays.
    pub arrived: bool,
    /// The step since which it has been about one place.
    pub stands_since: u32,
    stands_at: Vec<f32>,
}

impl Ghost {
    /// Creates one that has taken no step from `at`.
    pub fn new(at: Vec<f32>) -> Self {
        Self { stands_at: at.clone(), at, steps: 0, arrived: false, stands_since: 0 }
    }

    /// Takes note of a step that `world` has made towards `goal`.
    pub(super) fn note(&mut self, world: &dyn Environment, goal: &[f32]) {
        let (state, spec) = (world.states(), world.spec());
        (self.at, self.steps) = (spec.achieved(state).collect(), self.steps + 1);
        self.arrived = spec.reached(state, goal);
        if spec.goal_distance(state, &self.stands_at) > STANDS_WITHIN * spec.goal_radius {
            (self.stands_since, self.stands_at) = (self.steps, self.at.clone());
        }
    }
}

/// Minimum interval between recomputations of field and graph, and the pause after each as a
/// multiple of its duration. They run concurrently with training, but on the same cores, so they
/// pause longer while it runs.
const REFRESH_INTERVAL: Duration = Duration::from_millis(250);
const TRAINING_PAUSE_FACTOR: u32 = 80;
const IDLE_PAUSE_FACTOR: u32 = 3;

/// When something was last computed, and how long it took; `None` if it is due at once.
#[derive(Clone, Copy, Default)]
pub(super) struct RefreshTimer(pub Option<(Instant, Duration)>);

impl RefreshTimer {
    /// Whether it may be recomputed.
    pub fn is_due(self, snapshot: &Snapshot) -> bool {
        let trains = snapshot.phase.is_training();
        let factor = if trains { TRAINING_PAUSE_FACTOR } else { IDLE_PAUSE_FACTOR };
        self.0.is_none_or(|(at, took)| at.elapsed() >= REFRESH_INTERVAL.max(took * factor))
    }

    /// Whether it must be, given whether what it is computed from has changed.
    pub fn must(self, changed: bool, snapshot: &Snapshot) -> bool {
        self.0.is_none() || changed && self.is_due(snapshot)
    }

    /// Records a computation that started at `began`.
    pub fn done(&mut self, began: Instant) {
        self.0 = Some((Instant::now(), began.elapsed()));
    }
}
