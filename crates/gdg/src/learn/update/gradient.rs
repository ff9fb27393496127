//! The gradient of one network.

use std::ops::Range;

use parking_lot::Mutex;

use crate::learn::kernels::kernel;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::Pairs;
use crate::learn::networks::network::Network;
use crate::learn::networks::touched::TouchedCorners;

/// Gradient of one network from one part of a batch.
#[derive(Clone, Debug, Default)]
pub struct Gradient {
    /// Of the flat parameters.
    pub dense: Vec<f32>,
    /// Of the grid encodings of the positions read, in row order: `(positions, levels, channels)`.
    pub encoded: Vec<f32>,
}

impl Gradient {
    /// Resizes for a network of `parameters` flat parameters, whose gradient a backward pass will
    /// overwrite.
    pub fn prepare(&mut self, parameters: usize) {
        self.dense.resize(parameters, 0.0);
        self.encoded.clear();
    }

    /// Appends the gradients of encodings: some `columns` of `d` `(positions, stride)`.
    pub fn add_encoded(&mut self, d: &[f32], stride: usize, columns: Range<usize>) {
        self.encoded.extend(d.chunks_exact(stride).flat_map(|row| &row[columns.clone()]));
    }

    /// Adds the gradients of the pairs' grid encodings: the first columns of `dx`
    /// `(rows, 2 * grid_width + further columns)`.
    pub fn add_pair_corners(
        &mut self,
        encoder: &Encoder,
        pairs: Pairs,
        dx: &[f32],
        further: usize,
    ) {
        let width = encoder.grid_width();
        if width > 0 {
            let stride = 2 * width + further;
            let dx = &dx[..pairs.states.len() / encoder.spec().state_dim() * stride];
            self.add_encoded(dx, stride, 0..width);
            self.add_encoded(dx, stride, width..2 * width);
        }
    }
}

/// A network's gradient.
#[derive(Clone, Debug)]
pub struct FullGradient {
    /// Of the flat parameters.
    pub dense: Vec<f32>,
    /// Of the grid table, `(corners, channels)`; empty if the network has none.
    pub table: Vec<f32>,
}

/// Sums a network's gradients from all parts of a batch, which touched these corners of its table.
/// For checks against other implementations: steps sum the parts themselves.
pub fn full_gradient<P>(
    network: &Network,
    touched: &TouchedCorners,
    parts: &[Mutex<P>],
    gradient: impl Fn(&mut P) -> &mut Gradient,
) -> FullGradient {
    let (mut dense, mut encoded) = (Vec::new(), Vec::new());
    for part in parts {
        let mut part = part.lock();
        let own = gradient(&mut part);
        dense.resize(own.dense.len(), 0.0);
        kernel::add_into(&mut dense, &own.dense);
        encoded.push(own.encoded.clone());
    }
    let table = network.halves().1.map(|table| touched.table_gradient(&encoded, table.channels()));
    FullGradient { dense, table: table.unwrap_or_default() }
}
