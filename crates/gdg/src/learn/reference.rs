//! The learners' losses in plain arithmetic, in f64 and row by row: what hand-written gradients are
//! compared with, and where to try a change of a loss first.

use std::f64::consts::PI;

use crate::env::Spec;
use crate::learn::data::batch::{
    Batch, RAISE_FACTOR, RAISE_STEPS, STUCK_BOUND, STUCK_PROGRESS_STEPS,
};
use crate::learn::networks::encoder::CONTACT_SCALES;
use crate::learn::networks::grid_encoding::CHANNELS;
use crate::learn::networks::lookahead::{BLOCKED_CHANGE, MIN_GAIN_STEPS};
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Network;
use crate::learn::networks::shapes::Shapes;
use crate::learn::settings::LossScale;
use crate::learn::update::actor::{EXCESS_WEIGHT, WAY_OUT_WEIGHT};
use crate::learn::update::losses::LARGEST_ERROR;
use crate::learn::update::parts::{mispredicted, parts_of, rows_of_part};
use crate::learn::update::trained_networks::Training;

type Vector = Vec<f64>;

/// A network's flat parameters and grid table.
#[derive(Clone, Default)]
pub struct Net(pub [Vector; 2]);

impl Net {
    pub fn copied(network: &Network, averaged: bool) -> Self {
        let (dense, table) = network.copy(averaged).expect("weights");
        Self([dense, table.unwrap_or_default()].map(|part| wide(&part)))
    }
}

pub fn wide(numbers: &[f32]) -> Vector {
    numbers.iter().map(|number| f64::from(*number)).collect()
}

fn row(numbers: &[f32], i: usize, width: usize) -> Vector {
    wide(&numbers[i * width..(i + 1) * width])
}

pub fn mlp(shape: &Mlp, parameters: &[f64], x: &[f64]) -> Vector {
    let mut h = x.to_vec();
    for layer in 0..shape.layers {
        let (w, bias) = (&parameters[shape.weights(layer)], &parameters[shape.bias(layer)]);
        let mut sums = bias.to_vec();
        for (h, w) in h.iter().zip(w.chunks_exact(shape.hidden)) {
            sums.iter_mut().zip(w).for_each(|(sum, w)| *sum += h * w);
        }
        h = sums.into_iter().map(|sum| sum.max(0.0)).collect();
    }
    let w = parameters[shape.output_weights()].chunks_exact(shape.hidden);
    let outputs = w.zip(&parameters[shape.output_bias()]);
    outputs.map(|(w, b)| b + w.iter().zip(&h).map(|(w, h)| w * h).sum::<f64>()).collect()
}

fn softplus(z: f64) -> f64 {
    z.max(0.0) + (-z.abs()).exp().ln_1p()
}

/// What the actor is pulled to in one row: its bound, and the outputs of a way out.
pub type Pull = (f64, Option<Vector>);

/// Networks by their weights.
pub struct Reference<'a> {
    shapes: &'a Shapes,
    pub critics: Vec<Net>,
    pub model: Net,
    pub actor: Net,
}

impl<'a> Reference<'a> {
    /// Copies a learner's weights, or their averages.
    pub fn of(training: &'a Training, averaged: bool) -> Self {
        let shapes = training.shapes();
        let mut nets: Vec<Net> =
            training.named().map(|(_, network)| Net::copied(network, averaged)).collect();
        let actor = nets.pop().expect("an actor");
        let model = nets.get(shapes.critics).cloned().unwrap_or_default();
        nets.truncate(shapes.critics);
        Self { shapes, critics: nets, model, actor }
    }

    fn spec(&self) -> &Spec {
        &self.shapes.encoder.spec
    }

    fn scaled(&self, i: usize, value: f64) -> f64 {
        let spec = self.spec();
        let half = f64::from(spec.state_half_range[i]);
        let scaled = (value - f64::from(spec.state_centre[i])) / half;
        if half > 0.0 { scaled.clamp(-10.0, 10.0) } else { 0.0 }
    }

