//! The learner's losses in candle operations with autograd: the oracle for its hand-written
//! gradients, and where to try a change of a loss first.

use candle_core::{D, Device, Result, Tensor, Var, bail};
use candle_nn::{Linear, Module};

use crate::env::MOST_HALF_RANGES;
use crate::learn::data::batch::{
    Batch, RAISE_FACTOR, RAISE_STEPS, STUCK_BOUND, STUCK_PROGRESS_STEPS,
};
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::grid::GridShape;
use crate::learn::networks::lookahead::{BLOCKED_CHANGE, MIN_GAIN_STEPS};
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Network;
use crate::learn::networks::shapes::Shapes;
use crate::learn::settings::LossScale;
use crate::learn::update::losses::{EXCESS_WEIGHT, LARGEST_ERROR, WAY_OUT_WEIGHT};
use crate::learn::update::rows::{mispredicted, parts_of, rows_of_part};

/// A network's parameters as tensors.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// Flat parameters of the MLP.
    pub dense: Tensor,
    /// Values of the grid table, `(corners, channels)`.
    pub table: Option<Tensor>,
}

impl Parameters {
    /// Copies the parameters of a network with the inputs of `encoder`, or their running averages.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub(in crate::learn) fn copied(
        network: &Network,
        encoder: &Encoder,
        averaged: bool,
    ) -> Result<Self> {
        let (dense, table) = network.copy(averaged)?;
        let table = encoder
            .grid()
            .map(|grid| Tensor::from_vec(table, (grid.corners(), grid.channels), &Device::Cpu));
        Ok(Self { dense: Tensor::new(dense, &Device::Cpu)?, table: table.transpose()? })
    }
}

/// Losses of a learner's networks as candle tensors; `backward` yields all gradients.
pub struct Reference<'a> {
    shapes: &'a Shapes,
    critics: Vec<Parameters>,
    model: Parameters,
    actor: Parameters,
}

