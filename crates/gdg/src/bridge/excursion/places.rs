//! Places that agents have been at, and where actions lead from them: a table, not a network.

use std::collections::{HashMap, VecDeque};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::axes::goal_axes;
use crate::env::Spec;
use crate::learn::{Axis, axis_actions};
use crate::store::StoreError;

/// Failed attempts in a row after which an action counts as blocked, at first.
pub(crate) const MIN_ATTEMPTS: u16 = 2;

/// The same at last: it is raised step by step when no action is left to try.
pub(crate) const MAX_ATTEMPTS: u16 = 8;

/// Distances to the frontier are computed after this many arrivals, or as many as there are places.
const MEASURE_EVERY: usize = 512;

/// Maximum length of a step with noise, in typical ones.
const MAX_NOISE_STEPS: f32 = 2.0;

pub(crate) const MAX_PLACES: usize = 200_000;

const MAX_LOOKAHEAD: u32 = 2_000;

/// Distance to the frontier where no known action leads there.
pub const NO_FRONTIER: u32 = u32::MAX;

/// An action that has led to no other place yet.
const NOWHERE: u32 = u32::MAX;

/// A grid over the achieved goals and what else matters: the cells that agents have visited, and what
/// each of a fixed set of actions has led to there.
///
/// An action that has not been tried at a place is expected to lead to the neighbour in the
/// direction in which it has led elsewhere. If that neighbour is unvisited, the place is at the
/// frontier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Places {
    #[serde(skip)]
    spec: Spec,
    /// `(actions, action_dim)`: a full step forwards and backwards along each axis, in turns.
    #[serde(skip)]
    actions: Vec<f32>,
    #[serde(skip)]
    index: HashMap<Box<[i32]>, u32>,
    /// What the grid is over: the goal's components first.
    axes: Vec<Axis>,
    /// Coordinates of each place in the grid, `(places, axes)`.
    keys: Vec<i32>,
    /// Place that each action leads to, or [`NOWHERE`], `(places, actions)`.
    to: Vec<u32>,
    /// Attempts since it led there that left the agent where it was or led it astray, `(places,
    /// actions)`.
    attempts: Vec<u16>,
    /// Actions from each place to the frontier, computed by [`Self::measure`] and corrected by
    /// [`Self::record`], `(places)`.
    ahead: Vec<u32>,
    /// Sum of the changes of coordinates that each action has brought, `(actions, axes)`.
    moved: Vec<i64>,
    enough_attempts: u16,
    measure_in: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ActionOutcome {
    Unvisited,
    Place(usize),
    Blocked,
}

impl Places {
    pub fn new(spec: &Spec) -> Self {
        Self::along(spec, goal_axes(spec))
    }

    /// Without any place, in a grid over `axes`.
    pub fn along(spec: &Spec, axes: Vec<Axis>) -> Self {
        Self {
            actions: axis_actions(spec.action_dim),
            index: HashMap::new(),
            keys: Vec::new(),
            to: Vec::new(),
            attempts: Vec::new(),
            ahead: Vec::new(),
            moved: vec![0; 2 * spec.action_dim * axes.len()],
            enough_attempts: MIN_ATTEMPTS,
            measure_in: 0,
            axes,
            spec: spec.clone(),
        }
    }

    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    pub fn len(&self) -> usize {
        self.ahead.len()
    }

    pub fn action(&self, i: usize) -> &[f32] {
        &self.actions[i * self.spec.action_dim..(i + 1) * self.spec.action_dim]
    }

    fn action_count(&self) -> usize {
        2 * self.spec.action_dim
    }

    fn key(&self, place: usize) -> &[i32] {
        let g = self.axes.len();
        &self.keys[place * g..(place + 1) * g]
    }

    /// Returns the centre of `place` as a goal, `(goal_dim)`.
    pub fn centre(&self, place: usize) -> Vec<f32> {
        let of_goal = &self.key(place)[..self.spec.goal_dim()];
        of_goal.iter().map(|k| (*k as f32 + 0.5) * self.spec.goal_radius).collect()
    }

    /// Returns the place of `state` and whether it is new; `None` if it is new and there is no
    /// room.
    pub fn visit(&mut self, state: &[f32]) -> Option<(usize, bool)> {
        if self.measure_in == 0 {
            self.measure();
            self.measure_in = MEASURE_EVERY.max(self.len());
        }
        self.measure_in -= 1;
        let key: Box<[i32]> = self.axes.iter().map(|axis| axis.cell(state)).collect();
        if let Some(place) = self.index.get(&key) {
            return Some((*place as usize, false));
        }
        let place = self.len();
        if place >= MAX_PLACES {
            return None;
        }
        self.keys.extend(&key);
        self.index.insert(key, place as u32);
        self.to.resize(self.to.len() + self.action_count(), NOWHERE);
        self.attempts.resize(self.to.len(), 0);
        self.ahead.push(0);
        // The world is larger than it seemed.
        self.enough_attempts = MIN_ATTEMPTS;
        Some((place, true))
    }

