//! D and mu for inference: borrowed from the learner, or frozen for planning, evaluation and
//! display.

use std::sync::Arc;

use super::losses::Shapes;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{CopiedWeights, OwnedWeights, Policy, Scratch};

/// Borrowed weights of critics and actor. There is no dynamics model, so actions cannot be improved
/// by lookahead.
pub struct Nets<'a> {
    pub shapes: &'a Shapes,
    pub critics: Vec<Weights<'a>>,
    pub actor: Weights<'a>,
}

impl Policy for Nets<'_> {
    /// Computes D as the steps that Q(s, mu(s, g), g) means, by the most pessimistic critic (see
    /// [`super::returns::Returns::steps`]).
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        scratch.for_pairs(
            &self.shapes.encoder,
            (states, goals),
            (out, 1),
            |pairs, out, buffers| {
                self.shapes.values_of_actor(
                    (self.actor, &self.critics),
                    (pairs, &[]),
                    out,
                    buffers,
                );
                out.iter_mut().for_each(|q| *q = self.shapes.returns.steps(*q));
            },
        );
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let width = self.shapes.actor.outputs;
        scratch.for_pairs(
            &self.shapes.encoder,
            (states, goals),
            (out, width),
            |pairs, out, [ws, _]| {
                ws.actions(&self.shapes.encoder, &self.shapes.actor, self.actor, pairs, out);
            },
        );
    }
}

/// A frozen copy of critics and actor.
pub struct FrozenNets {
    shapes: Arc<Shapes>,
    critics: Vec<OwnedWeights>,
    actor: OwnedWeights,
}

impl FrozenNets {
    pub fn new(shapes: Arc<Shapes>, critics: Vec<CopiedWeights>, actor: CopiedWeights) -> Self {
        let critics =
            critics.into_iter().map(|copied| OwnedWeights::new(copied, &shapes.critic)).collect();
        Self { critics, actor: OwnedWeights::new(actor, &shapes.actor), shapes }
    }

    fn nets(&self) -> Nets<'_> {
        let encoder = &self.shapes.encoder;
        let critics = self.critics.iter().map(|own| own.weights(encoder)).collect();
        Nets { shapes: &self.shapes, critics, actor: self.actor.weights(encoder) }
    }
}

impl Policy for FrozenNets {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().distances(states, goals, out, scratch);
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().actions(states, goals, out, scratch);
    }
}
