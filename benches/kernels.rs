//! Single kernels at the shapes of an update: `cargo bench`.

use divan::{Bencher, black_box};
use gdg_tui::learn::kernel::{self, AdamRate, Matrix};

/// Rows and width.
const SHAPES: [(usize, usize); 4] = [(32, 64), (32, 128), (64, 256), (256, 256)];

fn main() {
    divan::main();
}

fn numbers(length: usize) -> Vec<f32> {
    (0..length).map(|i| (i % 17) as f32 * 0.1 - 0.8).collect()
}

/// Rows x width times width x width: a hidden layer forward.
#[divan::bench(args = SHAPES)]
fn forward(bencher: Bencher, (rows, width): (usize, usize)) {
    let (x, w, mut y) = (numbers(rows * width), numbers(width * width), numbers(rows * width));
    bencher.bench_local(|| {
        kernel::product(Matrix::new(black_box(&x), rows, width), Matrix::new(&w, width, width), &mut y);
    });
}

/// The gradient of its weights.
#[divan::bench(args = SHAPES)]
fn backward_weights(bencher: Bencher, (rows, width): (usize, usize)) {
    let (x, d, mut dw) = (numbers(rows * width), numbers(rows * width), numbers(width * width));
    bencher.bench_local(|| {
        kernel::product(Matrix::new(black_box(&x), rows, width).transposed(), Matrix::new(&d, rows, width), &mut dw);
    });
}

/// The gradient of its inputs.
#[divan::bench(args = SHAPES)]
fn backward_inputs(bencher: Bencher, (rows, width): (usize, usize)) {
    let (d, w, mut dx) = (numbers(rows * width), numbers(width * width), numbers(rows * width));
    bencher.bench_local(|| {
        let w = Matrix::new(&w, width, width).transposed();
        kernel::product(Matrix::new(black_box(&d), rows, width), w, &mut dx);
    });
}

/// Bias and ReLU of a hidden layer.
#[divan::bench(args = SHAPES)]
fn bias_relu(bencher: Bencher, (rows, width): (usize, usize)) {
    let (mut x, bias) = (numbers(rows * width), numbers(width));
    bencher.bench_local(|| kernel::add_bias_relu(black_box(&mut x), &bias));
}

/// An output layer of one number.
#[divan::bench(args = SHAPES)]
fn thin_output(bencher: Bencher, (rows, width): (usize, usize)) {
    let (x, w, mut y) = (numbers(rows * width), numbers(width), numbers(rows));
    bencher.bench_local(|| kernel::thin_forward(black_box(&x), &w, &[0.5], &mut y));
}

/// A dense Adam step of a network of that width.
#[divan::bench(args = [64, 128, 256])]
fn adam(bencher: Bencher, width: usize) {
    let length = width * (width + 8);
    let (mut w, mut m, mut v, g) = (numbers(length), vec![0.0; length], vec![0.0; length], numbers(length));
    let rate = AdamRate { rate: 1e-3, epsilon: 1e-8 };
    bencher.bench_local(|| kernel::adam(black_box(&mut w), &mut m, &mut v, &g, rate));
}