    /// Records that `action` led from place `from` to place `to`, which are the same if it left the
    /// agent there.
    pub fn record(&mut self, from: usize, action: usize, to: usize) {
        let (count, g) = (self.action_count(), self.axes.len());
        let at = from * count + action;
        let attempts = self.attempts[at].saturating_add(1);
        if from == to {
            self.attempts[at] = attempts;
        } else {
            let offset = self.offset(from, to);
            let moved = &mut self.moved[action * g..(action + 1) * g];
            moved.iter_mut().zip(offset).for_each(|(sum, moved)| *sum += moved);
            if self.is_astray(from, action, to) && attempts < self.most_attempts(at) {
                self.attempts[at] = attempts;
            } else {
                (self.to[at], self.attempts[at]) = (to as u32, 0);
            }
            // The way back is usually possible; if not, attempts will show it.
            let back = to * count + (action ^ 1);
            let is_known = self.to[back] != NOWHERE || self.attempts[back] > 0;
            if !is_known && !self.is_astray(to, action ^ 1, from) {
                self.to[back] = from as u32;
            }
            self.ahead[to] = self.least_ahead(to);
        }
        self.ahead[from] = self.least_ahead(from);
    }

    /// Returns the steps that cross a place along its longest side, at this share of an action.
    pub fn steps_across(&self, stride: f32) -> f32 {
        self.axes.iter().map(|axis| axis.width / (stride * axis.step)).fold(0.0, f32::max)
    }

    fn offset(&self, from: usize, to: usize) -> Vec<i64> {
        let ends = self.key(from).iter().zip(self.key(to));
        ends.map(|(from, to)| i64::from(*to) - i64::from(*from)).collect()
    }

    /// Returns the direction in which `action` has led; `None` if it has led nowhere.
    fn direction(&self, action: usize) -> Option<Vec<i32>> {
        let g = self.axes.len();
        direction(&self.moved[action * g..(action + 1) * g])
    }

    /// Whether it may be noise that led an agent from one place to another, and not `action`: noise
    /// leads to another direction, but not far.
    fn is_astray(&self, from: usize, action: usize, to: usize) -> bool {
        let (along, offset) = (self.direction(action), self.offset(from, to));
        let steps = |(axis, moved): (&Axis, &i64)| {
            (moved.unsigned_abs() as f32 - 1.0) * axis.width / axis.step
        };
        let noise_steps = self.axes.iter().zip(&offset).map(steps).fold(0.0, f32::max);
        along.is_some() && along != direction(&offset) && noise_steps <= MAX_NOISE_STEPS
    }

    fn expected(&self, place: usize, action: usize) -> Option<usize> {
        let along = self.direction(action)?;
        let ends = self.key(place).iter().zip(along);
        let key: Box<[i32]> = ends.map(|(k, step)| k.saturating_add(step)).collect();
        self.index.get(&key).map(|place| *place as usize)
    }

    /// Returns the failed attempts after which exit `at` counts as blocked or, if the last one led
    /// astray, as leading there.
    fn most_attempts(&self, at: usize) -> u16 {
        if self.to[at] == NOWHERE { self.enough_attempts } else { 2 * MIN_ATTEMPTS }
    }

    pub fn has_frontier(&self) -> bool {
        self.enough_attempts == MIN_ATTEMPTS
    }

    fn outcome(&self, place: usize, action: usize) -> ActionOutcome {
        let at = place * self.action_count() + action;
        if self.attempts[at] >= self.most_attempts(at) {
            return ActionOutcome::Blocked;
        }
        if self.to[at] != NOWHERE {
            return ActionOutcome::Place(self.to[at] as usize);
        }
        match self.expected(place, action) {
            Some(to) => ActionOutcome::Place(to),
            None if self.len() < MAX_PLACES => ActionOutcome::Unvisited,
            None => ActionOutcome::Blocked,
        }
    }

    /// Returns the number of actions from `place` to the frontier that begin with `action`, or
    /// [`NO_FRONTIER`].
    fn ahead_after(&self, place: usize, action: usize) -> u32 {
        match self.outcome(place, action) {
            ActionOutcome::Unvisited => 0,
            ActionOutcome::Place(to) => self.ahead[to].saturating_add(1),
            ActionOutcome::Blocked => NO_FRONTIER,
        }
    }

