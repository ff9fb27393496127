//! The arm that reaches for the goal: it follows the current policy.

use super::{ArmWorker, OnArrival};
use crate::env::Environment;
use crate::viewer::push_to_trail;

/// Number of steps that the arm stays at the goal.
const REST_STEPS: u32 = 12;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 24;

/// The arm's current reach.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reach {
    /// Position of the grip at the start.
    pub start: [f32; 3],
    /// State at the start.
    pub start_state: Vec<f32>,
    /// Steps taken.
    pub steps: u32,
    /// Straight-line distance from the grip to the goal, in metres.
    pub metres: f32,
    /// D to the goal, and to the current waypoint.
    pub distances: (f32, f32),
    /// Current waypoint, if it is not the goal.
    pub waypoint: Option<[f32; 3]>,
    /// Whether the grip has been at the goal.
    pub arrived: bool,
    /// Reaches that arrived, and all finished ones.
    pub finished: (u32, u32),
}

impl ArmWorker {
    /// Restarts the arm with its grip near a position, or at one of the world's own starts.
    pub(super) fn restart(&mut self, at: Option<[f32; 3]>) {
        match at {
            Some(at) => self.world.put(0, at),
            None => self.world.restart(0, &mut self.rng),
        }
        self.view.trail.clear();
        self.start_reach();
    }

    /// Starts a reach from where the arm is.
    pub(super) fn start_reach(&mut self) {
        let (pose, start_state) = (self.world.pose(0), self.state());
        let finished = self.view.reach.finished;
        let unknown = (f32::NAN, f32::NAN);
        self.view.reach = Reach {
            start: pose.grip,
            start_state,
            finished,
            distances: unknown,
            ..Default::default()
        };
        self.view.pose = pose;
        self.view.path.clear();
        self.view.reach.metres = self.metres_to_goal();
        self.pilot.forget_plan();
        self.resting = 0;
        self.shown.changed = true;
    }

    /// Returns the straight-line distance from the grip to the goal; NaN without a goal.
    fn metres_to_goal(&self) -> f32 {
        self.view
            .goal
            .0
            .map_or(f32::NAN, |goal| self.world.spec().goal_distance(self.world.states(), &goal))
    }

    /// Moves the arm by one step. At the goal it goes on, to stay there, and then does what
    /// `on_arrival` says.
    pub(super) fn reach_on(&mut self) {
        let Some(goal) = self.view.goal.0 else { return };
        self.shown.changed = true;
        let (reach, spec) = (&mut self.view.reach, self.world.spec());
        if !reach.arrived && spec.reached(self.world.states(), &goal) {
            reach.arrived = true;
            reach.finished = (reach.finished.0 + 1, reach.finished.1 + 1);
        }
        if reach.arrived {
            self.resting += 1;
            if self.resting > REST_STEPS
                && matches!(self.shown.on_arrival, OnArrival::Again | OnArrival::Visit)
            {
                return self.continue_after_arrival();
            }
        } else if reach.steps >= self.scene.episode_steps() {
            reach.finished.1 += 1;
            return self.restart(None);
        }
        // An arm of this program never fails.
        let Ok(path) = self.pilot.step(&mut self.world, &goal, &mut self.rng) else { return };
        self.view.path = path;
        let target = self.view.path[0];
        let state = self.state();
        self.view.pose = self.world.pose(0);
        push_to_trail(&mut self.view.trail, self.view.pose.grip, TRAIL_STEPS);
        let reach = &mut self.view.reach;
        reach.distances =
            (self.pilot.distance(&state, &goal), self.pilot.distance(&state, &target));
        reach.waypoint = (target != goal).then_some(target);
        reach.steps += u32::from(!reach.arrived);
        self.view.reach.metres = self.metres_to_goal();
    }

    fn continue_after_arrival(&mut self) {
        if self.shown.on_arrival == OnArrival::Again {
            return self.restart(None);
        }
        self.view.goal.0 = Some(self.scene.random_goal(&mut self.rng));
        self.start_reach();
        self.shown.timer.make_due();
    }
}