    /// Returns the Fourier features and, apart from them, the grid encoding of a scaled position.
    fn features(&self, net: &Net, u: &[f64]) -> [Vector; 2] {
        let octaves = 0..self.shapes.encoder.octaves as i32;
        let angles = u.iter().flat_map(|u| octaves.clone().map(move |l| PI * 2f64.powi(l) * u));
        let fourier = angles.flat_map(|angle| [angle.sin(), angle.cos()]).collect();
        let mut encoded = Vec::new();
        for level in self.shapes.encoder.grid.iter().flat_map(|grid| &grid.levels) {
            let mut sums = [0.0; CHANNELS];
            for bits in 0..1usize << u.len() {
                let (mut corner, mut weight, mut stride) = (level.first, 1.0, 1);
                for (axis, u) in u.iter().enumerate() {
                    let last = level.corners - 1;
                    let at = ((u + 1.0) * 0.5).clamp(0.0, 1.0) * last as f64;
                    let lower = (at as usize).min(last - 1);
                    let (upper, share) = (bits >> axis & 1, at - lower as f64);
                    weight *= if upper == 1 { share } else { 1.0 - share };
                    corner += (lower + upper) * stride;
                    stride *= level.corners;
                }
                let values = &net.0[1][corner * CHANNELS..][..CHANNELS];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
            }
            encoded.extend(sums);
        }
        [fourier, encoded]
    }

    /// Returns the inputs of a state, with and without those that depend on the network, and its
    /// scaled position.
    fn state_inputs(&self, net: &Net, state: &[f64]) -> [Vector; 2] {
        let u: Vector = state.iter().enumerate().map(|(i, s)| self.scaled(i, *s)).collect();
        let at: Vector = self.spec().achieved.iter().map(|i| u[*i]).collect();
        let [fourier, encoded] = self.features(net, &at);
        let contacts = self.spec().contacts.iter().flat_map(|contact| {
            let [slope, offset, width] =
                [contact.slope, contact.offset, contact.width].map(f64::from);
            let apart = (state[contact.other] - slope * state[contact.goal] - offset) / width;
            CONTACT_SCALES.map(|c| (apart / f64::from(c)).tanh())
        });
        [[u, fourier, contacts.collect()].concat(), encoded]
    }

    fn pair_inputs(&self, net: &Net, state: &[f64], goal: &[f64]) -> Vector {
        let achieved = &self.spec().achieved;
        let [of_state, at_state] = self.state_inputs(net, state);
        let w: Vector = achieved.iter().zip(goal).map(|(i, g)| self.scaled(*i, *g)).collect();
        let [fourier, at_goal] = self.features(net, &w);
        let rates = &self.shapes.encoder.relative;
        let offsets = achieved.iter().zip(goal).flat_map(|(i, g)| {
            rates.iter().map(move |rate| ((g - state[*i]) * f64::from(*rate)).tanh())
        });
        [of_state, w, fourier, offsets.collect(), at_state, at_goal].concat()
    }

    /// Returns D(s, g) by a critic.
    pub fn distance(&self, critic: &Net, state: &[f64], goal: &[f64]) -> f64 {
        let x = self.pair_inputs(critic, state, goal);
        f64::from(self.shapes.distance_scale)
            * softplus(mlp(&self.shapes.critic, &critic.0[0], &x)[0])
    }

    /// Returns D(s, g) by one or two critics: between their mean and their maximum.
    pub fn joint_distance(&self, state: &[f64], goal: &[f64]) -> f64 {
        let own = self.critics.iter().map(|critic| self.distance(critic, state, goal));
        let below = 0.5 * (1.0 - f64::from(self.shapes.pessimism));
        own.reduce(|a, b| a.max(b) - below * (a - b).abs()).expect("a critic")
    }

    fn value(&self, critic: &Net, state: &[f64], action: &[f64], goal: &[f64]) -> f64 {
        let x = [self.pair_inputs(critic, state, goal), action.to_vec()].concat();
        mlp(&self.shapes.critic, &critic.0[0], &x)[0]
    }

    /// Returns the actor's outputs before tanh.
    fn outputs(&self, actor: &Net, state: &[f64], goal: &[f64]) -> Vector {
        mlp(&self.shapes.actor, &actor.0[0], &self.pair_inputs(actor, state, goal))
    }

    pub fn action(&self, state: &[f64], goal: &[f64]) -> Vector {
        self.outputs(&self.actor, state, goal).into_iter().map(f64::tanh).collect()
    }

    /// Returns f(s, a) by a model.
    pub fn prediction(&self, model: &Net, state: &[f64], action: &[f64]) -> Vector {
        let [plain, encoded] = self.state_inputs(model, state);
        let x = [plain, encoded, action.to_vec()].concat();
        let change = mlp(&self.shapes.model, &model.0[0], &x).into_iter();
        let scales = wide(&self.spec().change_scale);
        change.zip(scales).zip(state).map(|((z, scale), s)| s + z * scale).collect()
    }