    fn least_ahead(&self, place: usize) -> u32 {
        (0..self.action_count())
            .map(|action| self.ahead_after(place, action))
            .min()
            .unwrap_or(NO_FRONTIER)
    }

    pub fn ahead(&self, place: usize) -> u32 {
        self.ahead[place]
    }

    /// Computes the distances to the frontier by breadth-first search, backwards from it.
    fn measure(&mut self) {
        let mut into: Vec<Vec<u32>> = vec![Vec::new(); self.len()];
        let mut queue = VecDeque::new();
        let mut ahead = vec![NO_FRONTIER; self.len()];
        for (place, ahead) in ahead.iter_mut().enumerate() {
            for action in 0..self.action_count() {
                match self.outcome(place, action) {
                    ActionOutcome::Unvisited => *ahead = 0,
                    ActionOutcome::Place(to) => into[to].push(place as u32),
                    ActionOutcome::Blocked => {}
                }
            }
            if *ahead == 0 {
                queue.push_back(place);
            }
        }
        let is_exhausted = queue.is_empty() && self.enough_attempts == MAX_ATTEMPTS;
        if queue.is_empty() && self.len() > 0 && !is_exhausted {
            self.enough_attempts += 1;
        }
        while let Some(place) = queue.pop_front() {
            for from in &into[place] {
                let from = *from as usize;
                if ahead[from] == NO_FRONTIER {
                    ahead[from] = ahead[place] + 1;
                    queue.push_back(from);
                }
            }
        }
        self.ahead = ahead;
        let cut_off = self.ahead.iter().filter(|ahead| **ahead == NO_FRONTIER).count();
        if 2 * cut_off > self.len() && !is_exhausted {
            self.doubt_noise();
        }
    }

    /// Takes back what may have been noise: each such action may lead to where it is expected to, or
    /// is tried once more.
    fn doubt_noise(&mut self) {
        for place in 0..self.len() {
            for action in 0..self.action_count() {
                let at = place * self.action_count() + action;
                let to = self.to[at];
                if to != NOWHERE && self.is_astray(place, action, to as usize) {
                    (self.to[at], self.attempts[at]) = match self.expected(place, action) {
                        Some(to) => (to as u32, 0),
                        None => (NOWHERE, self.enough_attempts - 1),
                    };
                }
            }
        }
    }

    /// Returns an action at `place`: any, or one that leads towards the frontier, that with the
    /// fewest attempts.
    pub fn choose_action(&self, place: usize, is_random: bool, rng: &mut ChaCha8Rng) -> usize {
        let count = self.action_count();
        if is_random {
            return rng.random_range(0..count);
        }
        let keys: Vec<(u32, u16)> = (0..count)
            .map(|action| (self.ahead_after(place, action), self.attempts[place * count + action]))
            .collect();
        let least = keys.iter().min();
        let best: Vec<usize> = (0..count).filter(|action| Some(&keys[*action]) == least).collect();
        best[rng.random_range(0..best.len())]
    }

    /// Returns the place at the frontier that the known actions lead to from `place`, unless there
    /// is none or it is too far to look up (for display only).
    pub fn frontier_from(&self, place: usize) -> Option<usize> {
        let mut at = place;
        for _ in 0..MAX_LOOKAHEAD {
            if self.ahead[at] == 0 {
                return Some(at);
            }
            let next =
                (0..self.action_count()).filter_map(|action| match self.outcome(at, action) {
                    ActionOutcome::Place(to) if self.ahead[to] < self.ahead[at] => Some(to),
                    _ => None,
                });
            at = next.min_by_key(|to| self.ahead[*to])?;
        }
        None
    }

    /// Forgets where actions lead, but neither the places nor the direction of each action.
    pub fn forget_outcomes(&mut self) {
        self.to.fill(NOWHERE);
        self.attempts.fill(0);
        (self.enough_attempts, self.measure_in) = (MIN_ATTEMPTS, 0);
    }

