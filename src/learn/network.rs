//! One network's parameters: a flat variable, a grid table, their optimiser state and their running average.

use candle_core::{CpuStorage, Device, Result, Storage, Tensor, Var, bail};
use parking_lot::RwLockReadGuard;
use rand_chacha::ChaCha8Rng;

use super::adam::{Moments, adam_rate, adam_step, modify};
use super::grid::{GridShape, LazyView, Places, TableView};
use super::kernel;
use super::mlp::Mlp;

/// A network's weights as slices: what the kernels read.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Flat parameters of the perceptron.
    pub dense: &'a [f32],
    /// The grid encoding's table.
    pub table: Option<TableView<'a>>,
}

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
    fn for_each_corner(&self, channels: usize, mut add: impl FnMut(usize, f32, &[f32])) {
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

/// A network's weights, held for reading.
pub struct Locked<'a> {
    network: &'a Network,
    dense: RwLockReadGuard<'a, Storage>,
    table: Option<RwLockReadGuard<'a, Storage>>,
}

impl Locked<'_> {
    /// The current weights, or their average where there is one and it is asked for.
    ///
    /// # Errors
    /// What candle reports.
    pub fn weights(&self, averaged: bool) -> Result<Weights<'_>> {
        let table = match (&self.network.table, &self.table) {
            (Some(table), Some(storage)) => Some(TableView {
                current: slice(storage)?,
                average: table.average.as_ref().filter(|_| averaged).map(|a| LazyView {
                    stored: &a.stored,
                    last: &a.last,
                    now: self.network.steps as u32,
                    decay: &a.decay,
                }),
            }),
            _ => None,
        };
        let dense = match self.network.dense_average.as_deref().filter(|_| averaged) {
            Some(average) => average,
            None => slice(&self.dense)?,
        };
        Ok(Weights { dense, table })
    }
}

/// A network with everything that training changes.
#[derive(Debug)]
pub struct Network {
    mlp: Mlp,
    dense: Var,
    dense_moments: Moments,
    dense_average: Option<Vec<f32>>,
    table: Option<Table>,
    steps: u64,
}

/// A grid table; only corners that a batch touches cost work.
#[derive(Debug)]
struct Table {
    channels: usize,
    /// `(corners, channels)`.
    values: Var,
    moments: Moments,
    average: Option<LazyAverage>,
    /// Sum of the parts' gradients at `touched` corners; zero elsewhere.
    sum: Vec<f32>,
    touched: Vec<u32>,
    is_touched: Vec<bool>,
}

#[derive(Debug)]
struct LazyAverage {
    stored: Vec<f32>,
    last: Vec<u32>,
    decay: Vec<f32>,
}

