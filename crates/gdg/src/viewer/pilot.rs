//! How the agent that is shown finds its way in any world: by the current policy, and a plan through
//! the bridge graph.

use std::sync::Arc;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{RefreshTimer, pause_factor, push_to_trail};
use crate::bridge::{BridgeGraph, EdgeStatus, Guide, Walker};
use crate::engine::{Networks, Snapshot};
use crate::env::{EnvError, Environment};
use crate::learn::Scratch;
use crate::train::Run;

/// What the walking agent does after arriving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnArrival {
    /// Starts again.
    #[default]
    Again,
    /// Continues to another goal.
    Visit,
    /// Stays there.
    Stay,
    /// Waits for another start or goal, also where it gives up.
    Wait,
}

impl OnArrival {
    /// Returns the next choice of the user.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Again => Self::Visit,
            Self::Visit => Self::Stay,
            Self::Stay => Self::Again,
            Self::Wait => Self::Wait,
        }
    }

    /// Returns its name on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Again => "restart",
            Self::Visit => "visit other goals",
            Self::Stay => "stay",
            Self::Wait => "wait",
        }
    }
}

/// A bridge candidate.
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
    /// Returns the number of edges with this record.
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
        let due = self.timer.is_urgent() || changed && self.timer.is_due(pause_factor(snapshot));
        if due {
            let began = Instant::now();
            self.networks = snapshot.networks.clone();
            let Networks { policy, candidates } = &*self.networks;
            self.graph = self
                .run
                .method
                .plans()
                .then(|| BridgeGraph::build(candidates, &**policy, &mut self.scratch));
            // Candidates may have moved, so the walk is replanned.
            self.walker = None;
            self.timer.done(began);
        }
        due
    }

    /// Forgets the graph, which the next refresh rebuilds.
    pub fn forget_graph(&mut self) {
        (self.graph, self.walker) = (None, None);
        self.timer.make_due();
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

    /// Returns D from a state to a goal.
    pub fn distance(&mut self, state: &[f32], goal: &[f32]) -> f32 {
        self.networks.policy.distance(state, goal, &mut self.scratch)
    }

    /// Moves the agent of `world` by one step towards `goal`; returns the waypoints that were ahead
    /// of it, the next one first and the goal last.
    ///
    /// # Errors
    /// The world fails.
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

/// Number of steps that the agent stays at the goal.
const REST_STEPS: u32 = 12;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 24;

/// The agent's current reach. Places are goals, `(goal_dim)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reach {
    /// Place at the start.
    pub start: Vec<f32>,
    /// State at the start.
    pub start_state: Vec<f32>,
    /// Place of the agent.
    pub at: Vec<f32>,
    /// Steps taken.
    pub steps: u32,
    /// Straight-line distance to the goal, in the world's unit; NaN without a goal.
    pub left: f32,
    /// D to the goal, and to the current waypoint.
    pub distances: (f32, f32),
    /// Current waypoint, if it is not the goal.
    pub waypoint: Option<Vec<f32>>,
    /// Waypoints ahead, ending at the goal.
    pub path: Vec<Vec<f32>>,
    /// Recent places, the current one last.
    pub trail: Vec<Vec<f32>>,
    /// Whether the agent has been at the goal.
    pub arrived: bool,
    /// Reaches that arrived, and all finished ones.
    pub finished: (u32, u32),
    /// Why the agent does not move, if its world has failed.
    pub failure: Option<String>,
}

/// The agent, and its world.
pub(super) struct Reacher {
    /// `None` if it has failed from the start.
    world: Option<Box<dyn Environment>>,
    rng: ChaCha8Rng,
    pub pilot: Pilot,
    pub goal: Option<Vec<f32>>,
    pub reach: Reach,
    resting: u32,
}

