//! What critics and actor learn from one part of a batch.

use super::batch::Transitions;
use super::losses::{Buffers, Rows, Shapes};
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::networks::table::TouchedCorners;
use crate::learn::update::objective::{NetworkPlan, NetworkWeights, Objective, Part};
use crate::learn::update::rows::{find_corners, parts_of};

/// The only set of positions: all networks read states and goals.
const PAIRS: usize = 0;

impl Objective for Shapes {
    type Batch = Transitions;
    type Buffers = Buffers;
    type Nets<'a> = Nets<'a>;

    const POSITION_SETS: usize = 1;

    fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    /// Returns the critics, the first of which trains the actor, and the actor.
    fn networks(&self) -> Vec<NetworkPlan> {
        let plan = |name, mlp| NetworkPlan::averaged(format!("{}.{name}", self.prefix), mlp, PAIRS);
        let critics = (0..self.critics).map(|k| plan(format!("critic{k}"), self.critic));
        critics.chain([plan("actor".to_owned(), self.actor)]).collect()
    }

    fn find_corners(&self, _: usize, batch: &Transitions, touched: &mut TouchedCorners) {
        let parts = (0..parts_of(batch.len())).map(|i| Rows::new(self, batch, i));
        find_corners(&self.encoder, parts.map(|rows| (rows.states, rows.goals)), touched);
    }

    fn gradients(
        &self,
        batch: &Transitions,
        i: usize,
        networks: NetworkWeights,
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let rows = Rows::new(self, batch, i);
        buffers.compute_targets(self, &rows, networks.averaged);
        let critics = gradients.iter_mut().zip(networks.current).take(self.critics);
        losses.critic = 0.0;
        for (gradient, critic) in critics {
            let loss = buffers.critic_gradient(self, &rows, *critic, gradient);
            losses.critic += loss / self.critics as f32;
        }
    }

    fn actor_gradient(
        &self,
        batch: &Transitions,
        i: usize,
        networks: &[Weights],
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let rows = Rows::new(self, batch, i);
        let (actor, critic) = (networks[self.critics], networks[0]);
        let gradient = &mut gradients[self.critics];
        losses.actor = buffers.actor_gradient(self, &rows, actor, critic, gradient);
    }

    fn nets<'a>(&'a self, mut weights: Vec<Weights<'a>>) -> Nets<'a> {
        let actor = weights[self.critics];
        weights.truncate(self.critics);
        Nets { shapes: self, critics: weights, actor }
    }

    fn outputs(nets: &Nets, batch: &Transitions) -> Vec<f32> {
        let mut distances = vec![0.0; batch.len()];
        nets.distances(&batch.states, &batch.goals, &mut distances, &mut Scratch::default());
        distances
    }
}

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
        let Shapes { encoder, actor, .. } = self.shapes;
        scratch.actions(encoder, actor, self.actor, [states, goals], out);
    }
}
