//! Hand-written losses and gradients of one part of a batch (see [`crate::learn::Reference`] for
//! the autograd version).

use std::iter::Sum;

use crate::learn::data::batch::{STUCK_BOUND, STUCK_PROGRESS_STEPS};
use crate::learn::networks::features::{Pairs, Workspace, resized};
use crate::learn::networks::lookahead::{Steps, WaysOut};
use crate::learn::networks::mlp::GradientRequest;
use crate::learn::networks::network::Weights;
use crate::learn::networks::shapes::{MAX_STATE_DIM, Path, Shapes, Workspaces, sigmoid, softplus};
use crate::learn::settings::LossScale;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::rows::Rows;

/// Losses of one update, each a mean over the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Weighted squared error on the chosen scale, averaged over the critics.
    pub critic: f32,
    /// |f(s, a) - s'|^2, with each component in units of its change scale.
    pub model: f32,
    /// D(f(s, mu(s, g)), w) in steps, with w either g or a waypoint on the way there; 0 in rows
    /// from which the actor does not learn.
    pub actor: f32,
}

impl Losses {
    /// Returns a loss, unless it is 0: the learner has no such network, or has not updated it yet.
    pub fn known(loss: f32) -> Option<f32> {
        (loss != 0.0).then_some(loss)
    }
}

impl Sum for Losses {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |sum, part| Self {
            critic: sum.critic + part.critic,
            model: sum.model + part.model,
            actor: sum.actor + part.actor,
        })
    }
}

/// Errors of the dynamics model count linearly beyond this many typical changes: what is typical may
/// have been seen before an agent had got hold of anything.
pub const LARGEST_ERROR: f32 = 10.0;

/// Weight of the squared excess of the actor's outputs over their bound.
pub const EXCESS_WEIGHT: f32 = 0.1;

/// Weight of the squared difference between a blocked actor's outputs before tanh and those of the
/// way out: [`WAY_OUT_OUTPUT`] for a full step, at most the actor's bound.
pub const WAY_OUT_WEIGHT: f32 = 0.3;

/// See [`WAY_OUT_WEIGHT`].
pub const WAY_OUT_OUTPUT: f32 = 2.0;

/// Options of the actor's loss.
#[derive(Clone, Copy)]
pub struct ActorLossOptions<'a> {
    /// What the actor is to approach, `(rows, goal_dim)`.
    pub towards: &'a [f32],
    /// See [`crate::learn::Batch::actor_weights`], `(rows)`; the bound of outputs holds in all rows.
    pub weights: &'a [f32],
    /// 1 / batch size.
    pub share: f32,
    /// See [`crate::learn::Batch::relearns`].
    pub frees_stuck: bool,
}

/// Buffers of the actor's gradient.
#[derive(Clone, Debug, Default)]
pub struct ActorBuffers {
    /// Of the passes through the networks.
    pub networks: Workspaces,
    /// D(s, g) of each row, then the bound of its actor's outputs.
    before: Vec<f32>,
    ways_out: WaysOut,
}

/// A loss of what the model predicts for the actor's actions.
#[derive(Clone, Copy, Default)]
pub struct ModelLoss<'a> {
    /// Its gradient with respect to the model's outputs, `(rows, state_dim)`.
    pub d_change: &'a [f32],
    /// 1 / batch size.
    pub share: f32,
    /// The bound of the outputs, `(rows)`; the actor's for all if empty.
    pub bounds: &'a [f32],
    /// Actions that the actor is pulled towards instead of following the gradient, `(rows,
    /// action_dim)`, NaN in rows without one; empty for none.
    pub ways_out: &'a [f32],
}

