//! Targets, losses and hand-written gradients of critics and model on one part of a batch.

use crate::learn::data::batch::{Batch, RAISE_FACTOR, RAISE_STEPS};
use crate::learn::networks::encoder::{Pairs, Workspace, resized};
use crate::learn::networks::lookahead::chosen;
use crate::learn::networks::mlp::GradientRequest;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::Nets;
use crate::learn::networks::returns::Returns;
use crate::learn::networks::shapes::{Shapes, Workspaces, sigmoid, softplus};
use crate::learn::settings::LossScale;
use crate::learn::update::parts::{BatchPart, Buffers, Gradient, Rows, mispredicted};

/// Errors of the dynamics model count linearly beyond this many typical changes: what is typical may
/// have been seen before an agent had got hold of anything.
pub const LARGEST_ERROR: f32 = 10.0;

impl Shapes {
    /// Computes the gradients of critics and model (Algorithm 1) on part number `i` of the batch, with
    /// the running averages of networks for targets.
    pub fn gradients(
        &self,
        batch: &Batch,
        i: usize,
        current: &Nets,
        averaged: &Nets,
        BatchPart { gradients, losses, buffers }: &mut BatchPart,
    ) {
        let rows = Rows::new(self, batch, i);
        self.encoder.plain_pairs(rows.states, rows.goals, &mut buffers.plain);
        if let Some(model) = current.model {
            let (gradient, ws) = (&mut gradients[self.critics], &mut buffers.networks.model);
            losses.model = self.model_gradient(model, &rows, gradient, ws);
        }
        match &self.returns {
            Some(returns) => self.value_targets(returns, &rows, averaged, buffers),
            None if self.critics > 0 => {
                let networks = &mut buffers.networks;
                losses.model_steps = self.model_error_steps(&rows, &averaged.critics, networks);
                self.distance_targets(&rows, current, averaged, buffers);
            }
            None => {}
        }
        losses.critic = 0.0;
        for (critic, gradient) in current.critics.iter().zip(gradients) {
            losses.critic +=
                self.critic_gradient(*critic, &rows, gradient, buffers) / self.critics as f32;
        }
    }

    /// Computes targets of D: d if the goal was reached, otherwise d + D'(s', g), capped at 1 +
    /// D'(f(s, mu'(s, g)), g) (see [`crate::learn::LearnSettings::greedy_targets`]), or at D'(s, g) if
    /// the model mispredicts the row's own step: most such steps end at a wall, and say little about
    /// how far it is. Both are kept within the bounds that hindsight or the bridge graph give, and
    /// raised to them little by little while distances are relearned, when those steps count as
    /// others do. D' and mu' use the running averages.
    fn distance_targets(
        &self,
        rows: &Rows,
        current: &Nets,
        averaged: &Nets,
        Buffers { plain, targets, after_actor, networks, .. }: &mut Buffers,
    ) {
        let s = self.encoder.spec.state_dim();
        // Before the model's buffers are used again.
        let left_out: Vec<bool> = if rows.greedy_targets && self.model_check {
            let errors = self.model_errors(rows.steps.len(), rows.share, &networks.model);
            mispredicted(&errors, rows.from, rows.states, s).collect()
        } else {
            vec![false; rows.steps.len()]
        };
        let critics = &averaged.critics;
        targets.resize(rows.steps.len(), 0.0);
        let ahead = rows.bootstrap_states;
        self.distances_between(critics, ahead, rows.goals, targets, &mut networks.critic);
        targets.iter_mut().zip(rows.steps).for_each(|(x, d)| *x += d);
        if let (true, Some(model)) = (rows.greedy_targets, current.model) {
            let mut next = std::mem::take(&mut networks.model.y);
            let pairs = Pairs { plain, states: rows.states, goals: rows.goals };
            let after = self.step_with_actor(averaged.actor, model, pairs, &mut next, networks);
            after_actor.resize(rows.steps.len(), 0.0);
            self.distances_between(critics, after, rows.goals, after_actor, &mut networks.critic);
            networks.model.y = next;
            for (x, (d, left_out)) in targets.iter_mut().zip(after_actor.iter().zip(&left_out)) {
                if !left_out {
                    *x = x.min(1.0 + d);
                }
            }
            if self.model_check && !rows.relearns {
                let stays = |row: &usize| left_out[*row] && rows.bootstrap[*row] > 0.0;
                let stay: Vec<usize> = (0..left_out.len()).filter(stays).collect();
                let [from, to] = [(rows.states, s), (rows.goals, self.encoder.spec.goal_dim())]
                    .map(|(numbers, width)| chosen(&stay, numbers, width));
                let own = resized(after_actor, stay.len());
                self.distances_between(critics, &from, &to, own, &mut networks.critic);
                for (row, own) in stay.into_iter().zip(own) {
                    targets[row] = targets[row].min(*own);
                }
            }
        }
        for (i, x) in targets.iter_mut().enumerate() {
            let known = rows.bootstrap[i] == 0.0;
            let target = if known { rows.steps[i] } else { *x }.min(rows.bound[i]);
            let most =
                if rows.relearns { RAISE_FACTOR * target + RAISE_STEPS } else { f32::INFINITY };
            *x = target.max(rows.lower[i].min(most));
        }
    }

