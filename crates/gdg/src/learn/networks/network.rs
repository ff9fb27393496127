//! One network: an MLP's flat parameters and a grid table.

use candle_core::{Result, Var, bail};
use rand_chacha::ChaCha8Rng;

use crate::learn::networks::dense::{Dense, DenseGuard, NetworkState};
use crate::learn::networks::grid::{GridShape, TableView};
use crate::learn::networks::mlp::{Mlp, Packed};
use crate::learn::networks::table::{Table, TableGuard};
use crate::store::{Store, StoreError};

/// A network's weights as slices, for the kernels.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Flat parameters of the MLP.
    pub dense: &'a [f32],
    /// Its hidden weights packed for matrix products; averages are packed for the forward pass
    /// only.
    pub packed: &'a Packed,
    /// The grid encoding's table.
    pub table: Option<TableView<'a>>,
}

/// A network's weights, locked for reading.
pub struct LockedNetwork<'a> {
    dense: DenseGuard<'a>,
    table: Option<TableGuard<'a>>,
}

impl LockedNetwork<'_> {
    /// Returns the current weights, or their running average if `averaged` and there is one.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn weights(&self, averaged: bool) -> Result<Weights<'_>> {
        let (dense, packed) = self.dense.numbers(averaged)?;
        let table = self.table.as_ref().map(|t| t.view(averaged)).transpose()?;
        Ok(Weights { dense, packed, table })
    }
}

/// A copy of one network's weights for inference.
#[derive(Debug)]
pub struct OwnedWeights {
    dense: Vec<f32>,
    packed: Packed,
    /// The grid table's values `(corners, channels)`, and the number of channels.
    table: Option<(Vec<f32>, usize)>,
}

impl OwnedWeights {
    /// Returns the weights as slices.
    pub fn weights(&self) -> Weights<'_> {
        let Self { dense, packed, table } = self;
        let table = table.as_ref().map(|(lines, stride)| TableView {
            lines,
            stride: *stride,
            average: None,
        });
        Weights { dense, packed, table }
    }
}

/// A network with its training state. Its two halves are stepped separately, possibly by two
/// threads.
#[derive(Debug)]
pub struct Network {
    dense: Dense,
    table: Option<Table>,
}

impl Network {
    /// Creates a network with random parameters, and a running average if `tau` is given.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn new(
        mlp: Mlp,
        grid: Option<&GridShape>,
        tau: Option<f32>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let dense = Dense::new(mlp, &mlp.initial(rng), tau.is_some())?;
        let table =
            grid.map(|grid| Table::new(&grid.initial(rng), grid.channels, tau)).transpose()?;
        Ok(Self { dense, table })
    }

    /// Returns the flat parameters as a candle variable; see `mlp::Mlp` for their order.
    pub fn dense(&self) -> &Var {
        self.dense.var()
    }

    /// Returns the grid table as a candle variable `(corners, 4, channels)`; the first of the four
    /// rows is the value.
    pub fn table(&self) -> Option<&Var> {
        self.table.as_ref().map(Table::lines)
    }

    /// Returns the two halves, for stepping.
    pub(in crate::learn) fn halves(&self) -> (&Dense, Option<&Table>) {
        (&self.dense, self.table.as_ref())
    }

    /// Locks the weights for reading.
    pub fn lock(&self) -> LockedNetwork<'_> {
        LockedNetwork { dense: self.dense.lock(), table: self.table.as_ref().map(Table::lock) }
    }

    /// Copies the weights (parameters, table), or their averages, evaluating lazy ones.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn copy(&self, averaged: bool) -> Result<(Vec<f32>, Vec<f32>)> {
        let dense = self.dense.lock().numbers(averaged)?.0.to_vec();
        let table = self.table.as_ref().map(|t| t.copy(averaged)).transpose()?;
        Ok((dense, table.unwrap_or_default()))
    }

    /// Copies the weights, or their averages, and packs them for inference.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn freeze(&self, averaged: bool) -> Result<OwnedWeights> {
        let (dense, table) = self.copy(averaged)?;
        let mut packed = Packed::default();
        self.dense.mlp().pack(&dense, false, &mut packed);
        Ok(OwnedWeights {
            dense,
            packed,
            table: self.table.as_ref().map(|own| (table, own.channels())),
        })
    }

    /// Returns the full training state, for a checkpoint.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn state(&self) -> Result<NetworkState> {
        let mut state = self.dense.state()?;
        if let Some(table) = &self.table {
            state.extend(table.state()?);
        }
        Ok(state)
    }

    /// Restores a state saved after `steps` updates; `find` returns the numbers saved under a name.
    ///
    /// # Errors
    /// Returns an error if a part is missing or has the wrong size.
    pub fn restore(
        &self,
        steps: u64,
        mut find: impl FnMut(&str) -> Option<Vec<f32>>,
    ) -> Result<()> {
        let mut fill = |name: &str, into: &mut [f32]| match find(name) {
            Some(values) if values.len() == into.len() => {
                into.copy_from_slice(&values);
                Ok(())
            }
            Some(values) => bail!("{name} has {} values instead of {}", values.len(), into.len()),
            None => bail!("{name} is missing"),
        };
        self.dense.restore(steps, &mut fill)?;
        self.table.as_ref().map_or(Ok(()), |table| table.restore(steps, &mut fill))
    }

    /// Returns the number of updates done.
    pub fn steps(&self) -> u64 {
        self.dense.steps()
    }
}

/// Writes the state of `networks`, with their names, after `updates` updates.
///
/// # Errors
/// Returns candle's error if a tensor operation fails.
pub fn save_networks<'a>(
    store: &mut Store,
    updates: u64,
    networks: impl Iterator<Item = (&'a str, &'a Network)>,
) -> Result<()> {
    store.put_text("learner_updates", updates.to_string());
    for (network, of) in networks {
        for (part, values) in of.state()? {
            store.put_numbers(format!("{network}.{part}"), values);
        }
    }
    Ok(())
}

/// Restores the state that [`save_networks`] wrote.
///
/// # Errors
/// Returns an error if the state is missing or does not fit; the networks are then unusable.
pub fn load_networks<'a>(
    store: &Store,
    mut networks: impl Iterator<Item = (&'a str, &'a Network)>,
) -> std::result::Result<(), StoreError> {
    let updates = store.text("learner_updates")?.parse::<u32>();
    let updates = updates
        .map_err(|_| StoreError::inconsistent("its number of updates is out of range"))?
        .into();
    let mut restore = |(name, network): (&str, &Network)| {
        network.restore(updates, |part| {
            store.numbers(&format!("{name}.{part}")).ok().map(<[f32]>::to_vec)
        })
    };
    networks.try_for_each(&mut restore).map_err(|error| {
        // Candle adds a backtrace where one is asked for.
        let error = error.to_string();
        let first = error.lines().next().unwrap_or_default();
        StoreError::inconsistent(format!("its networks do not fit: {first}"))
    })
}