/// A network's trainable state as plain numbers, for checkpoints: name and values.
pub type NetworkState = Vec<(&'static str, Vec<f32>)>;

/// Updates after which an average has arrived for all that f32 can tell.
fn decay_table(tau: f32) -> Vec<f32> {
    let keep = 1.0 - f64::from(tau);
    (0..1 << 13).map(|k| keep.powi(k) as f32).take_while(|d| *d > 1e-9).collect()
}

impl Network {
    /// A fresh network; `tau` for a running average, none without it.
    ///
    /// # Errors
    /// What candle reports.
    pub fn new(mlp: Mlp, grid: Option<&GridShape>, tau: Option<f32>, rng: &mut ChaCha8Rng) -> Result<Self> {
        let dense = mlp.initial(rng);
        let table = grid.map(|grid| {
            let values = grid.initial(rng);
            Ok::<_, candle_core::Error>(Table {
                channels: grid.channels,
                moments: Moments::new(values.len()),
                average: tau.map(|tau| LazyAverage {
                    stored: values.clone(),
                    last: vec![0; grid.corners()],
                    decay: decay_table(tau),
                }),
                sum: vec![0.0; values.len()],
                touched: Vec::new(),
                is_touched: vec![false; grid.corners()],
                values: variable(values, (grid.corners(), grid.channels))?,
            })
        });
        Ok(Self {
            mlp,
            dense_moments: Moments::new(dense.len()),
            dense_average: tau.map(|_| dense.clone()),
            dense: variable(dense.clone(), dense.len())?,
            table: table.transpose()?,
            steps: 0,
        })
    }

    /// Sizes of the perceptron.
    pub fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    /// The flat parameters as a candle variable, see [`Mlp`] for their order.
    pub fn dense(&self) -> &Var {
        &self.dense
    }

    /// The grid table as a candle variable, `(corners, channels)`.
    pub fn table(&self) -> Option<&Var> {
        self.table.as_ref().map(|t| &t.values)
    }

    /// Corners of the grid table and channels of each.
    pub fn table_size(&self) -> (usize, usize) {
        self.table.as_ref().map_or((0, 0), |t| (t.is_touched.len(), t.channels))
    }

    /// Locks the weights for reading.
    pub fn lock(&self) -> Locked<'_> {
        let table = self.table.as_ref().map(|t| t.values.storage_and_layout().0);
        Locked { network: self, dense: self.dense.storage_and_layout().0, table }
    }

    /// One Adam step along the sum of `parts` (in their order), then one step of the running average.
    ///
    /// # Errors
    /// What candle reports.
    pub fn step(&mut self, parts: &mut [&mut Gradient], rates: StepRates) -> Result<()> {
        self.steps += 1;
        let (first, rest) = parts.split_first_mut().expect("a batch has at least one part");
        for part in rest.iter() {
            kernel::add_into(&mut first.dense, &part.dense);
        }
        let rate = adam_rate(rates.dense, self.steps);
        adam_step(&self.dense, &mut self.dense_moments, &first.dense, rate)?;
        if let Some(average) = &mut self.dense_average {
            let (storage, _) = self.dense.storage_and_layout();
            kernel::soft_update(average, slice(&storage)?, rates.tau);
        }
        if let Some(table) = &mut self.table {
            parts.iter().for_each(|part| table.add(part));
            table.step(self.steps, rates)?;
        }
        Ok(())
    }

    /// Weights as owned numbers (parameters, table), averages written out.
    ///
    /// # Errors
    /// What candle reports.
    pub fn copy(&self, averaged: bool) -> Result<(Vec<f32>, Vec<f32>)> {
        let locked = self.lock();
        let weights = locked.weights(averaged)?;
        let table = weights.table.map_or(Vec::new(), |t| match &t.average {
            None => t.current.to_vec(),
            Some(lazy) => {
                let channels = t.current.len() / lazy.last.len();
                let rows = t.current.chunks_exact(channels).zip(lazy.stored.chunks_exact(channels)).enumerate();
                let values = rows.flat_map(|(corner, (current, stored))| {
                    let remaining = lazy.remaining(corner);
                    current.iter().zip(stored).map(move |(c, s)| c + (s - c) * remaining)
                });
                values.collect()
            }
        });
        Ok((weights.dense.to_vec(), table))
    }

    /// Everything that training changed, for a checkpoint.
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<NetworkState> {
        let (dense, values) = self.copy(false)?;
        let mut state = vec![("dense", dense), ("dense_m", self.dense_moments.m.clone())];
        state.push(("dense_v", self.dense_moments.v.clone()));
        state.extend(self.dense_average.clone().map(|a| ("dense_average", a)));
        if let Some(table) = &self.table {
            state.push(("table", values));
            state.push(("table_m", table.moments.m.clone()));
            state.push(("table_v", table.moments.v.clone()));
            if let Some(average) = &table.average {
                state.push(("table_average", average.stored.clone()));
                // Update numbers go through f32 by their bits.
                state.push(("table_average_last", average.last.iter().map(|l| f32::from_bits(*l)).collect()));
            }
        }
        Ok(state)
    }

    /// Takes up a state; `find` gives the numbers saved under a name.
    ///
    /// # Errors
    /// A part that is missing or of another size.
    pub fn restore(&mut self, steps: u64, mut find: impl FnMut(&str) -> Option<Vec<f32>>) -> Result<()> {
        let mut fill = |name: &str, into: &mut [f32]| match find(name) {
            Some(values) if values.len() == into.len() => {
                into.copy_from_slice(&values);
                Ok(())
            }
            Some(values) => bail!("{name} holds {} numbers instead of {}", values.len(), into.len()),
            None => bail!("{name} is missing"),
        };
        self.steps = steps;
        let mut result = Ok(());
        modify(&self.dense, |w| result = fill("dense", w))?;
        result?;
        fill("dense_m", &mut self.dense_moments.m)?;
        fill("dense_v", &mut self.dense_moments.v)?;
        if let Some(average) = &mut self.dense_average {
            fill("dense_average", average)?;
        }
        if let Some(table) = &mut self.table {
            let mut result = Ok(());
            modify(&table.values, |w| result = fill("table", w))?;
            result?;
            fill("table_m", &mut table.moments.m)?;
            fill("table_v", &mut table.moments.v)?;
            if let Some(average) = &mut table.average {
                fill("table_average", &mut average.stored)?;
                let mut last = vec![0.0; average.last.len()];
                fill("table_average_last", &mut last)?;
                average.last = last.into_iter().map(f32::to_bits).collect();
            }
        }
        Ok(())
    }

    /// Updates done.
    pub fn steps(&self) -> u64 {
        self.steps
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

impl Table {
    fn add(&mut self, part: &Gradient) {
        let Self { channels, sum, touched, is_touched, .. } = self;
        let mut touch = |corner: usize| {
            if !is_touched[corner] {
                is_touched[corner] = true;
                touched.push(corner as u32);
            }
        };
        if *channels == 4 {
            // The default, in vectors of four.
            let (sum, _) = sum.as_chunks_mut::<4>();
            part.for_each_corner(4, |corner, weight, d| {
                touch(corner);
                let sum = &mut sum[corner];
                (0..4).for_each(|c| sum[c] += weight * d[c]);
            });
        } else {
            part.for_each_corner(*channels, |corner, weight, d| {
                touch(corner);
                let sum = &mut sum[corner * *channels..(corner + 1) * *channels];
                sum.iter_mut().zip(d).for_each(|(s, d)| *s += weight * d);
            });
        }
    }

    /// Adam on the touched corners (the others' moments rest), and their averages brought up to date.
    fn step(&mut self, steps: u64, rates: StepRates) -> Result<()> {
        let Self { channels, values, moments, average, sum, touched, is_touched } = self;
        let rate = adam_rate(rates.table, steps);
        modify(values, |w| {
            for corner in touched.drain(..) {
                let corner = corner as usize;
                let at = corner * *channels..(corner + 1) * *channels;
                is_touched[corner] = false;
                if let Some(average) = average {
                    average.bring_up_to(steps as u32 - 1, corner, &w[at.clone()]);
                }
                let (m, v) = (&mut moments.m[at.clone()], &mut moments.v[at.clone()]);
                let (w, sum) = (&mut w[at.clone()], &mut sum[at]);
                kernel::adam_few(w, m, v, sum, rate);
                sum.fill(0.0);
            }
        })
    }
}

impl LazyAverage {
    /// Stores the average of `corner`, whose value has been `current` since its last change, as of `update`: the
    /// update that changes it then makes the average's own step towards the new value.
    #[inline]
    fn bring_up_to(&mut self, update: u32, corner: usize, current: &[f32]) {
        let remaining = self.decay.get((update - self.last[corner]) as usize).copied().unwrap_or(0.0);
        let stored = &mut self.stored[corner * current.len()..(corner + 1) * current.len()];
        for (stored, current) in stored.iter_mut().zip(current) {
            *stored = current + (*stored - current) * remaining;
        }
        self.last[corner] = update;
    }
}

fn variable(values: Vec<f32>, shape: impl Into<candle_core::Shape>) -> Result<Var> {
    Var::from_tensor(&Tensor::from_vec(values, shape.into(), &Device::Cpu)?)
}

fn slice(storage: &Storage) -> Result<&[f32]> {
    match storage {
        Storage::Cpu(CpuStorage::F32(data)) => Ok(data),
        _ => bail!("the fused kernels read f32 on the CPU"),
    }
}
