//! One step of lookahead: the action of a fixed set after which the critics expect the shortest
//! distance.

use crate::learn::networks::network::Weights;
use crate::learn::networks::shapes::{Shapes, Workspaces};

/// Minimum gain over the actor's action, in steps: smaller differences are noise of D.
pub const MIN_GAIN_STEPS: f32 = 0.1;

/// Least progress D(s, g) - D(f(s, a), g) of an action for which no other is tried, in steps; a step
/// on the shortest path makes 1.
pub const GOOD_PROGRESS_STEPS: f32 = 0.8;

/// An action is blocked if it changes every component by less than this, as a share of its change
/// scale.
pub const BLOCKED_CHANGE: f32 = 0.5;

/// Pairs whose actions are tried at a time, few enough for the activations to stay in the cache.
const PAIRS: usize = 8;

/// Steps of the actor as the model predicts them.
#[derive(Clone, Copy)]
pub struct Steps<'a> {
    /// `(rows, state_dim)`.
    pub states: &'a [f32],
    /// `(rows, action_dim)`.
    pub actions: &'a [f32],
    /// `(rows, state_dim)`.
    pub next: &'a [f32],
}

/// Returns some `rows` of `numbers`, which are `width` wide.
pub fn chosen(rows: &[usize], numbers: &[f32], width: usize) -> Vec<f32> {
    rows.iter().flat_map(|row| &numbers[row * width..(row + 1) * width]).copied().collect()
}

/// Calls `improve` with these `rows` of states, goals and actions, each given with its width, and
/// puts the improved actions in their places.
pub fn improve_rows(
    rows: &[usize],
    (states, s): (&[f32], usize),
    (goals, g): (&[f32], usize),
    (actions, a): (&mut [f32], usize),
    improve: impl FnOnce(&[f32], &[f32], &mut [f32]),
) {
    let mut best = chosen(rows, actions, a);
    improve(&chosen(rows, states, s), &chosen(rows, goals, g), &mut best);
    for (row, action) in rows.iter().zip(best.chunks_exact(a)) {
        actions[row * a..(row + 1) * a].copy_from_slice(action);
    }
}

impl Shapes {
    fn widths(&self) -> [usize; 3] {
        let spec = &self.encoder.spec;
        [spec.state_dim(), spec.goal_dim(), spec.action_dim]
    }

    /// Replaces `actions` `(rows, action_dim)`, the actor's in `states` towards `goals`, by those
    /// of [`Shapes::tried_actions`] with a smaller D(f(s, a), g) by all `critics`, where there is
    /// one and the actor's makes little progress.
    ///
    /// The actor descends the same objective along its gradient (Algorithm 1), which does not help
    /// where a wall blocks all similar actions.
    pub fn improve_actions(
        &self,
        model: Weights,
        critics: &[Weights],
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        ws: &mut Workspaces,
    ) {
        let [s, g, a] = self.widths();
        let rows = goals.len() / g;
        let (mut next, mut before, mut after) =
            (vec![0.0; states.len()], vec![0.0; rows], vec![0.0; rows]);
        self.next_states(model, states, actions, &mut next, &mut ws.model);
        self.distances_between(critics, states, goals, &mut before, &mut ws.critic);
        self.distances_between(critics, &next, goals, &mut after, &mut ws.critic);
        let slow: Vec<usize> =
            (0..rows).filter(|i| before[*i] - after[*i] < GOOD_PROGRESS_STEPS).collect();
        improve_rows(&slow, (states, s), (goals, g), (actions, a), |states, goals, actions| {
            self.try_actions(model, critics, states, goals, actions, ws);
        });
    }

    /// Replaces `actions` like [`Shapes::improve_actions`], but tries others in every row.
    fn try_actions(
        &self,
        model: Weights,
        critics: &[Weights],
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        ws: &mut Workspaces,
    ) {
        let [s, g, a] = self.widths();
        let count = 1 + self.tried_actions.len() / a;
        let (mut tried, mut next, mut distances) = (Vec::new(), Vec::new(), Vec::new());
        let chunks = states
            .chunks(PAIRS * s)
            .zip(goals.chunks(PAIRS * g))
            .zip(actions.chunks_mut(PAIRS * a));
        for ((states, goals), actions) in chunks {
            let repeated = |numbers: &[f32], width: usize| -> Vec<f32> {
                numbers.chunks_exact(width).flat_map(|row| row.repeat(count)).collect()
            };
            let (from, to) = (repeated(states, s), repeated(goals, g));
            tried.clear();
            for own in actions.chunks_exact(a) {
                tried.extend(own);
                tried.extend(&self.tried_actions);
            }
            next.resize(from.len(), 0.0);
            self.next_states(model, &from, &tried, &mut next, &mut ws.model);
            distances.resize(tried.len() / a, 0.0);
            self.distances_between(critics, &next, &to, &mut distances, &mut ws.critic);
            let tried = tried.chunks_exact(count * a).zip(distances.chunks_exact(count));
            for (action, (tried, distances)) in actions.chunks_exact_mut(a).zip(tried) {
                let mut shortest = distances[0] - MIN_GAIN_STEPS;
                for (other, distance) in tried.chunks_exact(a).zip(distances).skip(1) {
                    if *distance < shortest {
                        shortest = *distance;
                        action.copy_from_slice(other);
                    }
                }
            }
        }
    }

    /// Finds better actions by lookahead towards `goals` for the rows of positive weight whose
    /// actions are blocked, as the model predicts. Actions similar to a blocked one are blocked,
    /// too, so that the gradient of Algorithm 1 vanishes. Writes them to `found` `(rows,
    /// action_dim)`; NaN in rows without one.
    pub fn find_ways_out(
        &self,
        model: Weights,
        critic: Weights,
        Steps { states, actions, next }: Steps,
        (goals, weights): (&[f32], &[f32]),
        found: &mut Vec<f32>,
        ws: &mut Workspaces,
    ) {
        let [s, g, a] = self.widths();
        let is_blocked = |row: &usize| {
            let at = row * s..(row + 1) * s;
            let changes =
                next[at.clone()].iter().zip(&states[at]).map(|(next, state)| (next - state).abs());
            let scales = &self.encoder.spec.change_scale;
            changes.zip(scales).all(|(change, scale)| change <= BLOCKED_CHANGE * scale)
        };
        let rows: Vec<usize> =
            (0..weights.len()).filter(|row| weights[*row] > 0.0).filter(is_blocked).collect();
        let own = chosen(&rows, actions, a);
        let mut best = own.clone();
        let (from, to) = (chosen(&rows, states, s), chosen(&rows, goals, g));
        self.try_actions(model, &[critic], &from, &to, &mut best, ws);
        found.clear();
        found.resize(actions.len(), f32::NAN);
        for ((row, own), best) in rows.iter().zip(own.chunks_exact(a)).zip(best.chunks_exact(a)) {
            if own != best {
                found[row * a..(row + 1) * a].copy_from_slice(best);
            }
        }
    }
}
