//! Turns raw states and goals into network inputs, rows of which are (state, goal) pairs, and the
//! buffers of a pass through a network.

use std::f32::consts::PI;
use std::ops::Range;

use crate::env::{MOST_HALF_RANGES, Spec};
use crate::learn::networks::grid_encoding::{CHANNELS, GridReads, GridShape, TableView};
use crate::learn::networks::mlp::{Activations, Mlp};
use crate::learn::networks::network::Weights;
use crate::learn::settings::LearnSettings;

/// Scales c of what networks read of a contact, in its widths.
pub const CONTACT_SCALES: [f32; 3] = [1.0, 3.0, 9.0];

/// How many rows ahead encodings are prefetched.
pub const ROWS_AHEAD: usize = 2;

/// Input features of states and of (state, goal) pairs.
///
/// A *plain* state row is `[u | sin, cos(pi 2^l u_a) | tanh(apart / c)]` where `u` is the state scaled
/// to [-1, 1], `u_a` its achieved goal, and `apart` how far apart the two of each contact are, with
/// each of [`CONTACT_SCALES`]. A plain pair row is that, the same for the goal but for contacts, and
/// `tanh((g - s_a) / c)` for each relative scale c. Plain rows depend on no parameters, so all networks
/// share them. A network with a grid encoding appends the encoded position(s).
#[derive(Clone, Debug)]
pub struct Encoder {
    pub spec: Spec,
    /// Fourier octaves per coordinate.
    pub octaves: usize,
    /// 1 / c for each relative scale, in 1 / length.
    pub relative: Vec<f32>,
    /// Geometry of the grid encoding, if there is one.
    pub grid: Option<GridShape>,
}

impl Encoder {
    pub fn new(spec: &Spec, settings: &LearnSettings) -> Self {
        let dims = spec.goal_dim();
        let is_encoded = (1..=3).contains(&dims) && !settings.grid_cells.is_empty();
        let grid = spec.position_scale.filter(|_| is_encoded).map(|scale| {
            let half = spec.achieved.iter().map(|i| spec.state_half_range[*i]).fold(0.0, f32::max);
            GridShape::new(dims, &settings.grid_cells, 2.0 * half / scale)
        });
        Self {
            octaves: settings.fourier_octaves,
            relative: settings
                .relative_scales
                .iter()
                .map(|c| 1.0 / (c * spec.goal_radius))
                .collect(),
            spec: spec.clone(),
            grid,
        }
    }

    /// Returns the number of trainable parameters of `mlp` and its network's grid table.
    pub fn parameters_with(&self, mlp: &Mlp) -> u64 {
        (mlp.parameters() + self.grid.as_ref().map_or(0, |grid| grid.corners() * CHANNELS)) as u64
    }

    /// Returns the width of one position's grid encoding; 0 if there is none.
    pub fn grid_width(&self) -> usize {
        self.grid.as_ref().map_or(0, GridShape::width)
    }

    fn goal_features(&self) -> usize {
        self.spec.goal_dim() * 2 * self.octaves
    }

    /// Returns where the contacts are in plain state rows.
    pub fn contact_columns(&self) -> Range<usize> {
        let from = self.spec.state_dim() + self.goal_features();
        from..from + self.spec.contacts.len() * CONTACT_SCALES.len()
    }

    pub fn plain_state_width(&self) -> usize {
        self.contact_columns().end
    }

    pub fn plain_goal_width(&self) -> usize {
        self.spec.goal_dim() + self.goal_features()
    }

    pub fn plain_pair_width(&self) -> usize {
        let offset = self.spec.goal_dim() * self.relative.len();
        self.plain_state_width() + self.plain_goal_width() + offset
    }

    pub fn pair_width(&self) -> usize {
        self.plain_pair_width() + 2 * self.grid_width()
    }

    pub fn state_width(&self) -> usize {
        self.plain_state_width() + self.grid_width()
    }