impl<'a> Reference<'a> {
    /// Creates the losses at the current weights of `networks`: critics, model, actor.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub(in crate::learn) fn new(
        shapes: &'a Shapes,
        networks: impl Iterator<Item = &'a Network>,
    ) -> Result<Self> {
        let networks = networks.map(|network| {
            // The first row of each line holds the values.
            let values = |lines: &Var| lines.narrow(1, 0, 1)?.squeeze(1)?.contiguous();
            let table = network.table().map(values).transpose()?;
            Ok(Parameters { dense: network.dense().as_tensor().clone(), table })
        });
        Self::with_parameters(shapes, networks.collect::<Result<_>>()?)
    }

    /// Creates the losses at given parameters, in the same order.
    pub(in crate::learn) fn with_parameters(
        shapes: &'a Shapes,
        mut networks: Vec<Parameters>,
    ) -> Result<Self> {
        let (Some(actor), Some(model)) = (networks.pop(), networks.pop()) else {
            bail!("too few networks")
        };
        Ok(Self { shapes, critics: networks, model, actor })
    }

    /// Returns D(s, g) by critic `k`, `(rows)`; `states` `(rows, state_dim)`, `goals` `(rows,
    /// goal_dim)`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn distances(&self, k: usize, states: &Tensor, goals: &Tensor) -> Result<Tensor> {
        let critic = &self.critics[k];
        let x = pair_rows(&self.shapes.encoder, critic, states, goals)?;
        let z = mlp(&self.shapes.critic, &critic.dense, &x)?.squeeze(1)?;
        softplus(&z)? * f64::from(self.shapes.distance_scale)
    }

    /// Returns the actions mu(s, g), `(rows, action_dim)`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn actions(&self, states: &Tensor, goals: &Tensor) -> Result<Tensor> {
        self.actor_outputs(states, goals)?.tanh()
    }

    fn actor_outputs(&self, states: &Tensor, goals: &Tensor) -> Result<Tensor> {
        let x = pair_rows(&self.shapes.encoder, &self.actor, states, goals)?;
        mlp(&self.shapes.actor, &self.actor.dense, &x)
    }

    /// Returns the predicted next states f(s, a), `(rows, state_dim)`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn predictions(&self, states: &Tensor, actions: &Tensor) -> Result<Tensor> {
        let encoder = &self.shapes.encoder;
        let u = scaled(encoder, states)?;
        let mut columns = vec![state_row(encoder, &u)?];
        if let (Some(grid), Some(table)) = (encoder.grid(), &self.model.table) {
            columns.push(encode(grid, table, &achieved(encoder, &u)?)?);
        }
        columns.push(actions.clone());
        let change = mlp(&self.shapes.model, &self.model.dense, &Tensor::cat(&columns, 1)?)?;
        states + change.broadcast_mul(&row(&encoder.spec().change_scale, states.device())?)?
    }

    /// Returns the targets of the pairs in a [`Batch`], `(rows)`, with distances and actor steps
    /// computed from these weights.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn targets(&self, batch: &Batch, device: &Device) -> Result<Tensor> {
        let spec = self.shapes.encoder.spec();
        let tensor = |numbers: &[f32], width: usize| {
            Tensor::from_slice(numbers, (batch.len(), width), device)
        };
        let column = |numbers: &[f32]| Tensor::from_slice(numbers, batch.len(), device);
        let (states, ahead) = (
            tensor(&batch.states, spec.state_dim())?,
            tensor(&batch.bootstrap_states, spec.state_dim())?,
        );
        let goals = tensor(&batch.goals, spec.goal_dim())?;
        let steps = column(&batch.steps)?;
        let mut far = (&steps + self.joint_distances(&ahead, &goals)?)?;
        if batch.greedy_targets {
            let next = self.predictions(&states, &self.actions(&states, &goals)?)?;
            let capped = far.minimum(&(self.joint_distances(&next, &goals)? + 1.0)?)?;
            let has_check = self.shapes.model_check;
            far = if has_check {
                self.mispredicted(batch, device)?.where_cond(&far, &capped)?
            } else {
                capped
            };
        }
        let known = column(&batch.bootstrap)?.eq(0.0)?;
        let targets = known.where_cond(&steps, &far)?.minimum(&column(&batch.bound)?)?;
        let mut lower = column(&batch.lower)?;
        if batch.relearns {
            let most = targets.affine(RAISE_FACTOR.into(), RAISE_STEPS.into())?;
            lower = lower.minimum(&most)?;
        }
        Ok(targets.maximum(&lower)?.detach())
    }

    /// Returns 1 where the model mispredicts a pair's own step, otherwise 0, `(rows)`.
    fn mispredicted(&self, batch: &Batch, device: &Device) -> Result<Tensor> {
        let spec = self.shapes.encoder.spec();
        let s = spec.state_dim();
        let tensor = |numbers: &[f32], width: usize| {
            Tensor::from_slice(numbers, (batch.len(), width), device)
        };
        let (from, actions) = (tensor(&batch.from, s)?, tensor(&batch.actions, spec.action_dim)?);
        let errors: Vec<f32> =
            self.squared_model_errors(&from, &actions, &tensor(&batch.next, s)?)?.to_vec1()?;
        let of_part = |part| {
            let rows = rows_of_part(batch.len(), part);
            let at = rows.start * s..rows.end * s;
            mispredicted(&errors[rows], &batch.from[at.clone()], &batch.states[at], s).map(u8::from)
        };
        let found: Vec<u8> = (0..parts_of(batch.len())).flat_map(of_part).collect();
        Tensor::from_vec(found, batch.len(), device)
    }

    /// Returns D(s, g) by one or two critics, `(rows)`: between their mean and their maximum.
    fn joint_distances(&self, states: &Tensor, goals: &Tensor) -> Result<Tensor> {
        let first = self.distances(0, states, goals)?;
        let below = 0.5 * (1.0 - f64::from(self.shapes.pessimism));
        (1..self.critics.len()).try_fold(first, |d, k| {
            let own = self.distances(k, states, goals)?;
            d.maximum(&own)? - ((d - own)?.abs()? * below)?
        })
    }

    /// Returns the loss of critic `k` against `targets` `(rows)`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn critic_loss(
        &self,
        k: usize,
        states: &Tensor,
        goals: &Tensor,
        targets: &Tensor,
    ) -> Result<Tensor> {
        let distance = self.distances(k, states, goals)?;
        let scale = |d: &Tensor| match self.shapes.loss {
            LossScale::Squared => Ok(d.clone()),
            LossScale::Sqrt => (d + 0.25)?.sqrt(),
            LossScale::Log => (d + 1.0)?.log(),
        };
        let error = (scale(&distance)? - scale(targets)?)?;
        let above = error.gt(0.0)?.to_dtype(error.dtype())?;
        let expectile = f64::from(self.shapes.expectile);
        let weight = ((above * (2.0 * expectile - 1.0))? + (1.0 - expectile))?;
        (weight * error.sqr()?)?.mean_all()
    }

    /// Returns the dynamics model's loss, with each component in units of its change scale.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn model_loss(&self, states: &Tensor, actions: &Tensor, next: &Tensor) -> Result<Tensor> {
        let error = self.model_errors(states, actions, next)?;
        // Its derivative is twice the bounded error: quadratic up to the bound, linear beyond.
        let bounded = error.clamp(-LARGEST_ERROR, LARGEST_ERROR)?.detach();
        (&bounded * ((&error * 2.0)? - &bounded)?)?.sum(D::Minus1)?.mean_all()
    }

    /// Returns the squared bounded errors of the predictions, `(rows)`.
    fn squared_model_errors(
        &self,
        states: &Tensor,
        actions: &Tensor,
        next: &Tensor,
    ) -> Result<Tensor> {
        let errors = self.model_errors(states, actions, next)?;
        errors.clamp(-LARGEST_ERROR, LARGEST_ERROR)?.sqr()?.sum(D::Minus1)
    }

    /// Returns the errors of the predictions, `(rows, state_dim)`, with each component in units of
    /// its change scale.
    fn model_errors(&self, states: &Tensor, actions: &Tensor, next: &Tensor) -> Result<Tensor> {
        let scale =
            row(&zero_to_infinity(&self.shapes.encoder.spec().change_scale), states.device())?;
        (self.predictions(states, actions)? - next)?.broadcast_div(&scale)
    }

    /// Returns the actor's loss, mean D(f(s, mu(s, g)), w) by the first critic with `weights`
    /// `(rows)` (see [`Batch::actor_weights`]), and separately the
    /// weighted squared excess of its outputs over their bound, which is lower for a stuck actor if
    /// `frees_stuck` (see [`Batch::relearns`]). Where the actor is blocked and lookahead
    /// finds a way out, the former has no gradient, and the latter is the weighted squared
    /// difference from that action's outputs.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn actor_loss(
        &self,
        states: &Tensor,
        [goals, towards, weights]: [&Tensor; 3],
        frees_stuck: bool,
    ) -> Result<(Tensor, Tensor)> {
        let own_outputs = self.actor_outputs(states, goals)?;
        let next = self.predictions(states, &own_outputs.tanh()?)?;
        let after = self.distances(0, &next, towards)?;
        let outputs = own_outputs.abs()?;
        let bound = self.shapes.actor_bound;
        let excess = if frees_stuck {
            let progress = (self.distances(0, states, towards)? - &after)?.detach();
            let full = |value: f32| Tensor::full(value, progress.shape(), progress.device());
            let stuck = progress.lt(f64::from(STUCK_PROGRESS_STEPS))?;
            outputs.broadcast_sub(
                &stuck.where_cond(&full(bound.min(STUCK_BOUND))?, &full(bound)?)?.unsqueeze(1)?,
            )?
        } else {
            (outputs - f64::from(bound))?
        };
        let excess = (excess.relu()?.sqr()?.sum(D::Minus1)? * f64::from(EXCESS_WEIGHT))?;
        let weighted = (&after * weights)?;
        if !self.shapes.unblock_actor {
            return Ok((weighted.mean_all()?, excess.mean_all()?));
        }
        let (found, ways) = self.ways_out(states, towards, &next, &after)?;
        let found = (found * weights.gt(0.0)?)?;
        let off = (own_outputs - ways)?.sqr()?.sum(D::Minus1)?;
        let excess = found.where_cond(&(off * f64::from(WAY_OUT_WEIGHT))?, &excess)?;
        let loss = found.where_cond(&weighted.detach(), &weighted)?;
        Ok((loss.mean_all()?, excess.mean_all()?))
    }

    /// Returns where the actor's action is blocked and lookahead finds a way out, `(rows)`, and the
    /// outputs before tanh that lead there, `(rows, action_dim)`: `next` `(rows, state_dim)` and
    /// `after` `(rows)` follow the actor's action.
    fn ways_out(
        &self,
        states: &Tensor,
        towards: &Tensor,
        next: &Tensor,
        after: &Tensor,
    ) -> Result<(Tensor, Tensor)> {
        let (shapes, device) = (self.shapes, states.device());
        let spec = shapes.encoder.spec();
        let scale = row(&spec.change_scale, device)?.affine(f64::from(BLOCKED_CHANGE), 0.0)?;
        let moved = (next - states)?
            .abs()?
            .broadcast_gt(&scale)?
            .to_dtype(after.dtype())?
            .sum(D::Minus1)?;
        let (rows, a) = (states.dim(0)?, spec.action_dim);
        let enough = (after - f64::from(MIN_GAIN_STEPS))?.detach();
        let mut shortest = enough.clone();
        let mut ways = Tensor::zeros((rows, a), after.dtype(), device)?;
        for tried in shapes.tried_actions.chunks_exact(a) {
            let outputs: Vec<f32> =
                tried.iter().map(|action| shapes.way_out_output(*action)).collect();
            let actions = row(tried, device)?.broadcast_as((rows, a))?.contiguous()?;
            let distances =
                self.distances(0, &self.predictions(states, &actions)?, towards)?.detach();
            let better = distances.lt(&shortest)?;
            shortest = shortest.minimum(&distances)?;
            let outputs = row(&outputs, device)?.broadcast_as((rows, a))?.contiguous()?;
            ways = better.unsqueeze(1)?.broadcast_as((rows, a))?.where_cond(&outputs, &ways)?;
        }
        Ok((shortest.lt(&enough)?.mul(&moved.eq(0.0)?)?, ways))
    }
}

