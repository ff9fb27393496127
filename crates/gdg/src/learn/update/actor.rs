//! Hand-written gradients of the actor on one part of a batch.

use crate::learn::data::batch::{Batch, STUCK_BOUND, STUCK_PROGRESS_STEPS};
use crate::learn::networks::encoder::{Pairs, Workspace, resized};
use crate::learn::networks::lookahead::Steps;
use crate::learn::networks::mlp::GradientRequest;
use crate::learn::networks::network::Weights;
use crate::learn::networks::policy::Nets;
use crate::learn::networks::returns::straight_gradient;
use crate::learn::networks::shapes::{Shapes, sigmoid, softplus};
use crate::learn::update::parts::{BatchPart, Buffers, Gradient, Rows};

/// Weight of the squared excess of the actor's outputs over their bound.
pub const EXCESS_WEIGHT: f32 = 0.1;

/// Weight of the squared difference between a blocked actor's outputs before tanh and those of the
/// way out: [`WAY_OUT_OUTPUT`] for a full step, at most the actor's bound.
pub const WAY_OUT_WEIGHT: f32 = 0.3;

/// See [`WAY_OUT_WEIGHT`].
const WAY_OUT_OUTPUT: f32 = 2.0;

impl Shapes {
    /// Computes the actor's gradient on part number `i` of the batch, after
    /// [`Self::gradients`] and a step of the other networks, which are frozen.
    pub fn actor_gradient(&self, batch: &Batch, i: usize, nets: &Nets, part: &mut BatchPart) {
        let rows = Rows::new(self, batch, i);
        let Some(gradient) = part.gradients.last_mut() else { return };
        gradient.prepare(self.actor.parameters());
        part.losses.actor = match nets.model {
            Some(model) => self.descend(nets, model, &rows, gradient, &mut part.buffers),
            None => self.ascend(nets, &rows, gradient, &mut part.buffers),
        };
    }

    /// Computes the goal-distance gradient (Algorithm 1): that of mean D(f(s, mu(s, g)), w), with w
    /// either g or a waypoint on the way there, which flows through the frozen first critic, or the
    /// given D, and the frozen model into the actor, plus that of the excess of the actor's outputs
    /// over their bound. A blocked actor is pulled towards what lookahead finds instead. Returns the
    /// part's contribution to mean D.
    fn descend(
        &self,
        Nets { critics, actor, .. }: &Nets,
        model: Weights,
        rows: &Rows,
        gradient: &mut Gradient,
        Buffers { plain, networks, before, ways_out, lookahead, .. }: &mut Buffers,
    ) -> f32 {
        let (states, towards, a) = (rows.states, rows.actor_goals, self.actor.outputs);
        let pairs = Pairs { plain, states, goals: rows.goals };
        let count = rows.actor_weights.len();
        // Forward: a = mu(s, g), s' = f(s, a).
        let mut next_states = std::mem::take(&mut networks.model.y);
        self.step_with_actor(*actor, model, pairs, &mut next_states, networks);
        let next = &mut next_states[..states.len()];
        let mut action = std::mem::take(&mut networks.actor.y);
        let actions = &mut action[..count * a];
        ways_out.clear();
        before.clear();
        // To D and back to the model's outputs.
        let loss = if let Some(critic) = critics.first() {
            if self.unblock_actor {
                let (steps, towards) =
                    (Steps { states, actions, next }, (towards, rows.actor_weights));
                self.find_ways_out(model, *critic, steps, towards, ways_out, lookahead);
            }
            if rows.relearns {
                before.resize(count, 0.0);
                let ws = &mut networks.critic;
                self.distances_between(&[*critic], states, towards, before, ws);
            }
            self.critic_slope(*critic, next, rows, before, &mut networks.critic)
        } else {
            self.straight_slope(next, rows)
        };
        let d_action = resized(&mut networks.model.dx, count * a);
        let inputs = Some((self.model.inputs - a, &mut *d_action));
        let x = &networks.model.x[..count * self.model.inputs];
        let wanted = GradientRequest { parameters: None, inputs };
        self.model.backward(model.dense, model.packed, x, next, &mut networks.model.acts, wanted);
        let outputs = actions.iter_mut().zip(&*d_action).zip(&networks.actor.outputs);
        for (i, ((action, d), z)) in outputs.enumerate() {
            let bound = before.get(i / a).copied().unwrap_or(self.actor_bound);
            let excess = z - z.clamp(-bound, bound);
            *action = match ways_out.get(i) {
                Some(way) if !way.is_nan() => {
                    2.0 * WAY_OUT_WEIGHT * rows.share * (z - self.way_out_output(*way))
                }
                _ => d * (1.0 - *action * *action) + 2.0 * EXCESS_WEIGHT * rows.share * excess,
            };
        }
        self.actor_backward(*actor, pairs, actions, gradient, &mut networks.actor);
        networks.actor.y = action;
        networks.model.y = next_states;
        loss
    }

