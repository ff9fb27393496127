//! A network's optimiser step with the gradients of all parts of a batch.

use candle_core::Result;
use parking_lot::Mutex;

use crate::learn::networks::adam::LearningRates;
use crate::learn::networks::network::Network;
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::update::gradient::Gradient;

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
