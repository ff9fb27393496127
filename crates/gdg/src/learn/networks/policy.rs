//! D and mu for inference.

use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::{Pairs, SharedFeatures, Workspace};
use crate::learn::networks::lookahead::{LookaheadBuffers, improve_rows};
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Weights;
use crate::learn::networks::shapes::{Shapes, Workspaces};

/// Rows per forward pass, few enough for their activations to stay in the cache.
const ROWS: usize = 128;

/// Inference buffers, one per thread.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    plain: SharedFeatures,
    ws: Workspace,
    /// For learners whose D takes two networks.
    second: Workspace,
    lookahead: LookaheadBuffers,
    /// For steps that the dynamics model imagines; boxed, as few need them.
    imagined: Box<Workspaces>,
}

impl Scratch {
    /// Calls `compute` for a few pairs at a time, with their rows of `out` `(rows, width)` and two
    /// buffers.
    pub(in crate::learn) fn for_pairs(
        &mut self,
        encoder: &Encoder,
        states: &[f32],
        goals: &[f32],
        out: &mut [f32],
        width: usize,
        compute: impl Fn(Pairs, &mut [f32], [&mut Workspace; 2]),
    ) {
        let (s, g) = (encoder.spec().state_dim(), encoder.spec().goal_dim());
        let chunks =
            states.chunks(ROWS * s).zip(goals.chunks(ROWS * g)).zip(out.chunks_mut(ROWS * width));
        let Self { plain, ws, second, .. } = self;
        for ((states, goals), out) in chunks {
            encoder.plain_pairs(states, goals, plain);
            compute(Pairs { plain, states, goals }, out, [ws, second]);
        }
    }

    /// Computes the actions mu(s, g) of an `actor` of these sizes, `out` `(rows, action_dim)`.
    pub(in crate::learn) fn actions(
        &mut self,
        encoder: &Encoder,
        sizes: &Mlp,
        actor: Weights,
        [states, goals]: [&[f32]; 2],
        out: &mut [f32],
    ) {
        self.for_pairs(encoder, states, goals, out, sizes.outputs, |pairs, out, [ws, _]| {
            ws.actions(encoder, sizes, actor, pairs, out);
        });
    }
}

/// The learned D and mu, for inference.
///
/// D is a number of steps, finite and at least 0. In a world with a hidden state, it is an average
/// over what is hidden.
pub trait Policy: Send + Sync {
    /// Computes D(s, g) of each pair in steps, finite and at least 0. `states` `(rows, state_dim)`,
    /// `goals` `(rows, goal_dim)`, `out` `(rows)`.
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch);

    /// Computes the actions mu(s, g), `out` `(rows, action_dim)`. They should lie in [-1, 1]:
    /// others are clipped, by the trainer during exploration, otherwise by the world.
    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch);

    /// Replaces `actions` `(rows, action_dim)`, which are mu(s, g), by one step of lookahead: by
    /// other actions after which D is shorter. A policy without a dynamics model leaves them.
    fn improve_actions(
        &self,
        _states: &[f32],
        _goals: &[f32],
        _actions: &mut [f32],
        _scratch: &mut Scratch,
    ) {
    }

    /// Returns D of a single pair, in steps.
    fn distance(&self, state: &[f32], goal: &[f32], scratch: &mut Scratch) -> f32 {
        let mut out = [0.0];
        self.distances(state, goal, &mut out, scratch);
        out[0]
    }
}

/// Pairs whose D is asked.
#[derive(Default)]
pub(in crate::learn) struct DistanceQueries {
    /// `(pairs, state_dim)`.
    pub states: Vec<f32>,
    /// `(pairs, goal_dim)`.
    pub goals: Vec<f32>,
    distances: Vec<f32>,
}

impl DistanceQueries {
    /// Removes all pairs.
    pub fn clear(&mut self) {
        [&mut self.states, &mut self.goals, &mut self.distances].into_iter().for_each(Vec::clear);
    }

