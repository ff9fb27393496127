//! One step of lookahead: the action of a fixed set after which the critics expect the shortest
//! distance.

use crate::learn::networks::features::{Pairs, SharedFeatures, Workspace};
use crate::learn::networks::network::Weights;
use crate::learn::networks::shapes::Shapes;

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

/// Buffers of lookahead.
#[derive(Clone, Debug, Default)]
pub struct LookaheadBuffers {
    states: Vec<f32>,
    goals: Vec<f32>,
    actions: Vec<f32>,
    next: Vec<f32>,
    distances: Vec<f32>,
    before: Vec<f32>,
    plain: SharedFeatures,
    model: Workspace,
    critic: Workspace,
}

/// Better actions where the actor's own are blocked (see [`Shapes::find_ways_out`]).
#[derive(Clone, Debug, Default)]
pub struct WaysOut {
    rows: Vec<usize>,
    states: Vec<f32>,
    goals: Vec<f32>,
    own: Vec<f32>,
    best: Vec<f32>,
    lookahead: LookaheadBuffers,
    /// `(rows, action_dim)`; NaN in rows without one.
    pub actions: Vec<f32>,
}

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

/// Replaces each of `actions` `(rows, a)` by the one of those `tried` in its place,
/// `(rows * count, a)`, whose D in `distances` `(rows * count)` is clearly the smallest; the first
/// one tried is the action itself.
fn keep_shortest(actions: &mut [f32], tried: &[f32], distances: &[f32], a: usize) {
    let count = distances.len() / (actions.len() / a);
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

/// Calls `improve` with these `rows` of states, goals and actions, each given with its width, and
/// puts the improved actions in their places.
pub fn improve_rows(
    rows: &[usize],
    (states, s): (&[f32], usize),
    (goals, g): (&[f32], usize),
    (actions, a): (&mut [f32], usize),
    improve: impl FnOnce(&[f32], &[f32], &mut [f32]),
) {
    let chosen = |numbers: &[f32], width: usize| -> Vec<f32> {
        rows.iter().flat_map(|row| &numbers[row * width..(row + 1) * width]).copied().collect()
    };
    let mut best = chosen(actions, a);
    improve(&chosen(states, s), &chosen(goals, g), &mut best);
    for (row, action) in rows.iter().zip(best.chunks_exact(a)) {
        actions[row * a..(row + 1) * a].copy_from_slice(action);
    }
}

impl Shapes {
    /// Finds the rows whose `actions` `(rows, action_dim)` in `states` make less than
    /// [`GOOD_PROGRESS_STEPS`] towards `goals`, by f and by D of all `critics`.
    fn slow_rows(
        &self,
        model: Weights,
        critics: &[Weights],
        Steps { states, actions, .. }: Steps,
        goals: &[f32],
        buffers: &mut LookaheadBuffers,
    ) -> Vec<usize> {
        let rows = goals.len() / self.encoder.spec().goal_dim();
        let LookaheadBuffers { next, distances, before, plain, model: ws, critic, .. } = buffers;
        next.resize(states.len(), 0.0);
        self.next_states(model, states, actions, next, ws);
        for (states, out) in [(states, &mut *before), (next, distances)] {
            out.resize(rows, 0.0);
            self.encoder.plain_pairs(states, goals, plain);
            self.joint_distances(critics, Pairs { plain, states, goals }, out, critic);
        }
        let progress = before.iter().zip(distances).map(|(before, after)| before - *after);
        progress.enumerate().filter(|(_, p)| *p < GOOD_PROGRESS_STEPS).map(|(i, _)| i).collect()
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
        buffers: &mut LookaheadBuffers,
    ) {
        let spec = self.encoder.spec();
        let (s, g, a) = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        let steps = Steps { states, actions, next: &[] };
        let rows = self.slow_rows(model, critics, steps, goals, buffers);
        improve_rows(&rows, (states, s), (goals, g), (actions, a), |states, goals, actions| {
            self.try_actions(model, critics, states, goals, actions, buffers);
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
        buffers: &mut LookaheadBuffers,
    ) {
        let spec = self.encoder.spec();
        let (s, g, a) = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        let chunks = states
            .chunks(PAIRS * s)
            .zip(goals.chunks(PAIRS * g))
            .zip(actions.chunks_mut(PAIRS * a));
        for ((states, goals), actions) in chunks {
            let LookaheadBuffers {
                states: from,
                goals: to,
                actions: tried,
                next,
                distances,
                plain,
                ..
            } = buffers;
            [&mut *from, to, tried].into_iter().for_each(Vec::clear);
            for ((state, goal), own) in
                states.chunks_exact(s).zip(goals.chunks_exact(g)).zip(actions.chunks_exact(a))
            {
                let count = 1 + self.tried_actions.len() / a;
                for _ in 0..count {
                    from.extend(state);
                    to.extend(goal);
                }
                tried.extend(own);
                tried.extend(&self.tried_actions);
            }
            let rows = tried.len() / a;
            next.resize(rows * s, 0.0);
            self.next_states(model, from, tried, next, &mut buffers.model);
            self.encoder.plain_pairs(next, to, plain);
            distances.resize(rows, 0.0);
            self.joint_distances(
                critics,
                Pairs { plain, states: next, goals: to },
                distances,
                &mut buffers.critic,
            );
            keep_shortest(actions, tried, distances, a);
        }
    }

    /// Finds better actions by lookahead towards `goals` for the rows of positive weight whose
    /// actions are blocked, as the model predicts. Actions similar to a blocked one are blocked,
    /// too, so that the gradient of Algorithm 1 vanishes.
    pub fn find_ways_out(
        &self,
        model: Weights,
        critic: Weights,
        Steps { states, actions, next }: Steps,
        (goals, weights): (&[f32], &[f32]),
        ways: &mut WaysOut,
    ) {
        let spec = self.encoder.spec();
        let (s, g, a) = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        let is_blocked = |row: &usize| {
            let at = row * s..(row + 1) * s;
            let changes =
                next[at.clone()].iter().zip(&states[at]).map(|(next, state)| (next - state).abs());
            changes.zip(&spec.change_scale).all(|(change, scale)| change <= BLOCKED_CHANGE * scale)
        };
        let WaysOut { rows, states: from, goals: to, own, best, lookahead, actions: found } = ways;
        rows.clear();
        rows.extend((0..states.len() / s).filter(|row| weights[*row] > 0.0).filter(is_blocked));
        for (chosen, all, width) in [(&mut *from, states, s), (to, goals, g), (own, actions, a)] {
            chosen.clear();
            rows.iter().for_each(|row| chosen.extend(&all[row * width..(row + 1) * width]));
        }
        best.clone_from(own);
        self.try_actions(model, &[critic], from, to, best, lookahead);
        found.clear();
        found.resize(actions.len(), f32::NAN);
        for ((row, own), best) in rows.iter().zip(own.chunks_exact(a)).zip(best.chunks_exact(a)) {
            if own != best {
                found[row * a..(row + 1) * a].copy_from_slice(best);
            }
        }
    }
}
