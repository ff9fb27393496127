//! In-place access to candle variables, and Adam: step sizes, and moments that can be checkpointed.

use std::cell::RefCell;

use candle_core::{CpuStorage, InplaceOp1, Layout, Result, Storage, Var, bail};

use crate::learn::kernels::kernel::{self, AdamRate, BETA};
use crate::learn::settings::LearnSettings;

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
