//! What model and actor learn from one part of a batch.

use super::NAME;
use crate::env::Spec;
use crate::learn::data::batch::Batch;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::{Pairs, SharedFeatures};
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::networks::shapes::{MAX_STATE_DIM, Shapes, Workspaces};
use crate::learn::networks::table::TouchedCorners;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::ModelLoss;
use crate::learn::update::objective::{NetworkPlan, NetworkWeights, Objective, Part};
use crate::learn::update::rows::{PAIRS, Rows, TRANSITIONS, find_corners_of};
use crate::learn::update::straight::StraightLine;

/// The networks, in order.
pub const MODEL: usize = 0;
pub const ACTOR: usize = 1;

/// The straight line, and model and actor, which descends it.
pub struct GivenDistance {
    pub shapes: Shapes,
    pub line: StraightLine,
}

/// Buffers of one task of an update.
#[derive(Default)]
pub struct Buffers {
    plain: SharedFeatures,
    passes: Workspaces,
}

impl GivenDistance {
    /// Returns the distance in an environment of `spec`, and the shapes of the networks that
    /// `settings` specify.
    pub fn new(spec: &Spec, settings: &LearnSettings) -> Self {
        Self { shapes: Shapes::new(spec, settings), line: StraightLine::new(spec) }
    }

    /// Computes the actor's gradient of mean |f(s, mu(s, g)) - g| in steps, plus that of the excess
    /// of the actor's outputs over their bound, into `gradient`; `share` is 1 / batch size. Returns
    /// the part's contribution to the mean.
    fn descend(
        &self,
        networks: &[Weights],
        pairs: Pairs,
        share: f32,
        gradient: &mut Gradient,
        buffers: &mut Workspaces,
    ) -> f32 {
        gradient.prepare(self.shapes.actor.parameters());
        let (actor, model) = (networks[ACTOR], networks[MODEL]);
        let spec = self.shapes.encoder.spec();
        let s = spec.state_dim();
        let mut next = std::mem::take(&mut buffers.model.y);
        self.shapes.step_with_actor(actor, model, pairs, &mut next, buffers);
        let (mut loss, mut d_state) = (0.0, [0.0; MAX_STATE_DIM]);
        let d_state = &mut d_state[..s];
        let d_change = &mut next[..pairs.states.len()];
        for (next, goal) in
            d_change.chunks_exact_mut(s).zip(pairs.goals.chunks_exact(spec.goal_dim()))
        {
            loss += share * self.line.gradient(next, goal, d_state);
            for ((next, d), scale) in next.iter_mut().zip(&*d_state).zip(&spec.change_scale) {
                *next = share * scale * d;
            }
        }
        let after = ModelLoss { d_change, share, ..ModelLoss::default() };
        self.shapes.actor_gradient_through_model(actor, model, pairs, after, gradient, buffers);
        buffers.model.y = next;
        loss
    }
}

impl Objective for GivenDistance {
    type Batch = Batch;
    type Buffers = Buffers;
    type Nets<'a> = Nets<'a>;

    const POSITION_SETS: usize = 2;

    fn encoder(&self) -> &Encoder {
        &self.shapes.encoder
    }

    fn networks(&self) -> Vec<NetworkPlan> {
        let Shapes { model, actor, .. } = self.shapes;
        vec![
            NetworkPlan::plain(format!("{NAME}.model"), model, TRANSITIONS),
            NetworkPlan::averaged(format!("{NAME}.actor"), actor, PAIRS),
        ]
    }

    fn find_corners(&self, set: usize, batch: &Batch, touched: &mut TouchedCorners) {
        find_corners_of(set, &self.shapes, batch, touched);
    }

    fn gradients(
        &self,
        batch: &Batch,
        i: usize,
        networks: NetworkWeights,
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let rows = Rows::new(&self.shapes, batch, i);
        let (model, ws) = (networks.current[MODEL], &mut buffers.passes.model);
        losses.model = self.shapes.model_gradient(model, &rows, &mut gradients[MODEL], ws);
    }

    fn actor_gradient(
        &self,
        batch: &Batch,
        i: usize,
        networks: &[Weights],
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let Rows { states, goals, share, .. } = Rows::new(&self.shapes, batch, i);
        let Buffers { plain, passes } = buffers;
        self.shapes.encoder.plain_pairs(states, goals, plain);
        let pairs = Pairs { plain, states, goals };
        losses.actor = self.descend(networks, pairs, share, &mut gradients[ACTOR], passes);
    }

    fn nets<'a>(&'a self, weights: Vec<Weights<'a>>) -> Nets<'a> {
        Nets { objective: self, actor: weights[ACTOR] }
    }

    /// Returns the actions: the given D is always finite.
    fn outputs(nets: &Nets, batch: &Batch) -> Vec<f32> {
        let mut actions = vec![0.0; batch.len() * nets.objective.shapes.actor.outputs];
        nets.actions(&batch.states, &batch.goals, &mut actions, &mut Scratch::default());
        actions
    }
}

/// The straight line and the borrowed weights of the actor. Actions are not improved by lookahead.
pub struct Nets<'a> {
    pub objective: &'a GivenDistance,
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
        let Shapes { encoder, actor, .. } = &self.objective.shapes;
        scratch.actions(encoder, actor, self.actor, [states, goals], out);
    }
}