/// Returns the rows that a network reads of pairs, `(rows, pair_width)`.
pub(in crate::learn) fn pair_rows(
    encoder: &Encoder,
    network: &Parameters,
    states: &Tensor,
    goals: &Tensor,
) -> Result<Tensor> {
    let (u, v) = (scaled(encoder, states)?, scaled_goals(encoder, goals)?);
    let mut columns = vec![state_row(encoder, &u)?, v.clone()];
    if encoder.octaves() > 0 {
        columns.push(fourier(encoder, &v)?);
    }
    if !encoder.relative().is_empty() {
        let difference = (goals - achieved(encoder, states)?)?;
        for axis in 0..encoder.spec().goal_dim() {
            let d = difference.narrow(1, axis, 1)?;
            let rates =
                Tensor::from_slice(encoder.relative(), (1, encoder.relative().len()), d.device())?;
            columns.push(d.broadcast_mul(&rates)?.tanh()?);
        }
    }
    if let (Some(grid), Some(table)) = (encoder.grid(), &network.table) {
        columns.push(encode(grid, table, &achieved(encoder, &u)?)?);
        columns.push(encode(grid, table, &v)?);
    }
    Tensor::cat(&columns, 1)
}

fn row(values: &[f32], device: &Device) -> Result<Tensor> {
    Tensor::from_slice(values, (1, values.len()), device)
}

