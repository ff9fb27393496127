//! One network: a perceptron's flat parameters and a grid table.

use candle_core::{Result, Var, bail};
use rand_chacha::ChaCha8Rng;

use super::dense::{Dense, DenseGuard};
use super::grid::{GridShape, TableView};
use super::mlp::{Mlp, Packed};
use super::state::NetworkState;
use super::table::{Table, TableGuard};

/// A network's weights as slices: what the kernels read.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Flat parameters of the perceptron.
    pub dense: &'a [f32],
    /// Its hidden weights packed for products; those of averages for the way forward alone.
    pub packed: &'a Packed,
    /// The grid encoding's table.
    pub table: Option<TableView<'a>>,
}

/// A network's weights, held for reading.
pub struct Locked<'a> {
    dense: DenseGuard<'a>,
    table: Option<TableGuard<'a>>,
}

impl Locked<'_> {
    /// The current weights, or their average where there is one and it is asked for.
    ///
    /// # Errors
    /// What candle reports.
    pub fn weights(&self, averaged: bool) -> Result<Weights<'_>> {
        let (dense, packed) = self.dense.numbers(averaged)?;
        let table = self.table.as_ref().map(|t| t.view(averaged)).transpose()?;
        Ok(Weights { dense, packed, table })
    }
}

/// A network with everything that training changes. Its two halves are stepped apart, perhaps by two threads.
#[derive(Debug)]
pub struct Network {
    dense: Dense,
    table: Option<Table>,
}

impl Network {
    /// A fresh network; `tau` for a running average, none without it.
    ///
    /// # Errors
    /// What candle reports.
    pub fn new(mlp: Mlp, grid: Option<&GridShape>, tau: Option<f32>, rng: &mut ChaCha8Rng) -> Result<Self> {
        let dense = Dense::new(mlp, &mlp.initial(rng), tau.is_some())?;
        let table = grid.map(|grid| Table::new(&grid.initial(rng), grid.channels, tau)).transpose()?;
        Ok(Self { dense, table })
    }

    /// The flat parameters as a candle variable, see `mlp::Mlp` for their order.
    pub fn dense(&self) -> &Var {
        self.dense.var()
    }

    /// The grid table as a candle variable `(corners, 4, channels)`, of whose rows the first is the value.
    pub fn table(&self) -> Option<&Var> {
        self.table.as_ref().map(Table::lines)
    }

    /// The two halves, to be stepped.
    pub(super) fn halves(&self) -> (&Dense, Option<&Table>) {
        (&self.dense, self.table.as_ref())
    }

    /// Locks the weights for reading.
    pub fn lock(&self) -> Locked<'_> {
        Locked { dense: self.dense.lock(), table: self.table.as_ref().map(Table::lock) }
    }

    /// Weights as owned numbers (parameters, table), averages written out.
    ///
    /// # Errors
    /// What candle reports.
    pub fn copy(&self, averaged: bool) -> Result<(Vec<f32>, Vec<f32>)> {
        let dense = self.dense.lock().numbers(averaged)?.0.to_vec();
        let table = self.table.as_ref().map(|t| t.copy(averaged)).transpose()?;
        Ok((dense, table.unwrap_or_default()))
    }

    /// Everything that training changed, for a checkpoint.
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<NetworkState> {
        let mut state = self.dense.state()?;
        if let Some(table) = &self.table {
            state.extend(table.state()?);
        }
        Ok(state)
    }

    /// Takes up a state after `steps` updates; `find` gives the numbers saved under a name.
    ///
    /// # Errors
    /// A part that is missing or of another size.
    pub fn restore(&self, steps: u64, mut find: impl FnMut(&str) -> Option<Vec<f32>>) -> Result<()> {
        let mut fill = |name: &str, into: &mut [f32]| match find(name) {
            Some(values) if values.len() == into.len() => {
                into.copy_from_slice(&values);
                Ok(())
            }
            Some(values) => bail!("{name} holds {} numbers instead of {}", values.len(), into.len()),
            None => bail!("{name} is missing"),
        };
        self.dense.restore(steps, &mut fill)?;
        self.table.as_ref().map_or(Ok(()), |table| table.restore(steps, &mut fill))
    }

    /// Updates done.
    pub fn steps(&self) -> u64 {
        self.dense.steps()
    }
}