    /// Adds a pair.
    pub fn push(&mut self, state: &[f32], goal: &[f32]) {
        self.states.extend(state);
        self.goals.extend(goal);
        self.distances.push(0.0);
    }

    /// Returns D of each pair, in steps.
    pub fn ask(&mut self, policy: &dyn Policy, scratch: &mut Scratch) -> &[f32] {
        policy.distances(&self.states, &self.goals, &mut self.distances, scratch);
        &self.distances
    }
}

/// A policy with a dynamics model, which imagines where it leads.
pub(in crate::learn) trait Imagine: Policy {
    /// Computes the states expected after the actor's actions, f(s, mu(s, g)), `next`
    /// `(rows, state_dim)`.
    fn step(&self, states: &[f32], goals: &[f32], next: &mut Vec<f32>, scratch: &mut Scratch);
}

/// Improves the actor's `actions` `(rows, action_dim)` in the rows that are marked in `ahead` by
/// one step of lookahead.
pub fn look_ahead(
    policy: &dyn Policy,
    ahead: &[bool],
    states: &[f32],
    goals: &[f32],
    actions: &mut [f32],
    scratch: &mut Scratch,
) {
    let rows: Vec<usize> = (0..ahead.len()).filter(|row| ahead[*row]).collect();
    if rows.is_empty() {
        return;
    }
    let width = |numbers: &[f32]| numbers.len() / ahead.len();
    let (s, g, a) = (width(states), width(goals), width(actions));
    improve_rows(&rows, (states, s), (goals, g), (actions, a), |states, goals, actions| {
        policy.improve_actions(states, goals, actions, scratch);
    });
}

/// Borrowed weights of critics, dynamics model and actor.
#[derive(Clone)]
pub struct Nets<'a> {
    pub(in crate::learn) shapes: &'a Shapes,
    pub(in crate::learn) critics: Vec<Weights<'a>>,
    pub(in crate::learn) model: Weights<'a>,
    pub(in crate::learn) actor: Weights<'a>,
}

impl Policy for Nets<'_> {
    /// Computes D by all critics.
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        scratch.for_pairs(&self.shapes.encoder, states, goals, out, 1, |pairs, out, [ws, _]| {
            self.shapes.joint_distances(&self.critics, pairs, out, ws);
        });
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let Shapes { encoder, actor, .. } = self.shapes;
        scratch.actions(encoder, actor, self.actor, [states, goals], out);
    }

    fn improve_actions(
        &self,
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        let lookahead = &mut scratch.lookahead;
        self.shapes.improve_actions(self.model, &self.critics, states, goals, actions, lookahead);
    }
}

impl Imagine for Nets<'_> {
    fn step(&self, states: &[f32], goals: &[f32], next: &mut Vec<f32>, scratch: &mut Scratch) {
        let Scratch { plain, imagined, .. } = scratch;
        self.shapes.encoder.plain_pairs(states, goals, plain);
        let pairs = Pairs { plain, states, goals };
        self.shapes.step_with_actor(self.actor, self.model, pairs, next, imagined);
        next.truncate(states.len());
    }
}

#[cfg(test)]
pub(in crate::learn) mod tests {
    use super::*;

    /// A world of one axis: D is the straight line, and `wall` steps longer across 50; the actor
    /// leads from s to `next(s, g)`.
    pub struct Line {
        pub wall: f32,
        pub next: fn(f32, f32) -> f32,
    }

    impl Policy for Line {
        fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
            for (out, (s, g)) in out.iter_mut().zip(states.iter().zip(goals)) {
                let wall = if (*s < 50.0) == (*g < 50.0) { 0.0 } else { self.wall };
                *out = (s - g).abs() + wall;
            }
        }

        fn actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}
    }

    impl Imagine for Line {
        fn step(&self, states: &[f32], goals: &[f32], next: &mut Vec<f32>, _: &mut Scratch) {
            next.clear();
            next.extend(states.iter().zip(goals).map(|(s, g)| (self.next)(*s, *g)));
        }
    }
}
