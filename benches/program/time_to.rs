//! How long a run takes to learn: until planned success, and that of the actor alone, first reach
//! .95.

use super::{built_in, median, on, told, trainer};
use gdg::train::{Evaluation, Tick, TrainError};

/// Success rate to reach.
const SUCCESS: f64 = 0.95;

/// Updates between evaluations until planned success is reached, and afterwards: the actor alone
/// takes far longer, and an evaluation as long as hundreds of updates.
const EVALUATE_EVERY: [u64; 2] = [250, 1_000];

/// Tasks at each of the six distances.
const TASKS_PER_DISTANCE: usize = 15;

/// Updates after which a run is given up.
const MAX_UPDATES: u64 = 40_000;

/// Maximum number of seeds; one can take a minute.
const MAX_SEEDS: usize = 3;

/// A success rate of an evaluation.
type Rate = fn(&Evaluation) -> Option<f64>;

/// What is to reach the success rate: plans first.
const RATES: [(&str, Rate); 2] = [
    ("planned", Evaluation::success_rate),
    ("actor alone", |evaluation| evaluation.greedy.success),
];

/// When a run first reached the success rate.
#[derive(Clone, Copy)]
struct Moment {
    updates: u64,
    env_steps: u64,
    seconds: f64,
}

/// Measures the time from scratch to the success rate on a built-in map, excluding
/// evaluation time, for seeds 1, 2, ...
pub fn measure(map: &'static str, threads: usize, runs: usize) -> Result<String, TrainError> {
    let moments = (1..=runs.clamp(1, MAX_SEEDS) as u64)
        .map(|seed| moments(map, seed, threads))
        .collect::<Result<Vec<_>, _>>()?;
    let mut out = format!("{map}: time to {SUCCESS} on {}\n", on(threads));
    for (k, (what, _)) in RATES.iter().enumerate() {
        let of = |number: fn(Moment) -> f64| -> Vec<Option<f64>> {
            moments.iter().map(|run| run[k].map(number)).collect()
        };
        let (updates, seconds) = (of(|at| at.updates as f64), of(|at| at.seconds));
        let (s, n) = (told(median_or_never(&seconds), 1), told(median_or_never(&updates), 0));
        let steps = told(median_or_never(&of(|at| at.env_steps as f64)), 0);
        let seeds = seconds.iter().zip(&updates);
        let seeds: Vec<String> = seeds.map(|(s, n)| told(*s, 1) + " s, " + &told(*n, 0)).collect();
        let seeds = seeds.join("; ");
        out += &format!("  {what:<12}{s:>6} s, {n:>6} updates, {steps:>8} steps ({seeds})\n");
    }
    Ok(out)
}

/// Trains until both success rates are reached; returns when each first was.
fn moments(map: &str, seed: u64, threads: usize) -> Result<[Option<Moment>; 2], TrainError> {
    let mut trainer = trainer(&built_in(map), seed, threads)?;
    let mut reached = [None; 2];
    while reached.iter().any(Option::is_none) && trainer.counters().updates < MAX_UPDATES {
        let every = EVALUATE_EVERY[usize::from(reached[0].is_some())];
        if trainer.tick()? != Tick::Update || !trainer.counters().updates.is_multiple_of(every) {
            continue;
        }
        let evaluation = trainer.evaluate(&trainer.tasks(TASKS_PER_DISTANCE)?)?;
        let now = Moment {
            updates: trainer.counters().updates,
            env_steps: trainer.counters().env_steps,
            seconds: trainer.seconds(),
        };
        for (at, (_, rate)) in reached.iter_mut().zip(RATES) {
            if at.is_none() && rate(&evaluation).is_some_and(|rate| rate >= SUCCESS) {
                *at = Some(now);
            }
        }
    }
    Ok(reached)
}

/// Returns the median over runs; `None` if it is one that never got there.
fn median_or_never(numbers: &[Option<f64>]) -> Option<f64> {
    let middle = median(numbers.iter().map(|number| number.unwrap_or(f64::INFINITY)).collect());
    middle.is_finite().then_some(middle)
}
