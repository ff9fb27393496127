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

/// Whether row `i` of `numbers` `(rows, width)` is the same as the one before. Queries repeat a
/// state or a goal in many rows, and its features need not be computed again.
pub fn is_repeated(numbers: &[f32], i: usize, width: usize) -> bool {
    let Some(before) = i.checked_sub(1) else { return false };
    let row = |i: usize| numbers[i * width..(i + 1) * width].iter();
    row(before).zip(row(i)).all(|(a, b)| a.to_bits() == b.to_bits())
}

impl Encoder {
    /// Computes the inputs of pairs that all networks share.
    pub fn plain_pairs(&self, states: &[f32], goals: &[f32], plain: &mut SharedFeatures) {
        let (s, g) = (self.spec().state_dim(), self.spec().goal_dim());
        let (of_state, of_goal) = (self.plain_state_width(), self.plain_goal_width());
        let width = self.plain_pair_width();
        let rows = resized(&mut plain.rows, states.len() / s * width);
        plain.states.clear();
        plain.goals.clear();
        for (i, (state, goal)) in states.chunks_exact(s).zip(goals.chunks_exact(g)).enumerate() {
            let (before, row) = rows.split_at_mut(i * width);
            let before = &before[before.len().saturating_sub(width)..];
            let (state_row, rest) = row[..width].split_at_mut(of_state);
            let (goal_row, offset) = rest.split_at_mut(of_goal);
            if is_repeated(states, i, s) {
                state_row.copy_from_slice(&before[..of_state]);
                self.locate_again(&mut plain.states);
            } else {
                self.plain_state(state, state_row);
                self.locate_state(state, &mut plain.states);
            }
            if is_repeated(goals, i, g) {
                goal_row.copy_from_slice(&before[of_state..of_state + of_goal]);
                self.locate_again(&mut plain.goals);
            } else {
                self.plain_goal(goal, goal_row);
                self.locate_goal(goal, &mut plain.goals);
            }
            self.plain_offset(state, goal, offset);
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
        let (s, g) = (self.spec().state_dim(), self.spec().goal_dim());
        let (plain_width, grid) = (self.plain_pair_width(), self.grid_width());
        let x = resized(x, pairs.states.len() / s * stride);
        for (i, plain) in
            pairs.plain.rows.chunks_exact(plain_width).take(x.len() / stride).enumerate()
        {
            let (before, row) = x.split_at_mut(i * stride);
            row[..plain_width].copy_from_slice(plain);
            let parts = [
                (&pairs.plain.states, is_repeated(pairs.states, i, s), plain_width),
                (&pairs.plain.goals, is_repeated(pairs.goals, i, g), plain_width + grid),
            ];
            for (places, is_repeated, from) in parts {
                let encoded = &mut row[from..from + grid];
                if is_repeated {
                    let before = &before[before.len() - stride + from..];
                    encoded.copy_from_slice(&before[..grid]);
                } else {
                    self.encode(table, places, i, encoded);
                }
            }
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
