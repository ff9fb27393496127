//! The benchmark cases.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::baseline::Baseline;
use super::{built_in, median, on, time_us, trainer};
use gdg::bridge::{BridgeGraph, BridgeSettings, Candidates, Walker};
use gdg::env::{Environment, PointMaze};
use gdg::learn::{Batch, Gdg, LearnSettings, Learner, Profile, Scratch, Stage};
use gdg::map::Grid;
use gdg::train::{Preset, Tick, TrainError};

/// Shapes at which updates are measured: batch and width.
const SHAPES: [(usize, usize); 4] = [(64, 64), (64, 128), (64, 256), (256, 256)];

/// Updates per turn.
const UPDATES_PER_TURN: usize = 20;

/// Side length of the open map for fields and plans, in cells.
pub const OPEN_MAP_SIDE: usize = 256;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1)
}

fn open_map() -> Arc<Grid> {
    Arc::new(Grid::new(
        "open",
        OPEN_MAP_SIDE,
        vec![true; OPEN_MAP_SIDE * OPEN_MAP_SIDE],
        Vec::new(),
        Vec::new(),
    ))
}

/// Returns random pairs and transitions on a square map of `side` cells.
fn batch(rows: usize, side: f32) -> Batch {
    let (mut rng, last) = (rng(), side - 1.0);
    let mut numbers = |from: f32, to: f32| -> Vec<f32> {
        (0..2 * rows).map(|_| rng.random_range(from..to)).collect()
    };
    let from = numbers(1.0, last);
    let actions = numbers(-1.0, 1.0);
    let next = from.iter().zip(&actions).map(|(s, a)| s + a).collect();
    let goals = numbers(1.0, last);
    Batch {
        states: numbers(1.0, last),
        actor_goals: goals.clone(),
        actor_weights: vec![1.0; rows],
        goals,
        bootstrap_states: numbers(1.0, last),
        steps: vec![1.0; rows],
        bootstrap: vec![1.0; rows],
        bound: vec![f32::INFINITY; rows],
        lower: vec![0.0; rows],
        greedy_targets: false,
        relearns: false,
        from,
        actions,
        next,
    }
}

/// Returns the operations in the matrix products of one update (two per multiply-add).
fn operations(rows: usize, hidden: usize) -> f64 {
    let (b, h) = (rows as f64, hidden as f64);
    let network = |outputs: f64| 4.0 * h + h * h + h * outputs;
    let (critic, two) = (network(1.0), network(2.0));
    let backward = |weights: f64| weights + h * h;
    // Target forward; critic, model and actor forward and backward; for the actor, model and critic
    // again, backward to their inputs only.
    let passes = critic
        + (critic + backward(critic))
        + 2.0 * (two + backward(two))
        + (two + h * h)
        + (critic + h * h);
    2.0 * b * passes
}

/// Measures one update of critic, model and actor at each shape against plain candle-nn (Linear,
/// autograd, AdamW), and the speed of its matrix products as a share of the core's peak.
pub fn updates(threads: usize, runs: usize) -> Result<String, TrainError> {
    let peak = median((0..9).map(|_| gdg::learn::kernel::multiply_add_gflops()).collect());
    let mut out = format!("multiply-add peak of one core: {peak:.0} GFLOP/s\n\n");
    out += &format!("{:<12}{:>10}{:>10}{:>8}", "update", "plain", "fused", "ratio");
    out += &format!("{:>8}{:>12}{:>8}\n", "peak", on(threads), "ratio");
    for (rows, width) in SHAPES {
        out += &update(rows, width, threads, runs, peak)?;
    }
    Ok(out)
}