    pub fn plain_state(&self, state: &[f32], row: &mut [f32]) {
        let (scaled, fourier) = row.split_at_mut(self.spec.state_dim());
        for (i, u) in scaled.iter_mut().enumerate() {
            *u = self.spec.scaled(i, state[i]);
        }
        for (k, i) in self.spec.achieved.iter().enumerate() {
            octaves(scaled[*i], &mut fourier[2 * self.octaves * k..][..2 * self.octaves]);
        }
        let columns = row[self.contact_columns()].chunks_exact_mut(CONTACT_SCALES.len());
        for (contact, columns) in self.spec.contacts.iter().zip(columns) {
            let apart = contact.apart(state);
            columns.iter_mut().zip(CONTACT_SCALES).for_each(|(v, c)| *v = (apart / c).tanh());
        }
    }

    /// Writes the part of plain pair rows that depends on `goal` alone, after that of the state.
    fn plain_goal(&self, goal: &[f32], row: &mut [f32]) {
        let (scaled, fourier) = row.split_at_mut(self.spec.goal_dim());
        self.scaled_goal(goal, scaled);
        for (k, u) in scaled.iter().enumerate() {
            octaves(*u, &mut fourier[2 * self.octaves * k..][..2 * self.octaves]);
        }
    }

    /// Writes the last part of plain pair rows, the offset of `goal` from `state`.
    fn plain_offset(&self, state: &[f32], goal: &[f32], row: &mut [f32]) {
        let mut out = row.iter_mut();
        for (g, s) in goal.iter().zip(self.spec.achieved(state)) {
            for (rate, out) in self.relative.iter().zip(&mut out) {
                *out = ((g - s) * rate).tanh();
            }
        }
    }

    /// Writes the goal scaled to [-1, 1].
    fn scaled_goal(&self, goal: &[f32], out: &mut [f32]) {
        for ((out, g), i) in out.iter_mut().zip(goal).zip(&self.spec.achieved) {
            *out = self.spec.scaled(*i, *g);
        }
    }

    /// Writes the achieved goal of `state` scaled to [-1, 1]: the position that its grid encoding
    /// reads.
    fn scaled_achieved(&self, state: &[f32], out: &mut [f32]) {
        for (out, i) in out.iter_mut().zip(&self.spec.achieved) {
            *out = self.spec.scaled(*i, state[*i]);
        }
    }

    /// Adds the grid reads of `state`'s achieved goal to `places`.
    pub fn locate_state(&self, state: &[f32], places: &mut GridReads) {
        if let Some(grid) = &self.grid {
            let mut u = [0.0; 3];
            self.scaled_achieved(state, &mut u[..grid.dims]);
            grid.locate(&u[..grid.dims], places);
        }
    }

    pub fn locate_goal(&self, goal: &[f32], places: &mut GridReads) {
        if let Some(grid) = &self.grid {
            let mut u = [0.0; 3];
            self.scaled_goal(goal, &mut u[..grid.dims]);
            grid.locate(&u[..grid.dims], places);
        }
    }

    /// Adds the last of `places` once more.
    pub fn locate_again(&self, places: &mut GridReads) {
        self.grid.iter().for_each(|grid| grid.locate_again(places));
    }

    /// Prefetches what the encoding of the position at row `i` of `places` reads, if there is one.
    pub fn prefetch(&self, table: Option<TableView>, places: &GridReads, i: usize) {
        if let (Some(grid), Some(table)) = (&self.grid, table) {
            grid.prefetch(table, places, i);
        }
    }

    /// Writes the encoding of the position at row `i` of `places`.
    pub fn encode(&self, table: Option<TableView>, places: &GridReads, i: usize, out: &mut [f32]) {
        if let (Some(grid), Some(table)) = (&self.grid, table) {
            grid.encode(table, places, i, out);
        }
    }

