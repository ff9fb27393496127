//! The walking agent: it follows the current policy to the goal. The way along its plan is straight
//! where no wall is between two stops, and leads around walls elsewhere.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::{MazeWorker, OnArrival, cell_of};
use crate::draw::positions_along;
use crate::env::Environment;
use crate::map::{Cell, Grid};
use crate::viewer::push_to_trail;

/// Number of steps that the walking agent rests at the goal.
const REST_STEPS: u32 = 15;

/// Maximum length of the trail in steps.
const TRAIL_STEPS: usize = 14;

/// Minimum step budget of a walk, as in evaluation.
const MIN_STEP_BUDGET: u32 = 500;

/// Positions along a straight line in each cell that it crosses.
const SIGHT_PER_CELL: f32 = 8.0;

/// The distance that a way keeps from walls where it turns, in cells.
const MARGIN: f32 = 0.25;

/// Cells that are searched for a way around walls, at most: legs of a plan are short.
const MOST_SEARCHED: usize = 20_000;

/// Costs of a step along an axis and of a diagonal one.
const STEP: usize = 5;
const DIAGONAL: usize = 7;

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
            None => drop(self.world.restart(0, &mut self.rng)),
        }
        self.view.trail.clear();
        self.start_walk();
    }

    /// Puts the walking agent at a position, or as close to it as walls allow.
    pub(super) fn put_at(&mut self, at: [f32; 2]) {
        let _ = self.world.set_full_state(0, &at.map(f64::from));
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
        let waypoints: Vec<[f32; 2]> = waypoints.iter().map(|at| [at[0], at[1]]).collect();
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

/// Returns whether no wall is on the straight line between two positions.
pub(super) fn sees(map: &Grid, from: [f32; 2], to: [f32; 2]) -> bool {
    let cells = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = (SIGHT_PER_CELL * cells).ceil().max(1.0) as usize;
    positions_along([from, to], count).all(|[x, y]| map.is_free_at(x, y))
}

/// Returns `stops` with the corners between those that do not see each other, as the shortest way
/// around walls has them. It ends where none is found.
pub fn way_along(map: &Grid, stops: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut way: Vec<[f32; 2]> = stops.first().copied().into_iter().collect();
    for ends in stops.windows(2) {
        if !sees(map, ends[0], ends[1]) {
            let Some(corners) = corners(map, ends[0], ends[1]) else { break };
            way.extend(corners);
        }
        way.push(ends[1]);
    }
    way
}

/// Returns whether two positions see each other with some room beside the line.
fn has_room(map: &Grid, from: [f32; 2], to: [f32; 2]) -> bool {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let scale = MARGIN / x.hypot(y).max(f32::MIN_POSITIVE);
    [-scale, 0.0, scale].into_iter().all(|scale| {
        let [from, to] = [from, to].map(|at| [at[0] - scale * y, at[1] + scale * x]);
        sees(map, from, to)
    })
}

/// Returns the corners of the shortest way between two positions; `None` if there is none nearby.
fn corners(map: &Grid, from: [f32; 2], to: [f32; 2]) -> Option<Vec<[f32; 2]>> {
    let cells = cells_between(map, free_cell(map, from)?, free_cell(map, to)?)?;
    let centres: Vec<[f32; 2]> = cells.into_iter().map(Cell::centre).collect();
    let (mut corners, mut at, mut next) = (Vec::new(), from, 0);
    while !has_room(map, at, to) && next < centres.len() {
        // The farthest one in view; the next one follows in any case.
        let seen = centres[next..].iter().take_while(|centre| has_room(map, at, **centre)).count();
        next += seen.max(1);
        at = centres[next - 1];
        corners.push(at);
    }
    Some(corners)
}

fn free_cell(map: &Grid, [x, y]: [f32; 2]) -> Option<Cell> {
    map.is_free_at(x, y).then(|| Cell::new(x as usize, y as usize))
}

/// Returns the cells of a shortest way, both ends included.
fn cells_between(map: &Grid, from: Cell, to: Cell) -> Option<Vec<Cell>> {
    let least = |cell: Cell| {
        let (x, y) = (cell.x.abs_diff(to.x), cell.y.abs_diff(to.y));
        STEP * x.max(y) + (DIAGONAL - STEP) * x.min(y)
    };
    let mut known = HashMap::from([(from, (0, from))]);
    let mut open = BinaryHeap::from([(Reverse(least(from)), from)]);
    for _ in 0..MOST_SEARCHED {
        let (_, cell) = open.pop()?;
        if cell == to {
            let mut cells = vec![to];
            while let Some((_, before)) = known.get(&cells[cells.len() - 1])
                && cells[cells.len() - 1] != from
            {
                cells.push(*before);
            }
            cells.reverse();
            return Some(cells);
        }
        let cost = known[&cell].0;
        for next in map.neighbours(cell) {
            let is_diagonal = next.x != cell.x && next.y != cell.y;
            let cost = cost + if is_diagonal { DIAGONAL } else { STEP };
            if known.get(&next).is_none_or(|(best, _)| cost < *best) {
                known.insert(next, (cost, cell));
                open.push((Reverse(cost + least(next)), next));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    #[test]
    fn walls_block_the_view() {
        let map = parse_map("map", b"..#..\n..#..\n.....\n").expect("a map");
        assert!(sees(&map, [0.5, 0.5], [0.5, 0.5]) && sees(&map, [0.5, 2.5], [4.5, 2.5]));
        assert!(!sees(&map, [0.5, 0.5], [4.5, 0.5]) && !sees(&map, [1.5, 1.5], [3.5, 2.2]));
    }

    #[test]
    fn a_way_leads_around_walls_and_through_all_stops() {
        let map = parse_map("map", b"..#..#.\n..#..#.\n.....#.\n").expect("a map");
        let stops = [[0.5, 0.2], [1.9, 0.3], [3.1, 0.4], [4.6, 0.5]];
        let way = way_along(&map, &stops);
        assert!(stops.iter().all(|stop| way.contains(stop)), "{way:?}");
        assert!(way.windows(2).all(|ends| sees(&map, ends[0], ends[1])), "{way:?}");
        let length = |way: &[[f32; 2]]| {
            let hops =
                way.windows(2).map(|ends| (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]));
            hops.sum::<f32>()
        };
        assert!(length(&way) < 10.5, "no detour: {way:?}");
        let cut_off = way_along(&map, &[[3.5, 0.5], [4.5, 0.5], [6.5, 0.5]]);
        assert_eq!(cut_off, [[3.5, 0.5], [4.5, 0.5]], "no line through a wall");
    }
}
