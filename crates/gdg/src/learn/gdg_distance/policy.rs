//! The given D and the learned mu for inference: borrowed from the learner, or frozen.

use std::sync::Arc;

use super::Objective;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{CopiedWeights, OwnedWeights, Policy, Scratch};

/// The straight line and the borrowed weights of the actor. Actions are not improved by lookahead.
pub struct Nets<'a> {
    pub objective: &'a Objective,
    pub actor: Weights<'a>,
}

impl Policy for Nets<'_> {
    /// Computes the straight line in steps: its length over that of a typical step. It passes
    /// through walls, so in mazes it is too short.
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _scratch: &mut Scratch) {
        let spec = self.objective.shapes.encoder.spec();
        let pairs = states.chunks_exact(spec.state_dim()).zip(goals.chunks_exact(spec.goal_dim()));
        for (out, (state, goal)) in out.iter_mut().zip(pairs) {
            *out = self.objective.line.steps(state, goal);
        }
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let shapes = &self.objective.shapes;
        scratch.for_pairs(
            &shapes.encoder,
            (states, goals),
            (out, shapes.actor.outputs),
            |pairs, out, [ws, _]| {
                shapes.actions(self.actor, pairs, out, ws);
            },
        );
    }
}

/// The straight line and a frozen copy of the actor.
pub struct FrozenActor {
    objective: Arc<Objective>,
    actor: OwnedWeights,
}

impl FrozenActor {
    pub fn new(objective: Arc<Objective>, actor: CopiedWeights) -> Self {
        Self { actor: OwnedWeights::new(actor, &objective.shapes.actor), objective }
    }

    fn nets(&self) -> Nets<'_> {
        Nets {
            objective: &self.objective,
            actor: self.actor.weights(&self.objective.shapes.encoder),
        }
    }
}

impl Policy for FrozenActor {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().distances(states, goals, out, scratch);
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().actions(states, goals, out, scratch);
    }
}