    /// Backpropagates `d_row`, the gradient with respect to the pair row `row`, to `state`; writes
    /// the result to `d_state`.
    pub fn pair_state_gradient(
        &self,
        state: &[f32],
        row: &[f32],
        d_row: &[f32],
        table: Option<TableView>,
        d_state: &mut [f32],
    ) {
        let (state_dim, goal_dim) = (self.spec.state_dim(), self.spec.goal_dim());
        // First with respect to the scaled state.
        d_state.copy_from_slice(&d_row[..state_dim]);
        if self.octaves > 0 {
            let width = 2 * self.octaves;
            let values = row[state_dim..].chunks_exact(width);
            let gradients = d_row[state_dim..].chunks_exact(width);
            for ((i, v), d) in self.spec.achieved.iter().zip(values).zip(gradients) {
                d_state[*i] += octaves_gradient(v, d);
            }
        }
        if let (Some(grid), Some(table)) = (&self.grid, table) {
            let mut u = [0.0; 3];
            let mut du = [0.0; 3];
            self.scaled_achieved(state, &mut u[..grid.dims]);
            let from = self.plain_pair_width();
            grid.position_gradient(
                table,
                &u[..grid.dims],
                &d_row[from..from + grid.width()],
                &mut du[..grid.dims],
            );
            for (i, du) in self.spec.achieved.iter().zip(du) {
                d_state[*i] += du;
            }
        }
        for ((d, half), u) in d_state.iter_mut().zip(&self.spec.state_half_range).zip(row) {
            *d = if *half > 0.0 && u.abs() < MOST_HALF_RANGES { *d / half } else { 0.0 };
        }
        let columns = self.contact_columns();
        let values = row[columns.clone()].chunks_exact(CONTACT_SCALES.len());
        let gradients = d_row[columns].chunks_exact(CONTACT_SCALES.len());
        for ((contact, v), d) in self.spec.contacts.iter().zip(values).zip(gradients) {
            let terms =
                v.iter().zip(d).zip(CONTACT_SCALES).map(|((t, d), c)| d * (1.0 - t * t) / c);
            let d = terms.sum::<f32>() / contact.width;
            d_state[contact.other] += d;
            d_state[contact.goal] -= contact.slope * d;
        }
        if !self.relative.is_empty() {
            let from = self.plain_pair_width() - goal_dim * self.relative.len();
            let values = row[from..].chunks_exact(self.relative.len());
            let gradients = d_row[from..].chunks_exact(self.relative.len());
            for ((i, v), d) in self.spec.achieved.iter().zip(values).zip(gradients) {
                for ((t, d), rate) in v.iter().zip(d).zip(&self.relative) {
                    d_state[*i] -= d * (1.0 - t * t) * rate;
                }
            }
        }
    }

    /// Computes the inputs of pairs that all networks share.
    pub fn plain_pairs(&self, states: &[f32], goals: &[f32], plain: &mut SharedFeatures) {
        let (s, g) = (self.spec.state_dim(), self.spec.goal_dim());
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
        let (s, g) = (self.spec.state_dim(), self.spec.goal_dim());
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
                self.prefetch(table, places, i + ROWS_AHEAD);
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

/// The inputs that depend on no network's parameters, computed once for all networks.
#[derive(Clone, Debug, Default)]
pub struct SharedFeatures {
    /// `(rows, plain_pair_width)`.
    pub rows: Vec<f32>,
    pub states: GridReads,
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

/// Writes `sin(pi 2^l u), cos(pi 2^l u)` for l = 0, 1, ..., each from the previous one by the
/// double-angle formulas.
fn octaves(u: f32, out: &mut [f32]) {
    if out.is_empty() {
        return;
    }
    let (mut sin, mut cos) = (PI * u).sin_cos();
    for pair in out.chunks_exact_mut(2) {
        pair[0] = sin;
        pair[1] = cos;
        (sin, cos) = (2.0 * sin * cos, cos * cos - sin * sin);
    }
}

/// Returns the gradient with respect to u, from the octaves' values and gradients.
fn octaves_gradient(values: &[f32], gradients: &[f32]) -> f32 {
    let mut rate = PI;
    let mut sum = 0.0;
    for (v, d) in values.chunks_exact(2).zip(gradients.chunks_exact(2)) {
        sum += rate * (d[0] * v[1] - d[1] * v[0]);
        rate *= 2.0;
    }
    sum
}