/// Measures one update, plain and fused, on one thread and on all, in turns.
fn update(
    rows: usize,
    width: usize,
    threads: usize,
    runs: usize,
    peak_gflops: f64,
) -> Result<String, TrainError> {
    let settings =
        LearnSettings { batch_size: rows, hidden: width, ..LearnSettings::of(Preset::Paper) };
    let world = PointMaze::new(
        Arc::new(Grid::new("100", 100, vec![true; 10_000], Vec::new(), Vec::new())),
        1,
    );
    let fused = Gdg::new(world.spec(), &settings, 1, &mut rng())?;
    let together = Gdg::new(world.spec(), &settings, threads, &mut rng())?;
    let mut plain = Baseline::new(&settings)?;
    let batch = batch(rows, 100.0);
    let (mut of_plain, mut of_fused, mut of_together) = (Vec::new(), Vec::new(), Vec::new());
    let (mut failure, mut profile) = (Ok(()), Profile::default());
    // The first turn is a warm-up.
    for turn in 0..=runs {
        let mut repeat = |update: &mut dyn FnMut() -> candle_core::Result<()>| {
            let took = time_us(|| (0..UPDATES_PER_TURN).for_each(|_| failure = update()));
            took / UPDATES_PER_TURN as f64
        };
        let times = (
            repeat(&mut || plain.update(&batch)),
            repeat(&mut || fused.update_on(&batch, None, &mut profile).map(drop)),
            repeat(&mut || together.update_on(&batch, None, &mut profile).map(drop)),
        );
        if turn > 0 {
            of_plain.push(times.0);
            of_fused.push(times.1);
            of_together.push(times.2);
        }
    }
    failure?;
    let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
    let (speed_up, threads_speed_up) =
        (ratio(&of_plain, &of_fused), ratio(&of_fused, &of_together));
    let [plain, fused, together] = [of_plain, of_fused, of_together].map(median);
    let share = format!("{:.0} %", 100.0 * operations(rows, width) / (fused * 1e3) / peak_gflops);
    let shape = format!("{rows} x {width}");
    Ok(format!(
        "{shape:<12}{plain:>7.0} us{fused:>7.0} us{speed_up:>8.2}{share:>8}{together:>9.0} us\
         {threads_speed_up:>8.2}\n"
    ))
}

/// Measures one whole update of the default preset on a map of 32 x 32 cells, on one thread
/// and on all, in turns.
pub fn default_update(threads: usize, runs: usize) -> Result<String, TrainError> {
    const SIDE: usize = 32;
    let map = Grid::new("open", SIDE, vec![true; SIDE * SIDE], Vec::new(), Vec::new());
    let world = PointMaze::new(Arc::new(map), 1);
    let kernels = LearnSettings::default();
    let learners =
        [1, threads].map(|threads| Gdg::new(world.spec(), &kernels, threads, &mut rng()));
    let [one, all] = learners;
    let learners = [one?, all?];
    let batch = Batch { greedy_targets: true, ..batch(kernels.batch_size, SIDE as f32) };
    let mut times = [const { Vec::new() }; 2];
    let (mut failure, mut profile) = (Ok(()), Profile::default());
    // The first turn is a warm-up.
    for turn in 0..=runs {
        for (learner, times) in learners.iter().zip(&mut times) {
            let mut update = || failure = learner.update_on(&batch, None, &mut profile).map(drop);
            let took =
                time_us(|| (0..UPDATES_PER_TURN).for_each(|_| update())) / UPDATES_PER_TURN as f64;
            if turn > 0 {
                times.push(took);
            }
        }
    }
    failure?;
    let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
    let threads_speed_up = ratio(&times[0], &times[1]);
    let ([one, all], on_all) = (times.map(median), on(threads));
    Ok(format!(
        "default preset, one update: {one:.0} us, on {on_all} {all:.0} us \
         ({threads_speed_up:.2} times as fast)\n"
    ))
}

/// Measures training on a built-in map with the default preset.
pub fn default_preset(
    map: &'static str,
    threads: usize,
    runs: usize,
) -> Result<String, TrainError> {
    const UPDATES_PER_TURN: u64 = 500;
    let grid = built_in(map);
    let mut trainers = [trainer(&grid, 1, 1)?, trainer(&grid, 1, threads)?];
    let mut rates = [Vec::new(), Vec::new()];
    for turn in 0..=runs {
        for (trainer, rates) in trainers.iter_mut().zip(&mut rates) {
            let (seconds, mut updates) = (trainer.seconds(), 0);
            while updates < UPDATES_PER_TURN {
                updates += u64::from(trainer.tick()? == Tick::Update);
            }
            if turn > 0 {
                rates.push(UPDATES_PER_TURN as f64 / (trainer.seconds() - seconds));
            }
        }
    }
    let [one, all] = rates.map(median);
    let on_all = on(threads);
    let mut out =
        format!("{map}, default preset: {one:.0} updates/s on one thread, {all:.0} on {on_all}\n");
    for phase in Stage::ALL {
        let [one, all] = trainers.each_ref().map(|trainer| {
            let spent = trainer.profile().spent(phase).as_secs_f64();
            spent * 1e6 / trainer.counters().updates as f64
        });
        out += &format!("  {:<36}{one:>8.1} us{all:>8.1} us\n", phase.name());
    }
    Ok(out)
}

