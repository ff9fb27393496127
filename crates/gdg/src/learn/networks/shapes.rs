//! The three networks as one function: D(s, g), mu(s, g), f(s, a) and their compositions.

use candle_core::Result;

use crate::env::Spec;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::{Pairs, Workspace, is_repeated, resized};
use crate::learn::networks::grid::GridReads;
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Weights;
use crate::learn::settings::{LearnSettings, LossScale};

/// Sizes of the three networks, and the meaning of their outputs.
#[derive(Clone, Debug)]
pub struct Shapes {
    pub encoder: Encoder,
    /// Number of critics.
    pub critics: usize,
    pub critic: Mlp,
    pub actor: Mlp,
    pub model: Mlp,
    /// D = scale * softplus(z).
    pub distance_scale: f32,
    pub loss: LossScale,
    /// Weight of the largest distance of several critics; the rest is their mean.
    pub pessimism: f32,
    /// Weight of squared errors where the target is below D; others are weighted by 1 minus this.
    pub expectile: f32,
    /// Bound of the actor's outputs before tanh; infinite for none.
    pub actor_bound: f32,
    /// Whether greedy targets leave out the pairs whose own step the model mispredicts.
    pub model_check: bool,
    /// Whether a blocked actor is pulled towards an action that is not.
    pub unblock_actor: bool,
    /// Actions that lookahead tries besides the actor's, `(actions, action_dim)`.
    pub tried_actions: Vec<f32>,
}

/// The states' inputs that depend on no network's parameters.
#[derive(Clone, Copy)]
struct PlainRows<'a> {
    /// Rows of length `stride` that begin with those of the states.
    rows: &'a [f32],
    stride: usize,
    /// Grid reads of the states.
    positions: &'a GridReads,
}

/// Dimensions of actions up to which every combination of axes is tried; beyond, single axes.
const MAX_COMBINED_DIM: usize = 4;

/// The networks on the way from a pair to the distance after a step.
#[derive(Clone, Copy)]
pub struct Path<'a> {
    pub actor: Weights<'a>,
    pub model: Weights<'a>,
    pub critics: &'a [Weights<'a>],
}

/// Buffers of passes through all three networks.
#[derive(Clone, Debug, Default)]
pub struct Workspaces {
    /// Of the actor.
    pub actor: Workspace,
    /// Of the model.
    pub model: Workspace,
    /// Of the critic that evaluates the model's prediction.
    pub critic: Workspace,
}

impl Shapes {
    /// Returns the shapes of the networks that `settings` specify.
    pub fn new(spec: &Spec, settings: &LearnSettings) -> Self {
        let encoder = Encoder::new(spec, settings);
        let mlp = |inputs, outputs| Mlp {
            inputs,
            hidden: settings.hidden,
            layers: settings.layers,
            outputs,
        };
        Self {
            critics: settings.critics,
            critic: mlp(encoder.pair_width(), 1),
            actor: mlp(encoder.pair_width(), spec.action_dim),
            model: mlp(encoder.state_width() + spec.action_dim, spec.state_dim()),
            distance_scale: settings.distance_scale_steps,
            loss: settings.loss,
            pessimism: settings.pessimism,
            expectile: settings.expectile,
            actor_bound: if settings.actor_bound > 0.0 {
                settings.actor_bound
            } else {
                f32::INFINITY
            },
            model_check: settings.model_check,
            unblock_actor: settings.unblock_actor,
            tried_actions: tried_actions(spec.action_dim),
            encoder,
        }
    }

    /// Computes D(s, g) of each pair, `(rows)`.
    pub fn distances(&self, critic: Weights, pairs: Pairs, out: &mut [f32], ws: &mut Workspace) {
        self.encoder.pair_rows(pairs, critic.table, self.critic.inputs, &mut ws.x);
        let x = &ws.x[..out.len() * self.critic.inputs];
        self.critic.forward(critic.dense, critic.packed, x, out, &mut ws.acts);
        for z in out {
            *z = self.distance_scale * softplus(*z);
        }
    }