    fn state_and_goals(&self, batch: &Batch, i: usize) -> [Vector; 3] {
        let (s, g) = (self.spec().state_dim(), self.spec().goal_dim());
        [row(&batch.states, i, s), row(&batch.goals, i, g), row(&batch.actor_goals, i, g)]
    }

    /// Returns the targets of a batch; these networks are the averaged ones.
    pub fn targets(&self, batch: &Batch) -> Vector {
        let (s, a) = (self.spec().state_dim(), self.spec().action_dim);
        let errors = |i: usize| {
            let errors = self.model_errors(&self.model, batch, i);
            errors.map(|(_, bounded)| (bounded * bounded) as f32).sum()
        };
        let left_out: Vec<bool> = (0..parts_of(batch.len()))
            .filter(|_| batch.greedy_targets && self.shapes.returns.is_none())
            .flat_map(|part| {
                let rows = rows_of_part(batch.len(), part);
                let at = rows.start * s..rows.end * s;
                let errors: Vec<f32> = rows.map(errors).collect();
                let left_out = mispredicted(&errors, &batch.from[at.clone()], &batch.states[at], s);
                left_out.collect::<Vec<bool>>()
            })
            .collect();
        let target = |i: usize| {
            let [state, goal, _] = self.state_and_goals(batch, i);
            let (ahead, is_end) = (row(&batch.bootstrap_states, i, s), batch.bootstrap[i] == 0.0);
            if let Some(returns) = &self.shapes.returns {
                let noisy = self.action(&ahead, &goal).into_iter().zip(row(&batch.noise, i, a));
                let action: Vector = noisy.map(|(a, noise)| (a + noise).clamp(-1.0, 1.0)).collect();
                let values = self.critics.iter().map(|c| self.value(c, &ahead, &action, &goal));
                let least = values.fold(f64::INFINITY, f64::min);
                let rest = if is_end { 0.0 } else { f64::from(returns.discount) * least };
                return (f64::from(batch.rewards[i]) + rest).clamp(returns.lowest.into(), 0.0);
            }
            let mut target = f64::from(batch.steps[i]);
            if !is_end {
                target += self.joint_distance(&ahead, &goal);
                if batch.greedy_targets && !(self.shapes.model_check && left_out[i]) {
                    let next = self.prediction(&self.model, &state, &self.action(&state, &goal));
                    target = target.min(1.0 + self.joint_distance(&next, &goal));
                } else if batch.greedy_targets && !batch.relearns {
                    target = target.min(self.joint_distance(&state, &goal));
                }
            }
            target = target.min(batch.bound[i].into());
            let raised = f64::from(RAISE_FACTOR) * target + f64::from(RAISE_STEPS);
            let most = if batch.relearns { raised } else { f64::INFINITY };
            target.max(f64::from(batch.lower[i]).min(most))
        };
        (0..batch.len()).map(target).collect()
    }

    pub fn critic_loss(&self, critic: &Net, batch: &Batch, targets: &[f64]) -> f64 {
        let scale = |d: f64| match self.shapes.loss {
            LossScale::Squared => d,
            LossScale::Sqrt => (d + 0.25).sqrt(),
            LossScale::Log => d.ln_1p(),
        };
        let loss = |(i, target): (usize, &f64)| {
            let [state, goal, _] = self.state_and_goals(batch, i);
            if self.shapes.returns.is_some() {
                let action = row(&batch.actions, i, self.spec().action_dim);
                return (self.value(critic, &state, &action, &goal) - target).powi(2);
            }
            let error = scale(self.distance(critic, &state, &goal)) - scale(*target);
            let expectile = f64::from(self.shapes.expectile);
            (if error > 0.0 { expectile } else { 1.0 - expectile }) * error * error
        };
        targets.iter().enumerate().map(loss).sum::<f64>() / batch.len() as f64
    }

    /// Returns the errors of a prediction in units of change scales, each also bounded.
    fn model_errors(
        &self,
        model: &Net,
        batch: &Batch,
        i: usize,
    ) -> impl Iterator<Item = (f64, f64)> {
        let (s, most) = (self.spec().state_dim(), f64::from(LARGEST_ERROR));
        let action = row(&batch.actions, i, self.spec().action_dim);
        let predicted = self.prediction(model, &row(&batch.from, i, s), &action).into_iter();
        let errors = predicted.zip(row(&batch.next, i, s)).zip(wide(&self.spec().change_scale));
        errors.map(move |((p, n), scale)| {
            let error = if scale > 0.0 { (p - n) / scale } else { 0.0 };
            (error, error.clamp(-most, most))
        })
    }