impl Shapes {
    /// Computes a critic's gradient towards `targets` into `gradient`; `share` is 1 / batch size.
    /// Returns the part's loss.
    pub fn critic_gradient(
        &self,
        critic: Weights,
        pairs: Pairs,
        targets: &[f32],
        share: f32,
        gradient: &mut Gradient,
        ws: &mut Workspace,
    ) -> f32 {
        gradient.prepare(self.critic.parameters());
        let rows = targets.len();
        self.encoder.pair_rows(pairs, critic.table, self.critic.inputs, &mut ws.x);
        let x = &ws.x[..rows * self.critic.inputs];
        let z = resized(&mut ws.y, rows);
        self.critic.forward(critic.dense, critic.packed, x, z, &mut ws.acts);
        let mut loss = 0.0;
        for (z, target) in z.iter_mut().zip(targets) {
            let distance = self.distance_scale * softplus(*z);
            let (error, slope) = self.loss.error(distance, *target);
            let weight = if error > 0.0 { self.expectile } else { 1.0 - self.expectile };
            loss += weight * error * error * share;
            *z = 2.0 * weight * error * slope * share * self.distance_scale * sigmoid(*z);
        }
        let from = self.encoder.plain_pair_width();
        let dx = (from < self.critic.inputs)
            .then(|| (from, resized(&mut ws.dx, rows * (self.critic.inputs - from))));
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        self.critic.backward(critic.dense, critic.packed, x, z, &mut ws.acts, wanted);
        gradient.add_pair_corners(&self.encoder, pairs, &ws.dx, 0);
        loss
    }

    /// Computes the dynamics model's gradient of mean |f(s, a) - s'|^2 (with each component in
    /// units of its change scale, and linear beyond [`LARGEST_ERROR`]) into `gradient`. Returns the
    /// part's loss.
    pub fn model_gradient(
        &self,
        model: Weights,
        rows: &Rows,
        gradient: &mut Gradient,
        ws: &mut Workspace,
    ) -> f32 {
        gradient.prepare(self.model.parameters());
        let Rows { from: states, actions, next, share, .. } = *rows;
        let spec = self.encoder.spec();
        let s = spec.state_dim();
        let rows = states.len() / s;
        let mut predicted = std::mem::take(&mut ws.y);
        self.next_states(model, states, actions, resized(&mut predicted, rows * s), ws);
        let mut loss = 0.0;
        for (predicted, next) in predicted[..rows * s].chunks_exact_mut(s).zip(next.chunks_exact(s))
        {
            for ((p, n), scale) in predicted.iter_mut().zip(next).zip(&spec.change_scale) {
                let error = if *scale > 0.0 { (*p - n) / scale } else { 0.0 };
                let bounded = error.clamp(-LARGEST_ERROR, LARGEST_ERROR);
                loss += bounded * (2.0 * error - bounded) * share;
                *p = 2.0 * bounded * share;
            }
        }
        let from = self.encoder.plain_state_width();
        let (columns, grid_width) = (self.model.inputs - from, self.encoder.grid_width());
        let dx = (grid_width > 0).then(|| (from, resized(&mut ws.dx, rows * columns)));
        let x = &ws.x[..rows * self.model.inputs];
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        self.model.backward(
            model.dense,
            model.packed,
            x,
            &predicted[..rows * s],
            &mut ws.acts,
            wanted,
        );
        ws.y = predicted;
        if grid_width > 0 {
            gradient.add_encoded(&ws.dx[..rows * columns], columns, 0..grid_width);
        }
        loss
    }

    /// Returns the squared bounded errors of the predictions in each row, after [`Self::model_gradient`].
    pub fn model_errors(
        &self,
        rows: usize,
        share: f32,
        ws: &Workspace,
    ) -> impl Iterator<Item = f32> {
        let s = self.encoder.spec().state_dim();
        // `model_gradient` has replaced the predictions by the gradient with respect to the
        // outputs.
        ws.y[..rows * s]
            .chunks_exact(s)
            .map(move |d| d.iter().map(|d| (d / (2.0 * share)).powi(2)).sum())
    }

