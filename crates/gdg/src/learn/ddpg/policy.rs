//! D and mu for inference.

use super::losses::Shapes;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{Policy, Scratch};

/// Borrowed weights of critics and actor. There is no dynamics model, so actions cannot be improved
/// by lookahead.
pub struct Nets<'a> {
    pub shapes: &'a Shapes,
    pub critics: Vec<Weights<'a>>,
    pub actor: Weights<'a>,
}

impl Policy for Nets<'_> {
    /// Converts Q(s, mu(s, g), g) by the most pessimistic critic to steps (see
    /// [`super::returns::Returns::steps`]).
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        scratch.for_pairs(&self.shapes.encoder, states, goals, out, 1, |pairs, out, buffers| {
            self.shapes.values_of_actor(self.actor, &self.critics, pairs, &[], out, buffers);
            out.iter_mut().for_each(|q| *q = self.shapes.returns.steps(*q));
        });
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        let width = self.shapes.actor.outputs;
        scratch.for_pairs(
            &self.shapes.encoder,
            states,
            goals,
            out,
            width,
            |pairs, out, [ws, _]| {
                ws.actions(&self.shapes.encoder, &self.shapes.actor, self.actor, pairs, out);
            },
        );
    }
}
