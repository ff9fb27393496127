//! A learner's networks as functions: D(s, g) or Q(s, a, g), mu(s, g), f(s, a) and their
//! compositions.

use crate::env::Spec;
use crate::learn::networks::encoder::{
    Encoder, Pairs, ROWS_AHEAD, Workspace, is_repeated, resized,
};
use crate::learn::networks::grid_encoding::GridReads;
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Weights;
use crate::learn::networks::returns::{Returns, Reward, typical_step};
use crate::learn::settings::{LearnSettings, LossScale};

/// What a learner's critics learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Critics {
    /// D(s, g) in steps, without rewards.
    Distance,
    /// Nothing: D(s, g) = |s - g| is given (the paper's section 4.1).
    Given,
    /// Q(s, a, g), the sum of rewards. There is no dynamics model.
    Value(Reward),
}

/// Sizes of the networks, and the meaning of their outputs.
#[derive(Clone, Debug)]
pub struct Shapes {
    pub encoder: Encoder,
    pub prefix: &'static str,
    /// Number of critics; 0 where D is given.
    pub critics: usize,
    /// D(s, g) = scale * softplus(z), or Q(s, a, g), whose rows are pair rows followed by the action.
    pub critic: Mlp,
    /// mu(s, g) = tanh(z).
    pub actor: Mlp,
    /// f(s, a); not there where critics learn Q.
    pub model: Mlp,
    /// What Q means.
    pub returns: Option<Returns>,
    pub distance_scale: f32,
    pub loss: LossScale,
    /// Weight of the largest distance of several critics; the rest is their mean.
    pub pessimism: f32,
    /// Weight of squared errors where the target is below D; others are weighted by 1 minus this.
    pub expectile: f32,
    /// Bound of the actor's outputs before tanh; infinite for none.
    pub actor_bound: f32,
    /// Weight of the mean of the squared outputs, where critics learn Q.
    pub actor_l2: f32,
    /// Whether greedy targets leave out the pairs whose own step the model mispredicts.
    pub model_check: bool,
    /// Whether a blocked actor is pulled towards an action that is not.
    pub unblock_actor: bool,
    /// Actions that lookahead tries besides the actor's, `(actions, action_dim)`.
    pub tried_actions: Vec<f32>,
    pub step_length: f32,
}

/// The states' inputs that depend on no network's parameters.
#[derive(Clone, Copy)]
struct PlainRows<'a> {
    /// Rows of length `stride` that begin with those of the states.
    rows: &'a [f32],
    stride: usize,
    positions: &'a GridReads,
}

/// Dimensions of actions up to which every combination of axes is tried; beyond, single axes.
const MAX_COMBINED_DIM: usize = 4;

/// Buffers of passes through all networks.
#[derive(Clone, Debug, Default)]
pub struct Workspaces {
    pub actor: Workspace,
    pub model: Workspace,
    pub critic: Workspace,
}

impl Shapes {
    pub fn new(
        spec: &Spec,
        settings: &LearnSettings,
        prefix: &'static str,
        critics: Critics,
    ) -> Self {
        let encoder = Encoder::new(spec, settings);
        let LearnSettings { hidden, layers, actor_bound, .. } = *settings;
        let mlp = |inputs, outputs| Mlp { inputs, hidden, layers, outputs };
        let returns = match critics {
            Critics::Value(reward) => Some(Returns::new(reward, settings.discount, spec)),
            Critics::Distance | Critics::Given => None,
        };
        let action_inputs = if returns.is_some() { spec.action_dim } else { 0 };
        Self {
            prefix,
            critics: if critics == Critics::Given { 0 } else { settings.critics },
            critic: mlp(encoder.pair_width() + action_inputs, 1),
            actor: mlp(encoder.pair_width(), spec.action_dim),
            model: mlp(encoder.state_width() + spec.action_dim, spec.state_dim()),
            returns,
            distance_scale: settings.distance_scale_steps,
            loss: settings.loss,
            pessimism: settings.pessimism,
            expectile: settings.expectile,
            actor_bound: if actor_bound > 0.0 { actor_bound } else { f32::INFINITY },
            actor_l2: settings.actor_l2,
            model_check: settings.model_check,
            unblock_actor: settings.unblock_actor,
            tried_actions: tried_actions(spec.action_dim),
            step_length: typical_step(spec),
            encoder,
        }
    }

