//! Matrix products whose right-hand side is packed once and reused: between two optimiser steps, a
//! layer's weights serve every part of a batch and the passes of several networks.
//!
//! The kernel keeps a tile of the result in registers: a few rows by two vectors of columns (Goto
//! and van de Geijn 2008, "Anatomy of high-performance matrix multiplication", section 4). Each
//! number of the result is one chain of multiply-adds in the order of the inner index, whichever
//! tile it is in, so results do not depend on how rows are split over parts.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::learn::kernels::kernel;

/// Vectors of columns in a tile.
const VECTORS: usize = 2;

/// Maximum rows of a tile, with 32 registers and with fewer: enough chains of multiply-adds to keep
/// a core busy, few enough to keep the whole tile in registers.
const MAX_TILE_ROWS: (usize, usize) = (8, 6);

/// The right-hand side of products, `(depth, columns)`, cut into panels as wide as a tile; the last
/// panel is padded with zeros.
#[derive(Clone, Debug, Default)]
pub struct Panels {
    data: Vec<f32>,
    depth: usize,
    columns: usize,
    /// Columns of a panel.
    width: usize,
}

/// The left-hand side of a product with `rows` rows.
#[derive(Clone, Copy)]
pub enum Lhs<'a> {
    /// `(rows, depth)`, row-major.
    Rows(&'a [f32]),
    /// Its transpose: `(depth, rows)`, row-major.
    Columns(&'a [f32]),
}

impl Panels {
    /// Packs `b`, `(depth, columns)` row-major.
    ///
    /// # Panics
    /// Panics if `b` is too short.
    pub fn pack(&mut self, b: &[f32], depth: usize, columns: usize) {
        self.fill(depth, columns, |panel, width, from, count| {
            for (k, row) in panel.chunks_exact_mut(width).enumerate() {
                row[..count].copy_from_slice(&b[k * columns + from..][..count]);
            }
        });
    }

    /// Packs the transpose of `b`, which is `(columns, depth)` row-major.
    ///
    /// # Panics
    /// Panics if `b` is too short.
    pub fn pack_transposed(&mut self, b: &[f32], depth: usize, columns: usize) {
        self.fill(depth, columns, |panel, width, from, count| {
            kernel::transpose(&b[from * depth..][..count * depth], (count, depth), panel, width);
        });
    }

    /// Calls `fill` for each panel, with its width, its first column and how many there are.
    fn fill(
        &mut self,
        depth: usize,
        columns: usize,
        fill: impl Fn(&mut [f32], usize, usize, usize),
    ) {
        let width = Arch::new().dispatch(PanelWidth);
        let length = columns.div_ceil(width) * width * depth;
        if (self.depth, self.columns) != (depth, columns) || self.data.len() != length {
            // The padding beyond the last column stays zero from here on.
            self.data.clear();
            self.data.resize(length, 0.0);
        }
        (self.depth, self.columns, self.width) = (depth, columns, width);
        let panels = self.data.chunks_exact_mut(depth * width).zip((0..columns).step_by(width));
        panels.for_each(|(panel, from)| fill(panel, width, from, width.min(columns - from)));
    }

    /// Computes the columns of `out = left * self` from `from` on, `(rows, columns - from)`
    /// row-major.
    ///
    /// # Panics
    /// Panics if the sizes do not match.
    pub fn product(&self, left: Lhs, rows: usize, from: usize, out: &mut [f32]) {
        self.run(left, rows, from, None, out);
    }

    /// Computes a ReLU layer, `out = max(0, left * self + bias)`, `(rows, columns)`.
    ///
    /// # Panics
    /// Panics if the sizes do not match.
    pub fn relu_layer(&self, left: Lhs, rows: usize, bias: &[f32], out: &mut [f32]) {
        self.run(left, rows, 0, Some(bias), out);
    }

    fn run(&self, left: Lhs, rows: usize, from: usize, bias: Option<&[f32]>, out: &mut [f32]) {
        assert!(from <= self.columns, "column {from} of {}", self.columns);
        let wanted = self.columns - from;
        if rows > 0 && wanted > 0 {
            Arch::new().dispatch(Product { left, panels: self, rows, from, bias, out });
        }
    }
}

struct PanelWidth;

impl WithSimd for PanelWidth {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        VECTORS * S::F32_LANES
    }
}

