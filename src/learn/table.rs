//! The grid encoding's table: trained where a batch touches it, its average kept lazily.

use candle_core::{Device, Result, Tensor, Var};

use super::adam::{adam_rate, modify, slice};
use super::gradient::{Gradient, StepRates};
use super::grid::{LazyView, Note, TableView};
use super::kernel;

/// Rows of a corner's line: value, average, and Adam's first and second moment. With four channels that is one cache
/// line, so that a corner costs one miss and not four.
const ROWS: usize = 4;

/// Slot of a corner that the current update has not touched.
const UNTOUCHED: u32 = u32::MAX;

/// A table with everything that training changes.
#[derive(Debug)]
pub struct Table {
    channels: usize,
    /// `(corners, ROWS, channels)`.
    lines: Var,
    notes: Vec<Note>,
    /// `decay[k] = (1 - tau)^k`; empty for a table without an average.
    decay: Vec<f32>,
    /// Corners touched by the current update, and the sums of their gradients `(touched, channels)`.
    touched: Vec<u32>,
    sums: Vec<f32>,
}

impl Table {
    /// A table of fresh `values` `(corners, channels)`; `tau` for a running average.
    ///
    /// # Errors
    /// What candle reports.
    pub fn new(values: &[f32], channels: usize, tau: Option<f32>) -> Result<Self> {
        let corners = values.len() / channels;
        let mut lines = vec![0.0; corners * ROWS * channels];
        for (line, value) in lines.chunks_exact_mut(ROWS * channels).zip(values.chunks_exact(channels)) {
            line[..channels].copy_from_slice(value);
            line[channels..2 * channels].copy_from_slice(value);
        }
        Ok(Self {
            channels,
            lines: Var::from_tensor(&Tensor::from_vec(lines, (corners, ROWS, channels), &Device::Cpu)?)?,
            notes: vec![Note { last: 0, slot: UNTOUCHED }; corners],
            decay: tau.map_or(Vec::new(), decay_table),
            touched: Vec::new(),
            sums: Vec::new(),
        })
    }

    /// The table as a candle variable `(corners, 4, channels)`, of whose rows the first is the value.
    pub fn lines(&self) -> &Var {
        &self.lines
    }

    /// Corners and channels.
    pub fn size(&self) -> (usize, usize) {
        (self.notes.len(), self.channels)
    }

    /// What encodings read, after `now` updates; `lines` is the locked storage of [`Self::lines`].
    pub fn view<'a>(&'a self, lines: &'a [f32], averaged: bool, now: u64) -> TableView<'a> {
        let average = (averaged && !self.decay.is_empty()).then_some(LazyView {
            notes: &self.notes,
            now: now as u32,
            decay: &self.decay,
        });
        TableView { lines, stride: ROWS * self.channels, average }
    }

    /// Values `(corners, channels)` as they are, or their averages written out.
    ///
    /// # Errors
    /// What candle reports.
    pub fn copy(&self, averaged: bool, now: u64) -> Result<Vec<f32>> {
        let (storage, _) = self.lines.storage_and_layout();
        let view = self.view(slice(&storage)?, averaged, now);
        let channels = self.channels;
        let values = (0..self.notes.len()).flat_map(|corner| {
            let line = &view.lines[corner * view.stride..(corner + 1) * view.stride];
            let remaining = view.average.map_or(0.0, |lazy| lazy.remaining(corner));
            line[..channels]
                .iter()
                .zip(&line[channels..])
                .map(move |(value, stored)| value + (stored - value) * remaining)
        });
        Ok(values.collect())
    }

    /// Adds a part's gradient.
    pub fn add(&mut self, part: &Gradient) {
        let Self { channels, notes, touched, sums, .. } = self;
        let mut slot_of = |corner: usize, sums: &mut Vec<f32>| {
            let note = &mut notes[corner];
            if note.slot == UNTOUCHED {
                note.slot = touched.len() as u32;
                touched.push(corner as u32);
                sums.resize(touched.len() * *channels, 0.0);
            }
            note.slot as usize
        };
        if *channels == 4 {
            // The default, in vectors of four.
            part.for_each_corner(4, |corner, weight, d| {
                let slot = slot_of(corner, sums);
                let (sums, _) = sums.as_chunks_mut::<4>();
                (0..4).for_each(|c| sums[slot][c] += weight * d[c]);
            });
        } else {
            part.for_each_corner(*channels, |corner, weight, d| {
                let slot = slot_of(corner, sums);
                let sum = &mut sums[slot * *channels..(slot + 1) * *channels];
                sum.iter_mut().zip(d).for_each(|(s, d)| *s += weight * d);
            });
        }
    }

    /// Adam on the touched corners (the others' moments rest), and their averages brought up to date: update number
    /// `now` then makes the average's own step towards the new value.
    ///
    /// # Errors
    /// What candle reports.
    pub fn step(&mut self, now: u64, rates: StepRates) -> Result<()> {
        let Self { channels, lines, notes, decay, touched, sums } = self;
        let rate = adam_rate(rates.table, now);
        let before = now as u32 - 1;
        modify(lines, |lines| {
            for (corner, sum) in touched.iter().zip(sums.chunks_exact(*channels)) {
                let corner = *corner as usize;
                let note = &mut notes[corner];
                let remaining = decay.get((before - note.last) as usize).copied().unwrap_or(0.0);
                *note = Note { last: before, slot: UNTOUCHED };
                let line = &mut lines[corner * ROWS * *channels..(corner + 1) * ROWS * *channels];
                if let (([value, average, m, v], []), ([sum], [])) = (line.as_chunks_mut::<4>(), sum.as_chunks::<4>()) {
                    (0..4).for_each(|c| average[c] = value[c] + (average[c] - value[c]) * remaining);
                    kernel::adam_few(value, m, v, sum, rate);
                } else {
                    let (value, rest) = line.split_at_mut(*channels);
                    let (average, moments) = rest.split_at_mut(*channels);
                    let (m, v) = moments.split_at_mut(*channels);
                    average.iter_mut().zip(&*value).for_each(|(a, w)| *a = w + (*a - w) * remaining);
                    kernel::adam_few(value, m, v, sum, rate);
                }
            }
        })?;
        touched.clear();
        sums.clear();
        Ok(())
    }

    /// Everything that training changed: the lines, and the updates up to which averages are stored (by their bits).
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<[(&'static str, Vec<f32>); 2]> {
        let (storage, _) = self.lines.storage_and_layout();
        let last = self.notes.iter().map(|note| f32::from_bits(note.last)).collect();
        Ok([("table", slice(&storage)?.to_vec()), ("table_last", last)])
    }

    /// Takes up what [`Self::state`] gave, filled in by `fill`.
    ///
    /// # Errors
    /// What `fill` reports.
    pub fn restore(&mut self, mut fill: impl FnMut(&str, &mut [f32]) -> Result<()>) -> Result<()> {
        let mut result = Ok(());
        modify(&self.lines, |lines| result = fill("table", lines))?;
        result?;
        let mut last = vec![0.0; self.notes.len()];
        fill("table_last", &mut last)?;
        self.notes = last.into_iter().map(|bits| Note { last: f32::to_bits(bits), slot: UNTOUCHED }).collect();
        Ok(())
    }
}

/// (1 - tau)^k until f32 can no longer tell the average from the value.
fn decay_table(tau: f32) -> Vec<f32> {
    let keep = 1.0 - f64::from(tau);
    (0..1 << 13).map(|k| keep.powi(k) as f32).take_while(|d| *d > 1e-9).collect()
}
