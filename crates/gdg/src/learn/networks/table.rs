//! The grid encoding's table: trained only where a batch touches it, with a lazy running average.

use candle_core::{Device, Result, Storage, Tensor, Var, bail};
use parking_lot::{RwLock, RwLockReadGuard};

use crate::learn::kernels::kernel;
use crate::learn::networks::dense::{
    FillFn, LearningRates, NetworkState, adam_rate, modify, slice,
};
use crate::learn::networks::grid::{GridReads, GridShape, LazyAverageView, TableView};

/// Rows of a corner's line: value, average, and Adam's first and second moment. With four channels
/// that is one cache line, so a corner costs one cache miss instead of four.
const ROWS: usize = 4;

/// Names of the state's parts: the rows, and the updates as of which averages are stored.
const AVERAGE: &str = "table_average";
const ROW_NAMES: [&str; ROWS] = ["table", AVERAGE, "table_m", "table_v"];
const LAST: &str = "table_last";

/// A table with its training state.
#[derive(Debug)]
pub struct Table {
    channels: usize,
    /// `(corners, ROWS, channels)`.
    lines: Var,
    /// `decay[k] = (1 - tau)^k`; empty for a table without an average.
    decay: Vec<f32>,
    training: RwLock<TrainingState>,
}

/// State kept alongside the lines.
#[derive(Debug)]
struct TrainingState {
    steps: u64,
    /// Update as of which each corner's average is stored, `(corners)`.
    stored: Vec<u32>,
    /// Gradients of the corners that the current update touches, `(touched, channels)`.
    sums: Vec<f32>,
}

/// A table locked for reading.
pub struct TableGuard<'a> {
    table: &'a Table,
    lines: RwLockReadGuard<'a, Storage>,
    training: RwLockReadGuard<'a, TrainingState>,
}

impl TableGuard<'_> {
    /// Returns what encodings read: the values, or their running average if `averaged` and there is
    /// one.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn view(&self, averaged: bool) -> Result<TableView<'_>> {
        let Table { decay, channels, .. } = self.table;
        let lazy = LazyAverageView {
            stored: &self.training.stored,
            now: self.training.steps as u32,
            decay,
        };
        let average = (averaged && !decay.is_empty()).then_some(lazy);
        Ok(TableView { lines: slice(&self.lines)?, stride: ROWS * channels, average })
    }
}

