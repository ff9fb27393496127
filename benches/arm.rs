//! Time of a step of the arm: `cargo bench --bench arm`.
//!
//! Times differ between machines and with their load, so each is also given as a multiple of a
//! matrix product that is measured in turns with it.

use std::hint::black_box;
use std::time::Instant;

use gdg::env::{Environment, FetchReach};
use gdg::learn::product::{Lhs, Panels};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Turns, and steps in each.
const TURNS: usize = 60;
const STEPS: usize = 50;

/// Rows and width of the product, and repetitions in a turn.
const PRODUCT: (usize, usize) = (64, 128);
const PRODUCTS: usize = 50;

/// How actions are chosen.
#[derive(Clone, Copy)]
enum Pull {
    /// Uniform random.
    Random,
    /// Straight down: all fingers press onto the table.
    Down,
}

/// Returns the microseconds that `work` takes, of `count` repetitions.
fn time_us(count: usize, mut work: impl FnMut()) -> f64 {
    let began = Instant::now();
    (0..count).for_each(|_| work());
    began.elapsed().as_secs_f64() * 1e6 / count as f64
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let (rows, width) = PRODUCT;
    let numbers =
        |length: usize| (0..length).map(|i| (i % 17) as f32 * 0.1 - 0.8).collect::<Vec<f32>>();
    let (x, bias, mut y, mut w) =
        (numbers(rows * width), numbers(width), numbers(rows * width), Panels::default());
    w.pack(&numbers(width * width), width, width);
    for (name, pull) in [("random pulls", Pull::Random), ("pressing on the table", Pull::Down)] {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut world = FetchReach::new(1);
        let (mut of_step, mut of_product) = (Vec::new(), Vec::new());
        for _ in 0..TURNS {
            drop(world.restart(0, &mut rng));
            of_step.push(time_us(STEPS, || {
                let action = match pull {
                    Pull::Random => std::array::from_fn(|_| rng.random_range(-1.0..=1.0)),
                    Pull::Down => [0.0, 0.0, -1.0, 0.0],
                };
                drop(world.step(black_box(&action), &mut rng));
            }));
            of_product.push(time_us(PRODUCTS, || {
                w.relu_layer(Lhs::Rows(black_box(&x)), rows, &bias, &mut y);
            }));
        }
        let (step, product) = (median(of_step), median(of_product));
        println!(
            "arm step, {name}: {step:.1} us, {:.1} x a layer of {rows} x {width} x {width} ({product:.1} us)",
            step / product
        );
    }
}
