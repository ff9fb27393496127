//! Trainable multi-resolution grid encoding: feature channels stored at grid corners and read by
//! multilinear interpolation at a position (the dense levels of Müller et al. 2022, "Instant neural
//! graphics primitives").

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::learn::kernels::kernel::prefetch;

/// Trainable features at each corner of each grid.
pub const CHANNELS: usize = 4;

/// A level whose table would have more corners than this gets larger cells instead.
const MAX_CORNERS: usize = 1 << 19;

/// Geometry of the tables; positions are scaled to [-1, 1] along every axis.
#[derive(Clone, Debug, PartialEq)]
pub struct GridShape {
    pub dims: usize,
    pub levels: Vec<Level>,
}

/// One resolution of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Corners along each axis.
    pub corners: usize,
    /// Index of its first corner in the table of all levels.
    pub first: usize,
}

/// Read access to a table: its values, or their running average.
#[derive(Clone, Copy)]
pub struct TableView<'a> {
    /// One line per corner: its value, followed by its stored average if there is one.
    pub lines: &'a [f32],
    /// Numbers in a line: [`LINE`] of a table in training, [`CHANNELS`] of a copy.
    pub stride: usize,
    /// For reading the average: the update as of which each corner's average is stored, and its
    /// decay since.
    pub average: Option<LazyAverageView<'a>>,
}

/// Numbers at a corner of a table in training: value, average, and Adam's first and second moment.
/// That is one cache line, so a corner costs one cache miss instead of four.
pub const LINE: usize = 4 * CHANNELS;

/// The lazy running average of a table of which each update changes only a few corners.
///
/// While a corner's value is unchanged, its average approaches it by the same factor at every
/// update, so the average at any later time follows from the one at the last change. Only changed
/// corners cost work.
#[derive(Clone, Copy)]
pub struct LazyAverageView<'a> {
    /// Update as of which each corner's average is stored, `(corners)`.
    pub stored: &'a [u32],
    pub now: u32,
    /// `decay[k] = (1 - tau)^k`; 0 beyond its end.
    pub decay: &'a [f32],
}

impl LazyAverageView<'_> {
    /// Returns the remaining difference between the average and the value of `corner`, as a share
    /// of the stored difference.
    #[inline]
    pub fn remaining(&self, corner: usize) -> f32 {
        self.decay.get((self.now - self.stored[corner]) as usize).copied().unwrap_or(0.0)
    }
}

/// Location of a position in one level: the lower corner, and the weight of the upper corner along
/// each axis.
#[derive(Clone, Copy)]
struct LevelPosition {
    corner: usize,
    share: [f32; 3],
}

impl LevelPosition {
    #[inline]
    fn axis_weight(&self, bits: usize, axis: usize) -> f32 {
        if bits >> axis & 1 == 1 { self.share[axis] } else { 1.0 - self.share[axis] }
    }
}

impl Level {
    fn place(self, position: &[f32]) -> LevelPosition {
        let mut place = LevelPosition { corner: self.first, share: [0.0; 3] };
        let mut stride = 1;
        for (share, u) in place.share.iter_mut().zip(position) {
            let at = ((u + 1.0) * 0.5).clamp(0.0, 1.0) * (self.corners - 1) as f32;
            let lower = (at as usize).min(self.corners - 2);
            *share = at - lower as f32;
            place.corner += lower * stride;
            stride *= self.corners;
        }
        place
    }
}

/// Table reads of many positions: the corners around each position in every level, and their
/// weights.
#[derive(Clone, Debug, Default)]
pub struct GridReads {
    /// `(positions, levels, 2^dims)`.
    pub corners: Vec<u32>,
    /// `(positions, levels, 2^dims)`.
    pub weights: Vec<f32>,
}

impl GridReads {
    pub fn clear(&mut self) {
        self.corners.clear();
        self.weights.clear();
    }
}

impl GridShape {
    /// Creates tables for positions with one to three axes; `cell_sizes` are in units of which the
    /// range [-1, 1] spans `units`.
    pub fn new(dims: usize, cell_sizes: &[f32], units: f32) -> Self {
        let mut levels: Vec<Level> = Vec::new();
        let mut first = 0;
        for size in cell_sizes {
            let mut corners = (units / size).ceil() as usize + 1;
            while corners.pow(dims as u32) > MAX_CORNERS {
                corners = corners.div_ceil(2);
            }
            corners = corners.max(2);
            if levels.iter().any(|l| l.corners == corners) {
                continue;
            }
            levels.push(Level { corners, first });
            first += corners.pow(dims as u32);
        }
        Self { dims, levels }
    }

    pub fn corners(&self) -> usize {
        self.levels.last().map_or(0, |l| l.first + l.corners.pow(self.dims as u32))
    }

    pub fn width(&self) -> usize {
        self.levels.len() * CHANNELS
    }

    /// Draws an initial table of small random values.
    pub fn initial(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        (0..self.corners() * CHANNELS).map(|_| rng.random_range(-0.01..0.01)).collect()
    }

