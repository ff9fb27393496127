//! Dense kernels on row-major slices. The only place with unsafe code: vector loads and stores for
//! transposing blocks in registers.
//!
//! Element-wise loops are compiled for several SIMD instruction sets and selected at run time, so
//! that a portable build uses what the CPU supports.
#![allow(unsafe_code)]

use pulp::Arch;

/// Side of the blocks that [`transpose`] handles in registers.
#[cfg(target_arch = "x86_64")]
const BLOCK_SIDE: usize = 8;

/// Computes `out[c][r] = x[r][c]` for `x` of `(rows, cols)` and `out` with rows of `stride`
/// numbers.
///
/// # Panics
/// Panics if a slice is too short, or if `rows` exceeds `stride`.
pub fn transpose(x: &[f32], (rows, cols): (usize, usize), out: &mut [f32], stride: usize) {
    let (x, out) = (&x[..rows * cols], &mut out[..cols * stride]);
    assert!(rows <= stride, "{rows} numbers in rows of {stride}");
    let transposed = transpose_in_registers(x, (rows, cols), out, stride);
    for r in 0..rows {
        let from = if r < transposed.0 { transposed.1 } else { 0 };
        (from..cols).for_each(|c| out[c * stride + r] = x[r * cols + c]);
    }
}

/// Tells the processor that `place` will be read soon, and the rest of its cache line.
pub fn prefetch<T>(place: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint reads nothing, and every x86-64 processor knows it.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(place).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

/// Does the part of [`transpose`] that the processor can do in registers; returns its number of
/// rows and columns.
#[cfg(target_arch = "x86_64")]
fn transpose_in_registers(
    x: &[f32],
    (rows, cols): (usize, usize),
    out: &mut [f32],
    stride: usize,
) -> (usize, usize) {
    if !std::is_x86_feature_detected!("avx") {
        return (0, 0);
    }
    let transposed = (rows / BLOCK_SIDE * BLOCK_SIDE, cols / BLOCK_SIDE * BLOCK_SIDE);
    // SAFETY: the processor supports AVX, for which the function is compiled.
    unsafe { transpose_blocks(x, cols, transposed, out, stride) };
    transposed
}

/// Does nothing: for other processors, the compiler vectorises the plain loop well enough.
#[cfg(not(target_arch = "x86_64"))]
fn transpose_in_registers(_: &[f32], _: (usize, usize), _: &mut [f32], _: usize) -> (usize, usize) {
    (0, 0)
}

/// Does the part of [`transpose`] within the first `transposed` rows and columns, block by block.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx")]
fn transpose_blocks(
    x: &[f32],
    cols: usize,
    transposed: (usize, usize),
    out: &mut [f32],
    stride: usize,
) {
    use std::arch::x86_64::{_mm256_loadu_ps, _mm256_setzero_ps, _mm256_storeu_ps};
    use std::arch::x86_64::{
        _mm256_permute2f128_ps, _mm256_shuffle_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
    };
    for r in (0..transposed.0).step_by(BLOCK_SIDE) {
        for c in (0..transposed.1).step_by(BLOCK_SIDE) {
            // Plain loops: closures would become calls here, as they cannot be given the target
            // feature.
            let (mut x8, mut twos, mut fours) =
                ([_mm256_setzero_ps(); 8], [_mm256_setzero_ps(); 8], [_mm256_setzero_ps(); 8]);
            for i in 0..BLOCK_SIDE {
                let row = &x[(r + i) * cols + c..][..BLOCK_SIDE];
                // SAFETY: `row` holds eight numbers.
                x8[i] = unsafe { _mm256_loadu_ps(row.as_ptr()) };
            }
            // Interleave pairs of rows, then pairs of pairs, then swap halves.
            for i in 0..4 {
                twos[2 * i] = _mm256_unpacklo_ps(x8[2 * i], x8[2 * i + 1]);
                twos[2 * i + 1] = _mm256_unpackhi_ps(x8[2 * i], x8[2 * i + 1]);
            }
            for i in [0, 4] {
                for j in 0..2 {
                    fours[i + 2 * j] = _mm256_shuffle_ps::<0x44>(twos[i + j], twos[i + j + 2]);
                    fours[i + 2 * j + 1] = _mm256_shuffle_ps::<0xee>(twos[i + j], twos[i + j + 2]);
                }
            }
            for j in 0..4 {
                x8[j] = _mm256_permute2f128_ps::<0x20>(fours[j], fours[j + 4]);
                x8[j + 4] = _mm256_permute2f128_ps::<0x31>(fours[j], fours[j + 4]);
            }
            for j in 0..BLOCK_SIDE {
                let column = &mut out[(c + j) * stride + r..][..BLOCK_SIDE];
                // SAFETY: `column` has room for eight numbers.
                unsafe { _mm256_storeu_ps(column.as_mut_ptr(), x8[j]) };
            }
        }
    }
}

/// Sets `d[i] = 0` where the unit's output `y[i]` is 0 (the backward pass of ReLU).
pub fn relu_backward(d: &mut [f32], y: &[f32]) {
    Arch::new().dispatch(|| {
        for (d, y) in d.iter_mut().zip(y) {
            // Multiply instead of branching: a branch becomes a masked store, which takes some
            // processors a cycle per number.
            *d *= f32::from(*y > 0.0);
        }
    });
}

/// Computes `sums[c] = sum over rows of x[r][c]`.
pub fn column_sums(x: &[f32], sums: &mut [f32]) {
    Arch::new().dispatch(|| {
        sums.fill(0.0);
        for row in x.chunks_exact(sums.len()) {
            for (s, v) in sums.iter_mut().zip(row) {
                *s += v;
            }
        }
    });
}

/// Computes `sum += part`, element by element.
pub fn add_into(sum: &mut [f32], part: &[f32]) {
    Arch::new().dispatch(|| {
        for (s, p) in sum.iter_mut().zip(part) {
            *s += p;
        }
    });
}

/// Computes a layer with few outputs: `y[r][o] = bias[o] + sum_h x[r][h] w[o][h]`, with `w`
/// `(outputs, inputs)`. `gemm` runs at a tenth of its speed on matrices with 1 to 4 columns.
pub fn thin_forward(x: &[f32], w: &[f32], bias: &[f32], y: &mut [f32]) {
    Arch::new().dispatch(|| {
        let inputs = w.len() / bias.len();
        for (x, y) in x.chunks_exact(inputs).zip(y.chunks_exact_mut(bias.len())) {
            for ((y, b), w) in y.iter_mut().zip(bias).zip(w.chunks_exact(inputs)) {
                *y = b + dot(x, w);
            }
        }
    });
}

/// Computes `dx[r][h] = sum_o dy[r][o] w[o][h]`, the thin layer's gradient with respect to its
/// input.
pub fn thin_backward_input(dy: &[f32], w: &[f32], outputs: usize, dx: &mut [f32]) {
    Arch::new().dispatch(|| {
        let inputs = w.len() / outputs;
        for (dx, dy) in dx.chunks_exact_mut(inputs).zip(dy.chunks_exact(outputs)) {
            dx.fill(0.0);
            for (dy, w) in dy.iter().zip(w.chunks_exact(inputs)) {
                for (dx, w) in dx.iter_mut().zip(w) {
                    *dx += dy * w;
                }
            }
        }
    });
}

/// Computes `dw[o][h] = sum_r dy[r][o] x[r][h]` and `db[o] = sum_r dy[r][o]`.
pub fn thin_backward_weights(dy: &[f32], x: &[f32], dw: &mut [f32], db: &mut [f32]) {
    Arch::new().dispatch(|| {
        let outputs = db.len();
        let inputs = dw.len() / outputs;
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
    });
}

/// Returns the dot product, using sixteen partial sums so that it vectorises (a single sum may not
/// be reordered).
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

/// What one Adam step needs besides gradient and moments.
#[derive(Clone, Copy, Debug)]
pub struct AdamRate {
    /// Step size with both bias corrections folded in: lr sqrt(1 - b2^t) / (1 - b1^t).
    pub rate: f32,
    /// Epsilon under the same correction: eps sqrt(1 - b2^t).
    pub epsilon: f32,
}

/// Decay of Adam's first and second moment.
pub const BETA: (f32, f32) = (0.9, 0.999);

/// Moments below this are set to 0: those of dead units would decay into denormals, which are very
/// slow.
const MOMENT_FLOOR: f32 = 1e-20;

/// Takes one Adam step (Kingma and Ba 2015, algorithm 1 in the efficient form of section 2) on `w`.
pub fn adam(w: &mut [f32], m: &mut [f32], v: &mut [f32], gradient: &[f32], rate: AdamRate) {
    Arch::new().dispatch(|| {
        for (((w, m), v), g) in w.iter_mut().zip(m).zip(v).zip(gradient) {
            adam_scalar(w, m, v, *g, rate);
        }
    });
}

/// Does the same as [`adam`] for four numbers, where the run-time dispatch would cost more than the
/// step.
#[inline(always)]
pub fn adam_four(
    w: &mut [f32; 4],
    m: &mut [f32; 4],
    v: &mut [f32; 4],
    gradient: &[f32; 4],
    rate: AdamRate,
) {
    // Load everything before storing anything: only then does this become one vector.
    let (mut w1, mut m1, mut v1) = (*w, *m, *v);
    (0..4).for_each(|c| adam_scalar(&mut w1[c], &mut m1[c], &mut v1[c], gradient[c], rate));
    (*w, *m, *v) = (w1, m1, v1);
}

#[inline(always)]
fn adam_scalar(w: &mut f32, m: &mut f32, v: &mut f32, g: f32, rate: AdamRate) {
    let m1 = BETA.0 * *m + (1.0 - BETA.0) * g;
    let v1 = BETA.1 * *v + (1.0 - BETA.1) * (g * g);
    *m = if m1.abs() < MOMENT_FLOOR { 0.0 } else { m1 };
    *v = if v1 < MOMENT_FLOOR { 0.0 } else { v1 };
    *w -= rate.rate * *m / (v.sqrt() + rate.epsilon);
}

/// Computes `average += tau (w - average)` (Polyak averaging).
pub fn soft_update(average: &mut [f32], w: &[f32], tau: f32) {
    for (a, w) in average.iter_mut().zip(w) {
        *a += tau * (w - *a);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lengths beyond a full set of vectors at any SIMD width, with every remainder.
    const LENGTHS: std::ops::RangeInclusive<usize> = 0..=70;

    /// Returns numbers of both signs, 0 among them, exact in f32, that differ between seeds.
    fn numbers(length: usize, seed: usize) -> Vec<f32> {
        (0..length).map(|i| ((i * 31 + seed * 13) % 23) as f32 * 0.125 - 1.375).collect()
    }

    fn assert_close(found: &[f32], expected: impl Iterator<Item = f64>, label: &str) {
        let expected: Vec<f64> = expected.collect();
        assert_eq!(found.len(), expected.len(), "{label}");
        let off =
            found.iter().zip(&expected).map(|(f, r)| (f64::from(*f) - r).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{label}: off by {off}");
    }

    #[test]
    fn transpose_is_correct_at_any_size() {
        let odd = (0..=26).flat_map(|rows| (0..=26).map(move |cols| (rows, cols)));
        for (rows, cols) in odd.chain([(40, 7), (8, 70), (70, 8), (54, 128)]) {
            for stride in [rows, rows + 1, rows + 8] {
                let x: Vec<f32> = (0..rows * cols).map(|i| i as f32).collect();
                let mut out = vec![-1.0; stride * cols];
                transpose(&x, (rows, cols), &mut out, stride);
                // The padding between rows must stay untouched.
                let expected = |c, r| if r < rows { x[r * cols + c] } else { -1.0 };
                let all =
                    (0..cols).all(|c| (0..stride).all(|r| out[c * stride + r] == expected(c, r)));
                assert!(all, "{rows} x {cols} to rows of {stride}");
            }
        }
    }

    #[test]
    fn element_wise_loops_are_correct_at_any_length() {
        for n in LENGTHS {
            let (a, b) = (numbers(n, 1), numbers(n, 2));
            let changed = |change: fn(&mut [f32], &[f32])| {
                let mut a = a.clone();
                change(&mut a, &b);
                a
            };
            let pairs = || a.iter().zip(&b);
            let masked: Vec<f32> = pairs().map(|(d, y)| if *y > 0.0 { *d } else { 0.0 }).collect();
            assert_eq!(changed(relu_backward), masked, "{n} masked");
            let sums: Vec<f32> = pairs().map(|(s, p)| s + p).collect();
            assert_eq!(changed(add_into), sums, "{n} added");
            let average: Vec<f32> = pairs().map(|(a, w)| a + 0.25 * (w - a)).collect();
            assert_eq!(changed(|a, w| soft_update(a, w, 0.25)), average, "{n} averaged");
        }
    }

    #[test]
    fn adam_matches_the_paper_at_any_length() {
        let rate = AdamRate { rate: 0.01, epsilon: 1e-6 };
        for n in LENGTHS {
            let (w, m, g) = (numbers(n, 1), numbers(n, 2), numbers(n, 3));
            let v: Vec<f32> = numbers(n, 4).iter().map(|v| v * v).collect();
            let (mut w1, mut m1, mut v1) = (w.clone(), m.clone(), v.clone());
            adam(&mut w1, &mut m1, &mut v1, &g, rate);
            let (b1, b2) = (f64::from(BETA.0), f64::from(BETA.1));
            let of = |numbers: &[f32], i: usize| f64::from(numbers[i]);
            let m_expected = |i| b1 * of(&m, i) + (1.0 - b1) * of(&g, i);
            let v_expected = |i| b2 * of(&v, i) + (1.0 - b2) * of(&g, i).powi(2);
            assert_close(&m1, (0..n).map(m_expected), "first moments");
            assert_close(&v1, (0..n).map(v_expected), "second moments");
            let step = |i| {
                f64::from(rate.rate) * m_expected(i)
                    / (v_expected(i).sqrt() + f64::from(rate.epsilon))
            };
            assert_close(&w1, (0..n).map(|i| of(&w, i) - step(i)), "weights");

            if let (Ok(mut w), Ok(mut m), Ok(mut v), Ok(g)) =
                (w.try_into(), m.try_into(), v.try_into(), g.try_into())
            {
                adam_four(&mut w, &mut m, &mut v, &g, rate);
                assert_eq!((w1, m1, v1), (w.to_vec(), m.to_vec(), v.to_vec()), "at once");
            }
        }
    }

    #[test]
    fn sums_and_thin_layers_are_correct_at_any_width() {
        for (inputs, rows) in
            LENGTHS.skip(1).flat_map(|inputs| [0, 1, 2, 7].map(|rows| (inputs, rows)))
        {
            let x = numbers(rows * inputs, 1);
            let x_at = |r: usize, h: usize| f64::from(x[r * inputs + h]);
            let mut sums = vec![f32::NAN; inputs];
            column_sums(&x, &mut sums);
            assert_close(&sums, (0..inputs).map(|h| (0..rows).map(|r| x_at(r, h)).sum()), "sums");
            for outputs in 1..=5 {
                let (w, bias, dy) =
                    (numbers(outputs * inputs, 2), numbers(outputs, 3), numbers(rows * outputs, 4));
                let w_at = |o: usize, h: usize| f64::from(w[o * inputs + h]);
                let dy_at = |r: usize, o: usize| f64::from(dy[r * outputs + o]);

                let mut y = vec![f32::NAN; rows * outputs];
                thin_forward(&x, &w, &bias, &mut y);
                let dot = |r, o| (0..inputs).map(|h| x_at(r, h) * w_at(o, h)).sum::<f64>();
                let expected =
                    |i: usize| f64::from(bias[i % outputs]) + dot(i / outputs, i % outputs);
                assert_close(&y, (0..rows * outputs).map(expected), "forward");

                let mut dx = vec![f32::NAN; rows * inputs];
                thin_backward_input(&dy, &w, outputs, &mut dx);
                let expected = |i: usize| {
                    (0..outputs).map(|o| dy_at(i / inputs, o) * w_at(o, i % inputs)).sum::<f64>()
                };
                assert_close(&dx, (0..rows * inputs).map(expected), "inputs' gradient");

                let (mut dw, mut db) = (vec![f32::NAN; outputs * inputs], vec![f32::NAN; outputs]);
                thin_backward_weights(&dy, &x, &mut dw, &mut db);
                let expected = |i: usize| {
                    (0..rows).map(|r| dy_at(r, i / inputs) * x_at(r, i % inputs)).sum::<f64>()
                };
                assert_close(&dw, (0..outputs * inputs).map(expected), "weights' gradient");
                let expected = |o: usize| (0..rows).map(|r| dy_at(r, o)).sum();
                assert_close(&db, (0..outputs).map(expected), "biases' gradient");
            }
        }
    }
}
