//! The gradient of one network, from all parts of a batch, and its optimiser step.

use std::ops::Range;

use candle_core::Result;
use parking_lot::Mutex;

use crate::learn::kernels::kernel;
use crate::learn::networks::dense::LearningRates;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::Pairs;
use crate::learn::networks::network::Network;
use crate::learn::networks::table::TouchedCorners;

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

/// Half of a network: the two are stepped in separate tasks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Half {
    Dense,
    Table,
}

impl Half {
    /// Returns the half that task number `task` of a phase of steps handles.
    pub fn for_task(task: usize) -> Self {
        if task.is_multiple_of(2) { Self::Table } else { Self::Dense }
    }
}

/// Steps one half of a network with the sum of its gradients in all `parts`. Moves these out of the
/// parts meanwhile, so that other threads can lock the parts for their own steps.
///
/// # Errors
/// Returns candle's error if a tensor operation fails.
pub fn step_half<P>(
    network: &Network,
    half: Half,
    touched: &TouchedCorners,
    rates: LearningRates,
    parts: &[Mutex<P>],
    gradient: impl Fn(&mut P) -> &mut Gradient,
) -> Result<()> {
    let numbers = |part: &mut P, exchange: &mut Vec<f32>| {
        let gradient = gradient(part);
        std::mem::swap(
            exchange,
            if half == Half::Dense { &mut gradient.dense } else { &mut gradient.encoded },
        );
    };
    let mut taken: Vec<Vec<f32>> = vec![Vec::new(); parts.len()];
    parts.iter().zip(&mut taken).for_each(|(part, own)| numbers(&mut part.lock(), own));
    let result = match (half, network.halves()) {
        (Half::Dense, (dense, _)) => dense.step(&mut taken, rates),
        (Half::Table, (_, Some(table))) => table.step(touched, &taken, rates),
        (Half::Table, (_, None)) => Ok(()),
    };
    parts.iter().zip(&mut taken).for_each(|(part, own)| numbers(&mut part.lock(), own));
    result
}