    /// Computes targets of Q with the running averages.
    fn value_targets(
        &self,
        returns: &Returns,
        rows: &Rows,
        Nets { critics, actor, .. }: &Nets,
        Buffers { plain_ahead, targets, networks, .. }: &mut Buffers,
    ) {
        self.encoder.plain_pairs(rows.bootstrap_states, rows.goals, plain_ahead);
        targets.resize(rows.rewards.len(), 0.0);
        let (states, goals) = (rows.bootstrap_states, rows.goals);
        let ahead = Pairs { plain: plain_ahead, states, goals };
        self.values_of_actor(*actor, critics, ahead, rows.noise, targets, networks);
        for (i, target) in targets.iter_mut().enumerate() {
            *target = returns.target(rows.rewards[i], rows.bootstrap[i] == 0.0, *target);
        }
    }

    /// Computes a critic's gradient towards the targets into `gradient`: of the squared error of Q,
    /// or of the weighted squared error of D on its scale. Returns the part's loss.
    fn critic_gradient(
        &self,
        critic: Weights,
        rows: &Rows,
        gradient: &mut Gradient,
        Buffers { plain, targets, networks, .. }: &mut Buffers,
    ) -> f32 {
        gradient.prepare(self.critic.parameters());
        let (ws, count, share) = (&mut networks.critic, targets.len(), rows.share);
        let pairs = Pairs { plain, states: rows.states, goals: rows.goals };
        let mut outputs = std::mem::take(&mut ws.y);
        let outputs_of_rows = resized(&mut outputs, count);
        self.critic_outputs(critic, pairs, rows.actions, outputs_of_rows, ws);
        let mut loss = 0.0;
        for (z, target) in outputs_of_rows.iter_mut().zip(targets) {
            if self.returns.is_some() {
                let error = *z - *target;
                loss += error * error * share;
                *z = 2.0 * error * share;
            } else {
                let distance = self.distance_scale * softplus(*z);
                let (error, slope) = self.loss.error(distance, *target);
                let weight = if error > 0.0 { self.expectile } else { 1.0 - self.expectile };
                loss += weight * error * error * share;
                *z = 2.0 * weight * error * slope * share * self.distance_scale * sigmoid(*z);
            }
        }
        let from = self.encoder.plain_pair_width();
        let dx = (self.encoder.grid_width() > 0)
            .then(|| (from, resized(&mut ws.dx, count * (self.critic.inputs - from))));
        let x = &ws.x[..count * self.critic.inputs];
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        let Weights { dense, packed, .. } = critic;
        self.critic.backward(dense, packed, x, outputs_of_rows, &mut ws.acts, wanted);
        let further = self.critic.inputs - self.encoder.pair_width();
        gradient.add_pair_corners(&self.encoder, pairs, &ws.dx, further);
        ws.y = outputs;
        loss
    }

    /// Computes the dynamics model's gradient of mean |f(s, a) - s'|^2 (with each component in
    /// units of its change scale, and linear beyond [`LARGEST_ERROR`]) into `gradient`. Returns the
    /// part's loss.
    fn model_gradient(
        &self,
        model: Weights,
        &Rows { from: states, actions, next, share, .. }: &Rows,
        gradient: &mut Gradient,
        ws: &mut Workspace,
    ) -> f32 {
        gradient.prepare(self.model.parameters());
        let spec = &self.encoder.spec;
        let s = spec.state_dim();
        let rows = states.len() / s;
        let mut outputs = std::mem::take(&mut ws.y);
        let predicted = resized(&mut outputs, rows * s);
        self.next_states(model, states, actions, predicted, ws);
        let mut loss = 0.0;
        for (predicted, next) in predicted.chunks_exact_mut(s).zip(next.chunks_exact(s)) {
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
        self.model.backward(model.dense, model.packed, x, predicted, &mut ws.acts, wanted);
        ws.y = outputs;
        if grid_width > 0 {
            gradient.add_encoded(&ws.dx[..rows * columns], columns, 0..grid_width);
        }
        loss
    }

    /// Returns the mean error of D' after the steps that the model predicts, in steps, after
    /// [`Self::model_gradient`]; 0 where the goal is the whole state.
    fn model_error_steps(
        &self,
        rows: &Rows,
        critics: &[Weights],
        networks: &mut Workspaces,
    ) -> f32 {
        let spec = &self.encoder.spec;
        if spec.state_dim() == spec.goal_dim() {
            return 0.0;
        }
        let errors = networks.model.y.iter().zip(spec.change_scale.iter().cycle());
        let errors = errors.map(|(d, scale)| scale * d / (2.0 * rows.share));
        let predicted: Vec<f32> =
            rows.next.iter().zip(errors).map(|(next, error)| next + error).collect();
        let [mut real, mut expected] = [(); 2].map(|()| vec![0.0; rows.steps.len()]);
        let ws = &mut networks.critic;
        self.distances_between(critics, rows.next, rows.goals, &mut real, ws);
        self.distances_between(critics, &predicted, rows.goals, &mut expected, ws);
        let off = real.iter().zip(&expected).map(|(real, expected)| (real - expected).abs());
        off.sum::<f32>() * rows.share
    }

    /// Returns the squared bounded errors of the predictions in each row, after
    /// [`Self::model_gradient`], which has replaced the predictions by the gradient with respect to
    /// the outputs.
    fn model_errors(&self, rows: usize, share: f32, ws: &Workspace) -> Vec<f32> {
        let s = self.encoder.spec.state_dim();
        let errors = ws.y[..rows * s].chunks_exact(s);
        errors.map(|d| d.iter().map(|d| (d / (2.0 * share)).powi(2)).sum()).collect()
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