    /// Computes the actions mu(s, g), `(rows, action_dim)`.
    pub fn actions(&self, actor: Weights, pairs: Pairs, out: &mut [f32], ws: &mut Workspace) {
        ws.actions(&self.encoder, &self.actor, actor, pairs, out);
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
        let spec = self.encoder.spec();
        let (plain_width, width) = (self.encoder.plain_state_width(), self.model.inputs);
        let (dim, grid) = (spec.state_dim(), self.encoder.grid_width());
        let x = resized(&mut ws.x, states.len() / dim * width);
        let rows = plain.rows.chunks_exact(plain.stride);
        for (i, (own, action)) in rows.zip(actions.chunks_exact(spec.action_dim)).enumerate() {
            let (before, row) = x.split_at_mut(i * width);
            let (copy, rest) = row[..width].split_at_mut(plain_width);
            copy.copy_from_slice(&own[..plain_width]);
            let (encoded, last) = rest.split_at_mut(grid);
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

    /// Computes D(f(s, mu(s, g)), g) of each pair by all `critics`: the distance that remains after
    /// a step of the actor.
    pub fn distances_after_actor(
        &self,
        Path { actor, model, critics }: Path,
        pairs: Pairs,
        out: &mut [f32],
        buffers: &mut Workspaces,
    ) {
        let mut next = std::mem::take(&mut buffers.model.y);
        let states = self.step_with_actor(actor, model, pairs, &mut next, buffers);
        let mut plain = std::mem::take(&mut buffers.critic.plain);
        self.encoder.plain_pairs(states, pairs.goals, &mut plain);
        self.joint_distances(
            critics,
            Pairs { plain: &plain, states, goals: pairs.goals },
            out,
            &mut buffers.critic,
        );
        buffers.critic.plain = plain;
        buffers.model.y = next;
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
            self.distances(*critic, pairs, own, ws);
            out.iter_mut()
                .zip(own)
                .for_each(|(d, own)| *d = if k == 0 { *own } else { self.joint(*d, *own) });
        }
        ws.y = own;
    }

    /// Returns D by two critics, between their mean and their maximum.
    fn joint(&self, a: f32, b: f32) -> f32 {
        a.max(b) - 0.5 * (1.0 - self.pessimism) * (a - b).abs()
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
        let rows = states.len() / self.encoder.spec().state_dim();
        let mut action = std::mem::take(&mut buffers.actor.y);
        self.actions(
            actor,
            pairs,
            resized(&mut action, rows * self.actor.outputs),
            &mut buffers.actor,
        );
        let stride = self.encoder.plain_pair_width();
        let plain = PlainRows { rows: &plain.rows, stride, positions: &plain.states };
        let next = resized(next, states.len());
        let actions = &action[..rows * self.actor.outputs];
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
        let (s, width) = (self.encoder.spec().state_dim(), self.encoder.plain_state_width());
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
pub fn tried_actions(dim: usize) -> Vec<f32> {
    if dim <= MAX_COMBINED_DIM {
        // The digits of a number in base 3, less 1.
        let count = 3usize.pow(dim as u32);
        let digits = |i: usize| {
            (0..dim).map(|axis| (i / 3usize.pow(axis as u32) % 3) as f32 - 1.0).collect()
        };
        (0..count)
            .map(digits)
            .filter(|action: &Vec<f32>| action.iter().any(|v| *v != 0.0))
            .flatten()
            .collect()
    } else {
        axis_actions(dim)
    }
}

/// Returns full steps forwards and backwards along each axis, in turns, `(2 * dim, dim)`.
pub fn axis_actions(dim: usize) -> Vec<f32> {
    let along = |axis: usize, sign: f32| (0..dim).map(move |i| if i == axis { sign } else { 0.0 });
    (0..dim).flat_map(|axis| along(axis, 1.0).chain(along(axis, -1.0))).collect()
}

/// Maximum size of a state: states are short vectors, so their gradients live on the stack.
pub const MAX_STATE_DIM: usize = 512;

/// Checks that states are not too large.
///
/// # Errors
/// The state has more than [`MAX_STATE_DIM`] components.
pub fn check_state_dim(spec: &Spec) -> Result<()> {
    if spec.state_dim() > MAX_STATE_DIM {
        candle_core::bail!("states with more than {MAX_STATE_DIM} components are not supported");
    }
    Ok(())
}

/// Returns ln(1 + e^z) without overflow.
pub fn softplus(z: f32) -> f32 {
    z.max(0.0) + (-z.abs()).exp().ln_1p()
}

/// Returns the slope of [`softplus`].
pub fn sigmoid(z: f32) -> f32 {
    1.0 / (1.0 + (-z).exp())
}