    /// Calls `visit(corner, bits)` for each corner around a place; bit k of `bits` is set if it is
    /// the upper one along axis k.
    #[inline]
    fn around(&self, level: Level, place: &LevelPosition, mut visit: impl FnMut(usize, usize)) {
        for bits in 0..self.corners_around() {
            let mut corner = place.corner;
            let mut stride = 1;
            for axis in 0..self.dims {
                if bits >> axis & 1 == 1 {
                    corner += stride;
                }
                stride *= level.corners;
            }
            visit(corner, bits);
        }
    }

    /// Returns the number of corners that a position reads per level.
    pub fn corners_around(&self) -> usize {
        1 << self.dims
    }

    /// Adds the reads of `position` (`dims`, scaled) to `places`; they are the same for all tables
    /// of this shape.
    pub fn locate(&self, position: &[f32], places: &mut GridReads) {
        for level in &self.levels {
            let place = level.place(position);
            self.around(*level, &place, |corner, bits| {
                let weight = (0..self.dims).map(|axis| place.axis_weight(bits, axis)).product();
                places.corners.push(corner as u32);
                places.weights.push(weight);
            });
        }
    }

    /// Adds the last of `places` once more.
    pub fn locate_again(&self, places: &mut GridReads) {
        let reads = self.levels.len() * self.corners_around();
        places.corners.extend_from_within(places.corners.len() - reads..);
        places.weights.extend_from_within(places.weights.len() - reads..);
    }

    /// Prefetches what [`Self::encode`] reads for the position at `row` of `places`, if there is one:
    /// encoding is bound by memory latency.
    pub fn prefetch(&self, table: TableView, places: &GridReads, row: usize) {
        let reads = self.levels.len() * self.corners_around();
        let corners = places.corners.get(row * reads..(row + 1) * reads).unwrap_or_default();
        for corner in corners {
            let corner = *corner as usize;
            prefetch(&table.lines[corner * table.stride]);
            if let Some(lazy) = table.average {
                prefetch(&lazy.stored[corner]);
            }
        }
    }

    /// Encodes the position at `row` of `places` into `out` (`width`).
    pub fn encode(&self, table: TableView, places: &GridReads, row: usize, out: &mut [f32]) {
        if table.stride == LINE {
            self.encode_lines::<LINE>(table, places, row, out);
        } else {
            self.encode_lines::<CHANNELS>(table, places, row, out);
        }
    }

    fn encode_lines<const STRIDE: usize>(
        &self,
        table: TableView,
        places: &GridReads,
        row: usize,
        out: &mut [f32],
    ) {
        let around = self.corners_around();
        let reads = self.levels.len() * around;
        let at = row * reads..(row + 1) * reads;
        let (corners, weights) = (&places.corners[at.clone()], &places.weights[at]);
        let (lines, _) = table.lines.as_chunks::<STRIDE>();
        let (out, _) = out.as_chunks_mut::<CHANNELS>();
        let levels = corners.chunks_exact(around).zip(weights.chunks_exact(around)).zip(out);
        for ((corners, weights), out) in levels {
            let mut sum = [0.0; CHANNELS];
            for (corner, weight) in corners.iter().zip(weights) {
                let line = &lines[*corner as usize];
                match table.average {
                    None => (0..CHANNELS).for_each(|c| sum[c] += weight * line[c]),
                    Some(lazy) => {
                        let remaining = lazy.remaining(*corner as usize);
                        // A copy has no average, and shorter lines.
                        let stored = |c: usize| line[(CHANNELS + c) % STRIDE];
                        (0..CHANNELS).for_each(|c| {
                            sum[c] += weight * (line[c] + (stored(c) - line[c]) * remaining);
                        });
                    }
                }
            }
            *out = sum;
        }
    }

    /// Adds the encoding's gradient with respect to the scaled position to `d_position`, from
    /// `d_out` (`width`).
    pub fn position_gradient(
        &self,
        table: TableView,
        position: &[f32],
        d_out: &[f32],
        d_position: &mut [f32],
    ) {
        for (level, d_out) in self.levels.iter().zip(d_out.chunks_exact(CHANNELS)) {
            let place = level.place(position);
            let per_unit = 0.5 * (level.corners - 1) as f32;
            self.around(*level, &place, |corner, bits| {
                let values = &table.lines[corner * table.stride..][..CHANNELS];
                let along: f32 = values.iter().zip(d_out).map(|(v, d)| v * d).sum();
                for (axis, d) in d_position.iter_mut().enumerate().take(self.dims) {
                    let others: f32 = (0..self.dims)
                        .filter(|a| *a != axis)
                        .map(|a| place.axis_weight(bits, a))
                        .product();
                    let sign = if bits >> axis & 1 == 1 { per_unit } else { -per_unit };
                    // Positions are clamped to the range, so the gradient is zero outside it.
                    if position[axis].abs() <= 1.0 {
                        *d += sign * others * along;
                    }
                }
            });
        }
    }
}
