//! Updates on candle's autograd tape: the same losses, averages and steps as the learner's own
//! kernels; slower, but easy to change.

use std::ops::Range;

use candle_core::{Device, Result, Tensor, Var, bail};

use crate::learn::data::batch::Batch;
use crate::learn::kernels::kernel::{AdamRate, BETA};
use crate::learn::networks::adam::LearningRates;
use crate::learn::networks::adam::adam_rate;
use crate::learn::networks::dense::NetworkState;
use crate::learn::networks::network::Network;
use crate::learn::networks::shapes::Shapes;
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::settings::Backend;
use crate::learn::update::losses::Losses;
use crate::learn::update::reference::{Layers, Parameters, Reference};
use crate::learn::update::rows::{PAIRS, TRANSITIONS, find_corners_of};

/// Copies of all networks, trained on the tape.
pub struct Tape {
    /// Critics, model, actor.
    networks: Vec<TapeNetwork>,
}

/// Checks the backend of a learner that has no losses on a tape.
///
/// # Errors
/// `backend` is not the fused one.
pub fn refuse_tape(backend: Backend, learner: &str) -> Result<()> {
    if backend != Backend::Fused {
        bail!("the learner {learner} needs backend=fused");
    }
    Ok(())
}

/// A network's copy.
struct TapeNetwork {
    dense: TapeParameters,
    /// Values `(corners, channels)`.
    table: Option<TapeParameters>,
}

/// Parameters with their moments and average.
struct TapeParameters {
    values: Var,
    m: Tensor,
    v: Tensor,
    average: Option<Tensor>,
}

impl Tape {
    /// Copies `networks` (critics, model, actor); returns `None` for the learner's own kernels.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn new<'a>(
        backend: Backend,
        networks: impl Iterator<Item = &'a Network>,
    ) -> Result<Option<Self>> {
        match backend {
            Backend::Fused => Ok(None),
            Backend::Tape => {
                Ok(Some(Self { networks: networks.map(TapeNetwork::new).collect::<Result<_>>()? }))
            }
        }
    }

    /// Performs one update, like [`crate::learn::Gdg::update_on`]; `steps` is its number, from 1.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn update(
        &mut self,
        shapes: &Shapes,
        batch: &Batch,
        steps: u64,
        rates: LearningRates,
    ) -> Result<Losses> {
        let spec = shapes.encoder.spec();
        let tensor = |numbers: &[f32], width: usize| {
            Tensor::from_slice(numbers, (numbers.len() / width, width), &Device::Cpu)
        };
        let (s, g) = (spec.state_dim(), spec.goal_dim());
        let (states, goals) = (tensor(&batch.states, s)?, tensor(&batch.goals, g)?);
        let towards = tensor(&batch.actor_goals, g)?;
        let weights = Tensor::from_slice(&batch.actor_weights, batch.len(), &Device::Cpu)?;
        let (from, next) = (tensor(&batch.from, s)?, tensor(&batch.next, s)?);
        let actions = tensor(&batch.actions, spec.action_dim)?;
        let critics = 0..self.networks.len() - 2;
        let (model, actor) = (critics.end, critics.end + 1);
        let [of_pairs, of_transitions] =
            [PAIRS, TRANSITIONS].map(|set| corners_read(set, shapes, batch));
        let (of_pairs, of_transitions) = (of_pairs?, of_transitions?);

        let targets = self.reference(shapes, true)?.targets(batch, &Device::Cpu)?;
        let now = self.reference(shapes, false)?;
        let mut critic_losses = Vec::new();
        for k in critics.clone() {
            critic_losses.push(now.critic_loss(k, &states, &goals, &targets)?);
        }
        let critic_loss = Tensor::stack(&critic_losses, 0)?.sum_all()?;
        let model_loss = now.model_loss(&from, &actions, &next)?;
        self.step(critics.clone(), &critic_loss, of_pairs.as_ref(), steps, rates)?;
        self.step(model..model + 1, &model_loss, of_transitions.as_ref(), steps, rates)?;
        let (actor_loss, excess) = self.reference(shapes, false)?.actor_loss(
            &states,
            [&goals, &towards, &weights],
            batch.relearns,
        )?;
        let loss = (&actor_loss + excess)?;
        self.step(actor..actor + 1, &loss, of_pairs.as_ref(), steps, rates)?;
        Ok(Losses {
            critic: critic_loss.to_scalar::<f32>()? / critics.len() as f32,
            model: model_loss.to_scalar()?,
            actor: actor_loss.to_scalar()?,
        })
    }

    /// Returns the losses at the current parameters or their averages.
    fn reference<'a>(&self, shapes: &'a Shapes, averaged: bool) -> Result<Reference<'a>> {
        let parameters = self.networks.iter().map(|network| network.parameters(averaged)).collect();
        Reference::with_parameters(shapes, parameters, Layers::Fused)
    }

    /// Takes an optimiser step on `loss` for some of the networks. In their tables, only the corners
    /// that `read`, `(corners, 1)`, marks may change.
    fn step(
        &mut self,
        which: Range<usize>,
        loss: &Tensor,
        read: Option<&Tensor>,
        steps: u64,
        rates: LearningRates,
    ) -> Result<()> {
        let gradients = loss.backward()?;
        for network in &mut self.networks[which] {
            if let Some(gradient) = gradients.get(&network.dense.values) {
                network.dense.step(gradient, None, adam_rate(rates.dense, steps), rates.tau)?;
            }
            if let Some(table) = &mut network.table
                && let Some(gradient) = gradients.get(&table.values)
            {
                let read = read.map(|read| read.broadcast_as(gradient.shape())).transpose()?;
                table.step(gradient, read.as_ref(), adam_rate(rates.table, steps), rates.tau)?;
            }
        }
        Ok(())
    }

    /// Writes the copies back to `networks`, in the order they were copied, after `steps` updates.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn write_back<'a>(
        &self,
        networks: impl Iterator<Item = &'a Network>,
        steps: u64,
    ) -> Result<()> {
        for (network, trained) in networks.zip(&self.networks) {
            let state = trained.state(steps)?;
            let state: std::collections::HashMap<_, _> = state.into_iter().collect();
            network.restore(steps, |part| state.get(part).cloned())?;
        }
        Ok(())
    }
}