    pub fn restored(mut self, spec: &Spec) -> Result<Self, StoreError> {
        let fresh = Self::along(spec, std::mem::take(&mut self.axes));
        let (count, actions, g) = (self.len(), fresh.action_count(), fresh.axes.len());
        let exits = count * actions;
        // Far from overflow, as one action changes a coordinate by few units.
        let fits = count <= MAX_PLACES
            && fresh.axes.starts_with(&goal_axes(spec))
            && fresh.axes.iter().all(|axis| axis.fits(spec))
            && self.moved.len() == fresh.moved.len()
            && self.moved.iter().all(|sum| sum.unsigned_abs() < 1 << 60)
            && self.keys.len() == count * g
            && [self.to.len(), self.attempts.len()] == [exits; 2]
            && self.to.iter().all(|to| *to == NOWHERE || (*to as usize) < count)
            && (MIN_ATTEMPTS..=MAX_ATTEMPTS).contains(&self.enough_attempts)
            && self.measure_in <= MEASURE_EVERY.max(count);
        if fits {
            let keys = self.keys.chunks_exact(g).enumerate();
            self.index = keys.map(|(i, key)| (Box::from(key), i as u32)).collect();
        }
        let fits = fits && self.index.len() == count;
        StoreError::unless(fits, "the stored places do not fit this world")?;
        Ok(Self { spec: fresh.spec, actions: fresh.actions, axes: fresh.axes, ..self })
    }
}

/// Returns the direction of an offset in units of its longest component; `None` if it is zero.
fn direction(offset: &[i64]) -> Option<Vec<i32>> {
    let longest = offset.iter().map(|moved| moved.abs()).max().filter(|moved| *moved > 0)?;
    Some(offset.iter().map(|moved| (*moved as f64 / longest as f64).round() as i32).collect())
}

#[cfg(test)]
pub(super) mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::bridge::candidates::tests::line;

    /// Returns the spec of a plane in which an agent moves at most one goal radius per step.
    pub fn plane() -> Spec {
        Spec { state_centre: vec![50.0; 2], ..line(1).0 }
    }

    fn row(places: &mut Places, x: std::ops::Range<i32>) -> Vec<usize> {
        x.map(|x| places.visit(&[x as f32 + 0.5, 0.5]).expect("there is room").0).collect()
    }

    #[test]
    fn the_frontier_is_where_an_untried_action_may_lead_to_an_unvisited_place() {
        let mut places = Places::new(&plane());
        let row = row(&mut places, 0..6);
        let (right, left, up, down) = (0, 1, 2, 3);
        for pair in row.windows(2) {
            places.record(pair[0], right, pair[1]);
        }
        // Walls above and below everywhere, and at both ends but the right one.
        let block = |places: &mut Places, at: usize, action: usize| {
            (0..MIN_ATTEMPTS).for_each(|_| places.record(at, action, at));
        };
        for at in &row {
            block(&mut places, *at, up);
            block(&mut places, *at, down);
        }
        block(&mut places, row[0], left);
        places.measure();
        let ahead: Vec<u32> = row.iter().map(|place| places.ahead(*place)).collect();
        assert_eq!(ahead, [5, 4, 3, 2, 1, 0]);
        assert_eq!(places.frontier_from(row[0]), Some(row[5]));
        assert_eq!(places.centre(row[5]), [5.5, 0.5]);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        assert!((0..20).all(|_| places.choose_action(row[2], false, &mut rng) == right));
        assert!(places.has_frontier());
        block(&mut places, row[5], right);
        places.measure();
        assert!(!places.has_frontier());
        assert!(row.iter().all(|place| places.frontier_from(*place).is_none()));
        // Walls may have opened: all is tried again, more patiently first ...
        places.measure();
        assert_eq!(places.frontier_from(row[0]), Some(row[0]));
        // ... and from the beginning after a change of the world.
        places.forget_outcomes();
        assert!(places.has_frontier());
    }

    #[test]
    fn actions_are_expected_to_lead_where_they_have_led_elsewhere_in_spite_of_noise() {
        let mut places = Places::new(&plane());
        let row = row(&mut places, 0..4);
        let right = 0;
        places.record(row[0], right, row[1]);
        let to = |i: usize| ActionOutcome::Place(row[i]);
        assert_eq!(
            [0, 1, 2, 3].map(|i| places.outcome(row[i], right)),
            [to(1), to(2), to(3), ActionOutcome::Unvisited]
        );
        for pair in row.windows(2).cycle().take(9) {
            places.record(pair[0], right, pair[1]);
        }
        places.record(row[3], right, row[2]);
        places.record(row[1], right, row[0]);
        let outcomes = |places: &Places| [1, 3].map(|i| places.outcome(row[i], right));
        assert_eq!(outcomes(&places), [ActionOutcome::Place(row[2]), ActionOutcome::Unvisited]);
        // Noise again and again is taken for where the action leads, but not for good.
        (0..3).for_each(|_| places.record(row[1], right, row[0]));
        places.record(row[3], right, row[2]);
        assert_eq!(outcomes(&places), [row[0], row[2]].map(ActionOutcome::Place));
        places.doubt_noise();
        assert_eq!(outcomes(&places), [ActionOutcome::Place(row[2]), ActionOutcome::Unvisited]);
    }
}