    /// Computes a critic's outputs, `(rows)`, for pairs and, where it learns Q, `actions` `(rows,
    /// action_dim)`; keeps inputs and activations for the backward pass.
    pub fn critic_outputs(
        &self,
        critic: Weights,
        pairs: Pairs,
        actions: &[f32],
        out: &mut [f32],
        ws: &mut Workspace,
    ) {
        let (width, pair_width) = (self.critic.inputs, self.encoder.pair_width());
        self.encoder.pair_rows(pairs, critic.table, width, &mut ws.x);
        let x = &mut ws.x[..out.len() * width];
        if width > pair_width {
            let rows = x.chunks_exact_mut(width).zip(actions.chunks_exact(width - pair_width));
            rows.for_each(|(row, action)| row[pair_width..].copy_from_slice(action));
        }
        self.critic.forward(critic.dense, critic.packed, x, out, &mut ws.acts);
    }

    /// Computes D(s, g) of each pair by one or two critics, `(rows)`: between their mean and their
    /// maximum.
    pub fn joint_distances(
        &self,
        critics: &[Weights],
        pairs: Pairs,
        out: &mut [f32],
        ws: &mut Workspace,
    ) {
        let mut own = std::mem::take(&mut ws.y);
        for (k, critic) in critics.iter().enumerate() {
            let own = resized(&mut own, out.len());
            self.critic_outputs(*critic, pairs, &[], own, ws);
            for (d, z) in out.iter_mut().zip(own) {
                let own = self.distance_scale * softplus(*z);
                *d = match k {
                    0 => own,
                    _ => d.max(own) - 0.5 * (1.0 - self.pessimism) * (*d - own).abs(),
                };
            }
        }
        ws.y = own;
    }

    /// Computes the inputs of pairs, then [`Self::joint_distances`].
    pub fn distances_between(
        &self,
        critics: &[Weights],
        states: &[f32],
        goals: &[f32],
        out: &mut [f32],
        ws: &mut Workspace,
    ) {
        let mut plain = std::mem::take(&mut ws.plain);
        self.encoder.plain_pairs(states, goals, &mut plain);
        self.joint_distances(critics, Pairs { plain: &plain, states, goals }, out, ws);
        ws.plain = plain;
    }

    /// Computes the minimum of Q(s, mu(s, g) + noise, g) over `critics`, `(rows)`; Fujimoto et al.
    /// 2018, sections 4.2 and 5.3. `noise` is `(rows, action_dim)`, or empty for none.
    pub fn values_of_actor(
        &self,
        actor: Weights,
        critics: &[Weights],
        pairs: Pairs,
        noise: &[f32],
        out: &mut [f32],
        ws: &mut Workspaces,
    ) {
        let mut actions = std::mem::take(&mut ws.actor.y);
        let actions_of_rows = resized(&mut actions, out.len() * self.actor.outputs);
        ws.actor.actions(&self.encoder, &self.actor, actor, pairs, actions_of_rows);
        for (action, noise) in actions_of_rows.iter_mut().zip(noise) {
            *action = (*action + noise).clamp(-1.0, 1.0);
        }
        let mut own = std::mem::take(&mut ws.critic.y);
        for (k, critic) in critics.iter().enumerate() {
            let own = resized(&mut own, out.len());
            self.critic_outputs(*critic, pairs, actions_of_rows, own, &mut ws.critic);
            for (least, q) in out.iter_mut().zip(own) {
                *least = if k == 0 { *q } else { least.min(*q) };
            }
        }
        ws.critic.y = own;
        ws.actor.y = actions;
    }

    /// Predicts the next states f(s, a) = s + scale * network, component by component, `(rows,
    /// state_dim)`; keeps the activations for the backward pass.
    fn predict(
        &self,
        model: Weights,
        states: &[f32],
        actions: &[f32],
        plain: PlainRows,
        next: &mut [f32],
        ws: &mut Workspace,
    ) {
        let spec = &self.encoder.spec;
        let (plain_width, width) = (self.encoder.plain_state_width(), self.model.inputs);
        let (dim, grid) = (spec.state_dim(), self.encoder.grid_width());
        let x = resized(&mut ws.x, states.len() / dim * width);
        let rows = plain.rows.chunks_exact(plain.stride);
        for (i, (own, action)) in rows.zip(actions.chunks_exact(spec.action_dim)).enumerate() {
            let (before, row) = x.split_at_mut(i * width);
            let (copy, rest) = row[..width].split_at_mut(plain_width);
            copy.copy_from_slice(&own[..plain_width]);
            let (encoded, last) = rest.split_at_mut(grid);
            self.encoder.prefetch(model.table, plain.positions, i + ROWS_AHEAD);
            if is_repeated(states, i, dim) {
                let before = &before[before.len() - width + plain_width..];
                encoded.copy_from_slice(&before[..grid]);
            } else {
                self.encoder.encode(model.table, plain.positions, i, encoded);
            }
            last.copy_from_slice(action);
        }
        self.model.forward(model.dense, model.packed, x, next, &mut ws.acts);
        for (next, state) in next.chunks_exact_mut(dim).zip(states.chunks_exact(dim)) {
            for ((next, state), scale) in next.iter_mut().zip(state).zip(&spec.change_scale) {
                *next = state + scale * *next;
            }
        }
    }

