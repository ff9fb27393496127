//! One network: an MLP's flat parameters and a grid table, as candle variables changed in place, with
//! their training state: Adam's moments and running averages.

use std::cell::RefCell;

use candle_core::{CpuStorage, Device, InplaceOp1, Layout, Result, Storage, Tensor, Var, bail};
use parking_lot::{RwLock, RwLockReadGuard};
use rand_chacha::ChaCha8Rng;

use crate::learn::error::LearnError;
use crate::learn::kernels::kernel::{self, AdamRate, BETA};
use crate::learn::networks::grid_encoding::{
    CHANNELS, GridReads, GridShape, LINE, LazyAverageView, TableView,
};
use crate::learn::networks::mlp::{Mlp, Packed};
use crate::learn::settings::LearnSettings;
use crate::store::{Store, StoreError};

/// A network's weights as slices, for the kernels.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    pub dense: &'a [f32],
    /// Its hidden weights packed for matrix products; averages are packed for the forward pass
    /// only.
    pub packed: &'a Packed,
    pub table: Option<TableView<'a>>,
}

/// A variable and its training state, locked for reading.
type Guards<'a, T> = (RwLockReadGuard<'a, Storage>, RwLockReadGuard<'a, T>);

/// A network's weights, locked for reading.
pub struct LockedNetwork<'a> {
    dense: Guards<'a, DenseState>,
    table: Option<(&'a GridTable, Guards<'a, TableState>)>,
}

impl LockedNetwork<'_> {
    /// Returns the current weights, or their running average if `averaged` and there is one.
    pub fn weights(&self, averaged: bool) -> Result<Weights<'_>> {
        let (numbers, state) = &self.dense;
        let (dense, packed) = match state.average.as_ref().filter(|_| averaged) {
            Some((average, packed)) => (&average[..], packed),
            None => (slice(numbers)?, &state.packed),
        };
        let Some((GridTable { decay, .. }, (lines, state))) = &self.table else {
            return Ok(Weights { dense, packed, table: None });
        };
        let TableState { stored, steps, .. } = &**state;
        let lazy = LazyAverageView { stored, now: *steps as u32, decay };
        let average = (averaged && !decay.is_empty()).then_some(lazy);
        let table = Some(TableView { lines: slice(lines)?, stride: LINE, average });
        Ok(Weights { dense, packed, table })
    }
}

/// A copy of one network's weights for inference.
#[derive(Debug)]
pub struct OwnedWeights {
    dense: Vec<f32>,
    packed: Packed,
    /// The grid table's values `(corners, channels)`.
    table: Option<Vec<f32>>,
}

impl OwnedWeights {
    pub fn weights(&self) -> Weights<'_> {
        let Self { dense, packed, table } = self;
        let view = |lines| TableView { lines, stride: CHANNELS, average: None };
        Weights { dense, packed, table: table.as_deref().map(view) }
    }
}

/// A network with its training state. Its two halves are stepped separately, possibly by two
/// threads.
#[derive(Debug)]
pub struct Network {
    pub dense: Dense,
    pub table: Option<GridTable>,
}

impl Network {
    /// Creates a network with random parameters, and a running average if `tau` is given.
    pub fn new(
        mlp: Mlp,
        grid: Option<&GridShape>,
        tau: Option<f32>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let dense = Dense::new(mlp, &mlp.initial(rng), tau.is_some())?;
        let table = grid.map(|grid| GridTable::new(&grid.initial(rng), tau)).transpose()?;
        Ok(Self { dense, table })
    }

