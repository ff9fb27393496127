//! One part of a batch, and what one thread computes from it.

use crate::learn::data::batch::Batch;
use crate::learn::networks::network::Weights;
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::update::features::{Pairs, SharedFeatures};
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::{Losses, Shapes, Workspaces};

/// Number of parts that a batch is split into, and minimum rows per part. The parts do not depend on the number of
/// threads and are summed in order, so the results do not depend on it either.
const PARTS: usize = 4;
const MIN_PART_ROWS: usize = 32;

/// Returns the number of rows per part of a batch; the last part may have fewer.
pub fn part_rows(batch: usize) -> usize {
    batch.div_ceil(PARTS).max(MIN_PART_ROWS)
}

/// Buffers of one task of an update.
#[derive(Default)]
pub struct Part {
    pub plain: SharedFeatures,
    plain_ahead: SharedFeatures,
    targets: Vec<f32>,
    after_actor: Vec<f32>,
    pub critics: Vec<Gradient>,
    pub model: Gradient,
    pub actor: Gradient,
    pub buffers: Workspaces,
    pub losses: Losses,
}

impl Part {
    /// Creates buffers for `critics` critics.
    pub fn new(critics: usize) -> Self {
        Self { critics: vec![Gradient::default(); critics], ..Self::default() }
    }

    /// Computes the targets of the part's rows: d if the goal was reached, otherwise d + D'(s', g), capped at 1 +
    /// D'(f(s, mu'(s, g)), g) (see [`crate::learn::LearnSettings::greedy_targets`]). Both are kept within the
    /// bounds that hindsight or the bridge graph give. D' and mu' use running averages.
    pub fn targets(&mut self, shapes: &Shapes, rows: &Rows, (actor, model, critics): (Weights, Weights, &[Weights])) {
        shapes.encoder.plain_pairs(rows.states, rows.goals, &mut self.plain);
        shapes.encoder.plain_pairs(rows.bootstrap_states, rows.goals, &mut self.plain_ahead);
        self.targets.resize(rows.steps.len(), 0.0);
        let ahead = Pairs { plain: &self.plain_ahead, states: rows.bootstrap_states, goals: rows.goals };
        shapes.max_distances(critics, ahead, &mut self.targets, &mut self.buffers.critic);
        self.targets.iter_mut().zip(rows.steps).for_each(|(x, d)| *x += d);
        if rows.greedy_targets {
            self.after_actor.resize(rows.steps.len(), 0.0);
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let buffers = &mut self.buffers;
            shapes.distances_after_actor((actor, model, critics), pairs, &mut self.after_actor, buffers);
            self.targets.iter_mut().zip(&self.after_actor).for_each(|(x, d)| *x = x.min(1.0 + d));
        }
        for (i, x) in self.targets.iter_mut().enumerate() {
            let known = rows.bootstrap[i] == 0.0;
            *x = if known { rows.steps[i] } else { *x }.min(rows.bound[i]).max(rows.lower[i]);
        }
    }

    /// Computes each critic's gradient towards the targets.
    pub fn critic_gradients(&mut self, shapes: &Shapes, rows: &Rows, critics: &[Weights]) {
        self.losses.critic = 0.0;
        for (critic, gradient) in critics.iter().zip(&mut self.critics) {
            gradient.prepare(shapes.critic.parameters());
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let loss =
                shapes.critic_gradient(*critic, pairs, &self.targets, rows.share, gradient, &mut self.buffers.critic);
            self.losses.critic += loss / critics.len() as f32;
        }
    }
}

/// Finds the table corners that the batch's pairs touch, in the order of the parts' gradients.
pub fn find_corners_of_pairs(shapes: &Shapes, batch: &Batch, parts: usize, touched: &mut TouchedCorners) {
    let encoder = &shapes.encoder;
    let Some(grid) = encoder.grid() else { return };
    let (s, g) = (encoder.spec().state_dim(), encoder.spec().goal_dim());
    touched.find(grid, |places| {
        for rows in (0..parts).map(|i| Rows::new(shapes, batch, i)) {
            rows.states.chunks_exact(s).for_each(|state| encoder.locate_state(state, places));
            rows.goals.chunks_exact(g).for_each(|goal| encoder.locate_goal(goal, places));
        }
    });
}

/// Finds the table corners that the batch's transitions touch, in the order of the parts' gradients.
pub fn find_corners_of_transitions(shapes: &Shapes, batch: &Batch, parts: usize, touched: &mut TouchedCorners) {
    let encoder = &shapes.encoder;
    let Some(grid) = encoder.grid() else { return };
    touched.find(grid, |places| {
        for rows in (0..parts).map(|i| Rows::new(shapes, batch, i)) {
            let states = rows.from.chunks_exact(encoder.spec().state_dim());
            states.for_each(|state| encoder.locate_state(state, places));
        }
    });
}

/// The rows of a batch that belong to one part.
pub struct Rows<'a> {
    pub states: &'a [f32],
    pub goals: &'a [f32],
    bootstrap_states: &'a [f32],
    steps: &'a [f32],
    bootstrap: &'a [f32],
    bound: &'a [f32],
    lower: &'a [f32],
    pub from: &'a [f32],
    pub actions: &'a [f32],
    pub next: &'a [f32],
    greedy_targets: bool,
    pub frees_stuck_actor: bool,
    /// 1 / batch size.
    pub share: f32,
}

impl<'a> Rows<'a> {
    /// Returns the rows of part number `part`.
    pub fn new(shapes: &Shapes, batch: &'a Batch, part: usize) -> Self {
        let spec = shapes.encoder.spec();
        let size = part_rows(batch.len());
        let rows = part * size..((part + 1) * size).min(batch.len());
        let cut = |numbers: &'a [f32], width: usize| &numbers[rows.start * width..rows.end * width];
        let (s, g) = (spec.state_dim(), spec.goal_dim());
        Self {
            states: cut(&batch.states, s),
            goals: cut(&batch.goals, g),
            bootstrap_states: cut(&batch.bootstrap_states, s),
            steps: cut(&batch.steps, 1),
            bootstrap: cut(&batch.bootstrap, 1),
            bound: cut(&batch.bound, 1),
            lower: cut(&batch.lower, 1),
            from: cut(&batch.from, s),
            actions: cut(&batch.actions, spec.action_dim),
            next: cut(&batch.next, s),
            greedy_targets: batch.greedy_targets,
            frees_stuck_actor: batch.frees_stuck_actor,
            share: 1.0 / batch.len() as f32,
        }
    }
}
