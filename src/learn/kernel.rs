//! Dense kernels on row-major slices. The one place with unsafe code: the calls into `gemm`.
//!
//! Element-wise loops run through `pulp`'s dispatch, so that a portable build uses the vectors that the CPU has.
#![allow(unsafe_code)]

use gemm::Parallelism;
use pulp::Arch;

/// A matrix in a slice: `rows` x `cols`, read along `row_stride` and `col_stride`.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    data: &'a [f32],
    rows: usize,
    cols: usize,
    row_stride: usize,
    col_stride: usize,
}

impl<'a> Matrix<'a> {
    /// `rows` x `cols`, row-major and dense.
    ///
    /// # Panics
    /// If `data` is shorter than that.
    pub fn new(data: &'a [f32], rows: usize, cols: usize) -> Self {
        assert!(data.len() >= rows * cols, "{} numbers for {rows} x {cols}", data.len());
        Self { data, rows, cols, row_stride: cols, col_stride: 1 }
    }

    /// The same numbers, rows and columns exchanged.
    #[must_use]
    pub fn transposed(self) -> Self {
        Self { rows: self.cols, cols: self.rows, row_stride: self.col_stride, col_stride: self.row_stride, ..self }
    }
}

/// `out = a b`; `out` is `(a.rows, b.cols)` row-major.
///
/// # Panics
/// If the sizes do not fit each other.
pub fn product(a: Matrix, b: Matrix, out: &mut [f32]) {
    let (m, k, n) = (a.rows, a.cols, b.cols);
    assert_eq!(k, b.rows, "inner sizes differ");
    assert!(out.len() >= m * n, "{} numbers for {m} x {n}", out.len());
    if m == 0 || n == 0 {
        return;
    }
    // SAFETY: both matrices' slices hold rows x cols numbers at their strides (checked by `Matrix::new`;
    // transposing exchanges sizes and strides together), `out` holds m x n and is not aliased.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            1,
            n as isize,
            false,
            a.data.as_ptr(),
            a.col_stride as isize,
            a.row_stride as isize,
            b.data.as_ptr(),
            b.col_stride as isize,
            b.row_stride as isize,
            1.0,
            1.0,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

/// `x[r][c] = max(0, x[r][c] + bias[c])`.
pub fn add_bias_relu(x: &mut [f32], bias: &[f32]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for row in x.chunks_exact_mut(bias.len()) {
                for (v, b) in row.iter_mut().zip(bias) {
                    let sum = *v + b;
                    *v = if sum > 0.0 { sum } else { 0.0 };
                }
            }
        },
    );
}

/// `d[i] = 0` where the unit's output `y[i]` is 0 (the backward pass of ReLU).
pub fn relu_backward(d: &mut [f32], y: &[f32]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (d, y) in d.iter_mut().zip(y) {
                *d = if *y > 0.0 { *d } else { 0.0 };
            }
        },
    );
}

/// `sums[c] = sum over rows of x[r][c]`.
pub fn column_sums(x: &[f32], sums: &mut [f32]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            sums.fill(0.0);
            for row in x.chunks_exact(sums.len()) {
                for (s, v) in sums.iter_mut().zip(row) {
                    *s += v;
                }
            }
        },
    );
}

/// `sum += part`, element by element.
pub fn add_into(sum: &mut [f32], part: &[f32]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (s, p) in sum.iter_mut().zip(part) {
                *s += p;
            }
        },
    );
}

/// A layer of few outputs: `y[r][o] = bias[o] + sum_h x[r][h] w[o][h]`. `w` is `(outputs, inputs)`; `gemm` runs at
/// a tenth of its speed on matrices with 1 to 4 columns.
pub fn thin_forward(x: &[f32], w: &[f32], bias: &[f32], y: &mut [f32]) {
    let inputs = w.len() / bias.len();
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (x, y) in x.chunks_exact(inputs).zip(y.chunks_exact_mut(bias.len())) {
                for ((y, b), w) in y.iter_mut().zip(bias).zip(w.chunks_exact(inputs)) {
                    *y = b + dot(x, w);
                }
            }
        },
    );
}

/// `dx[r][h] = sum_o dy[r][o] w[o][h]`, the thin layer's gradient with respect to its input.
pub fn thin_backward_input(dy: &[f32], w: &[f32], outputs: usize, dx: &mut [f32]) {
    let inputs = w.len() / outputs;
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (dx, dy) in dx.chunks_exact_mut(inputs).zip(dy.chunks_exact(outputs)) {
                dx.fill(0.0);
                for (dy, w) in dy.iter().zip(w.chunks_exact(inputs)) {
                    for (dx, w) in dx.iter_mut().zip(w) {
                        *dx += dy * w;
                    }
                }
            }
        },
    );
}

