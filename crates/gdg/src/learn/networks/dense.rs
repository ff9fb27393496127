//! An MLP's flat parameters with their training state.

use candle_core::{Device, Result, Storage, Tensor, Var};
use parking_lot::{RwLock, RwLockReadGuard};

use crate::learn::kernels::kernel;
use crate::learn::networks::adam::{LearningRates, Moments, adam_rate, adam_step, modify, slice};
use crate::learn::networks::mlp::{Mlp, Packed};

/// A network's training state as plain numbers: names and values.
pub type NetworkState = Vec<(&'static str, Vec<f32>)>;

/// Fills a slice with the numbers saved under a name.
pub type FillFn<'a> = &'a mut dyn FnMut(&str, &mut [f32]) -> Result<()>;

/// Flat parameters as a candle variable, with their training state.
#[derive(Debug)]
pub struct Dense {
    mlp: Mlp,
    var: Var,
    training: RwLock<TrainingState>,
}

/// State kept in sync with the parameters.
#[derive(Debug)]
struct TrainingState {
    steps: u64,
    /// Hidden weights packed for products.
    packed: Packed,
    moments: Moments,
    /// The running average, flat and packed.
    average: Option<(Vec<f32>, Packed)>,
}

/// Parameters locked for reading.
pub struct DenseGuard<'a> {
    numbers: RwLockReadGuard<'a, Storage>,
    training: RwLockReadGuard<'a, TrainingState>,
}

impl DenseGuard<'_> {
    /// Returns the parameters, or their running average if `averaged` and there is one, flat and
    /// packed (averages for the forward pass only).
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn numbers(&self, averaged: bool) -> Result<(&[f32], &Packed)> {
        match self.training.average.as_ref().filter(|_| averaged) {
            Some((average, packed)) => Ok((average, packed)),
            None => Ok((slice(&self.numbers)?, &self.training.packed)),
        }
    }
}

impl Dense {
    /// Creates the variable from initial `parameters`, with a running average if `averaged`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn new(mlp: Mlp, parameters: &[f32], averaged: bool) -> Result<Self> {
        let (mut packed, mut packed_average) = (Packed::default(), Packed::default());
        mlp.pack(parameters, true, &mut packed);
        mlp.pack(parameters, false, &mut packed_average);
        let average = averaged.then(|| (parameters.to_vec(), packed_average));
        let training =
            TrainingState { steps: 0, packed, moments: Moments::new(parameters.len()), average };
        let var =
            Var::from_tensor(&Tensor::from_slice(parameters, parameters.len(), &Device::Cpu)?)?;
        Ok(Self { mlp, var, training: RwLock::new(training) })
    }

    /// Returns the network's size.
    pub fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    /// Returns the parameters as a candle variable; see [`Mlp`] for their order.
    pub fn var(&self) -> &Var {
        &self.var
    }

    /// Returns the number of updates done.
    pub fn steps(&self) -> u64 {
        self.training.read().steps
    }

    /// Locks the parameters for reading.
    pub fn lock(&self) -> DenseGuard<'_> {
        DenseGuard { numbers: self.var.storage_and_layout().0, training: self.training.read() }
    }

    /// Takes one Adam step on the sum of the gradients `parts` (summed in order into the first),
    /// then updates the average.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn step(&self, parts: &mut [Vec<f32>], rates: LearningRates) -> Result<()> {
        let TrainingState { steps, packed, moments, average } = &mut *self.training.write();
        let Some((gradient, rest)) = parts.split_first_mut() else { return Ok(()) };
        for part in rest {
            kernel::add_into(gradient, part);
        }
        *steps += 1;
        adam_step(&self.var, moments, gradient, adam_rate(rates.dense, *steps))?;
        let (storage, _) = self.var.storage_and_layout();
        let parameters = slice(&storage)?;
        self.mlp.pack(parameters, true, packed);
        if let Some((average, packed)) = average {
            kernel::soft_update(average, parameters, rates.tau);
            self.mlp.pack(average, false, packed);
        }
        Ok(())
    }

    /// Returns the full training state, for a checkpoint.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn state(&self) -> Result<NetworkState> {
        let parameters = self.lock().numbers(false)?.0.to_vec();
        let TrainingState { moments, average, .. } = &*self.training.read();
        let mut state = vec![
            ("dense", parameters),
            ("dense_m", moments.m.clone()),
            ("dense_v", moments.v.clone()),
        ];
        state.extend(average.as_ref().map(|(average, _)| ("dense_average", average.clone())));
        Ok(state)
    }

    /// Restores the state that [`Self::state`] returned after `done` updates, read through `fill`.
    ///
    /// # Errors
    /// Returns the error of `fill`, or candle's error if a tensor operation fails.
    pub fn restore(&self, done: u64, fill: FillFn) -> Result<()> {
        let TrainingState { steps, packed, moments, average } = &mut *self.training.write();
        let mut result = Ok(());
        modify(&self.var, |parameters| {
            result = fill("dense", parameters);
            self.mlp.pack(parameters, true, packed);
        })?;
        result?;
        fill("dense_m", &mut moments.m)?;
        fill("dense_v", &mut moments.v)?;
        if let Some((average, packed)) = average {
            fill("dense_average", average)?;
            self.mlp.pack(average, false, packed);
        }
        *steps = done;
        Ok(())
    }
}
