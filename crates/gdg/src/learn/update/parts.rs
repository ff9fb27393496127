//! How a batch is split into parts, one task each, what a task computes, and the optimiser steps with
//! the sum of all parts.

use std::ops::Range;

use candle_core::Result;
use parking_lot::Mutex;

use crate::learn::data::batch::Batch;
use crate::learn::networks::encoder::{Encoder, Pairs, SharedFeatures};
use crate::learn::networks::network::{LearningRates, Network, TouchedCorners};
use crate::learn::networks::shapes::{Shapes, Workspaces};
use crate::learn::update::profile::Losses;

/// Number of parts that a batch is split into, and minimum rows per part. The parts do not depend
/// on the number of threads and are summed in order, so the results do not depend on it either.
const PARTS: usize = 4;
const MIN_PART_ROWS: usize = 32;

/// Returns the number of rows per part of a batch; the last part may have fewer.
fn part_rows(batch: usize) -> usize {
    batch.div_ceil(PARTS).max(MIN_PART_ROWS)
}

pub fn parts_of(batch: usize) -> usize {
    batch.div_ceil(part_rows(batch))
}

pub fn rows_of_part(batch: usize, part: usize) -> Range<usize> {
    let size = part_rows(batch);
    part * size..((part + 1) * size).min(batch)
}

/// The rows of a batch that belong to one part: its fields.
pub struct Rows<'a> {
    pub states: &'a [f32],
    pub goals: &'a [f32],
    pub actor_goals: &'a [f32],
    pub actor_weights: &'a [f32],
    pub bootstrap_states: &'a [f32],
    pub steps: &'a [f32],
    pub bootstrap: &'a [f32],
    pub bound: &'a [f32],
    pub lower: &'a [f32],
    pub from: &'a [f32],
    pub actions: &'a [f32],
    pub next: &'a [f32],
    pub rewards: &'a [f32],
    pub noise: &'a [f32],
    pub greedy_targets: bool,
    pub relearns: bool,
    /// 1 / batch size.
    pub share: f32,
}

impl<'a> Rows<'a> {
    pub fn new(shapes: &Shapes, batch: &'a Batch, part: usize) -> Self {
        let spec = &shapes.encoder.spec;
        let rows = rows_of_part(batch.len(), part);
        // Not all learners need all numbers.
        let cut = |numbers: &'a [f32], width: usize| {
            numbers.get(rows.start * width..rows.end * width).unwrap_or_default()
        };
        let (s, g) = (spec.state_dim(), spec.goal_dim());
        Self {
            states: cut(&batch.states, s),
            goals: cut(&batch.goals, g),
            actor_goals: cut(&batch.actor_goals, g),
            actor_weights: cut(&batch.actor_weights, 1),
            bootstrap_states: cut(&batch.bootstrap_states, s),
            steps: cut(&batch.steps, 1),
            bootstrap: cut(&batch.bootstrap, 1),
            bound: cut(&batch.bound, 1),
            lower: cut(&batch.lower, 1),
            from: cut(&batch.from, s),
            actions: cut(&batch.actions, spec.action_dim),
            next: cut(&batch.next, s),
            rewards: cut(&batch.rewards, 1),
            noise: cut(&batch.noise, spec.action_dim),
            greedy_targets: batch.greedy_targets,
            relearns: batch.relearns,
            share: 1.0 / batch.len() as f32,
        }
    }
}

/// The sets of positions in a batch: those of its pairs, and those of the model's transitions.
pub const PAIRS: usize = 0;
pub const TRANSITIONS: usize = 1;

/// Finds the table corners around set number `set` of the batch's positions, in the order in which
/// gradients list them, part by part.
pub fn find_corners(set: usize, shapes: &Shapes, batch: &Batch, touched: &mut TouchedCorners) {
    let Encoder { spec, grid: Some(grid), .. } = &shapes.encoder else { return };
    touched.find(grid, |places| {
        for i in 0..parts_of(batch.len()) {
            let rows = Rows::new(shapes, batch, i);
            let (states, goals) =
                if set == PAIRS { (rows.states, rows.goals) } else { (rows.from, &[][..]) };
            for state in states.chunks_exact(spec.state_dim()) {
                shapes.encoder.locate_state(state, places);
            }
            for goal in goals.chunks_exact(spec.goal_dim()) {
                shapes.encoder.locate_goal(goal, places);
            }
        }
    });
}

/// A model mispredicts a step only if its squared error, with each component in units of its change
/// scale, exceeds this.
const MISPREDICTED_ERROR: f32 = 0.01;