    /// Replaces the next states in `next` by the gradient of weighted mean D(s', w) with respect to
    /// the model's outputs, through the frozen critic. If `before` holds D(s, w) `(rows)`, replaces
    /// it by the bounds of the actor's outputs, which are narrower where the step makes no progress.
    /// Returns the part's contribution to mean D.
    fn critic_slope(
        &self,
        critic: Weights,
        next: &mut [f32],
        rows: &Rows,
        before: &mut [f32],
        ws: &mut Workspace,
    ) -> f32 {
        let spec = &self.encoder.spec;
        let (width, count) = (self.critic.inputs, rows.actor_weights.len());
        let (mut plain, mut outputs) = (std::mem::take(&mut ws.plain), std::mem::take(&mut ws.y));
        self.encoder.plain_pairs(next, rows.actor_goals, &mut plain);
        let ahead = Pairs { plain: &plain, states: next, goals: rows.actor_goals };
        let outputs_of_rows = resized(&mut outputs, count);
        self.critic_outputs(critic, ahead, &[], outputs_of_rows, ws);
        let mut loss = 0.0;
        for (i, (z, weight)) in outputs_of_rows.iter_mut().zip(rows.actor_weights).enumerate() {
            let (distance, share) = (self.distance_scale * softplus(*z), weight * rows.share);
            loss += share * distance;
            if let Some(before) = before.get_mut(i) {
                let stuck = *before - distance < STUCK_PROGRESS_STEPS;
                *before = if stuck { self.actor_bound.min(STUCK_BOUND) } else { self.actor_bound };
            }
            *z = share * self.distance_scale * sigmoid(*z);
        }
        let x = &ws.x[..count * width];
        let dx = resized(&mut ws.dx, count * width);
        let wanted = GradientRequest { parameters: None, inputs: Some((0, &mut *dx)) };
        let Weights { dense, packed, table } = critic;
        self.critic.backward(dense, packed, x, outputs_of_rows, &mut ws.acts, wanted);
        let mut d_state = vec![0.0; spec.state_dim()];
        for (i, next) in next.chunks_exact_mut(spec.state_dim()).enumerate() {
            let at = i * width..(i + 1) * width;
            self.encoder.pair_state_gradient(next, &x[at.clone()], &dx[at], table, &mut d_state);
            for ((next, d), scale) in next.iter_mut().zip(&d_state).zip(&spec.change_scale) {
                *next = scale * d;
            }
        }
        (ws.plain, ws.y) = (plain, outputs);
        loss
    }

    /// Does the same as [`Self::critic_slope`] where D is given.
    fn straight_slope(&self, next: &mut [f32], rows: &Rows) -> f32 {
        let spec = &self.encoder.spec;
        let (mut loss, mut d_state) = (0.0, vec![0.0; spec.state_dim()]);
        let goals = rows.actor_goals.chunks_exact(spec.goal_dim());
        for (next, goal) in next.chunks_exact_mut(spec.state_dim()).zip(goals) {
            loss +=
                rows.share * straight_gradient(spec, self.step_length, next, goal, &mut d_state);
            for ((next, d), scale) in next.iter_mut().zip(&d_state).zip(&spec.change_scale) {
                *next = rows.share * scale * d;
            }
        }
        loss
    }

    /// Returns the target output before tanh for `action`.
    pub fn way_out_output(&self, action: f32) -> f32 {
        action * WAY_OUT_OUTPUT.min(self.actor_bound)
    }

    /// Computes the gradient of mean -Q(s, mu(s, g), g) by the frozen first critic (Lillicrap et al.
    /// 2016, Eq. 6), of the weighted mean of z^2 (Andrychowicz et al. 2017, appendix A: the squared
    /// outputs before tanh, against vanishing gradients) and of their excess over a bound. Returns
    /// the part's share of mean -Q.
    fn ascend(
        &self,
        Nets { critics, actor, .. }: &Nets,
        rows: &Rows,
        gradient: &mut Gradient,
        Buffers { plain, networks, .. }: &mut Buffers,
    ) -> f32 {
        let (share, a, count) = (rows.share, self.actor.outputs, rows.rewards.len());
        let pairs = Pairs { plain, states: rows.states, goals: rows.goals };
        let (critic, actor_ws, ws) = (critics[0], &mut networks.actor, &mut networks.critic);
        let (mut action, mut q) = (std::mem::take(&mut actor_ws.y), std::mem::take(&mut ws.y));
        let (actions, values) = (resized(&mut action, count * a), resized(&mut q, count));
        actor_ws.actions(&self.encoder, &self.actor, *actor, pairs, actions);
        self.critic_outputs(critic, pairs, actions, values, ws);
        let loss = values.iter().map(|q| -share * q).sum();
        values.fill(-share);
        let d_action = resized(&mut ws.dx, count * a);
        let inputs = Some((self.critic.inputs - a, &mut *d_action));
        let x = &ws.x[..count * self.critic.inputs];
        let wanted = GradientRequest { parameters: None, inputs };
        self.critic.backward(critic.dense, critic.packed, x, values, &mut ws.acts, wanted);
        let l2 = self.actor_l2 / a as f32;
        for ((action, d), z) in actions.iter_mut().zip(&*d_action).zip(&actor_ws.outputs) {
            let excess = z - z.clamp(-self.actor_bound, self.actor_bound);
            *action =
                d * (1.0 - *action * *action) + 2.0 * share * (EXCESS_WEIGHT * excess + l2 * z);
        }
        self.actor_backward(*actor, pairs, actions, gradient, actor_ws);
        (actor_ws.y, ws.y) = (action, q);
        loss
    }

    /// Computes the actor's gradient from that of its outputs before tanh, `d` `(rows, action_dim)`.
    fn actor_backward(
        &self,
        actor: Weights,
        pairs: Pairs,
        d: &[f32],
        gradient: &mut Gradient,
        ws: &mut Workspace,
    ) {
        let (rows, inputs) = (d.len() / self.actor.outputs, self.actor.inputs);
        let from = self.encoder.plain_pair_width();
        let dx = (from < inputs).then(|| (from, resized(&mut ws.dx, rows * (inputs - from))));
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        let x = &ws.x[..rows * inputs];
        self.actor.backward(actor.dense, actor.packed, x, d, &mut ws.acts, wanted);
        gradient.add_pair_corners(&self.encoder, pairs, &ws.dx, 0);
    }
}
