//! Input rows of (state, goal) pairs, and the buffers of a pass through a network.

use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::grid::{GridReads, TableView};
use crate::learn::networks::mlp::{Activations, Mlp};
use crate::learn::networks::network::Weights;

/// The inputs that depend on no network's parameters, computed once for all networks.
#[derive(Clone, Debug, Default)]
pub struct SharedFeatures {
    /// `(rows, plain_pair_width)`.
    pub rows: Vec<f32>,
    /// Grid reads of the states.
    pub states: GridReads,
    /// Grid reads of the goals.
    pub goals: GridReads,
}

/// (state, goal) pairs, one per row.
#[derive(Clone, Copy)]
pub struct Pairs<'a> {
    /// The inputs that all networks share.
    pub plain: &'a SharedFeatures,
    /// `(rows, state_dim)`.
    pub states: &'a [f32],
    /// `(rows, goal_dim)`.
    pub goals: &'a [f32],
}

/// Buffers of one pass, grown to the largest batch seen.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    pub plain: SharedFeatures,
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    /// The actor's outputs before tanh, `(rows, action_dim)`.
    pub outputs: Vec<f32>,
    pub dx: Vec<f32>,
    pub acts: Activations,
}

/// Returns the first `length` numbers of `buffer`, which grows if it is shorter.
pub fn resized(buffer: &mut Vec<f32>, length: usize) -> &mut [f32] {
    buffer.resize(buffer.len().max(length), 0.0);
    &mut buffer[..length]
}

impl Encoder {
    /// Computes the inputs of pairs that all networks share.
    pub fn plain_pairs(&self, states: &[f32], goals: &[f32], plain: &mut SharedFeatures) {
        let (s, g) = (self.spec().state_dim(), self.spec().goal_dim());
        let width = self.plain_pair_width();
        let rows = resized(&mut plain.rows, states.len() / s * width).chunks_exact_mut(width);
        plain.states.clear();
        plain.goals.clear();
        for ((state, goal), row) in states.chunks_exact(s).zip(goals.chunks_exact(g)).zip(rows) {
            self.plain_pair(state, goal, row);
            self.locate_state(state, &mut plain.states);
            self.locate_goal(goal, &mut plain.goals);
        }
    }

    /// Builds full pair rows from plain ones and a network's table: the first `pair_width` columns
    /// of `x` `(rows, stride)`.
    pub fn pair_rows(
        &self,
        pairs: Pairs,
        table: Option<TableView>,
        stride: usize,
        x: &mut Vec<f32>,
    ) {
        let (width, plain_width) = (self.pair_width(), self.plain_pair_width());
        let count = pairs.states.len() / self.spec().state_dim();
        let places = [&pairs.plain.states, &pairs.plain.goals];
        let plain = pairs.plain.rows.chunks_exact(plain_width);
        for ((i, row), plain) in
            resized(x, count * stride).chunks_exact_mut(stride).enumerate().zip(plain)
        {
            let (copy, encoded) = row[..width].split_at_mut(plain_width);
            copy.copy_from_slice(plain);
            self.encode(table, &places, i, encoded);
        }
    }
}

impl Workspace {
    /// Computes the actions mu(s, g) = tanh(z), `(rows, action_dim)`; keeps inputs, outputs z and
    /// activations for the backward pass.
    pub fn actions(
        &mut self,
        encoder: &Encoder,
        mlp: &Mlp,
        actor: Weights,
        pairs: Pairs,
        out: &mut [f32],
    ) {
        encoder.pair_rows(pairs, actor.table, mlp.inputs, &mut self.x);
        let rows = out.len() / mlp.outputs;
        let outputs = resized(&mut self.outputs, out.len());
        mlp.forward(
            actor.dense,
            actor.packed,
            &self.x[..rows * mlp.inputs],
            outputs,
            &mut self.acts,
        );
        for (a, z) in out.iter_mut().zip(outputs) {
            *a = z.tanh();
        }
    }
}
