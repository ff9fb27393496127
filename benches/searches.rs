//! Searches of an evaluation on large maps: `cargo bench --bench searches`.

use std::sync::Arc;

use divan::Bencher;
use gdg::env::{Evaluated, PointMaze};
use gdg::map::{Diameter, Grid, RandomMapKind, random};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const KINDS: [RandomMapKind; 3] =
    [RandomMapKind::City, RandomMapKind::Maze, RandomMapKind::Perfect];

/// Side of the maps, in cells.
const SIDE: usize = 1024;

/// Tasks at each of six distances, as in an evaluation of a run.
const TASKS: usize = 20;

fn main() {
    divan::main();
}

fn map(kind: RandomMapKind) -> Grid {
    random(kind, Some(SIDE), 1)
}

/// The diameter, once for every map.
#[divan::bench(args = KINDS, sample_count = 3)]
fn diameter(bencher: Bencher, kind: RandomMapKind) {
    let map = map(kind);
    bencher.bench_local(|| Diameter::compute(&map));
}

/// The tasks of an evaluation.
#[divan::bench(args = KINDS, sample_count = 3)]
fn tasks(bencher: Bencher, kind: RandomMapKind) {
    let world = PointMaze::new(Arc::new(map(kind)), 0);
    world.diameter();
    bencher.bench_local(|| world.tasks(TASKS, &mut ChaCha8Rng::seed_from_u64(1)));
}

/// The pairs on which an evaluation measures the error of D.
#[divan::bench(args = KINDS, sample_count = 3)]
fn pairs(bencher: Bencher, kind: RandomMapKind) {
    let world = PointMaze::new(Arc::new(map(kind)), 0);
    bencher.bench_local(|| {
        world.ground_truth().map(|mut truth| truth.pairs(&mut ChaCha8Rng::seed_from_u64(1)))
    });
}