    pub fn lock(&self) -> LockedNetwork<'_> {
        let Self { dense, table } = self;
        LockedNetwork {
            dense: (dense.var.storage_and_layout().0, dense.training.read()),
            table: table
                .as_ref()
                .map(|table| (table, (table.lines.storage_and_layout().0, table.training.read()))),
        }
    }

    /// Copies the weights (parameters, table), or their averages, evaluating lazy ones.
    pub fn copy(&self, averaged: bool) -> Result<(Vec<f32>, Option<Vec<f32>>)> {
        let locked = self.lock();
        let Weights { dense, table, .. } = locked.weights(averaged)?;
        let values = |TableView { lines, average, .. }: TableView| {
            let values = lines.chunks_exact(LINE).enumerate().flat_map(|(corner, line)| {
                let remaining = average.map_or(0.0, |lazy| lazy.remaining(corner));
                let (value, rest) = line.split_at(CHANNELS);
                value.iter().zip(rest).map(move |(w, stored)| w + (stored - w) * remaining)
            });
            values.collect()
        };
        Ok((dense.to_vec(), table.map(values)))
    }

    /// Copies the weights, or their averages, and packs them for inference.
    pub fn freeze(&self, averaged: bool) -> Result<OwnedWeights> {
        let (dense, table) = self.copy(averaged)?;
        let mut packed = Packed::default();
        self.dense.mlp.pack(&dense, false, &mut packed);
        Ok(OwnedWeights { dense, packed, table })
    }

    /// Writes the full training state under names that begin with `name`.
    pub fn save(&self, name: &str, store: &mut Store) -> Result<()> {
        let table = self.table.as_ref().map(GridTable::state).transpose()?;
        for (part, values) in self.dense.state()?.into_iter().chain(table.into_iter().flatten()) {
            store.put_numbers(format!("{name}.{part}"), values);
        }
        Ok(())
    }

    /// Restores what [`Self::save`] wrote after `done` updates. The network is unusable if that
    /// does not fit.
    pub fn load(
        &self,
        name: &str,
        store: &Store,
        done: u64,
    ) -> std::result::Result<(), LearnError> {
        let find = |part: &str, length: usize| {
            let misfit = |problem: String| {
                StoreError::inconsistent(format!("its networks do not fit: {part} {problem}"))
            };
            let values = store
                .numbers(&format!("{name}.{part}"))
                .map_err(|_| misfit("is missing".to_owned()))?;
            if values.len() == length {
                Ok(values)
            } else {
                Err(misfit(format!("has {} values instead of {length}", values.len())))
            }
        };
        self.dense.restore(done, &find)?;
        self.table.as_ref().map_or(Ok(()), |table| table.restore(done, &find))
    }
}