    /// Computes s' = f(s, mu(s, g)) of each pair into `next`, `(rows, state_dim)`; keeps the
    /// activations for the backward passes.
    pub fn step_with_actor<'a>(
        &self,
        actor: Weights,
        model: Weights,
        pairs: Pairs,
        next: &'a mut Vec<f32>,
        buffers: &mut Workspaces,
    ) -> &'a [f32] {
        let Pairs { plain, states, .. } = pairs;
        let rows = states.len() / self.encoder.spec.state_dim();
        let mut action = std::mem::take(&mut buffers.actor.y);
        let actions = resized(&mut action, rows * self.actor.outputs);
        buffers.actor.actions(&self.encoder, &self.actor, actor, pairs, actions);
        let stride = self.encoder.plain_pair_width();
        let plain = PlainRows { rows: &plain.rows, stride, positions: &plain.states };
        let next = resized(next, states.len());
        self.predict(model, states, actions, plain, next, &mut buffers.model);
        buffers.actor.y = action;
        next
    }

    /// Predicts the next states f(s, a) of `states` `(rows, state_dim)` after `actions` `(rows,
    /// action_dim)` into `next`; keeps the activations for the backward pass.
    pub fn next_states(
        &self,
        model: Weights,
        states: &[f32],
        actions: &[f32],
        next: &mut [f32],
        ws: &mut Workspace,
    ) {
        let (s, width) = (self.encoder.spec.state_dim(), self.encoder.plain_state_width());
        let mut plain = std::mem::take(&mut ws.plain);
        let rows = resized(&mut plain.rows, states.len() / s * width);
        plain.states.clear();
        for (i, state) in states.chunks_exact(s).enumerate() {
            if is_repeated(states, i, s) {
                rows.copy_within((i - 1) * width..i * width, i * width);
                self.encoder.locate_again(&mut plain.states);
            } else {
                self.encoder.plain_state(state, &mut rows[i * width..(i + 1) * width]);
                self.encoder.locate_state(state, &mut plain.states);
            }
        }
        let own = PlainRows { rows: &plain.rows, stride: width, positions: &plain.states };
        self.predict(model, states, actions, own, next, ws);
        ws.plain = plain;
    }
}

/// Returns the actions to try, `(actions, dim)`: full steps along every combination of axes. (Half
/// steps as well are no better in mazes with corridors one cell wide.)
fn tried_actions(dim: usize) -> Vec<f32> {
    if dim > MAX_COMBINED_DIM {
        return axis_actions(dim);
    }
    // The digits of a number in base 3, less 1.
    let digit = |i: usize, axis: usize| (i / 3usize.pow(axis as u32) % 3) as f32 - 1.0;
    let actions = (0..3usize.pow(dim as u32)).map(|i| (0..dim).map(move |axis| digit(i, axis)));
    actions.filter(|action| action.clone().any(|v| v != 0.0)).flatten().collect()
}

/// Returns full steps forwards and backwards along each axis, in turns, `(2 * dim, dim)`.
pub fn axis_actions(dim: usize) -> Vec<f32> {
    let along = |axis: usize, sign: f32| (0..dim).map(move |i| if i == axis { sign } else { 0.0 });
    (0..dim).flat_map(|axis| along(axis, 1.0).chain(along(axis, -1.0))).collect()
}

/// Returns ln(1 + e^z) without overflow.
pub fn softplus(z: f32) -> f32 {
    z.max(0.0) + (-z.abs()).exp().ln_1p()
}

pub fn sigmoid(z: f32) -> f32 {
    1.0 / (1.0 + (-z).exp())
}
