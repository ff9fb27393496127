//! How long a run takes to learn: time until planned success first reaches .95.

use std::sync::Arc;

use super::{TimeToSuccess, median};
use gdg::env::PointMaze;
use gdg::map::builtin;
use gdg::train::{Method, Preset, Registry, Run, Settings, Tick, TrainError, Trainer};

/// Success rate with planning to reach.
const SUCCESS: f64 = 0.95;

/// Updates between evaluations.
const EVALUATE_EVERY: u64 = 250;

/// Tasks at each of the six distances.
const TASKS_PER_DISTANCE: usize = 15;

/// Updates after which a run is given up.
const MAX_UPDATES: u64 = 40_000;

/// Maximum number of seeds; one can take a minute.
const MAX_SEEDS: usize = 3;

/// Measures the time from scratch to the success rate on a built-in map, excluding
/// evaluation time, for seeds 1, 2, ...
pub fn measure(
    map: &'static str,
    threads: usize,
    runs: usize,
) -> Result<TimeToSuccess, TrainError> {
    let Some(grid) = builtin(map).map(Arc::new) else { unreachable!("{map} is built in") };
    let world = PointMaze::new(grid, 0);
    let (mut updates, mut seconds) = (Vec::new(), Vec::new());
    for seed in 1..=runs.clamp(1, MAX_SEEDS) as u64 {
        let run = Run {
            method: Method::default(),
            preset: Preset::Default,
            seed,
            settings: Settings::default(),
        };
        let mut trainer = Trainer::new(run, &world, &Registry::builtin(), threads)?;
        let mut reached = false;
        while !reached && trainer.counters().updates < MAX_UPDATES {
            let updated = trainer.tick()? == Tick::Update;
            if updated && trainer.counters().updates.is_multiple_of(EVALUATE_EVERY) {
                let evaluation = trainer.evaluate(&trainer.tasks(TASKS_PER_DISTANCE)?)?;
                reached = evaluation.success_rate().is_some_and(|rate| rate >= SUCCESS);
            }
        }
        updates.push(reached.then_some(trainer.counters().updates));
        seconds.push(reached.then_some(trainer.seconds()));
    }
    let or_never = |number: Option<f64>| number.unwrap_or(f64::INFINITY);
    let finite = |number: f64| number.is_finite().then_some(number);
    Ok(TimeToSuccess {
        map,
        success: SUCCESS,
        median_updates: finite(median(
            updates.iter().map(|n| or_never(n.map(|n| n as f64))).collect(),
        )),
        median_seconds: finite(median(seconds.iter().map(|s| or_never(*s)).collect())),
        updates,
        seconds,
    })
}