struct Product<'a> {
    left: Lhs<'a>,
    panels: &'a Panels,
    rows: usize,
    from: usize,
    bias: Option<&'a [f32]>,
    out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { left, panels, rows, from, bias, out } = self;
        let Panels { ref data, depth, columns, width } = *panels;
        let max_rows = if S::REGISTER_COUNT >= 32 { MAX_TILE_ROWS.0 } else { MAX_TILE_ROWS.1 };
        // Tiles of nearly equal height: a last tile of one or two rows would take almost as long as
        // a full one.
        let tiles = rows.div_ceil(max_rows);
        for panel in from / width..columns.div_ceil(width) {
            let (b, _) = S::as_simd_f32s(&data[panel * depth * width..][..depth * width]);
            let first = panel * width;
            let to = Window {
                columns: first.max(from)..(first + width).min(columns),
                first,
                from,
                stride: columns - from,
            };
            let bias = bias.map(|bias| &bias[to.columns.clone()]);
            for tile in 0..tiles {
                let (r, end) = (rows * tile / tiles, rows * (tile + 1) / tiles);
                let out = &mut out[r * to.stride..end * to.stride];
                macro_rules! tile {
                    ($($n:literal)*) => {
                        match end - r {
                            $($n => match left {
                                Lhs::Rows(a) => {
                                    let tile = rows_tile::<S, $n>(simd, &a[r * depth..end * depth], b);
                                    store(simd, &tile, &to, bias, out);
                                }
                                Lhs::Columns(a) => {
                                    let tile = columns_tile::<S, $n>(simd, &a[..depth * rows], rows, r, b);
                                    store(simd, &tile, &to, bias, out);
                                }
                            },)*
                            _ => unreachable!("no tile has more rows"),
                        }
                    };
                }
                tile!(1 2 3 4 5 6 7 8);
            }
        }
    }
}

/// Rows of the result in registers.
type Tile<S, const R: usize> = [[<S as Simd>::f32s; VECTORS]; R];

/// Which columns of a panel belong to the result, and where to store them.
struct Window {
    /// The panel's part of the result, as a range of all columns.
    columns: Range<usize>,
    /// The panel's first column.
    first: usize,
    /// The result's first column.
    from: usize,
    /// Columns of the result.
    stride: usize,
}

/// Computes a tile from the rows `a` `(R, depth)`.
#[inline(always)]
fn rows_tile<S: Simd, const R: usize>(simd: S, a: &[f32], b: &[S::f32s]) -> Tile<S, R> {
    let depth = a.len() / R;
    let rows: [&[f32]; R] = std::array::from_fn(|i| &a[i * depth..][..depth]);
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; R];
    for (k, b) in b.as_chunks::<VECTORS>().0[..depth].iter().enumerate() {
        for i in 0..R {
            let factor = simd.splat_f32s(rows[i][k]);
            for v in 0..VECTORS {
                sums[i][v] = simd.mul_add_e_f32s(factor, b[v], sums[i][v]);
            }
        }
    }
    sums
}

/// Computes a tile from `R` columns of `a` `(depth, rows)`, starting at `r`.
#[inline(always)]
fn columns_tile<S: Simd, const R: usize>(
    simd: S,
    a: &[f32],
    rows: usize,
    r: usize,
    b: &[S::f32s],
) -> Tile<S, R> {
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; R];
    for (a, b) in a.chunks_exact(rows).zip(b.as_chunks::<VECTORS>().0) {
        let a = &a[r..][..R];
        for i in 0..R {
            let factor = simd.splat_f32s(a[i]);
            for v in 0..VECTORS {
                sums[i][v] = simd.mul_add_e_f32s(factor, b[v], sums[i][v]);
            }
        }
    }
    sums
}

