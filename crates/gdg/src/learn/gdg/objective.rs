//! What critics, dynamics model and actor learn from one part of a batch (Algorithm 1).

use crate::learn::data::batch::{Batch, RAISE_FACTOR, RAISE_STEPS};
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::{Pairs, SharedFeatures};
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::{Nets, Policy, Scratch};
use crate::learn::networks::shapes::{Path, Shapes};
use crate::learn::networks::table::TouchedCorners;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::{ActorBuffers, ActorLossOptions};
use crate::learn::update::objective::{NetworkPlan, NetworkWeights, Objective, Part};
use crate::learn::update::rows::{PAIRS, Rows, TRANSITIONS, find_corners_of, mispredicted};

/// The networks after the critics, in order.
const MODEL: usize = 0;
const ACTOR: usize = 1;

impl Objective for Shapes {
    type Batch = Batch;
    type Buffers = Buffers;
    type Nets<'a> = Nets<'a>;

    const POSITION_SETS: usize = 2;

    fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    fn networks(&self) -> Vec<NetworkPlan> {
        let critics = (0..self.critics)
            .map(|k| NetworkPlan::averaged(format!("critic{k}"), self.critic, PAIRS));
        let model = NetworkPlan::plain("model".to_owned(), self.model, TRANSITIONS);
        let actor = NetworkPlan::averaged("actor".to_owned(), self.actor, PAIRS);
        critics.chain([model, actor]).collect()
    }

    fn find_corners(&self, set: usize, batch: &Batch, touched: &mut TouchedCorners) {
        find_corners_of(set, self, batch, touched);
    }

    fn gradients(
        &self,
        batch: &Batch,
        i: usize,
        NetworkWeights { current, averaged }: NetworkWeights,
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let rows = Rows::new(self, batch, i);
        let (critics, current) = current.split_at(self.critics);
        let (critic_gradients, gradients) = gradients.split_at_mut(self.critics);
        let model = current[MODEL];
        let ws = &mut buffers.passes.networks.model;
        losses.model = self.model_gradient(model, &rows, &mut gradients[MODEL], ws);
        buffers.check_model(self, &rows);
        let (critics_averaged, averaged) = averaged.split_at(self.critics);
        let path = Path { actor: averaged[ACTOR], model, critics: critics_averaged };
        buffers.compute_targets(self, &rows, path);
        losses.critic = buffers.critic_gradients(self, &rows, critics, critic_gradients);
    }

    fn actor_gradient(
        &self,
        batch: &Batch,
        i: usize,
        networks: &[Weights],
        Part { gradients, losses, buffers }: &mut Part<Buffers>,
    ) {
        let rows = Rows::new(self, batch, i);
        let (critics, networks) = networks.split_at(self.critics);
        let path = Path { actor: networks[ACTOR], model: networks[MODEL], critics };
        let pairs = Pairs { plain: &buffers.plain, states: rows.states, goals: rows.goals };
        let options = ActorLossOptions {
            towards: rows.actor_goals,
            weights: rows.actor_weights,
            share: rows.share,
            frees_stuck: rows.relearns,
        };
        let gradient = &mut gradients[self.critics + ACTOR];
        losses.actor = self.actor_gradient(path, pairs, options, gradient, &mut buffers.passes);
    }

    fn nets<'a>(&'a self, mut weights: Vec<Weights<'a>>) -> Nets<'a> {
        let (model, actor) = (weights[self.critics + MODEL], weights[self.critics + ACTOR]);
        weights.truncate(self.critics);
        Nets { shapes: self, critics: weights, model, actor }
    }

    fn outputs(nets: &Nets, batch: &Batch) -> Vec<f32> {
        let mut distances = vec![0.0; batch.len()];
        nets.distances(&batch.states, &batch.goals, &mut distances, &mut Scratch::default());
        distances
    }
}

/// Buffers of one task of an update.
#[derive(Default)]
pub struct Buffers {
    plain: SharedFeatures,
    plain_ahead: SharedFeatures,
    targets: Vec<f32>,
    after_actor: Vec<f32>,
    /// Squared errors of the model, `(rows)`.
    model_errors: Vec<f32>,
    /// Whether each row is left out of greedy targets as the model mispredicts its step, `(rows)`.
    left_out: Vec<bool>,
    passes: ActorBuffers,
}

impl Buffers {
    /// Finds the rows to leave out of greedy targets, after [`Shapes::model_gradient`].
    fn check_model(&mut self, shapes: &Shapes, rows: &Rows) {
        self.left_out.clear();
        if !(rows.greedy_targets && shapes.model_check) {
            return self.left_out.resize(rows.steps.len(), false);
        }
        self.model_errors.clear();
        self.model_errors.extend(shapes.model_errors(
            rows.steps.len(),
            rows.share,
            &self.passes.networks.model,
        ));
        let s = shapes.encoder.spec().state_dim();
        self.left_out.extend(mispredicted(&self.model_errors, rows.from, rows.states, s));
    }

    /// Computes the targets of the part's rows: d if the goal was reached, otherwise d + D'(s', g),
    /// capped at 1 + D'(f(s, mu'(s, g)), g) (see [`crate::learn::LearnSettings::greedy_targets`])
    /// unless the model mispredicts the row's own step. Both are kept within the bounds that
    /// hindsight or the bridge graph give, and raised to them little by little while distances are
    /// relearned. D' and mu' use the running averages in `path`.
    fn compute_targets(&mut self, shapes: &Shapes, rows: &Rows, path: Path) {
        shapes.encoder.plain_pairs(rows.states, rows.goals, &mut self.plain);
        shapes.encoder.plain_pairs(rows.bootstrap_states, rows.goals, &mut self.plain_ahead);
        self.targets.resize(rows.steps.len(), 0.0);
        let ahead =
            Pairs { plain: &self.plain_ahead, states: rows.bootstrap_states, goals: rows.goals };
        let buffers = &mut self.passes.networks;
        shapes.joint_distances(path.critics, ahead, &mut self.targets, &mut buffers.critic);
        self.targets.iter_mut().zip(rows.steps).for_each(|(x, d)| *x += d);
        if rows.greedy_targets {
            self.after_actor.resize(rows.steps.len(), 0.0);
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            shapes.distances_after_actor(path, pairs, &mut self.after_actor, buffers);
            let caps = self.after_actor.iter().zip(&self.left_out);
            for (x, (d, left_out)) in self.targets.iter_mut().zip(caps) {
                if !left_out {
                    *x = x.min(1.0 + d);
                }
            }
        }
        for (i, x) in self.targets.iter_mut().enumerate() {
            let known = rows.bootstrap[i] == 0.0;
            let target = if known { rows.steps[i] } else { *x }.min(rows.bound[i]);
            let most =
                if rows.relearns { RAISE_FACTOR * target + RAISE_STEPS } else { f32::INFINITY };
            *x = target.max(rows.lower[i].min(most));
        }
    }

    /// Computes each critic's gradient towards the targets. Returns the critics' mean loss.
    fn critic_gradients(
        &mut self,
        shapes: &Shapes,
        rows: &Rows,
        critics: &[Weights],
        gradients: &mut [Gradient],
    ) -> f32 {
        let mut mean = 0.0;
        for (critic, gradient) in critics.iter().zip(gradients) {
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let ws = &mut self.passes.networks.critic;
            let loss =
                shapes.critic_gradient(*critic, pairs, &self.targets, rows.share, gradient, ws);
            mean += loss / critics.len() as f32;
        }
        mean
    }
}
