//! The walking agent: it follows the current policy to the goal.

use super::legs::sees;
use super::{MazeWorker, OnArrival, cell_of};
use crate::env::Environment;
use crate::map::Cell;
use crate::viewer::pilot::position;
use crate::viewer::push_to_trail;

/// Number of steps that the walking agent rests at the goal.
const REST_STEPS: u32 = 15;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 14;

/// Minimum step budget of a walk, as in evaluation.
const MIN_STEP_BUDGET: u32 = 500;

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
    /// D along the plan: from here to the first waypoint, from each to the next, and to the goal.
    /// NaN without a plan.
    pub along: f32,
    /// Current waypoint, if it is not the goal.
    pub waypoint: Option<[f32; 2]>,
    /// Whether it has arrived.
    pub arrived: bool,
    /// Whether it has taken too many steps and waits.
    pub gave_up: bool,
    /// Walks that reached the goal, and all finished walks.
    pub finished_walks: (u32, u32),
}

impl MazeWorker {
    /// Restarts the walking agent at a cell or at a random position.
    pub(super) fn restart(&mut self, cell: Option<Cell>) {
        match cell.and_then(|cell| self.world.map().nearest_free(cell)) {
            Some(cell) => self.put_at(cell.centre()),
            None => self.world.restart(0, &mut self.rng),
        }
        self.view.trail.clear();
        self.start_walk();
    }

    /// Puts the walking agent at a position, or as close to it as walls allow.
    pub(super) fn put_at(&mut self, at: [f32; 2]) {
        self.world.set_full_state(0, &at.map(f64::from));
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
        self.view.walk = Walk {
            start: at,
            finished_walks,
            distances: (f32::NAN, f32::NAN),
            along: f32::NAN,
            ..Walk::default()
        };
        self.pilot.forget_plan();
        (self.view.path, self.view.way) = Default::default();
        self.view.walk.shortest =
            self.view.goal.0.and_then(|goal| self.true_steps(at, goal.centre()));
        self.shown.changed = true;
    }

    /// Rests at the goal, then continues as `on_arrival` says.
    fn rest_at_goal(&mut self) {
        self.resting += 1;
        if self.resting <= REST_STEPS {
            return;
        }
        match self.shown.on_arrival {
            OnArrival::Again => self.restart(None),
            OnArrival::Visit => {
                let mut goal = [0.0; 2];
                self.world.sample_goal(0, &mut self.rng, &mut goal);
                self.view.goal.0 = Some(cell_of(goal));
                self.refresh_cut_off();
                self.start_walk();
                self.shown.timer.make_due();
            }
            OnArrival::Stay | OnArrival::Wait => {}
        }
    }

    /// Moves the walking agent by one step.
    pub(super) fn walk_on(&mut self) {
        let Some(goal) = self.view.goal.0 else { return };
        if self.view.walk.arrived {
            return self.rest_at_goal();
        }
        if self.view.walk.gave_up {
            return;
        }
        self.shown.changed = true;
        let (goal, at) = (goal.centre(), self.position());
        self.view.walk.distances.0 = self.pilot.distance(&at, &goal);
        if self.world.spec().reached(&at, &goal) {
            self.view.walk.arrived = true;
            self.view.walk.waypoint = None;
            self.view.walk.finished_walks =
                (self.view.walk.finished_walks.0 + 1, self.view.walk.finished_walks.1 + 1);
            (self.view.path, self.view.way) = Default::default();
            return;
        }
        // The same step budget as in evaluation.
        if self.view.walk.steps
            >= self.view.walk.shortest.map_or(MIN_STEP_BUDGET, |s| (3 * s).max(MIN_STEP_BUDGET))
        {
            self.view.walk.finished_walks.1 += 1;
            if self.shown.on_arrival == OnArrival::Wait {
                self.view.walk.gave_up = true;
            } else {
                self.restart(None);
            }
            return;
        }
        // A maze never fails.
        let Ok(waypoints) = self.pilot.step(&mut self.world, &goal, &mut self.rng) else { return };
        let waypoints: Vec<[f32; 2]> = waypoints.iter().map(|at| position(at)).collect();
        let target = waypoints[0];
        // The straight line to a goal is no plan if no path leads there, or only one around walls
        // that the actor alone has to find.
        let is_plan = self.view.walk.shortest.is_some()
            && (waypoints.len() > 1 || sees(self.world.map(), at, goal));
        let plan = if is_plan { waypoints } else { Vec::new() };
        self.view.set_plan(self.world.map(), at, plan);
        let stops: Vec<[f32; 2]> = [at].into_iter().chain(self.view.path.clone()).collect();
        let hop = |ends: &[[f32; 2]]| self.pilot.distance(&ends[0], &ends[1]);
        let hops = stops.windows(2).map(hop);
        self.view.walk.along = hops.reduce(|sum, hop| sum + hop).unwrap_or(f32::NAN);
        self.view.walk.distances.1 = self.pilot.distance(&at, &target);
        self.view.walk.waypoint = (target != goal).then_some(target);
        self.view.walk.steps += 1;
        push_to_trail(&mut self.view.trail, at, TRAIL_STEPS);
    }
}