/// Returns scales to divide by, with 0 replaced by infinity so that constant components become 0.
fn zero_to_infinity(scales: &[f32]) -> Vec<f32> {
    scales.iter().map(|scale| if *scale > 0.0 { *scale } else { f32::INFINITY }).collect()
}

fn scaled(encoder: &Encoder, states: &Tensor) -> Result<Tensor> {
    let (spec, device) = (encoder.spec(), states.device());
    let half_range = row(&zero_to_infinity(&spec.state_half_range), device)?;
    let scaled = states.broadcast_sub(&row(&spec.state_centre, device)?)?;
    scaled.broadcast_div(&half_range)?.clamp(-MOST_HALF_RANGES, MOST_HALF_RANGES)
}

fn scaled_goals(encoder: &Encoder, goals: &Tensor) -> Result<Tensor> {
    let spec = encoder.spec();
    let of = |values: &[f32]| {
        row(&spec.achieved.iter().map(|i| values[*i]).collect::<Vec<_>>(), goals.device())
    };
    goals
        .broadcast_sub(&of(&spec.state_centre)?)?
        .broadcast_div(&of(&zero_to_infinity(&spec.state_half_range))?)?
        .clamp(-MOST_HALF_RANGES, MOST_HALF_RANGES)
}

fn achieved(encoder: &Encoder, states: &Tensor) -> Result<Tensor> {
    let indices: Vec<u32> = encoder.spec().achieved.iter().map(|i| *i as u32).collect();
    states.index_select(&Tensor::new(indices, states.device())?, 1)
}