impl Reacher {
    /// Puts the agent of `world` at one of the world's own starts.
    pub fn new(world: Result<Box<dyn Environment>, EnvError>, snapshot: &Snapshot) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(snapshot.run.seed);
        // The screen draws its goals from the first stream.
        rng.set_stream(1);
        let failure = world.as_ref().err().map(ToString::to_string);
        let (pilot, reach) = (Pilot::new(snapshot), Reach { failure, ..Reach::default() });
        let mut reacher = Self { world: world.ok(), rng, pilot, goal: None, reach, resting: 0 };
        reacher.restart();
        reacher
    }

    /// Returns the agent's world.
    pub fn world(&self) -> Option<&dyn Environment> {
        self.world.as_deref()
    }

    /// Returns the agent's world, to move the agent; [`Self::begin`] starts a reach from there.
    pub fn world_mut(&mut self) -> Option<&mut dyn Environment> {
        self.world.as_deref_mut()
    }

    /// Starts a reach from one of the world's own starts.
    pub fn restart(&mut self) {
        let Some(world) = &mut self.world else { return };
        match world.restart(0, &mut self.rng) {
            Ok(()) => self.begin(),
            Err(error) => self.reach.failure = Some(error.to_string()),
        }
    }

    /// Starts a reach from where the agent is.
    pub fn begin(&mut self) {
        let Some(world) = &self.world else { return };
        let (state, spec) = (world.states(), world.spec());
        let at: Vec<f32> = spec.achieved(state).collect();
        let to = |goal: &Vec<f32>| spec.goal_distance(state, goal);
        self.reach = Reach {
            start: at.clone(),
            start_state: state.to_vec(),
            at,
            left: self.goal.as_ref().map_or(f32::NAN, to),
            distances: (f32::NAN, f32::NAN),
            finished: self.reach.finished,
            ..Reach::default()
        };
        self.pilot.forget_plan();
        self.resting = 0;
    }

    /// Starts a reach for `goal`.
    pub fn reach_for(&mut self, goal: Vec<f32>) {
        self.goal = Some(goal);
        let trail = std::mem::take(&mut self.reach.trail);
        self.begin();
        self.reach.trail = trail;
    }

    /// Starts a reach for a random goal.
    pub fn reach_for_any(&mut self) {
        let Some(world) = &self.world else { return };
        let mut goal = vec![0.0; world.spec().goal_dim()];
        world.sample_goal(0, &mut self.rng, &mut goal);
        self.reach_for(goal);
    }

    /// Changes to the latest networks, if that is due; returns whether the graph has changed.
    pub fn refresh(&mut self, snapshot: &Snapshot) -> bool {
        self.world.is_some() && self.pilot.refresh(snapshot)
    }

    /// Moves the agent by one step; gives up after `most` steps. At the goal it goes on, to stay
    /// there, and then does what `on_arrival` says. Returns whether that is another goal.
    pub fn step(&mut self, most: u32, on_arrival: OnArrival) -> bool {
        let (Some(goal), Some(world)) = (self.goal.clone(), &mut self.world) else { return false };
        let reach = &mut self.reach;
        if reach.failure.is_some() {
            return false;
        }
        if !reach.arrived && world.spec().reached(world.states(), &goal) {
            reach.arrived = true;
            reach.finished = (reach.finished.0 + 1, reach.finished.1 + 1);
        }
        if reach.arrived {
            self.resting += 1;
            match on_arrival {
                OnArrival::Again if self.resting > REST_STEPS => {
                    self.restart();
                    return false;
                }
                OnArrival::Visit if self.resting > REST_STEPS => {
                    self.reach_for_any();
                    return true;
                }
                _ => {}
            }
        } else if reach.steps >= most || world.has_ended(0) {
            reach.finished.1 += 1;
            self.restart();
            return false;
        }
        let path = match self.pilot.step(&mut **world, &goal, &mut self.rng) {
            Ok(path) => path,
            Err(error) => {
                reach.failure = Some(error.to_string());
                return false;
            }
        };
        let (state, target) = (world.states(), &path[0]);
        reach.at = world.spec().achieved(state).collect();
        reach.left = world.spec().goal_distance(state, &goal);
        reach.distances = (self.pilot.distance(state, &goal), self.pilot.distance(state, target));
        reach.waypoint = (*target != goal).then(|| target.clone());
        push_to_trail(&mut reach.trail, reach.at.clone(), TRAIL_STEPS);
        reach.steps += u32::from(!reach.arrived);
        reach.path = path;
        false
    }
}
