//! The gradient of one network from one part of a batch.

use crate::learn::settings::LearnSettings;

/// Gradient of one network from one part of a batch.
#[derive(Clone, Debug, Default)]
pub struct Gradient {
    /// Of the flat parameters.
    pub dense: Vec<f32>,
    /// Of the grid encodings of the positions read, in row order: `(positions, levels, channels)`.
    pub encoded: Vec<f32>,
}

impl Gradient {
    /// Resizes for a network of `parameters` flat parameters, whose gradient a backward pass will overwrite.
    pub fn prepare(&mut self, parameters: usize) {
        self.dense.resize(parameters, 0.0);
        self.encoded.clear();
    }

    /// Appends the gradients of encodings: columns `from..from + width` of `d` `(positions, stride)`.
    pub fn add_encoded(&mut self, d: &[f32], (from, width, stride): (usize, usize, usize)) {
        self.encoded.extend(d.chunks_exact(stride).flat_map(|row| &row[from..from + width]));
    }
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
        Self { dense: settings.learning_rate, table: settings.grid_learning_rate, tau: settings.tau }
    }
}
