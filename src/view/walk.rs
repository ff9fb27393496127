//! The walking agent: it follows the current policy to the goal.

use super::{Worker, cell_of};
use crate::bridge::{Target, Walker};
use crate::env::Environment;
use crate::learn::Policy;
use crate::map::Cell;

/// Number of steps that the walking agent rests at the goal.
const REST_STEPS: u32 = 15;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 14;

/// Minimum step budget of a walk, as in evaluation.
const MIN_STEP_BUDGET: u32 = 500;

/// What the walking agent does after arriving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnArrival {
    /// Starts again from a random position.
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

/// The walking agent's current walk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Walk {
    /// Start position.
    pub start: [f32; 2],
    /// Steps taken.
    pub steps: u32,
    /// Shortest possible number of steps, if the goal is reachable.
    pub shortest: Option<u32>,
    /// D to the goal, and to the current waypoint.
    pub distances: (f32, f32),
    /// Current waypoint, if it is not the goal.
    pub waypoint: Option<[f32; 2]>,
    /// Whether it has arrived.
    pub arrived: bool,
    /// Whether it has taken too many steps and waits.
    pub gave_up: bool,
    /// Walks that reached the goal, and all finished walks.
    pub finished_walks: (u32, u32),
}

impl Worker {
    /// Restarts the walking agent at a cell or at a random position.
    pub(super) fn restart(&mut self, cell: Option<Cell>) {
        match cell.and_then(|cell| self.world.map().nearest_free(cell)) {
            Some(cell) => self.world.set_full_state(0, &cell.centre().map(f64::from)),
            None => self.world.restart(0, &mut self.rng),
        }
        self.view.trail.clear();
        self.start_walk();
    }

    /// Restarts the walking agent at the map's own start, or at a random position if it has none.
    pub(super) fn restart_at_start(&mut self) {
        self.restart(self.world.map().starts().first().copied());
    }

    /// Starts a walk from the agent's position to the goal.
    pub(super) fn start_walk(&mut self) {
        let at = self.position();
        self.resting = 0;
        let finished_walks = self.view.walk.finished_walks;
        self.view.walk = Walk { start: at, finished_walks, distances: (f32::NAN, f32::NAN), ..Walk::default() };
        self.walker = None;
        self.view.path.clear();
        self.view.walk.shortest = self.view.goal.0.and_then(|goal| self.true_steps(cell_of(at), goal));
        self.changed = true;
    }

    /// Rests at the goal, then continues as `on_arrival` says.
    fn rest_at_goal(&mut self) {
        self.resting += 1;
        if self.resting <= REST_STEPS {
            return;
        }
        match self.on_arrival {
            OnArrival::Again => self.restart(None),
            OnArrival::Visit => {
                let mut goal = [0.0; 2];
                self.world.sample_goal(0, &mut self.rng, &mut goal);
                self.view.goal.0 = Some(cell_of(goal));
                self.refresh_cut_off();
                self.start_walk();
                self.field_timer.make_due();
            }
            OnArrival::Stay | OnArrival::Wait => {}
        }
    }

    /// Moves the walking agent by one step.
    pub(super) fn walk(&mut self) {
        let Some(goal) = self.view.goal.0 else { return };
        if self.view.walk.arrived {
            return self.rest_at_goal();
        }
        if self.view.walk.gave_up {
            return;
        }
        self.changed = true;
        let (goal, at) = (goal.centre(), self.position());
        let networks = self.networks.clone();
        let policy = &*networks.policy;
        self.view.walk.distances.0 = policy.distance(&at, &goal, &mut self.scratch);
        if self.world.spec().reached(&at, &goal) {
            self.view.walk.arrived = true;
            self.view.walk.waypoint = None;
            self.view.walk.finished_walks = (self.view.walk.finished_walks.0 + 1, self.view.walk.finished_walks.1 + 1);
            self.view.path.clear();
            return;
        }
        // The same step budget as in evaluation.
        if self.view.walk.steps >= self.view.walk.shortest.map_or(MIN_STEP_BUDGET, |s| (3 * s).max(MIN_STEP_BUDGET)) {
            self.view.walk.finished_walks.1 += 1;
            if self.on_arrival == OnArrival::Wait {
                self.view.walk.gave_up = true;
            } else {
                self.restart(None);
            }
            return;
        }
        let target = self.next_target(at, goal, policy);
        self.view.walk.distances.1 = policy.distance(&at, &target, &mut self.scratch);
        self.view.walk.waypoint = (target != goal).then_some(target);
        let mut action = [0.0; 2];
        policy.actions(&at, &target, &mut action, &mut self.scratch);
        if let (Some(walker), Some(graph)) = (&self.walker, &self.graph)
            && walker.looks_ahead(graph)
        {
            policy.improve_actions(&at, &target, &mut action, &mut self.scratch);
        }
        self.world.step(&action, &mut self.rng);
        self.view.walk.steps += 1;
        self.view.trail.push(at);
        if self.view.trail.len() > TRAIL_STEPS {
            self.view.trail.remove(0);
        }
    }

    /// Returns the agent's next target and updates the displayed path.
    fn next_target(&mut self, at: [f32; 2], goal: [f32; 2], policy: &dyn Policy) -> [f32; 2] {
        let Some(graph) = &self.graph else {
            self.view.path = vec![goal];
            return goal;
        };
        let scratch = &mut self.scratch;
        let walker = self.walker.get_or_insert_with(|| Walker::new(graph.route(&goal, policy, scratch)));
        let target = walker.step(&at, graph, policy, scratch);
        let target = [target[0], target[1]];
        self.view.path = match walker.target() {
            Some(Target::Candidate(_)) => {
                walker.waypoints_ahead().into_iter().map(|i| [graph.point(i)[0], graph.point(i)[1]]).collect()
            }
            _ => Vec::new(),
        };
        self.view.path.push(goal);
        target
    }
}