    /// Computes the actor's goal-distance gradient (Algorithm 1) into `gradient`: that of mean
    /// D(f(s, mu(s, g)), w), with w either g or a waypoint on the way there, which flows through
    /// the frozen first critic and the frozen model into the actor, plus that of the excess of the
    /// actor's outputs over their bound. A blocked actor is pulled towards what lookahead finds
    /// instead. Returns the part's contribution to mean D.
    pub fn actor_gradient(
        &self,
        Path { actor, model, critics }: Path,
        pairs: Pairs,
        options: ActorLossOptions,
        gradient: &mut Gradient,
        buffers: &mut ActorBuffers,
    ) -> f32 {
        gradient.prepare(self.actor.parameters());
        let ActorLossOptions { towards, weights, share, frees_stuck } = options;
        let ActorBuffers { networks: buffers, before, ways_out } = buffers;
        let critic = critics[0];
        let states = pairs.states;
        let rows = states.len() / self.encoder.spec().state_dim();
        // Forward: a = mu(s, g), s' = f(s, a).
        let mut next = std::mem::take(&mut buffers.model.y);
        self.step_with_actor(actor, model, pairs, &mut next, buffers);
        if self.unblock_actor {
            let actions = &buffers.actor.y[..rows * self.actor.outputs];
            let steps = Steps { states, actions, next: &next[..states.len()] };
            self.find_ways_out(model, critic, steps, (towards, weights), ways_out);
        }
        if frees_stuck {
            let mut plain = std::mem::take(&mut buffers.critic.plain);
            self.encoder.plain_pairs(states, towards, &mut plain);
            let now = Pairs { plain: &plain, states, goals: towards };
            self.distances(critic, now, resized(before, rows), &mut buffers.critic);
            buffers.critic.plain = plain;
        }
        // Forward to D and backward to the model's outputs.
        let before = if frees_stuck { &mut before[..] } else { &mut [] };
        let d_change = &mut next[..states.len()];
        let loss = self.critic_slope(critic, d_change, options, before, &mut buffers.critic);
        let loss_after = ModelLoss { d_change, share, bounds: before, ways_out: &ways_out.actions };
        self.actor_gradient_through_model(actor, model, pairs, loss_after, gradient, buffers);
        buffers.model.y = next;
        loss
    }

    /// Replaces the next states in `next` by the gradient of weighted mean D(s', w) with respect to
    /// the model's outputs, through the frozen critic. If `before` holds
    /// D(s, w) `(rows)`, replaces it by the bounds of the actor's outputs, which are narrower where
    /// the step makes no progress. Returns the part's contribution to mean D.
    fn critic_slope(
        &self,
        critic: Weights,
        next: &mut [f32],
        ActorLossOptions { towards, weights, share, .. }: ActorLossOptions,
        before: &mut [f32],
        ws: &mut Workspace,
    ) -> f32 {
        let spec = self.encoder.spec();
        let s = spec.state_dim();
        let rows = next.len() / s;
        let mut next_plain = std::mem::take(&mut ws.plain);
        self.encoder.plain_pairs(next, towards, &mut next_plain);
        let width = self.critic.inputs;
        let ahead = Pairs { plain: &next_plain, states: next, goals: towards };
        self.encoder.pair_rows(ahead, critic.table, width, &mut ws.x);
        ws.plain = next_plain;
        let x = &ws.x[..rows * width];
        let z = resized(&mut ws.y, rows);
        self.critic.forward(critic.dense, critic.packed, x, z, &mut ws.acts);
        let mut loss = 0.0;
        for (i, (z, weight)) in z.iter_mut().zip(weights).enumerate() {
            let (distance, share) = (self.distance_scale * softplus(*z), weight * share);
            loss += share * distance;
            if let Some(before) = before.get_mut(i) {
                let stuck = *before - distance < STUCK_PROGRESS_STEPS;
                *before = if stuck { self.actor_bound.min(STUCK_BOUND) } else { self.actor_bound };
            }
            *z = share * self.distance_scale * sigmoid(*z);
        }
        let dx = resized(&mut ws.dx, rows * width);
        let wanted = GradientRequest { parameters: None, inputs: Some((0, &mut *dx)) };
        self.critic.backward(critic.dense, critic.packed, x, z, &mut ws.acts, wanted);
        let mut d_state = [0.0; MAX_STATE_DIM];
        let d_state = &mut d_state[..s];
        for (i, next) in next.chunks_exact_mut(s).enumerate() {
            let at = i * width..(i + 1) * width;
            self.encoder.pair_state_gradient(next, &x[at.clone()], &dx[at], critic.table, d_state);
            for ((next, d), scale) in next.iter_mut().zip(&*d_state).zip(&spec.change_scale) {
                *next = scale * d;
            }
        }
        loss
    }