/// Returns which corners of a table set number `set` of the batch's positions reads, `(corners, 1)`;
/// `None` without a table.
fn corners_read(set: usize, shapes: &Shapes, batch: &Batch) -> Result<Option<Tensor>> {
    let Some(grid) = shapes.encoder.grid() else { return Ok(None) };
    let mut touched = TouchedCorners::default();
    find_corners_of(set, shapes, batch, &mut touched);
    let mut read = vec![0_u8; grid.corners()];
    touched.corners().iter().for_each(|corner| read[*corner as usize] = 1);
    let count = read.len();
    Tensor::from_vec(read, (count, 1), &Device::Cpu).map(Some)
}

impl TapeNetwork {
    fn new(network: &Network) -> Result<Self> {
        let state: std::collections::HashMap<_, _> = network.state()?.into_iter().collect();
        let (average, table_average) = network.copy(true)?;
        let numbers =
            |name: &str| Tensor::from_slice(&state[name], state[name].len(), &Device::Cpu);
        let averaged = state.contains_key("dense_average");
        let dense = TapeParameters {
            values: Var::from_tensor(&numbers("dense")?)?,
            m: numbers("dense_m")?,
            v: numbers("dense_v")?,
            average: if averaged {
                Some(Tensor::from_slice(&average, average.len(), &Device::Cpu)?)
            } else {
                None
            },
        };
        let table = match network.table() {
            Some(lines) => {
                let (corners, _, channels) = lines.dims3()?;
                let row = |name: &str| numbers(name)?.reshape((corners, channels));
                let average =
                    Tensor::from_slice(&table_average, (corners, channels), &Device::Cpu)?;
                let average = averaged.then_some(average);
                Some(TapeParameters {
                    values: Var::from_tensor(&row("table")?)?,
                    m: row("table_m")?,
                    v: row("table_v")?,
                    average,
                })
            }
            None => None,
        };
        Ok(Self { dense, table })
    }

    fn parameters(&self, averaged: bool) -> Parameters {
        let of = |slot: &TapeParameters| match slot.average.as_ref().filter(|_| averaged) {
            Some(average) => average.clone(),
            None => slot.values.as_tensor().clone(),
        };
        Parameters { dense: of(&self.dense), table: self.table.as_ref().map(of) }
    }

    /// Returns the state in the format of [`Network::state`].
    fn state(&self, steps: u64) -> Result<NetworkState> {
        let numbers = |t: &Tensor| t.flatten_all()?.to_vec1::<f32>();
        let TapeParameters { values, m, v, average } = &self.dense;
        let mut state =
            vec![("dense", numbers(values)?), ("dense_m", numbers(m)?), ("dense_v", numbers(v)?)];
        if let Some(average) = average {
            state.push(("dense_average", numbers(average)?));
        }
        if let Some(TapeParameters { values, m, v, average }) = &self.table {
            let rows = [("table", values.as_tensor()), ("table_m", m), ("table_v", v)];
            for (name, row) in rows {
                state.push((name, numbers(row)?));
            }
            if let Some(average) = average {
                state.push(("table_average", numbers(average)?));
                state.push(("table_last", vec![f32::from_bits(steps as u32); values.dim(0)?]));
            }
        }
        Ok(state)
    }
}

impl TapeParameters {
    /// Takes one Adam step where `touched`, then updates the average.
    fn step(
        &mut self,
        gradient: &Tensor,
        touched: Option<&Tensor>,
        rate: AdamRate,
        tau: f32,
    ) -> Result<()> {
        let beta = (f64::from(BETA.0), f64::from(BETA.1));
        let m = ((&self.m * beta.0)? + (gradient * (1.0 - beta.0))?)?;
        let v = ((&self.v * beta.1)? + (gradient.sqr()? * (1.0 - beta.1))?)?;
        let step = ((&m * f64::from(rate.rate))? / (v.sqrt()? + f64::from(rate.epsilon))?)?;
        let values = (self.values.as_tensor() - step)?;
        let chosen = |new: Tensor, old: &Tensor| {
            touched.map_or(Ok(new.clone()), |t| t.where_cond(&new, old))
        };
        let values = chosen(values, &self.values)?.detach();
        (self.m, self.v) = (chosen(m, &self.m)?.detach(), chosen(v, &self.v)?.detach());
        self.values.set(&values)?;
        if let Some(average) = &mut self.average {
            *average = (&*average + ((values - &*average)? * f64::from(tau))?)?.detach();
        }
        Ok(())
    }
}
