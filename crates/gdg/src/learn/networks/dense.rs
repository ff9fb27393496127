//! An MLP's flat parameters with their training state: in-place access to candle variables, and Adam.

use std::cell::RefCell;

use candle_core::{CpuStorage, Device, InplaceOp1, Layout, Result, Storage, Tensor, Var, bail};
use parking_lot::{RwLock, RwLockReadGuard};

use crate::learn::kernels::kernel::{self, AdamRate, BETA};
use crate::learn::networks::mlp::{Mlp, Packed};
use crate::learn::settings::LearnSettings;

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

pub(crate) const EPSILON: f64 = 1e-8;

/// First and second moment of a variable's gradient.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    pub m: Vec<f32>,
    pub v: Vec<f32>,
}

impl Moments {
    /// Creates zero moments for `length` numbers.
    pub fn new(length: usize) -> Self {
        Self { m: vec![0.0; length], v: vec![0.0; length] }
    }
}

/// Returns Adam's bias-corrected step size at update number `step` (from 1).
pub fn adam_rate(learning_rate: f32, step: u64) -> AdamRate {
    let step = step.min(1 << 30) as i32;
    let (c1, c2) =
        (1.0 - f64::from(BETA.0).powi(step), (1.0 - f64::from(BETA.1).powi(step)).sqrt());
    AdamRate { rate: (f64::from(learning_rate) * c2 / c1) as f32, epsilon: (EPSILON * c2) as f32 }
}

/// Step sizes of one update.
#[derive(Clone, Copy, Debug)]
pub struct LearningRates {
    /// Of the flat parameters.
    pub dense: f32,
    /// Of the grid table.
    pub table: f32,
    /// Of the running average.
    pub tau: f32,
}

impl LearningRates {
    /// Returns the step sizes in `settings`.
    pub fn from_settings(settings: &LearnSettings) -> Self {
        Self {
            dense: settings.learning_rate,
            table: settings.grid_learning_rate,
            tau: settings.tau,
        }
    }
}

/// Modifies a variable's data in place.
pub fn modify(var: &Var, change: impl FnOnce(&mut [f32])) -> Result<()> {
    var.inplace_op1(&Modify(RefCell::new(Some(change))))
}

/// Takes one dense Adam step.
pub fn adam_step(var: &Var, moments: &mut Moments, gradient: &[f32], rate: AdamRate) -> Result<()> {
    modify(var, |w| kernel::adam(w, &mut moments.m, &mut moments.v, gradient, rate))
}

/// An in-place change as a candle operation; it runs once.
struct Modify<F>(RefCell<Option<F>>);

impl<F: FnOnce(&mut [f32])> InplaceOp1 for Modify<F> {
    fn name(&self) -> &'static str {
        "modify"
    }

    fn cpu_fwd(&self, storage: &mut CpuStorage, layout: &Layout) -> Result<()> {
        let (CpuStorage::F32(data), Some((from, to)), Some(change)) =
            (storage, layout.contiguous_offsets(), self.0.borrow_mut().take())
        else {
            bail!("in-place changes need contiguous f32 parameters and run once")
        };
        change(&mut data[from..to]);
        Ok(())
    }
}

/// Returns a variable's data.
///
/// # Errors
/// Returns an error unless the data is f32 on the CPU.
pub fn slice(storage: &Storage) -> Result<&[f32]> {
    match storage {
        Storage::Cpu(CpuStorage::F32(data)) => Ok(data),
        _ => bail!("the fused kernels need f32 on the CPU"),
    }
}