/// A network's training state as plain numbers: names and values.
type NetworkState = Vec<(&'static str, Vec<f32>)>;

/// Returns as many numbers as given that were saved under a name.
type FindFn<'a> = &'a dyn Fn(&str, usize) -> std::result::Result<&'a [f32], StoreError>;

/// Flat parameters as a candle variable, with their training state.
#[derive(Debug)]
pub struct Dense {
    pub mlp: Mlp,
    /// See [`Mlp`] for their order.
    pub var: Var,
    training: RwLock<DenseState>,
}

/// State kept in sync with the parameters.
#[derive(Debug)]
struct DenseState {
    steps: u64,
    /// Hidden weights packed for products.
    packed: Packed,
    /// First and second moment of the gradient.
    m: Vec<f32>,
    v: Vec<f32>,
    /// The running average, flat and packed.
    average: Option<(Vec<f32>, Packed)>,
}

impl Dense {
    /// Creates the variable from initial `parameters`, with a running average if `averaged`.
    fn new(mlp: Mlp, parameters: &[f32], averaged: bool) -> Result<Self> {
        let (mut packed, mut packed_average) = (Packed::default(), Packed::default());
        mlp.pack(parameters, true, &mut packed);
        mlp.pack(parameters, false, &mut packed_average);
        let length = parameters.len();
        let training = DenseState {
            steps: 0,
            packed,
            m: vec![0.0; length],
            v: vec![0.0; length],
            average: averaged.then(|| (parameters.to_vec(), packed_average)),
        };
        let var = Var::from_tensor(&Tensor::from_slice(parameters, length, &Device::Cpu)?)?;
        Ok(Self { mlp, var, training: RwLock::new(training) })
    }

    pub fn steps(&self) -> u64 {
        self.training.read().steps
    }

    /// Takes one Adam step on the sum of the gradients `parts` (summed in order into the first),
    /// then updates the average.
    pub fn step(&self, parts: &mut [Vec<f32>], rates: LearningRates) -> Result<()> {
        let DenseState { steps, packed, m, v, average } = &mut *self.training.write();
        let Some((gradient, rest)) = parts.split_first_mut() else { return Ok(()) };
        for part in rest {
            kernel::add_into(gradient, part);
        }
        *steps += 1;
        modify(&self.var, |parameters| {
            kernel::adam(parameters, m, v, gradient, adam_rate(rates.dense, *steps));
            self.mlp.pack(parameters, true, packed);
            if let Some((average, packed)) = average {
                kernel::soft_update(average, parameters, rates.tau);
                self.mlp.pack(average, false, packed);
            }
        })
    }

    /// Returns the full training state, for a checkpoint.
    fn state(&self) -> Result<NetworkState> {
        let (storage, state) = (self.var.storage_and_layout().0, self.training.read());
        let DenseState { m, v, average, .. } = &*state;
        let parts = [("dense", slice(&storage)?), ("dense_m", m), ("dense_v", v)];
        let average = average.as_ref().map(|(average, _)| ("dense_average", &average[..]));
        Ok(parts.into_iter().chain(average).map(|(name, part)| (name, part.to_vec())).collect())
    }

    /// Restores the state that [`Self::state`] returned after `done` updates.
    fn restore(&self, done: u64, find: FindFn) -> std::result::Result<(), LearnError> {
        let DenseState { steps, packed, m, v, average } = &mut *self.training.write();
        let length = m.len();
        let parameters = find("dense", length)?;
        modify(&self.var, |own| own.copy_from_slice(parameters))?;
        self.mlp.pack(parameters, true, packed);
        m.copy_from_slice(find("dense_m", length)?);
        v.copy_from_slice(find("dense_v", length)?);
        if let Some((average, packed)) = average {
            average.copy_from_slice(find("dense_average", length)?);
            self.mlp.pack(average, false, packed);
        }
        *steps = done;
        Ok(())
    }
}

pub(crate) const EPSILON: f64 = 1e-8;

/// Returns Adam's bias-corrected step size at update number `step` (from 1).
fn adam_rate(learning_rate: f32, step: u64) -> AdamRate {
    let step = step.min(1 << 30) as i32;
    let (c1, c2) =
        (1.0 - f64::from(BETA.0).powi(step), (1.0 - f64::from(BETA.1).powi(step)).sqrt());
    AdamRate { rate: (f64::from(learning_rate) * c2 / c1) as f32, epsilon: (EPSILON * c2) as f32 }
}

/// Step sizes of one update.
#[derive(Clone, Copy, Debug)]
pub struct LearningRates {
    /// Of the flat parameters.
    dense: f32,
    /// Of the grid table.
    table: f32,
    /// Of the running average.
    tau: f32,
}

impl LearningRates {
    pub fn from_settings(settings: &LearnSettings) -> Self {
        let LearnSettings { learning_rate, grid_learning_rate, tau, .. } = *settings;
        Self { dense: learning_rate, table: grid_learning_rate, tau }
    }
}

/// Modifies a variable's data in place.
fn modify(var: &Var, change: impl FnOnce(&mut [f32])) -> Result<()> {
    var.inplace_op1(&Modify(RefCell::new(Some(change))))
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
fn slice(storage: &Storage) -> Result<&[f32]> {
    match storage {
        Storage::Cpu(CpuStorage::F32(data)) => Ok(data),
        _ => bail!("the fused kernels need f32 on the CPU"),
    }
}

/// Names of the state's parts: the rows of a corner's line, and the updates as of which averages are
/// stored.
const AVERAGE: &str = "table_average";
const ROW_NAMES: [&str; LINE / CHANNELS] = ["table", AVERAGE, "table_m", "table_v"];
const LAST: &str = "table_last";

/// A table with its training state.
#[derive(Debug)]
pub struct GridTable {
    /// `(corners, 4, channels)`: the rows of each corner.
    pub lines: Var,
    /// `decay[k] = (1 - tau)^k`; empty for a table without an average.
    decay: Vec<f32>,
    training: RwLock<TableState>,
}

/// State kept alongside the lines.
#[derive(Debug)]
struct TableState {
    steps: u64,
    /// Update as of which each corner's average is stored, `(corners)`.
    stored: Vec<u32>,
    /// Gradients of the corners that the current update touches, `(touched, channels)`.
    sums: Vec<[f32; CHANNELS]>,
}

impl GridTable {
    /// Creates a table with initial `values` `(corners, channels)`, and a running average if `tau`
    /// is given.
    fn new(values: &[f32], tau: Option<f32>) -> Result<Self> {
        let corners = values.len() / CHANNELS;
        let mut lines = vec![0.0; corners * LINE];
        for (line, value) in lines.chunks_exact_mut(LINE).zip(values.chunks_exact(CHANNELS)) {
            line[..CHANNELS].copy_from_slice(value);
            line[CHANNELS..2 * CHANNELS].copy_from_slice(value);
        }
        let shape = (corners, LINE / CHANNELS, CHANNELS);
        let training = TableState { steps: 0, stored: vec![0; corners], sums: Vec::new() };
        Ok(Self {
            lines: Var::from_tensor(&Tensor::from_vec(lines, shape, &Device::Cpu)?)?,
            decay: tau.map_or(Vec::new(), decay_table),
            training: RwLock::new(training),
        })
    }

    /// Takes one Adam step on the `touched` corners (the others' moments stay unchanged), with the
    /// sum of `parts`, the gradients of encodings. First brings the touched corners' averages up to
    /// date with the old values, so that this update's averaging step is towards the new ones.
    pub fn step(
        &self,
        touched: &TouchedCorners,
        parts: &[Vec<f32>],
        rates: LearningRates,
    ) -> Result<()> {
        let TableState { steps, stored, sums } = &mut *self.training.write();
        let before = *steps as u32;
        *steps += 1;
        touched.sum_into(parts, sums);
        let rate = adam_rate(rates.table, *steps);
        modify(&self.lines, |lines| {
            let (rows, _) = lines.as_chunks_mut::<CHANNELS>();
            let (lines, _) = rows.as_chunks_mut::<{ LINE / CHANNELS }>();
            for (corner, sum) in touched.corners.iter().zip(sums) {
                let corner = *corner as usize;
                let last = std::mem::replace(&mut stored[corner], before);
                let remaining = self.decay.get((before - last) as usize).copied().unwrap_or(0.0);
                let [value, average, m, v] = &mut lines[corner];
                (0..CHANNELS)
                    .for_each(|c| average[c] = value[c] + (average[c] - value[c]) * remaining);
                kernel::adam_four(value, m, v, sum, rate);
            }
        })
    }

    /// Returns the full training state: the rows, and the updates as of which averages are stored
    /// (as the bits of floats). A table without an average needs neither averages nor these.
    fn state(&self) -> Result<NetworkState> {
        let storage = self.lines.storage_and_layout().0;
        let lines = slice(&storage)?;
        let mut state = NetworkState::new();
        for (row, name) in ROW_NAMES.into_iter().enumerate() {
            if self.has_row(name) {
                let numbers = lines.chunks_exact(CHANNELS).skip(row).step_by(LINE / CHANNELS);
                state.push((name, numbers.flatten().copied().collect()));
            }
        }
        if !self.decay.is_empty() {
            let last =
                self.training.read().stored.iter().map(|last| f32::from_bits(*last)).collect();
            state.push((LAST, last));
        }
        Ok(state)
    }

    /// Restores the state that [`Self::state`] returned after `done` updates.
    fn restore(&self, done: u64, find: FindFn) -> std::result::Result<(), LearnError> {
        let TableState { steps, stored, .. } = &mut *self.training.write();
        for (row, name) in ROW_NAMES.into_iter().enumerate() {
            // Without an average, its row holds the value.
            let numbers =
                find(if self.has_row(name) { name } else { "table" }, stored.len() * CHANNELS)?;
            modify(&self.lines, |lines| {
                let to = lines.chunks_exact_mut(CHANNELS).skip(row).step_by(LINE / CHANNELS);
                to.zip(numbers.chunks_exact(CHANNELS))
                    .for_each(|(to, row)| to.copy_from_slice(row));
            })?;
        }
        if !self.decay.is_empty() {
            let last = find(LAST, stored.len())?;
            if last.iter().any(|last| u64::from(last.to_bits()) > done) {
                let problem = format!("{LAST} contains updates in the future");
                return Err(StoreError::inconsistent(problem).into());
            }
            *stored = last.iter().map(|last| last.to_bits()).collect();
        }
        *steps = done;
        Ok(())
    }

    fn has_row(&self, name: &str) -> bool {
        name != AVERAGE || !self.decay.is_empty()
    }
}

/// Returns (1 - tau)^k for each k until f32 can no longer distinguish the average from the value.
fn decay_table(tau: f32) -> Vec<f32> {
    let keep = 1.0 - f64::from(tau);
    (0..1 << 13).map(|k| keep.powi(k) as f32).take_while(|d| *d > 1e-9).collect()
}

/// Slot of an untouched corner.
const UNTOUCHED: u32 = u32::MAX;

/// The distinct corners around a batch's positions, and which of them each position reads.
#[derive(Clone, Debug, Default)]
pub struct TouchedCorners {
    /// The touched corners, in order of first occurrence.
    corners: Vec<u32>,
    /// For each read, the index of its corner in `corners`: `(positions, levels, 2^dims)`.
    slots: Vec<u32>,
    /// Corners and weights of the positions' reads.
    places: GridReads,
    /// For each corner of the table, its index in `corners`.
    slot_of: Vec<u32>,
    /// Number of corners that a position reads per level.
    around: usize,
}

impl TouchedCorners {
    /// Finds the corners of a table of `shape` that are read by the positions that `locate` adds.
    pub fn find(&mut self, shape: &GridShape, locate: impl FnOnce(&mut GridReads)) {
        self.slot_of.resize(shape.corners(), UNTOUCHED);
        for corner in self.corners.drain(..) {
            self.slot_of[corner as usize] = UNTOUCHED;
        }
        self.around = shape.corners_around();
        self.places.clear();
        self.slots.clear();
        locate(&mut self.places);
        let Self { corners, slot_of, .. } = self;
        self.slots.extend(self.places.corners.iter().map(|corner| {
            let slot = &mut slot_of[*corner as usize];
            if *slot == UNTOUCHED {
                *slot = corners.len() as u32;
                corners.push(*corner);
            }
            *slot
        }));
    }

    /// Writes the gradient of each touched corner to `sums`, `(touched, channels)`, from the
    /// gradients of the positions' encodings: `parts` of `(positions, levels, channels)`, in the
    /// order in which the positions were located.
    fn sum_into(&self, parts: &[Vec<f32>], sums: &mut Vec<[f32; CHANNELS]>) {
        sums.clear();
        sums.resize(self.corners.len(), [0.0; CHANNELS]);
        let encodings = parts.iter().flat_map(|part| part.as_chunks::<CHANNELS>().0);
        let read =
            self.slots.chunks_exact(self.around).zip(self.places.weights.chunks_exact(self.around));
        for ((slots, weights), d) in read.zip(encodings) {
            for (slot, weight) in slots.iter().zip(weights) {
                (0..CHANNELS).for_each(|c| sums[*slot as usize][c] += weight * d[c]);
            }
        }
    }

    /// Returns the gradient of the whole table, `(corners, channels)`, from the same input.
    #[cfg(test)]
    pub fn table_gradient(&self, parts: &[Vec<f32>]) -> Vec<f32> {
        let (mut sums, mut gradient) = (Vec::new(), vec![0.0; self.slot_of.len() * CHANNELS]);
        self.sum_into(parts, &mut sums);
        for (corner, sum) in self.corners.iter().zip(sums) {
            gradient[*corner as usize * CHANNELS..][..CHANNELS].copy_from_slice(&sum);
        }
        gradient
    }
}
