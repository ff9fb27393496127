//! What of a network a checkpoint holds.

use candle_core::Result;

/// A network's trainable state as plain numbers: name and values.
pub type NetworkState = Vec<(&'static str, Vec<f32>)>;

/// Fills a slice with the numbers saved under a name.
pub type Fill<'a> = &'a mut dyn FnMut(&str, &mut [f32]) -> Result<()>;
