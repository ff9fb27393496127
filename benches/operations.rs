//! Single operations: `cargo bench --bench operations`, with a word to measure only those whose
//! names contain it (`-- arm`).

use std::hint::black_box;
use std::sync::Arc;

use divan::Bencher;
use gdg::env::{Environment, Evaluated, FetchReach, PointMaze};
use gdg::learn::kernel::{self, AdamRate};
use gdg::learn::product::{Lhs, Panels};
use gdg::learn::{GDG, LearnSettings, Learner, NetworkLearner, Scratch};
use gdg::map::{Cell, Diameter, Grid, RandomMapKind, random};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rows and width of a layer in an update.
const SHAPES: [(usize, usize); 4] = [(32, 64), (32, 128), (64, 256), (256, 256)];
const WIDTHS: [usize; 3] = [64, 128, 256];

/// The maps on which the searches of an evaluation are measured, and their side in cells.
const KINDS: [RandomMapKind; 3] =
    [RandomMapKind::City, RandomMapKind::Maze, RandomMapKind::Perfect];
const SIDE: usize = 1024;

/// Tasks at each of six distances, as in an evaluation of a run.
const TASKS: usize = 20;

/// Agents that act, and the side of their map in cells.
const AGENTS: usize = 32;
const OPEN_SIDE: usize = 256;

fn main() {
    divan::main();
}

fn numbers(length: usize) -> Vec<f32> {
    (0..length).map(|i| (i % 17) as f32 * 0.1 - 0.8).collect()
}

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1)
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

/// A dense Adam step of a network of that width.
#[divan::bench(args = WIDTHS)]
fn adam(bencher: Bencher, width: usize) {
    let length = width * (width + 8);
    let (mut w, mut m, mut v, g) =
        (numbers(length), vec![0.0; length], vec![0.0; length], numbers(length));
    let rate = AdamRate { rate: 1e-3, epsilon: 1e-8 };
    bencher.bench_local(|| kernel::adam(black_box(&mut w), &mut m, &mut v, &g, rate));
}

/// The weights of a hidden layer packed for the backward pass, once per update.
#[divan::bench(args = WIDTHS)]
fn pack_transposed(bencher: Bencher, width: usize) {
    let (w, mut packed) = (numbers(width * width), Panels::default());
    bencher.bench_local(|| packed.pack_transposed(black_box(&w), width, width));
}

/// A step of the arm: of random pulls, and of one straight down, which presses all fingers onto the
/// table.
#[divan::bench(args = [false, true])]
fn arm_step(bencher: Bencher, presses: bool) {
    let (mut world, mut rng) = (FetchReach::new(1), rng());
    bencher.bench_local(|| {
        let mut pull = || std::array::from_fn(|_| rng.random_range(-1.0..=1.0));
        let action: [f32; 4] = if presses { [0.0, 0.0, -1.0, 0.0] } else { pull() };
        drop(world.step(black_box(&action), &mut rng));
    });
}

/// A step of all agents in a maze, their actions, and D on all of its cells.
#[divan::bench(args = ["step", "actions", "field"])]
fn agents(bencher: Bencher, what: &str) {
    let free = vec![true; OPEN_SIDE * OPEN_SIDE];
    let map = Arc::new(Grid::new("open", OPEN_SIDE, free, Vec::new(), Vec::new()));
    let (mut world, mut rng) = (PointMaze::new(map.clone(), AGENTS), rng());
    (0..AGENTS).for_each(|i| drop(world.restart(i, &mut rng)));
    let learner = NetworkLearner::new(GDG, world.spec(), &LearnSettings::default(), 1, &mut rng);
    let Ok(policy) = learner.map_err(Into::into).and_then(|learner| learner.policy(true)) else {
        return;
    };
    let (mut scratch, mut actions) = (Scratch::default(), vec![0.0; 2 * AGENTS]);
    let states = world.states().to_vec();
    let cells: Vec<f32> = map.free_cells().flat_map(Cell::centre).collect();
    let goals = [40.5, 200.5].repeat(cells.len() / 2);
    let mut field = vec![0.0; cells.len() / 2];
    bencher.bench_local(|| match what {
        "step" => drop(world.step(black_box(&actions), &mut rng)),
        "actions" => policy.actions(&states, &goals[..states.len()], &mut actions, &mut scratch),
        _ => policy.distances(black_box(&cells), &goals, &mut field, &mut scratch),
    });
}

/// The searches of an evaluation: the diameter, once for every map; its tasks; the pairs on which it
/// measures the error of D.
#[divan::bench(args = KINDS, sample_count = 3)]
fn search_diameter(bencher: Bencher, kind: RandomMapKind) {
    let map = random(kind, Some(SIDE), 1);
    bencher.bench_local(|| Diameter::compute(&map));
}

#[divan::bench(args = KINDS, sample_count = 3)]
fn search_tasks(bencher: Bencher, kind: RandomMapKind) {
    let world = PointMaze::new(random(kind, Some(SIDE), 1).into(), 0);
    world.diameter();
    bencher.bench_local(|| world.tasks(TASKS, &mut rng()));
}

#[divan::bench(args = KINDS, sample_count = 3)]
fn search_pairs(bencher: Bencher, kind: RandomMapKind) {
    let world = PointMaze::new(random(kind, Some(SIDE), 1).into(), 0);
    bencher.bench_local(|| world.ground_truth().map(|mut truth| truth.pairs(&mut rng())));
}
