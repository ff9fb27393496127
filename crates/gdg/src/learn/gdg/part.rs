//! One part of a batch, and what one thread computes from it.

use crate::learn::networks::features::{Pairs, SharedFeatures};
use crate::learn::networks::network::Weights;
use crate::learn::networks::shapes::Shapes;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::{ActorBuffers, Losses};
use crate::learn::update::rows::{Rows, mispredicted};

/// Buffers of one task of an update.
#[derive(Default)]
pub struct Part {
    pub plain: SharedFeatures,
    plain_ahead: SharedFeatures,
    targets: Vec<f32>,
    after_actor: Vec<f32>,
    /// Squared errors of the model, `(rows)`.
    model_errors: Vec<f32>,
    /// Whether each row is left out of greedy targets as the model mispredicts its step, `(rows)`.
    left_out: Vec<bool>,
    pub critics: Vec<Gradient>,
    pub model: Gradient,
    pub actor: Gradient,
    pub buffers: ActorBuffers,
    pub losses: Losses,
}

impl Part {
    /// Creates buffers for `critics` critics.
    pub fn new(critics: usize) -> Self {
        Self { critics: vec![Gradient::default(); critics], ..Self::default() }
    }

    /// Finds the rows to leave out of greedy targets, after [`Shapes::model_gradient`].
    pub fn check_model(&mut self, shapes: &Shapes, rows: &Rows) {
        self.left_out.clear();
        if !(rows.greedy_targets && shapes.model_check) {
            return self.left_out.resize(rows.steps.len(), false);
        }
        self.model_errors.clear();
        self.model_errors.extend(shapes.model_errors(
            rows.steps.len(),
            rows.share,
            &self.buffers.networks.model,
        ));
        let s = shapes.encoder.spec().state_dim();
        self.left_out.extend(mispredicted(&self.model_errors, (rows.from, rows.states), s));
    }

    /// Computes the targets of the part's rows: d if the goal was reached, otherwise d + D'(s', g),
    /// capped at 1 + D'(f(s, mu'(s, g)), g) (see [`crate::learn::LearnSettings::greedy_targets`])
    /// unless the model mispredicts the row's own step. Both are kept within the bounds that
    /// hindsight or the bridge graph give. D' and mu' use running averages.
    pub fn targets(
        &mut self,
        shapes: &Shapes,
        rows: &Rows,
        (actor, model, critics): (Weights, Weights, &[Weights]),
    ) {
        shapes.encoder.plain_pairs(rows.states, rows.goals, &mut self.plain);
        shapes.encoder.plain_pairs(rows.bootstrap_states, rows.goals, &mut self.plain_ahead);
        self.targets.resize(rows.steps.len(), 0.0);
        let ahead =
            Pairs { plain: &self.plain_ahead, states: rows.bootstrap_states, goals: rows.goals };
        shapes.joint_distances(
            critics,
            ahead,
            &mut self.targets,
            &mut self.buffers.networks.critic,
        );
        self.targets.iter_mut().zip(rows.steps).for_each(|(x, d)| *x += d);
        if rows.greedy_targets {
            self.after_actor.resize(rows.steps.len(), 0.0);
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let buffers = &mut self.buffers.networks;
            shapes.distances_after_actor(
                (actor, model, critics),
                pairs,
                &mut self.after_actor,
                buffers,
            );
            let caps = self.after_actor.iter().zip(&self.left_out);
            for (x, (d, left_out)) in self.targets.iter_mut().zip(caps) {
                if !left_out {
                    *x = x.min(1.0 + d);
                }
            }
        }
        for (i, x) in self.targets.iter_mut().enumerate() {
            let known = rows.bootstrap[i] == 0.0;
            *x = if known { rows.steps[i] } else { *x }.min(rows.bound[i]).max(rows.lower[i]);
        }
    }

    /// Computes each critic's gradient towards the targets.
    pub fn critic_gradients(&mut self, shapes: &Shapes, rows: &Rows, critics: &[Weights]) {
        self.losses.critic = 0.0;
        for (critic, gradient) in critics.iter().zip(&mut self.critics) {
            gradient.prepare(shapes.critic.parameters());
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let loss = shapes.critic_gradient(
                *critic,
                pairs,
                &self.targets,
                rows.share,
                gradient,
                &mut self.buffers.networks.critic,
            );
            self.losses.critic += loss / critics.len() as f32;
        }
    }
}