/// The error must also exceed this multiple of the mean over the part of the batch: where steps are
/// random, or nothing has been learned yet, all are off.
const MISPREDICTED_FACTOR: f32 = 3.0;

/// Returns the rows of a part whose pair begins with a step that the model mispredicts: of squared
/// `errors` `(rows)` on transitions that begin in `from` `(rows, state_dim)`, for pairs that begin
/// in `states` `(rows, state_dim)`.
pub fn mispredicted(
    errors: &[f32],
    from: &[f32],
    states: &[f32],
    state_dim: usize,
) -> impl Iterator<Item = bool> {
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    let most = MISPREDICTED_ERROR.max(MISPREDICTED_FACTOR * mean);
    let own = from
        .chunks_exact(state_dim)
        .zip(states.chunks_exact(state_dim))
        .map(|(from, state)| from == state);
    errors.iter().zip(own).map(move |(error, own)| own && *error > most)
}

/// Gradient of one network from one part of a batch.
#[derive(Clone, Debug, Default)]
pub struct Gradient {
    /// Of the flat parameters.
    pub dense: Vec<f32>,
    /// Of the grid encodings of the positions read, in row order: `(positions, levels, channels)`.
    pub encoded: Vec<f32>,
}

impl Gradient {
    /// Resizes for a network of `parameters` flat parameters, whose gradient a backward pass will
    /// overwrite.
    pub fn prepare(&mut self, parameters: usize) {
        self.dense.resize(parameters, 0.0);
        self.encoded.clear();
    }

    /// Appends the gradients of encodings: some `columns` of `d` `(positions, stride)`.
    pub fn add_encoded(&mut self, d: &[f32], stride: usize, columns: Range<usize>) {
        self.encoded.extend(d.chunks_exact(stride).flat_map(|row| &row[columns.clone()]));
    }

    /// Adds the gradients of the pairs' grid encodings: the first columns of `dx`
    /// `(rows, 2 * grid_width + further columns)`.
    pub fn add_pair_corners(
        &mut self,
        encoder: &Encoder,
        pairs: Pairs,
        dx: &[f32],
        further: usize,
    ) {
        let width = encoder.grid_width();
        if width > 0 {
            let stride = 2 * width + further;
            let dx = &dx[..pairs.states.len() / encoder.spec.state_dim() * stride];
            self.add_encoded(dx, stride, 0..width);
            self.add_encoded(dx, stride, width..2 * width);
        }
    }
}

/// What one task computes from its part of a batch.
#[derive(Default)]
pub struct BatchPart {
    /// Of each network.
    pub gradients: Vec<Gradient>,
    pub losses: Losses,
    pub buffers: Buffers,
}

/// Buffers of one task, kept between updates.
#[derive(Default)]
pub struct Buffers {
    /// The pairs' inputs, and those of the pairs from which targets bootstrap.
    pub plain: SharedFeatures,
    pub plain_ahead: SharedFeatures,
    pub targets: Vec<f32>,
    pub after_actor: Vec<f32>,
    pub networks: Workspaces,
    /// D(s, g) of each row, then the bound of its actor's outputs.
    pub before: Vec<f32>,
    /// See [`Shapes::find_ways_out`].
    pub ways_out: Vec<f32>,
    pub lookahead: Workspaces,
}

/// Half of a network: the two are stepped in separate tasks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Half {
    Dense,
    Table,
}

/// Steps one half of network number `k` with the sum of its gradients in all `parts`. Moves these
/// out of the parts meanwhile, so that other threads can lock the parts for their own steps.
pub fn step_half(
    (k, network): (usize, &Network),
    half: Half,
    touched: &TouchedCorners,
    rates: LearningRates,
    parts: &[Mutex<BatchPart>],
) -> Result<()> {
    let exchange = |taken: &mut [Vec<f32>]| {
        for (part, own) in parts.iter().zip(taken) {
            let Gradient { dense, encoded } = &mut part.lock().gradients[k];
            std::mem::swap(own, if half == Half::Dense { dense } else { encoded });
        }
    };
    let mut taken = vec![Vec::new(); parts.len()];
    exchange(&mut taken);
    let result = match (half, &network.table) {
        (Half::Dense, _) => network.dense.step(&mut taken, rates),
        (Half::Table, Some(table)) => table.step(touched, &taken, rates),
        (Half::Table, None) => Ok(()),
    };
    exchange(&mut taken);
    result
}