/// `dw[o][h] = sum_r dy[r][o] x[r][h]` and `db[o] = sum_r dy[r][o]`.
pub fn thin_backward_weights(dy: &[f32], x: &[f32], dw: &mut [f32], db: &mut [f32]) {
    let outputs = db.len();
    let inputs = dw.len() / outputs;
    Arch::new().dispatch(
        #[inline(always)]
        || {
            dw.fill(0.0);
            db.fill(0.0);
            for (x, dy) in x.chunks_exact(inputs).zip(dy.chunks_exact(outputs)) {
                for ((dy, dw), db) in dy.iter().zip(dw.chunks_exact_mut(inputs)).zip(db.iter_mut()) {
                    *db += dy;
                    for (dw, x) in dw.iter_mut().zip(x) {
                        *dw += dy * x;
                    }
                }
            }
        },
    );
}

/// Dot product in sixteen running sums, which vectorises (a single sum may not be reordered).
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 16];
    let (a16, b16) = (a.chunks_exact(16), b.chunks_exact(16));
    let tail: f32 = a16.remainder().iter().zip(b16.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a16.zip(b16) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *s += a * b;
        }
    }
    sums.iter().sum::<f32>() + tail
}

/// What one Adam step needs to know besides gradient and moments.
#[derive(Clone, Copy, Debug)]
pub struct AdamRate {
    /// Step size with both bias corrections folded in: lr sqrt(1 - b2^t) / (1 - b1^t).
    pub rate: f32,
    /// Epsilon under the same correction: eps sqrt(1 - b2^t).
    pub epsilon: f32,
}

/// Decay of Adam's first and second moment.
pub const BETA: (f32, f32) = (0.9, 0.999);

/// Moments below this are 0: those of dead units would decay into denormals, which are very slow.
const TINY: f32 = 1e-20;

/// One Adam step (Kingma and Ba 2015, algorithm 1 in the efficient form of section 2) on `w`.
pub fn adam(w: &mut [f32], m: &mut [f32], v: &mut [f32], gradient: &[f32], rate: AdamRate) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (((w, m), v), g) in w.iter_mut().zip(m).zip(v).zip(gradient) {
                adam_one(w, m, v, *g, rate);
            }
        },
    );
}

/// [`adam`] for a handful of numbers, where a dispatch would cost more than the step.
#[inline(always)]
pub fn adam_few(w: &mut [f32], m: &mut [f32], v: &mut [f32], gradient: &[f32], rate: AdamRate) {
    let ((w4, w), (m4, m)) = (w.as_chunks_mut::<4>(), m.as_chunks_mut::<4>());
    let ((v4, v), (g4, g)) = (v.as_chunks_mut::<4>(), gradient.as_chunks::<4>());
    for (((w, m), v), g) in w4.iter_mut().zip(m4).zip(v4).zip(g4) {
        // All loads before all stores: only then does this become one vector.
        let (mut w1, mut m1, mut v1) = (*w, *m, *v);
        (0..4).for_each(|c| adam_one(&mut w1[c], &mut m1[c], &mut v1[c], g[c], rate));
        (*w, *m, *v) = (w1, m1, v1);
    }
    for (((w, m), v), g) in w.iter_mut().zip(m).zip(v).zip(g) {
        adam_one(w, m, v, *g, rate);
    }
}

#[inline(always)]
fn adam_one(w: &mut f32, m: &mut f32, v: &mut f32, g: f32, rate: AdamRate) {
    let m1 = BETA.0 * *m + (1.0 - BETA.0) * g;
    let v1 = BETA.1 * *v + (1.0 - BETA.1) * (g * g);
    *m = if m1.abs() < TINY { 0.0 } else { m1 };
    *v = if v1 < TINY { 0.0 } else { v1 };
    *w -= rate.rate * *m / (v.sqrt() + rate.epsilon);
}

/// `average += tau (w - average)` (Polyak averaging).
pub fn soft_update(average: &mut [f32], w: &[f32], tau: f32) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (a, w) in average.iter_mut().zip(w) {
                *a += tau * (w - *a);
            }
        },
    );
}

/// Multiply-adds that this core does a second at most, in GFLOP/s (two operations each): many independent chains on
/// registers alone.
pub fn multiply_add_gflops() -> f64 {
    Arch::new().dispatch(Peak)
}

struct Peak;

impl pulp::WithSimd for Peak {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> f64 {
        const CHAINS: usize = 16;
        const ROUNDS: usize = 100_000;
        let (factor, term) = (simd.splat_f32s(0.999_9), simd.splat_f32s(0.000_1));
        let mut chains = [simd.splat_f32s(std::hint::black_box(1.0)); CHAINS];
        let began = std::time::Instant::now();
        for _ in 0..ROUNDS {
            for chain in &mut chains {
                *chain = simd.mul_add_f32s(factor, *chain, term);
            }
        }
        // What is computed has to be read before the clock is, or it may be computed later or not at all.
        std::hint::black_box(chains.map(|chain| simd.reduce_sum_f32s(chain)));
        let seconds = began.elapsed().as_secs_f64();
        (2 * S::F32_LANES * CHAINS * ROUNDS) as f64 / seconds / 1e9
    }
}
