//! The gradient of one network from one part of a batch.

use super::grid::Places;
use super::kernel;

/// Gradient of one network from one part of a batch.
#[derive(Clone, Debug, Default)]
pub struct Gradient {
    /// Of the flat parameters.
    pub dense: Vec<f32>,
    /// Where the table was read, in order, repeats included.
    places: Places,
    /// Gradient of each level's encoding at each position read, `(positions, levels, channels)`.
    encoded: Vec<f32>,
}

impl Gradient {
    /// Prepares for a network of `parameters` flat parameters, which a backward pass will overwrite.
    pub fn prepare(&mut self, parameters: usize) {
        self.dense.resize(parameters, 0.0);
        self.places.clear();
        self.encoded.clear();
    }

    /// The whole gradient of several parts: flat parameters, and a table of `(corners, channels)`.
    pub fn sum<'a>(parts: impl Iterator<Item = &'a Self>, table: (usize, usize)) -> (Vec<f32>, Vec<f32>) {
        let (mut dense, mut values) = (Vec::new(), vec![0.0; table.0 * table.1]);
        for part in parts {
            dense.resize(part.dense.len(), 0.0);
            kernel::add_into(&mut dense, &part.dense);
            part.for_each_corner(table.1.max(1), |corner, weight, d| {
                let sum = &mut values[corner * table.1..][..table.1];
                sum.iter_mut().zip(d).for_each(|(s, d)| *s += weight * d);
            });
        }
        (dense, values)
    }

    /// Adds the gradient of the encodings of the positions of `places`, of which `d` holds one a row from column
    /// `from` on, `(positions, stride)`.
    pub fn add_encoded(&mut self, places: &Places, d: &[f32], (from, width, stride): (usize, usize, usize)) {
        self.places.corners.extend(&places.corners);
        self.places.weights.extend(&places.weights);
        self.encoded.extend(d.chunks_exact(stride).flat_map(|row| &row[from..from + width]));
    }

    /// Calls `add(corner, weight, d)` for each corner read, `d` being the gradient of its level's encoding.
    #[inline(always)]
    pub fn for_each_corner(&self, channels: usize, mut add: impl FnMut(usize, f32, &[f32])) {
        let levels = self.encoded.len() / channels;
        if levels == 0 {
            return;
        }
        let around = self.places.corners.len() / levels;
        let read = self.places.corners.chunks_exact(around).zip(self.places.weights.chunks_exact(around));
        for ((corners, weights), d) in read.zip(self.encoded.chunks_exact(channels)) {
            corners.iter().zip(weights).for_each(|(corner, weight)| add(*corner as usize, *weight, d));
        }
    }
}

/// Step sizes of one update.
#[derive(Clone, Copy, Debug)]
pub struct StepRates {
    /// Of the flat parameters.
    pub dense: f32,
    /// Of the grid table.
    pub table: f32,
    /// Of the running average.
    pub tau: f32,
}
