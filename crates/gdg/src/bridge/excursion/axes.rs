//! The axes that distinguish places: the goal's components, and those that agents must change first.

use serde::{Deserialize, Serialize};

use crate::env::{LEAST_MOVE, MAX_MAGNITUDE, Spec};
use crate::learn::Axis;

/// The achieved goal seldom moves if less than this share of the latest steps moves it.
const SELDOM: f64 = 0.2;

/// The goal is an object if a smaller share moves it: what else seldom moves is part of it.
const MOSTLY: f64 = 0.5;

/// Averaging window of that share, in steps.
const LATEST_STEPS: u64 = 5_000;

/// Of other components, those that at most this share of the steps moves: keys, doors, levers.
const RARE: f64 = 0.02;

/// They have moved at least this often: once may be an accident.
const LEAST_MOVES: u64 = 3;

/// Most cells that one component is divided into, and all of them together, beside the goal's.
const MOST_CELLS: f64 = 8.0;
const MOST_CELLS_TOGETHER: f64 = 4096.0;

/// Steps between two looks at what moves.
const LOOK_EVERY: u64 = 1_000;

/// Returns the axes of the goal: cells one goal radius wide.
pub fn goal_axes(spec: &Spec) -> Vec<Axis> {
    let width = spec.goal_radius;
    // Where nothing has moved yet, a step has no length.
    let step = Some(spec.largest_change()).filter(|step| *step > 0.0).unwrap_or(width);
    let axis = |component: &usize| Axis { component: *component, width, low: 0.0, step };
    spec.achieved.iter().map(axis).collect()
}

/// Whether a step has moved component `i`.
fn moves(spec: &Spec, state: &[f32], next: &[f32], i: usize) -> bool {
    (next[i] - state[i]).abs() > LEAST_MOVE * spec.change_scale[i]
}

/// How often the agents' steps have moved each component of the state, and how far it has got.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moves {
    steps: u64,
    /// Share of the latest steps that have moved the achieved goal.
    goal_share: f64,
    /// Steps that have moved each component, `(state_dim)`, as the ranges.
    moved: Vec<u64>,
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Moves {
    pub fn new(spec: &Spec) -> Self {
        let s = spec.state_dim();
        Self { moved: vec![0; s], low: vec![0.0; s], high: vec![0.0; s], ..Self::default() }
    }

    /// Takes note of a step. Returns whether it is time to look at what moves.
    pub fn note(&mut self, spec: &Spec, state: &[f32], next: &[f32]) -> bool {
        if self.steps == 0 {
            (self.low, self.high) = (state.to_vec(), state.to_vec());
        }
        let moves = |i: usize| moves(spec, state, next, i);
        for (i, v) in next.iter().enumerate() {
            self.moved[i] += u64::from(moves(i));
            let (low, high) = (v.min(state[i]), v.max(state[i]));
            (self.low[i], self.high[i]) = (self.low[i].min(low), self.high[i].max(high));
        }
        self.steps += 1;
        let goal = if spec.goal_moves(state, next) { 1.0 } else { 0.0 };
        self.goal_share += (goal - self.goal_share) / self.steps.min(LATEST_STEPS) as f64;
        self.steps.is_multiple_of(LOOK_EVERY)
    }

    pub fn fit(&self, spec: &Spec) -> bool {
        let s = spec.state_dim();
        [self.moved.len(), self.low.len(), self.high.len()] == [s; 3]
            && (0.0..=1.0).contains(&self.goal_share)
            && self.steps < 1 << 60
            && self.moved.iter().all(|moved| *moved <= self.steps)
            && self.low.iter().chain(&self.high).all(|v| v.abs() <= MAX_MAGNITUDE)
            && self.low.iter().zip(&self.high).all(|(low, high)| low <= high)
    }

    /// Returns the share of the latest steps that have moved the achieved goal.
    pub fn goal_share(&self) -> Option<f64> {
        (self.steps > 0).then_some(self.goal_share)
    }

    /// Whether the achieved goal seldom moves.
    pub fn goal_rests(&self) -> bool {
        self.steps >= LOOK_EVERY && self.goal_share < SELDOM
    }

    /// Returns the axes that distinguish places from now on, if there are more than `axes`.
    pub fn more_axes(&self, spec: &Spec, axes: &[Axis]) -> Option<Vec<Axis>> {
        if self.goal_share < MOSTLY {
            return None;
        }
        let rare = LEAST_MOVES as f64..RARE * self.steps as f64;
        let matters = |i: usize| rare.contains(&(self.moved[i] as f64));
        let is_known = |i: usize| axes.iter().any(|axis| axis.component == i);
        let others = (0..spec.state_dim()).filter(|i| !spec.achieved.contains(i));
        let others: Vec<usize> = others.filter(|i| is_known(*i) || matters(*i)).collect();
        if others.iter().all(|i| is_known(*i)) {
            return None;
        }
        let cells = MOST_CELLS_TOGETHER.powf(1.0 / others.len() as f64).floor();
        let cells = cells.clamp(2.0, MOST_CELLS) as f32;
        let axis = |component: usize| {
            let width = (self.high[component] - self.low[component]) / cells;
            // It may jump; what rests is in the middle of a cell.
            let low = self.low[component] - 0.5 * width;
            Axis { component, width, low, step: width }
        };
        Some(goal_axes(spec).into_iter().chain(others.into_iter().map(axis)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;

    /// The goal is the second component of four.
    fn spec() -> Spec {
        Spec { achieved: vec![1], ..positions(&[(0.0, 9.0); 4]) }
    }

    /// Returns what has been seen in `steps` steps, of which every `every`-th moves each component.
    fn seen(steps: u64, every: [u64; 4]) -> Moves {
        let (spec, mut moves) = (spec(), Moves::new(&spec()));
        let mut state = vec![0.0; 4];
        for step in 1..=steps {
            let moved = |(i, v): (usize, &f32)| {
                if step.is_multiple_of(every[i]) { 1.0 - v } else { *v }
            };
            let next: Vec<f32> = state.iter().enumerate().map(moved).collect();
            moves.note(&spec, &state, &next);
            state = next;
        }
        moves
    }

    #[test]
    fn what_seldom_moves_tells_places_apart_unless_it_is_part_of_what_has_to_be_moved() {
        let (spec, own) = (spec(), goal_axes(&spec()));
        let axis = |component| Axis { component, width: 0.125, low: -0.0625, step: 0.125 };
        let more = |steps, every| seen(steps, every).more_axes(&spec, &own);
        // A velocity, a key, and what has turned but once.
        assert_eq!(more(2_000, [1, 1, 100, 1_500]), Some(vec![own[0], axis(2)]));
        assert_eq!(more(2_000, [1, 1, 2, 30]), None, "too often");
        assert_eq!([50, 3].map(|goal| more(2_000, [1, goal, 50, 50])), [None, None], "an object");
        let keys = [own[0], axis(0), axis(2)];
        assert_eq!(seen(2_000, [100, 1, 100, 1]).more_axes(&spec, &own), Some(keys.to_vec()));
        assert_eq!(seen(2_000, [100, 1, 1, 1]).more_axes(&spec, &keys), None, "known already");
        assert!(seen(2_000, [1, 50, 1, 1]).goal_rests() && !seen(2_000, [1, 4, 1, 1]).goal_rests());
    }
}
