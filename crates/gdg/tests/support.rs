//! What most tests of runs share.

use std::path::Path;
use std::sync::Arc;

pub use crate::runs::{state, train_to};
use gdg::env::{Environment, PointMaze};
use gdg::job::Job;
use gdg::learn::Threads;
use gdg::map::parse_map;
use gdg::train::{self, Evaluation, Registry, Run, SaveTo, Settings, Trainer};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Returns a maze without agents of its own.
pub fn maze(text: &str) -> PointMaze {
    PointMaze::new(Arc::new(parse_map("maze", text.as_bytes()).unwrap()), 0)
}

/// Returns a run of `method` with its usual preset and these settings.
pub fn trainer(
    world: &dyn Environment,
    method: &str,
    settings: Settings,
    seed: u64,
    threads: impl Into<Threads>,
) -> Trainer {
    let (method, registry) = (method.parse().unwrap(), Registry::builtin());
    let run = Run { preset: registry.preset_of(&method), method, seed, settings };
    Trainer::new(run, world, &registry, threads).unwrap()
}

/// Fails with the name of the first part in which two runs differ.
pub fn assert_same(a: &Trainer, b: &Trainer) {
    let (a, b) = (state(a), state(b));
    for (name, part) in &a {
        assert!(b.get(name) == Some(part), "{name} differs");
    }
    assert_eq!(a.len(), b.len());
}

/// Trains several runs until `updates` are done.
pub fn train_all<const N: usize>(runs: [&mut Trainer; N], updates: u64) {
    runs.into_iter().for_each(|run| train_to(run, updates));
}

/// Returns what is read from a checkpoint of a run.
pub fn resumed(run: &Trainer, threads: usize) -> Trainer {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new folder/run.safetensors");
    train::save(run, &SaveTo::Replace(path.clone())).unwrap();
    load(&path, threads)
}

/// Returns the run in a checkpoint.
pub fn load(path: &Path, threads: usize) -> Trainer {
    train::load(path, &Registry::builtin(), threads).unwrap()
}

/// Checks that a run stopped after `at` updates ends, resumed, as one that went on to the `end`,
/// and returns that.
pub fn assert_resumes(begin: impl Fn() -> Trainer, at: u64, end: u64) -> Trainer {
    let [mut straight, mut stopped] = [begin(), begin()];
    train_to(&mut straight, end);
    train_to(&mut stopped, at);
    let mut again = resumed(&stopped, 2);
    assert_same(&stopped, &again);
    train_to(&mut again, end);
    assert_same(&straight, &again);
    straight
}

/// Evaluates a run on `tasks` of each distance.
pub fn evaluated(run: &Trainer, tasks: usize) -> Evaluation {
    run.evaluation().unwrap().evaluate(tasks, &Job::default()).unwrap()
}

/// Returns the success on plans and without them, on `tasks` of each distance.
pub fn success(run: &Trainer, tasks: usize) -> [f64; 2] {
    let found = evaluated(run, tasks);
    [found.planned.unwrap_or_default(), found.alone].map(|score| score.success.unwrap_or_default())
}
