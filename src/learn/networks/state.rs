//! A network's training state in checkpoints.

use candle_core::Result;

/// A network's training state as plain numbers: names and values.
pub type NetworkState = Vec<(&'static str, Vec<f32>)>;

/// Fills a slice with the numbers saved under a name.
pub type FillFn<'a> = &'a mut dyn FnMut(&str, &mut [f32]) -> Result<()>;