fn state_row(encoder: &Encoder, u: &Tensor) -> Result<Tensor> {
    if encoder.octaves() == 0 {
        return Ok(u.clone());
    }
    Tensor::cat(&[u, &fourier(encoder, &achieved(encoder, u)?)?], 1)
}

fn fourier(encoder: &Encoder, u: &Tensor) -> Result<Tensor> {
    let mut columns = Vec::new();
    for axis in 0..u.dim(1)? {
        for octave in 0..encoder.octaves() {
            let angle =
                (u.narrow(1, axis, 1)? * (std::f64::consts::PI * f64::from(1u32 << octave)))?;
            columns.extend([angle.sin()?, angle.cos()?]);
        }
    }
    Tensor::cat(&columns, 1)
}

/// Returns the grid encoding by indexing and interpolation, `(rows, levels * channels)`.
fn encode(grid: &GridShape, table: &Tensor, u: &Tensor) -> Result<Tensor> {
    let mut columns = Vec::new();
    for level in &grid.levels {
        let span = (level.corners - 1) as f64;
        let at = (((u + 1.0)? * 0.5)?.clamp(0.0, 1.0)? * span)?;
        let lower = at.floor()?.clamp(0.0, span - 1.0)?.detach();
        let share = (at - &lower)?;
        let mut sum: Option<Tensor> = None;
        for bits in 0..1usize << grid.dims {
            let mut index = lower.narrow(1, 0, 1)?.zeros_like()?;
            let mut weight = index.ones_like()?;
            let mut stride = 1.0;
            for axis in 0..grid.dims {
                let upper = bits >> axis & 1;
                let share = share.narrow(1, axis, 1)?;
                weight = (weight * if upper == 1 { share } else { (1.0 - share)? })?;
                index = (index + ((lower.narrow(1, axis, 1)? + upper as f64)? * stride)?)?;
                stride *= level.corners as f64;
            }
            let index =
                (index + level.first as f64)?.squeeze(1)?.to_dtype(candle_core::DType::U32)?;
            let read = table.index_select(&index, 0)?.broadcast_mul(&weight)?;
            sum = Some(match sum {
                Some(sum) => (sum + read)?,
                None => read,
            });
        }
        columns.extend(sum);
    }
    Tensor::cat(&columns, 1)
}

/// Returns an MLP's outputs by candle-nn's layers.
pub(in crate::learn) fn mlp(shape: &Mlp, parameters: &Tensor, x: &Tensor) -> Result<Tensor> {
    let part = |range: std::ops::Range<usize>| parameters.narrow(0, range.start, range.len());
    let mut h = x.clone();
    for layer in 0..shape.layers {
        let w = part(shape.weights(layer))?.reshape((shape.layer_inputs(layer), shape.hidden))?;
        h = Linear::new(w.t()?, Some(part(shape.bias(layer))?)).forward(&h)?.relu()?;
    }
    let w = part(shape.output_weights())?.reshape((shape.outputs, shape.hidden))?;
    Linear::new(w, Some(part(shape.output_bias())?)).forward(&h)
}

/// Returns ln(1 + e^z) without overflow.
fn softplus(z: &Tensor) -> Result<Tensor> {
    z.relu()? + (z.abs()?.neg()?.exp()? + 1.0)?.log()?
}
