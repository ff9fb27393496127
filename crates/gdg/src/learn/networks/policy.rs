//! D and mu for inference.

use std::sync::Arc;

use crate::learn::networks::encoder::{Pairs, SharedFeatures};
use crate::learn::networks::lookahead::improve_rows;
use crate::learn::networks::network::{OwnedWeights, Weights};
use crate::learn::networks::shapes::{Shapes, Workspaces};

/// Rows per forward pass, few enough for their activations to stay in the cache.
const ROWS: usize = 128;

/// Inference buffers, one per thread.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    plain: SharedFeatures,
    networks: Box<Workspaces>,
}

impl Scratch {
    /// Calls `compute` for a few pairs at a time, with their rows of `out` `(rows, width)`.
    fn for_pairs(
        &mut self,
        shapes: &Shapes,
        [states, goals]: [&[f32]; 2],
        (out, width): (&mut [f32], usize),
        compute: impl Fn(Pairs, &mut [f32], &mut Workspaces),
    ) {
        let (s, g) = (shapes.encoder.spec.state_dim(), shapes.encoder.spec.goal_dim());
        let chunks =
            states.chunks(ROWS * s).zip(goals.chunks(ROWS * g)).zip(out.chunks_mut(ROWS * width));
        for ((states, goals), out) in chunks {
            shapes.encoder.plain_pairs(states, goals, &mut self.plain);
            compute(Pairs { plain: &self.plain, states, goals }, out, &mut self.networks);
        }
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

    /// Computes the states `next` expected one step after `states` by these `actions`, `(rows,
    /// action_dim)`. A policy without a dynamics model expects no change.
    fn imagine(&self, states: &[f32], _actions: &[f32], next: &mut [f32], _scratch: &mut Scratch) {
        next.copy_from_slice(states);
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

/// Borrowed weights of a learner's networks.
#[derive(Clone)]
pub struct Nets<'a> {
    pub shapes: &'a Shapes,
    pub critics: Vec<Weights<'a>>,
    pub model: Option<Weights<'a>>,
    pub actor: Weights<'a>,
    /// Whether actions are improved by lookahead.
    pub looks_ahead: bool,
}

impl Shapes {
    /// Returns networks with these weights, in the order in which a learner has them: critics,
    /// model, actor.
    pub fn nets<'a>(&'a self, mut weights: Vec<Weights<'a>>) -> Nets<'a> {
        let (model, actor) = (weights[self.critics], weights[weights.len() - 1]);
        weights.truncate(self.critics);
        let model = self.returns.is_none().then_some(model);
        Nets { shapes: self, critics: weights, model, actor, looks_ahead: true }
    }
}

impl Policy for Nets<'_> {
    /// Computes D by all critics. Where D is given, it passes through walls; where critics learn Q,
    /// it is Q(s, mu(s, g), g) by the most pessimistic one in steps.
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let (shapes, spec) = (self.shapes, &self.shapes.encoder.spec);
        if self.critics.is_empty() {
            let pairs =
                states.chunks_exact(spec.state_dim()).zip(goals.chunks_exact(spec.goal_dim()));
            for (out, (state, goal)) in out.iter_mut().zip(pairs) {
                *out = spec.goal_distance(state, goal) / shapes.step_length;
            }
            return;
        }
        scratch.for_pairs(shapes, [states, goals], (out, 1), |pairs, out, ws| {
            let Some(returns) = &shapes.returns else {
                return shapes.joint_distances(&self.critics, pairs, out, &mut ws.critic);
            };
            shapes.values_of_actor(self.actor, &self.critics, pairs, &[], out, ws);
            out.iter_mut().for_each(|q| *q = returns.steps(*q));
        });
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let Shapes { encoder, actor, .. } = self.shapes;
        let out = (out, actor.outputs);
        scratch.for_pairs(self.shapes, [states, goals], out, |pairs, out, ws| {
            ws.actor.actions(encoder, actor, self.actor, pairs, out);
        });
    }

    fn improve_actions(
        &self,
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        if let Some(model) = self.model.filter(|_| self.looks_ahead && !self.critics.is_empty()) {
            let (critics, ws) = (&self.critics, &mut scratch.networks);
            self.shapes.improve_actions(model, critics, states, goals, actions, ws);
        }
    }

    fn imagine(&self, states: &[f32], actions: &[f32], next: &mut [f32], scratch: &mut Scratch) {
        match self.model {
            Some(model) => {
                let ws = &mut scratch.networks.model;
                self.shapes.next_states(model, states, actions, next, ws);
            }
            None => next.copy_from_slice(states),
        }
    }
}

impl Imagine for Nets<'_> {
    fn step(&self, states: &[f32], goals: &[f32], next: &mut Vec<f32>, scratch: &mut Scratch) {
        let Scratch { plain, networks } = scratch;
        self.shapes.encoder.plain_pairs(states, goals, plain);
        if let Some(model) = self.model {
            let pairs = Pairs { plain, states, goals };
            self.shapes.step_with_actor(self.actor, model, pairs, next, networks);
        }
        next.truncate(states.len());
    }
}

/// A frozen copy of a learner's networks.
pub struct Frozen {
    pub shapes: Arc<Shapes>,
    pub weights: Vec<OwnedWeights>,
    /// See [`Nets::looks_ahead`].
    pub looks_ahead: bool,
}

impl Frozen {
    fn nets(&self) -> Nets<'_> {
        let nets = self.shapes.nets(self.weights.iter().map(OwnedWeights::weights).collect());
        Nets { looks_ahead: self.looks_ahead, ..nets }
    }
}

impl Policy for Frozen {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().distances(states, goals, out, scratch);
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().actions(states, goals, out, scratch);
    }

    fn improve_actions(
        &self,
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        self.nets().improve_actions(states, goals, actions, scratch);
    }
}

#[cfg(test)]
pub(in crate::learn) mod tests {
    use super::*;

    /// A world of one axis: D is the straight line, and `wall` steps longer across 50; the actor
    /// leads from s to `next(s, g)`.
    pub struct LineWorld {
        pub wall: f32,
        pub next: fn(f32, f32) -> f32,
    }

    impl Policy for LineWorld {
        fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
            for (out, (s, g)) in out.iter_mut().zip(states.iter().zip(goals)) {
                let wall = if (*s < 50.0) == (*g < 50.0) { 0.0 } else { self.wall };
                *out = (s - g).abs() + wall;
            }
        }

        fn actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}
    }

    impl Imagine for LineWorld {
        fn step(&self, states: &[f32], goals: &[f32], next: &mut Vec<f32>, _: &mut Scratch) {
            next.clear();
            next.extend(states.iter().zip(goals).map(|(s, g)| (self.next)(*s, *g)));
        }
    }
}