    /// Returns the target output before tanh for `action`.
    pub fn way_out_output(&self, action: f32) -> f32 {
        action * WAY_OUT_OUTPUT.min(self.actor_bound)
    }

    /// Computes the actor's gradient into `gradient`, after [`Self::step_with_actor`]: that of a
    /// loss through the frozen model, plus that of the excess of the actor's outputs over their
    /// bound, except in rows with a way out.
    pub fn actor_gradient_through_model(
        &self,
        actor: Weights,
        model: Weights,
        pairs: Pairs,
        ModelLoss { d_change, share, bounds, ways_out }: ModelLoss,
        gradient: &mut Gradient,
        buffers: &mut Workspaces,
    ) {
        let a = self.actor.outputs;
        let rows = d_change.len() / self.model.outputs;
        let mut action = std::mem::take(&mut buffers.actor.y);
        let d_action = resized(&mut buffers.model.dx, rows * a);
        let wanted = GradientRequest {
            parameters: None,
            inputs: Some((self.model.inputs - a, &mut *d_action)),
        };
        let x = &buffers.model.x[..rows * self.model.inputs];
        self.model.backward(
            model.dense,
            model.packed,
            x,
            d_change,
            &mut buffers.model.acts,
            wanted,
        );
        for (i, ((action, d), z)) in
            action[..rows * a].iter_mut().zip(&*d_action).zip(&buffers.actor.outputs).enumerate()
        {
            let bound = bounds.get(i / a).copied().unwrap_or(self.actor_bound);
            let excess = z - z.clamp(-bound, bound);
            *action = match ways_out.get(i) {
                Some(way) if !way.is_nan() => {
                    2.0 * WAY_OUT_WEIGHT * share * (z - self.way_out_output(*way))
                }
                _ => d * (1.0 - *action * *action) + 2.0 * EXCESS_WEIGHT * share * excess,
            };
        }
        let from = self.encoder.plain_pair_width();
        let dx = (from < self.actor.inputs)
            .then(|| (from, resized(&mut buffers.actor.dx, rows * (self.actor.inputs - from))));
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        let x = &buffers.actor.x[..rows * self.actor.inputs];
        self.actor.backward(
            actor.dense,
            actor.packed,
            x,
            &action[..rows * a],
            &mut buffers.actor.acts,
            wanted,
        );
        buffers.actor.y = action;
        gradient.add_pair_corners(&self.encoder, pairs, &buffers.actor.dx, 0);
    }
}

impl LossScale {
    /// Returns the error of `distance` against `target` on this scale, and the scale's slope at
    /// `distance`.
    fn error(self, distance: f32, target: f32) -> (f32, f32) {
        match self {
            Self::Squared => (distance - target, 1.0),
            Self::Sqrt => {
                let root = (distance + 0.25).sqrt();
                (root - (target + 0.25).sqrt(), 0.5 / root)
            }
            Self::Log => (distance.ln_1p() - target.ln_1p(), 1.0 / (1.0 + distance)),
        }
    }
}