    pub fn model_loss(&self, model: &Net, batch: &Batch) -> f64 {
        let errors = (0..batch.len()).flat_map(|i| self.model_errors(model, batch, i));
        errors.map(|(error, bounded)| bounded * (2.0 * error - bounded)).sum::<f64>()
            / batch.len() as f64
    }

    /// Returns what the actor is pulled to in each row: bounds are lower for a stuck actor, and there
    /// are ways out where it is blocked.
    pub fn pulls(&self, batch: &Batch) -> Vec<Pull> {
        let Shapes { actor_bound, tried_actions, unblock_actor, .. } = self.shapes;
        let (spec, bound) = (self.spec(), f64::from(*actor_bound));
        let pull = |i: usize| {
            let Some(critic) = self.critics.first().filter(|_| self.shapes.returns.is_none())
            else {
                return (bound, None);
            };
            let [state, goal, towards] = self.state_and_goals(batch, i);
            let next = self.prediction(&self.model, &state, &self.action(&state, &goal));
            let after = self.distance(critic, &next, &towards);
            let progress = self.distance(critic, &state, &towards) - after;
            let is_stuck = batch.relearns && progress < f64::from(STUCK_PROGRESS_STEPS);
            let bound = if is_stuck { bound.min(STUCK_BOUND.into()) } else { bound };
            let mut changes = next.iter().zip(&state).zip(wide(&spec.change_scale));
            let is_blocked =
                changes.all(|((n, s), scale)| (n - s).abs() <= f64::from(BLOCKED_CHANGE) * scale);
            let mut way = (after - f64::from(MIN_GAIN_STEPS), None);
            if is_blocked && *unblock_actor && batch.actor_weights[i] > 0.0 {
                for tried in tried_actions.chunks_exact(spec.action_dim) {
                    let there = self.prediction(&self.model, &state, &wide(tried));
                    let distance = self.distance(critic, &there, &towards);
                    if distance < way.0 {
                        let outputs = tried.iter().map(|a| self.shapes.way_out_output(*a).into());
                        way = (distance, Some(outputs.collect()));
                    }
                }
            }
            (bound, way.1)
        };
        (0..batch.len()).map(pull).collect()
    }

    /// Returns an actor's loss, mean D(f(s, mu(s, g)), w) or mean -Q(s, mu(s, g), g), and all that it
    /// minimises: rows with a way out do not descend the former.
    pub fn actor_loss(&self, actor: &Net, batch: &Batch, pulls: &[Pull]) -> [f64; 2] {
        let spec = self.spec();
        let mut sums = [0.0; 2];
        for (i, (bound, way)) in pulls.iter().enumerate() {
            let [state, goal, towards] = self.state_and_goals(batch, i);
            let z = self.outputs(actor, &state, &goal);
            let action: Vector = z.iter().map(|z| z.tanh()).collect();
            let excess: f64 = z.iter().map(|z| (z.abs() - bound).max(0.0).powi(2)).sum();
            let mut pull = f64::from(EXCESS_WEIGHT) * excess;
            let cost = if self.shapes.returns.is_some() {
                let squares = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
                pull += f64::from(self.shapes.actor_l2) * squares;
                -self.value(&self.critics[0], &state, &action, &goal)
            } else {
                let next = self.prediction(&self.model, &state, &action);
                let left = || {
                    let off = spec.achieved.iter().zip(&towards).map(|(i, g)| next[*i] - g);
                    let length = off.map(|off| off * off).sum::<f64>().sqrt();
                    length / f64::from(self.shapes.step_length)
                };
                let weight = f64::from(batch.actor_weights[i]);
                let distance = |critic| weight * self.distance(critic, &next, &towards);
                self.critics.first().map_or_else(left, distance)
            };
            sums[0] += cost;
            sums[1] += match way {
                None => cost + pull,
                Some(way) => {
                    let off = z.iter().zip(way).map(|(z, way)| (z - way).powi(2)).sum::<f64>();
                    f64::from(WAY_OUT_WEIGHT) * off
                }
            };
        }
        sums.map(|sum| sum / batch.len() as f64)
    }
}