impl Table {
    /// Creates a table with initial `values` `(corners, channels)`, and a running average if `tau`
    /// is given.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn new(values: &[f32], channels: usize, tau: Option<f32>) -> Result<Self> {
        let corners = values.len() / channels;
        let mut lines = vec![0.0; corners * ROWS * channels];
        for (line, value) in
            lines.chunks_exact_mut(ROWS * channels).zip(values.chunks_exact(channels))
        {
            line[..channels].copy_from_slice(value);
            line[channels..2 * channels].copy_from_slice(value);
        }
        Ok(Self {
            channels,
            lines: Var::from_tensor(&Tensor::from_vec(
                lines,
                (corners, ROWS, channels),
                &Device::Cpu,
            )?)?,
            decay: tau.map_or(Vec::new(), decay_table),
            training: RwLock::new(TrainingState {
                steps: 0,
                stored: vec![0; corners],
                sums: Vec::new(),
            }),
        })
    }

    /// Returns the table as a candle variable `(corners, 4, channels)`; the first of the four rows
    /// is the value.
    pub fn lines(&self) -> &Var {
        &self.lines
    }

    /// Returns the number of channels per corner.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Locks the table for reading.
    pub fn lock(&self) -> TableGuard<'_> {
        TableGuard {
            table: self,
            lines: self.lines.storage_and_layout().0,
            training: self.training.read(),
        }
    }

    /// Copies the values `(corners, channels)`, or their averages, evaluating lazy ones.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn copy(&self, averaged: bool) -> Result<Vec<f32>> {
        let guard = self.lock();
        let view = guard.view(averaged)?;
        let values = view.lines.chunks_exact(view.stride).enumerate().flat_map(|(corner, line)| {
            let remaining = view.average.map_or(0.0, |lazy| lazy.remaining(corner));
            let (value, rest) = line.split_at(self.channels);
            value.iter().zip(rest).map(move |(value, stored)| value + (stored - value) * remaining)
        });
        Ok(values.collect())
    }

    /// Takes one Adam step on the `touched` corners (the others' moments stay unchanged), with the
    /// sum of `parts`, the gradients of encodings. First brings the touched corners' averages up to
    /// date with the old values, so that this update's averaging step is towards the new ones.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn step(
        &self,
        touched: &TouchedCorners,
        parts: &[Vec<f32>],
        rates: LearningRates,
    ) -> Result<()> {
        let (Self { channels, decay, .. }, TrainingState { steps, stored, sums }) =
            (self, &mut *self.training.write());
        let before = *steps as u32;
        *steps += 1;
        touched.sum_into(parts, *channels, sums);
        let rate = adam_rate(rates.table, *steps);
        modify(&self.lines, |lines| {
            for (corner, sum) in touched.corners().iter().zip(sums.chunks_exact(*channels)) {
                let corner = *corner as usize;
                let last = std::mem::replace(&mut stored[corner], before);
                let remaining = decay.get((before - last) as usize).copied().unwrap_or(0.0);
                let line = &mut lines[corner * ROWS * *channels..(corner + 1) * ROWS * *channels];
                if let (([value, average, m, v], []), ([sum], [])) =
                    (line.as_chunks_mut::<4>(), sum.as_chunks::<4>())
                {
                    (0..4)
                        .for_each(|c| average[c] = value[c] + (average[c] - value[c]) * remaining);
                    kernel::adam_small(value, m, v, sum, rate);
                } else {
                    let (value, rest) = line.split_at_mut(*channels);
                    let (average, moments) = rest.split_at_mut(*channels);
                    let (m, v) = moments.split_at_mut(*channels);
                    average
                        .iter_mut()
                        .zip(&*value)
                        .for_each(|(a, w)| *a = w + (*a - w) * remaining);
                    kernel::adam_small(value, m, v, sum, rate);
                }
            }
        })
    }

    /// Returns the full training state: the rows, and the updates as of which averages are stored
    /// (as the bits of floats). A table without an average needs neither averages nor these.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn state(&self) -> Result<NetworkState> {
        let guard = self.lock();
        let lines = slice(&guard.lines)?;
        let mut state = NetworkState::new();
        for (row, name) in ROW_NAMES.into_iter().enumerate() {
            if self.has_row(name) {
                let numbers = lines.chunks_exact(self.channels).skip(row).step_by(ROWS);
                state.push((name, numbers.flatten().copied().collect()));
            }
        }
        if !self.decay.is_empty() {
            let last = guard.training.stored.iter().map(|last| f32::from_bits(*last)).collect();
            state.push((LAST, last));
        }
        Ok(state)
    }

    /// Restores the state that [`Self::state`] returned after `done` updates, read through `fill`.
    ///
    /// # Errors
    /// Returns the error of `fill`, or candle's error if a tensor operation fails.
    pub fn restore(&self, done: u64, fill: FillFn) -> Result<()> {
        let TrainingState { steps, stored, .. } = &mut *self.training.write();
        let mut result = Ok(());
        modify(&self.lines, |lines| {
            result = self.restore_rows(lines, fill);
        })?;
        result?;
        if !self.decay.is_empty() {
            let mut last = vec![0.0; stored.len()];
            fill(LAST, &mut last)?;
            if last.iter().any(|last| u64::from(last.to_bits()) > done) {
                bail!("{LAST} contains updates in the future");
            }
            *stored = last.into_iter().map(f32::to_bits).collect();
        }
        *steps = done;
        Ok(())
    }

    fn restore_rows(&self, lines: &mut [f32], fill: FillFn) -> Result<()> {
        let mut numbers = vec![0.0; lines.len() / ROWS];
        for (row, name) in ROW_NAMES.into_iter().enumerate() {
            if self.has_row(name) {
                fill(name, &mut numbers)?;
            }
            let to = lines.chunks_exact_mut(self.channels).skip(row).step_by(ROWS);
            to.zip(numbers.chunks_exact(self.channels))
                .for_each(|(to, row)| to.copy_from_slice(row));
        }
        Ok(())
    }

    /// Returns whether this row is part of the state.
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

    /// Returns the touched corners.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// Writes the gradient of each touched corner to `sums`, `(touched, channels)`, from the
    /// gradients of the positions' encodings: `parts` of `(positions, levels, channels)`, in the
    /// order in which the positions were located.
    pub fn sum_into(&self, parts: &[Vec<f32>], channels: usize, sums: &mut Vec<f32>) {
        sums.clear();
        sums.resize(self.corners.len() * channels, 0.0);
        let encodings = parts.iter().flat_map(|part| part.chunks_exact(channels));
        let read =
            self.slots.chunks_exact(self.around).zip(self.places.weights.chunks_exact(self.around));
        for ((slots, weights), d) in read.zip(encodings) {
            let reads = slots.iter().zip(weights);
            if let ((sums, []), ([d], [])) = (sums.as_chunks_mut::<4>(), d.as_chunks::<4>()) {
                // The default of four channels, vectorised.
                reads.for_each(|(slot, weight)| {
                    (0..4).for_each(|c| sums[*slot as usize][c] += weight * d[c]);
                });
            } else {
                for (slot, weight) in reads {
                    let sums = &mut sums[*slot as usize * channels..][..channels];
                    sums.iter_mut().zip(d).for_each(|(sum, d)| *sum += weight * d);
                }
            }
        }
    }

    /// Returns the gradient of the whole table, `(corners, channels)`, from the same input.
    pub fn table_gradient(&self, parts: &[Vec<f32>], channels: usize) -> Vec<f32> {
        let mut sums = Vec::new();
        self.sum_into(parts, channels, &mut sums);
        let mut gradient = vec![0.0; self.slot_of.len() * channels];
        for (corner, sum) in self.corners.iter().zip(sums.chunks_exact(channels)) {
            gradient[*corner as usize * channels..][..channels].copy_from_slice(sum);
        }
        gradient
    }
}