/// Measures acting, the field of a whole map, planning, and environment steps.
pub fn other() -> Result<String, TrainError> {
    let map = open_map();
    let mut world = PointMaze::new(map.clone(), 32);
    let mut rng = rng();
    (0..32).try_for_each(|i| world.restart(i, &mut rng))?;
    let learner = Gdg::new(world.spec(), &LearnSettings::default(), 1, &mut rng)?;
    let policy = learner.policy(true)?;
    let mut scratch = Scratch::default();
    let timed = |what, runs: usize, work: &mut dyn FnMut()| {
        work();
        let us = median((0..runs).map(|_| time_us(&mut *work)).collect());
        format!("{what:<56}{us:>10.1} us{runs:>7} runs\n")
    };
    let (states, goals) =
        (world.states().to_vec(), world.states().iter().rev().copied().collect::<Vec<f32>>());
    let mut actions = vec![0.0; 64];
    let mut all = String::new();
    all += &timed("actions of 32 agents", 200, &mut || {
        policy.actions(&states, &goals, &mut actions, &mut scratch);
    });
    let cells: Vec<f32> = map.free_cells().flat_map(gdg::map::Cell::centre).collect();
    let one_goal = [40.5, 200.5].repeat(cells.len() / 2);
    let mut field = vec![0.0; cells.len() / 2];
    all += &timed("distance field of a 256 x 256 map (both critics)", 7, &mut || {
        policy.distances(&cells, &one_goal, &mut field, &mut scratch);
    });
    for (candidates, what) in
        [(500, "planning query, 500 candidates"), (1500, "planning query, 1500 candidates")]
    {
        let (candidates, settings) = explored_candidates(&map, candidates);
        let graph = BridgeGraph::build(
            world.spec(),
            &settings,
            &candidates.frozen(),
            &*policy,
            &mut scratch,
        );
        all += &timed(what, 50, &mut || {
            let mut walker = Walker::new(graph.route(&[40.5, 200.5], &*policy, &mut scratch));
            walker.step(&[200.5, 40.5], &graph, &*policy, &mut scratch);
        });
    }
    // Asking for 500 candidates yields three times as many on this map.
    let (candidates, _) = explored_candidates(&map, 500);
    all += &timed("blocking training to build a graph of 1500 candidates", 20, &mut || {
        std::hint::black_box((learner.policy(true).is_ok(), candidates.frozen()));
    });
    all +=
        &timed("environment step of 32 agents", 500, &mut || drop(world.step(&actions, &mut rng)));
    Ok(all)
}

/// Collects about `candidates` candidates from random walks on the open map.
fn explored_candidates(map: &Arc<Grid>, candidates: usize) -> (Candidates, BridgeSettings) {
    let mut rng = rng();
    let mut world = PointMaze::new(map.clone(), 32);
    let settings = BridgeSettings { candidates, ..BridgeSettings::default() };
    let mut candidates = Candidates::new(world.spec(), 32, &settings);
    let mut actions = vec![0.0f32; 64];
    for step in 0..20_000 {
        if step % 10 == 0 {
            actions.fill_with(|| rng.random_range(-1.0..1.0));
        }
        if step % 100 == 0 {
            (0..32).for_each(|i| {
                candidates.end_episode(i);
                drop(world.restart(i, &mut rng));
            });
        }
        world
            .states()
            .chunks_exact(2)
            .enumerate()
            .for_each(|(i, state)| candidates.visit(i, state, state));
        drop(world.step(&actions, &mut rng));
    }
    (candidates, settings)
}
