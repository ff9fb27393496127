//! Single kernels at the shapes of an update: `cargo bench`.

use divan::{Bencher, black_box};
use gdg::learn::kernel::{self, AdamRate};
use gdg::learn::product::{Lhs, Panels};

/// Rows and width.
const SHAPES: [(usize, usize); 4] = [(32, 64), (32, 128), (64, 256), (256, 256)];

fn main() {
    divan::main();
}

fn numbers(length: usize) -> Vec<f32> {
    (0..length).map(|i| (i % 17) as f32 * 0.1 - 0.8).collect()
}

/// A hidden layer forward: rows x width times width x width, bias and ReLU.
#[divan::bench(args = SHAPES)]
fn forward(bencher: Bencher, (rows, width): (usize, usize)) {
    let (x, bias, mut y, mut w) =
        (numbers(rows * width), numbers(width), numbers(rows * width), Panels::default());
    w.pack(&numbers(width * width), width, width);
    bencher.bench_local(|| w.relu_layer(Lhs::Rows(black_box(&x)), rows, &bias, &mut y));
}

/// The gradient of its weights, packing included.
#[divan::bench(args = SHAPES)]
fn backward_weights(bencher: Bencher, (rows, width): (usize, usize)) {
    let (x, d, mut dw) = (numbers(rows * width), numbers(rows * width), numbers(width * width));
    let mut packed = Panels::default();
    bencher.bench_local(|| {
        packed.pack(black_box(&d), rows, width);
        packed.product(Lhs::Columns(black_box(&x)), width, 0, &mut dw);
    });
}

/// The gradient of its inputs.
#[divan::bench(args = SHAPES)]
fn backward_inputs(bencher: Bencher, (rows, width): (usize, usize)) {
    let (d, mut dx, mut w) = (numbers(rows * width), numbers(rows * width), Panels::default());
    w.pack_transposed(&numbers(width * width), width, width);
    bencher.bench_local(|| w.product(Lhs::Rows(black_box(&d)), rows, 0, &mut dx));
}

/// The gradient behind a ReLU layer.
#[divan::bench(args = SHAPES)]
fn relu_backward(bencher: Bencher, (rows, width): (usize, usize)) {
    let (mut d, y) = (numbers(rows * width), numbers(rows * width));
    bencher.bench_local(|| kernel::relu_backward(black_box(&mut d), &y));
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
    let (mut w, mut m, mut v, g) =
        (numbers(length), vec![0.0; length], vec![0.0; length], numbers(length));
    let rate = AdamRate { rate: 1e-3, epsilon: 1e-8 };
    bencher.bench_local(|| kernel::adam(black_box(&mut w), &mut m, &mut v, &g, rate));
}

/// The weights of a hidden layer packed for the backward pass, once per update.
#[divan::bench(args = [64, 128, 256])]
fn pack_transposed(bencher: Bencher, width: usize) {
    let (w, mut packed) = (numbers(width * width), Panels::default());
    bencher.bench_local(|| packed.pack_transposed(black_box(&w), width, width));
}
