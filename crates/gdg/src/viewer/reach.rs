//! An agent that reaches for the goal again and again: it follows the current policy.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::pilot::{OnArrival, Pilot};
use super::push_to_trail;
use crate::engine::Snapshot;
use crate::env::{EnvError, Environment};

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
        self.world.as_ref().is_some_and(|world| self.pilot.refresh(snapshot, world.spec()))
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
