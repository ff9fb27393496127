//! One network's parameters: a flat variable, a grid table, their optimiser state and their running average.

use candle_core::{Device, Result, Storage, Tensor, Var, bail};
use parking_lot::RwLockReadGuard;
use rand_chacha::ChaCha8Rng;

use super::adam::{Moments, adam_rate, adam_step, modify, slice};
use super::gradient::{Gradient, StepRates};
use super::grid::{GridShape, TableView};
use super::kernel;
use super::mlp::{Mlp, Packed};
use super::table::Table;

/// A network's weights as slices: what the kernels read.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Flat parameters of the perceptron.
    pub dense: &'a [f32],
    /// Its hidden weights packed for products; those of averages for the way forward alone.
    pub packed: &'a Packed,
    /// The grid encoding's table.
    pub table: Option<TableView<'a>>,
}

/// A network's weights, held for reading.
pub struct Locked<'a> {
    network: &'a Network,
    dense: RwLockReadGuard<'a, Storage>,
    table: Option<RwLockReadGuard<'a, Storage>>,
}

impl Locked<'_> {
    /// The current weights, or their average where there is one and it is asked for.
    ///
    /// # Errors
    /// What candle reports.
    pub fn weights(&self, averaged: bool) -> Result<Weights<'_>> {
        let table = match (&self.network.table, &self.table) {
            (Some(table), Some(lines)) => Some(table.view(slice(lines)?, averaged, self.network.steps)),
            _ => None,
        };
        let (dense, packed) = match self.network.dense_average.as_ref().filter(|_| averaged) {
            Some((average, packed)) => (&average[..], packed),
            None => (slice(&self.dense)?, &self.network.packed),
        };
        Ok(Weights { dense, packed, table })
    }
}

/// A network with everything that training changes.
#[derive(Debug)]
pub struct Network {
    mlp: Mlp,
    dense: Var,
    /// Its hidden weights packed, kept in step with it.
    packed: Packed,
    dense_moments: Moments,
    /// The running average, as it is and packed.
    dense_average: Option<(Vec<f32>, Packed)>,
    table: Option<Table>,
    steps: u64,
}

/// A network's trainable state as plain numbers, for checkpoints: name and values.
pub type NetworkState = Vec<(&'static str, Vec<f32>)>;

impl Network {
    /// A fresh network; `tau` for a running average, none without it.
    ///
    /// # Errors
    /// What candle reports.
    pub fn new(mlp: Mlp, grid: Option<&GridShape>, tau: Option<f32>, rng: &mut ChaCha8Rng) -> Result<Self> {
        let dense = mlp.initial(rng);
        let (mut packed, mut packed_average) = (Packed::default(), Packed::default());
        mlp.pack(&dense, true, &mut packed);
        mlp.pack(&dense, false, &mut packed_average);
        let table = grid.map(|grid| Table::new(&grid.initial(rng), grid.channels, tau)).transpose()?;
        Ok(Self {
            mlp,
            dense_moments: Moments::new(dense.len()),
            dense_average: tau.map(|_| (dense.clone(), packed_average)),
            dense: Var::from_tensor(&Tensor::from_vec(dense.clone(), dense.len(), &Device::Cpu)?)?,
            packed,
            table,
            steps: 0,
        })
    }

    /// Sizes of the perceptron.
    pub fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    /// The flat parameters as a candle variable, see [`Mlp`] for their order.
    pub fn dense(&self) -> &Var {
        &self.dense
    }

    /// The grid table as a candle variable `(corners, 4, channels)`, of whose rows the first is the value.
    pub fn table(&self) -> Option<&Var> {
        self.table.as_ref().map(Table::lines)
    }

    /// Corners of the grid table and channels of each.
    pub fn table_size(&self) -> (usize, usize) {
        self.table.as_ref().map_or((0, 0), Table::size)
    }

    /// Locks the weights for reading.
    pub fn lock(&self) -> Locked<'_> {
        let table = self.table.as_ref().map(|t| t.lines().storage_and_layout().0);
        Locked { network: self, dense: self.dense.storage_and_layout().0, table }
    }

    /// One Adam step along the sum of `parts` (in their order), then one step of the running average.
    ///
    /// # Errors
    /// What candle reports.
    pub fn step(&mut self, parts: &mut [Gradient], rates: StepRates) -> Result<()> {
        self.steps += 1;
        let Some((first, rest)) = parts.split_first_mut() else { return Ok(()) };
        for part in rest.iter() {
            kernel::add_into(&mut first.dense, &part.dense);
        }
        let rate = adam_rate(rates.dense, self.steps);
        adam_step(&self.dense, &mut self.dense_moments, &first.dense, rate)?;
        let (storage, _) = self.dense.storage_and_layout();
        let dense = slice(&storage)?;
        self.mlp.pack(dense, true, &mut self.packed);
        if let Some((average, packed)) = &mut self.dense_average {
            kernel::soft_update(average, dense, rates.tau);
            self.mlp.pack(average, false, packed);
        }
        drop(storage);
        if let Some(table) = &mut self.table {
            parts.iter().for_each(|part| table.add(part));
            table.step(self.steps, rates)?;
        }
        Ok(())
    }

    /// Weights as owned numbers (parameters, table), averages written out.
    ///
    /// # Errors
    /// What candle reports.
    pub fn copy(&self, averaged: bool) -> Result<(Vec<f32>, Vec<f32>)> {
        let dense = self.lock().weights(averaged)?.dense.to_vec();
        let table = self.table.as_ref().map(|t| t.copy(averaged, self.steps)).transpose()?;
        Ok((dense, table.unwrap_or_default()))
    }

    /// Everything that training changed, for a checkpoint.
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<NetworkState> {
        let dense = self.lock().weights(false)?.dense.to_vec();
        let mut state = vec![("dense", dense), ("dense_m", self.dense_moments.m.clone())];
        state.push(("dense_v", self.dense_moments.v.clone()));
        state.extend(self.dense_average.as_ref().map(|(average, _)| ("dense_average", average.clone())));
        if let Some(table) = &self.table {
            state.extend(table.state()?);
        }
        Ok(state)
    }

    /// Takes up a state; `find` gives the numbers saved under a name.
    ///
    /// # Errors
    /// A part that is missing or of another size.
    pub fn restore(&mut self, steps: u64, mut find: impl FnMut(&str) -> Option<Vec<f32>>) -> Result<()> {
        let mut fill = |name: &str, into: &mut [f32]| match find(name) {
            Some(values) if values.len() == into.len() => {
                into.copy_from_slice(&values);
                Ok(())
            }
            Some(values) => bail!("{name} holds {} numbers instead of {}", values.len(), into.len()),
            None => bail!("{name} is missing"),
        };
        self.steps = steps;
        let mut result = Ok(());
        modify(&self.dense, |w| {
            result = fill("dense", w);
            self.mlp.pack(w, true, &mut self.packed);
        })?;
        result?;
        fill("dense_m", &mut self.dense_moments.m)?;
        fill("dense_v", &mut self.dense_moments.v)?;
        if let Some((average, packed)) = &mut self.dense_average {
            fill("dense_average", average)?;
            self.mlp.pack(average, false, packed);
        }
        if let Some(table) = &mut self.table {
            table.restore(fill)?;
        }
        Ok(())
    }

    /// Updates done.
    pub fn steps(&self) -> u64 {
        self.steps
    }
}
