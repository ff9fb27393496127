//! Measures how local an edit of the map stays, and how fast the learner adapts to it.
//!
//! Trains on one map, switches to an edited one, and evaluates both at intervals. *Away* is the
//! error of D over pairs whose distance the edit does not change and whose ends are more than 10
//! steps from every changed cell; *grown* the one over pairs whose distance grows.
//!
//! ```sh
//! cargo run --release --example edits -- fourrooms closed.map --seeds 3
//! ```

use std::path::Path;
use std::sync::Arc;

use clap::Parser;
use gdg::env::{Evaluated, PointMaze, TruePairs};
use gdg::learn::Scratch;
use gdg::map::{Cell, Grid, builtin, load_map};
use gdg::train::{Method, Overrides, Preset, Registry, Run, Trainer, settings_from};
use miette::{IntoDiagnostic, Result, miette};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Evaluations after the edit, in updates.
const AFTER: [u64; 7] = [0, 500, 1_000, 2_000, 3_000, 4_000, 6_000];

/// Pairs whose ends are within this many steps of a changed cell are not *away*.
const NEAR_STEPS: u32 = 10;

/// Map, edited map and training.
#[derive(Parser)]
struct Args {
    /// Built-in map or map file
    before: String,
    /// Map file of the same size
    after: String,
    /// Updates before the edit
    #[arg(long, default_value_t = 20_000)]
    updates: u64,
    /// Updates after which the edit is undone
    #[arg(long)]
    undo: Option<u64>,
    /// Runs, with seeds 1, 2, ...
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// Evaluation tasks at each distance
    #[arg(long, default_value_t = 30)]
    eval_tasks: usize,
    /// Settings
    #[arg(long, value_name = "NAME=VALUE", num_args = 1..)]
    set: Vec<String>,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let map = |name: &str| match builtin(name) {
        Some(map) => Ok(map),
        None => load_map(Path::new(name)).into_diagnostic(),
    };
    let (before, after) = (Arc::new(map(&args.before)?), Arc::new(map(&args.after)?));
    let settings =
        settings_from(Preset::Default, &Overrides { set: &args.set, ..Overrides::default() });
    let settings = settings.map_err(|error| miette!("{error}"))?;
    println!("| seed | updates | greedy | planned | D away | D grown |\n|---|---|---|---|---|---|");
    for seed in 1..=args.seeds {
        let run = Run {
            method: Method::default(),
            preset: Preset::Default,
            seed,
            settings: settings.clone(),
        };
        let world = PointMaze::new(before.clone(), 0);
        let mut trainer = Trainer::new(run, &world, &Registry::builtin(), 1).into_diagnostic()?;
        train_to(&mut trainer, args.updates)?;
        report(&trainer, seed, "before", &before, &after, args.eval_tasks)?;
        change(&mut trainer, &after)?;
        for updates in AFTER {
            if args.undo.is_some_and(|undo| updates > undo) {
                break;
            }
            train_to(&mut trainer, args.updates + updates)?;
            report(&trainer, seed, &format!("+{updates}"), &after, &before, args.eval_tasks)?;
        }
        if let Some(undo) = args.undo {
            train_to(&mut trainer, args.updates + undo)?;
            change(&mut trainer, &before)?;
            for updates in AFTER {
                train_to(&mut trainer, args.updates + undo + updates)?;
                report(
                    &trainer,
                    seed,
                    &format!("undone +{updates}"),
                    &before,
                    &after,
                    args.eval_tasks,
                )?;
            }
        }
    }
    Ok(())
}

fn train_to(trainer: &mut Trainer, updates: u64) -> Result<()> {
    while trainer.counters().updates < updates {
        trainer.tick().into_diagnostic()?;
    }
    Ok(())
}

fn change(trainer: &mut Trainer, map: &Arc<Grid>) -> Result<()> {
    let maze =
        PointMaze::downcast_ref(trainer.world()).ok_or_else(|| miette!("the world is no maze"))?;
    let world = maze.with_map(map.clone());
    trainer.change_world(&world).into_diagnostic()?;
    Ok(())
}

/// Prints a row of the table: success on `map`, and the errors of D by how distances differ from
/// those on `other`.
fn report(
    trainer: &Trainer,
    seed: u64,
    when: &str,
    map: &Arc<Grid>,
    other: &Arc<Grid>,
    tasks: usize,
) -> Result<()> {
    let tasks = trainer.tasks(tasks).into_diagnostic()?;
    let evaluation = trainer.evaluate(&tasks).into_diagnostic()?;
    let rate = |score: Option<f64>| score.map_or("-".to_owned(), |rate| format!("{rate:.3}"));
    let greedy = rate(evaluation.greedy.success);
    let planned = rate(evaluation.planned.as_ref().and_then(|planned| planned.success));
    let (away, grown) = errors(trainer, map, other)?;
    println!("| {seed} | {when} | {greedy} | {planned} | {} | {} |", rate(away), rate(grown));
    Ok(())
}

/// Returns the mean relative error of D over the pairs away from the edit and over those whose
/// distance is longer on `map` than on `other`.
fn errors(
    trainer: &Trainer,
    map: &Arc<Grid>,
    other: &Arc<Grid>,
) -> Result<(Option<f64>, Option<f64>)> {
    let worlds = [map, other].map(|map| PointMaze::new(map.clone(), 0));
    let [here, there] = &worlds;
    let no_truth = || miette!("the world has no true distances");
    let mut truth = here.ground_truth().ok_or_else(no_truth)?;
    let mut truth_there = there.ground_truth().ok_or_else(no_truth)?;
    let changed: Vec<f32> = (0..map.width() * map.height())
        .map(|i| map.cell(i))
        .filter(|cell: &Cell| map.is_free(*cell) != other.is_free(*cell))
        .flat_map(Cell::centre)
        .collect();
    let near_edit = |at: &[f32]| {
        changed
            .chunks_exact(2)
            .any(|c| (c[0] - at[0]).abs().max((c[1] - at[1]).abs()) <= NEAR_STEPS as f32)
    };
    let policy = trainer.policy().into_diagnostic()?;
    let (mut scratch, mut away, mut grown) = (Scratch::default(), Mean::default(), Mean::default());
    for TruePairs { goal, states, steps, near } in truth.pairs(&mut ChaCha8Rng::seed_from_u64(1)) {
        for ((state, steps), near) in states.chunks_exact(2).zip(steps).zip(near) {
            if near || !map.is_free_at(state[0], state[1]) || !map.is_free_at(goal[0], goal[1]) {
                continue;
            }
            let mut exact =
                |from: &[f32]| truth_there.steps(from, &goal, u32::MAX).and_then(|steps| steps[0]);
            let (own, elsewhere) =
                (truth.steps(state, &goal, u32::MAX).and_then(|steps| steps[0]), exact(state));
            let error = f64::from(
                (policy.distance(state, &goal, &mut scratch) - steps as f32).abs() / steps as f32,
            );
            if own == elsewhere && !near_edit(state) && !near_edit(&goal) {
                away.add(error);
            } else if own > elsewhere {
                grown.add(error);
            }
        }
    }
    Ok((away.value(), grown.value()))
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}
