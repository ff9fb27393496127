//! The corners of a grid table that an update touches, found once for all networks that read the
//! same positions.

use crate::learn::networks::grid::{GridReads, GridShape};

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
