//! How a batch is split into parts, one task each.

use std::ops::Range;

use crate::learn::data::batch::Batch;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::shapes::Shapes;
use crate::learn::networks::table::TouchedCorners;

/// Number of parts that a batch is split into, and minimum rows per part. The parts do not depend
/// on the number of threads and are summed in order, so the results do not depend on it either.
const PARTS: usize = 4;
const MIN_PART_ROWS: usize = 32;

/// Returns the number of rows per part of a batch; the last part may have fewer.
fn part_rows(batch: usize) -> usize {
    batch.div_ceil(PARTS).max(MIN_PART_ROWS)
}

/// Returns the number of parts of a batch.
pub fn parts_of(batch: usize) -> usize {
    batch.div_ceil(part_rows(batch))
}

/// Returns the rows of a batch that belong to part number `part`.
pub fn rows_of_part(batch: usize, part: usize) -> Range<usize> {
    let size = part_rows(batch);
    part * size..((part + 1) * size).min(batch)
}

/// Finds the table corners that the states and goals of a batch touch, given part by part: in the
/// order of the parts' gradients.
pub fn find_corners<'a>(
    encoder: &Encoder,
    parts: impl Iterator<Item = (&'a [f32], &'a [f32])>,
    touched: &mut TouchedCorners,
) {
    let Some(grid) = encoder.grid() else { return };
    let (s, g) = (encoder.spec().state_dim(), encoder.spec().goal_dim());
    touched.find(grid, |places| {
        for (states, goals) in parts {
            states.chunks_exact(s).for_each(|state| encoder.locate_state(state, places));
            goals.chunks_exact(g).for_each(|goal| encoder.locate_goal(goal, places));
        }
    });
}

/// The rows of a batch that belong to one part.
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
    pub greedy_targets: bool,
    pub relearns: bool,
    /// 1 / batch size.
    pub share: f32,
}

impl<'a> Rows<'a> {
    /// Returns the rows of part number `part`.
    pub fn new(shapes: &Shapes, batch: &'a Batch, part: usize) -> Self {
        let spec = shapes.encoder.spec();
        let rows = rows_of_part(batch.len(), part);
        let cut = |numbers: &'a [f32], width: usize| &numbers[rows.start * width..rows.end * width];
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
            greedy_targets: batch.greedy_targets,
            relearns: batch.relearns,
            share: 1.0 / batch.len() as f32,
        }
    }
}

/// A model mispredicts a step if its squared error, with each component in units of its change
/// scale, exceeds this ...
pub const MISPREDICTED_ERROR: f32 = 0.01;

/// ... and this multiple of the mean over the part of the batch: where steps are random, or nothing
/// has been learned yet, all are off.
pub const MISPREDICTED_FACTOR: f32 = 3.0;

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

/// The sets of positions in a batch: those of its pairs, and those of its transitions.
pub const PAIRS: usize = 0;
pub const TRANSITIONS: usize = 1;

/// Finds the table corners around set number `set` of the batch's positions.
pub fn find_corners_of(set: usize, shapes: &Shapes, batch: &Batch, touched: &mut TouchedCorners) {
    let parts = (0..parts_of(batch.len())).map(|i| Rows::new(shapes, batch, i));
    let parts = parts.map(|rows| match set {
        PAIRS => (rows.states, rows.goals),
        _ => (rows.from, [].as_slice()),
    });
    find_corners(&shapes.encoder, parts, touched);
}