/// Writes a tile to the rows `out`, applying bias and ReLU if there is a bias.
#[inline(always)]
fn store<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<S, R>,
    to: &Window,
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    let (skip, count) = (to.columns.start - to.first, to.columns.len());
    if count == VECTORS * S::F32_LANES {
        let bias = bias.map(|bias| S::as_simd_f32s(bias).0);
        for i in 0..R {
            let row = &mut out[i * to.stride + to.columns.start - to.from..][..count];
            let (row, _) = S::as_mut_simd_f32s(row);
            for v in 0..VECTORS {
                row[v] = bias.map_or(tile[i][v], |bias| {
                    simd.max_f32s(simd.add_f32s(tile[i][v], bias[v]), simd.splat_f32s(0.0))
                });
            }
        }
        return;
    }
    for i in 0..R {
        let numbers: &[f32] = pulp::bytemuck::cast_slice(&tile[i]);
        let row = &mut out[i * to.stride + to.columns.start - to.from..][..count];
        row.copy_from_slice(&numbers[skip..skip + count]);
        if let Some(bias) = bias {
            row.iter_mut().zip(bias).for_each(|(y, b)| *y = (*y + b).max(0.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_correct_in_all_forms_at_odd_sizes() {
        let numbers = |length: usize, first: usize| -> Vec<f32> {
            (first..first + length).map(|i| ((i * 7919) % 23) as f32 * 0.25 - 2.5).collect()
        };
        // Tiles of every height; full, partial and no panels; and sizes of the networks.
        let odd = (0..=17).flat_map(|rows| {
            (0..=70).map(move |columns| (rows, 1 + (rows + columns) % 5, columns))
        });
        for (rows, depth, columns) in
            odd.chain([(12, 16, 32), (13, 9, 65), (29, 40, 72), (64, 31, 128)])
        {
            let (a, b) = (numbers(rows * depth, 0), numbers(depth * columns, 5));
            let (bias, mut panels) = (numbers(columns, 0), Panels::default());
            // A side given as its transpose; the last columns alone; a ReLU layer.
            for (of_columns, transposed, from, layer) in [
                (false, false, 0, false),
                (true, false, 0, false),
                (false, true, columns / 2, false),
                (false, false, 0, true),
            ] {
                let left = if of_columns { Lhs::Columns(&a) } else { Lhs::Rows(&a) };
                if transposed {
                    panels.pack_transposed(&b, depth, columns);
                } else {
                    panels.pack(&b, depth, columns);
                }
                let mut out = vec![f32::NAN; rows * (columns - from)];
                if layer {
                    panels.relu_layer(left, rows, &bias, &mut out);
                } else {
                    panels.product(left, rows, from, &mut out);
                }
                for (i, out) in out.into_iter().enumerate() {
                    let (r, c) = (i / (columns - from), from + i % (columns - from));
                    let term = |k: usize| {
                        let a = a[if of_columns { k * rows + r } else { r * depth + k }];
                        let b = b[if transposed { c * depth + k } else { k * columns + c }];
                        f64::from(a) * f64::from(b)
                    };
                    let sum: f64 = (0..depth).map(term).sum();
                    let expected = if layer { (sum + f64::from(bias[c])).max(0.0) } else { sum };
                    let off = (f64::from(out) - expected).abs();
                    assert!(off < 1e-3, "{rows} x {depth} x {columns} from {from}: {out}");
                }
            }
        }
    }

    #[test]
    fn a_row_is_bit_identical_alone_and_among_others() {
        let (depth, columns) = (50, 70);
        let numbers = |n: usize| -> Vec<f32> {
            (0..n).map(|i| ((i * 31) % 101) as f32 * 0.017 - 0.8).collect()
        };
        let (a, b) = (numbers(20 * depth), numbers(depth * columns));
        let mut panels = Panels::default();
        panels.pack(&b, depth, columns);
        let (mut all, mut one) = (vec![0.0; 20 * columns], vec![0.0; columns]);
        panels.product(Lhs::Rows(&a), 20, 0, &mut all);
        for r in 0..20 {
            panels.product(Lhs::Rows(&a[r * depth..][..depth]), 1, 0, &mut one);
            assert_eq!(one, all[r * columns..][..columns], "row {r}");
        }
    }
}
