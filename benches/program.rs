//! The speed of this machine, as ratios of side-by-side runs: `cargo bench --bench program`, with
//! `-- --only PART` for a part alone.
//!
//! What is compared takes turns within one process, so that a drifting machine speed affects all
//! alike; tables show medians of many turns.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::{Parser, ValueEnum};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use gdg::env::{Environment, PointMaze};
use gdg::learn::{Batch, GDG, LearnSettings, NetworkLearner, PHASE_CLOCK, Profile, TrainingPhase};
use gdg::map::{Grid, builtin};
use gdg::text::counted;
use gdg::train::{self, Method, Preset, Registry, Run, SaveTo, Settings, Tick, Trainer};
use gdg_tui::setup::parallel_jobs;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Maps on which whole runs of the default preset are measured.
const MAPS: [&str; 2] = ["fourrooms", "city"];

/// Batch and width of the updates of the published algorithm.
const SHAPES: [(usize, usize); 4] = [(64, 64), (64, 128), (64, 256), (256, 256)];

/// Updates in a turn: of a learner alone, and in training.
const UPDATES: usize = 20;
const TRAINED_UPDATES: u64 = 500;

/// Updates of a run whose processor time is measured, from its beginning until the sixth graph is in
/// use, and the most runs of each method.
const PROFILED_UPDATES: u64 = 6_500;
const PROFILED_RUNS: usize = 4;

/// Updates after which the checkpoint is saved.
const SAVED_AFTER: u64 = 6_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// One update of critic, model and actor
    Updates,
    /// Updates per second on built-in maps
    Training,
    /// What each second of processor time is spent on, with bridge points and without
    Profile,
    /// What a checkpoint consists of
    Checkpoint,
}

/// Measures the speed of learning on this machine.
#[derive(Parser)]
struct Args {
    /// Measure this part alone; may be given more than once [default: all]
    #[arg(long, value_name = "PART")]
    only: Vec<Part>,
    /// Threads to compare with a single one [default: this machine's cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Repetitions of each comparison; the median is reported
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u16).range(1..=1000))]
    runs: u16,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let (threads, runs) = (parallel_jobs(args.threads), args.runs.into());
    for part in Part::value_variants() {
        if !args.only.is_empty() && !args.only.contains(part) {
            continue;
        }
        let table = match part {
            Part::Updates => updates(threads, runs),
            Part::Training => MAPS.iter().map(|map| training(map, threads, runs)).collect(),
            Part::Profile => MAPS.iter().map(|map| profile(map, runs.min(PROFILED_RUNS))).collect(),
            Part::Checkpoint => checkpoint(threads),
        };
        println!("{}", table?);
    }
    Ok(())
}

/// One update: of the published algorithm at each shape on a map of 100 x 100 cells, and of the
/// default preset on one of 32 x 32.
fn updates(threads: usize, runs: usize) -> Result<String> {
    let mut out = format!("{:<16}{:>13}{:>13}{:>8}\n", "one update", on(1), on(threads), "ratio");
    let published = SHAPES.map(|(rows, width)| {
        let paper = LearnSettings::of(Preset::Paper);
        let settings = LearnSettings { batch_size: rows, hidden: width, ..paper };
        (format!("{rows} x {width}"), 100, settings)
    });
    let default = ("default preset".to_owned(), 32, LearnSettings::default());
    for (name, side, settings) in published.into_iter().chain([default]) {
        let map = Grid::new("open", side, vec![true; side * side], Vec::new(), Vec::new());
        let world = PointMaze::new(map.into(), 1);
        let learner =
            |threads| NetworkLearner::new(GDG, world.spec(), &settings, threads, &mut rng());
        let greedy_targets = side == 32;
        let batch = Batch { greedy_targets, ..batch(settings.batch_size, side as f32) };
        let mut profile = Profile::default();
        let times = in_turns(runs, &mut [learner(1)?, learner(threads)?], |learner| {
            let began = Instant::now();
            for _ in 0..UPDATES {
                learner.update_on(&batch, None, &mut profile)?;
            }
            Ok(1e6 * began.elapsed().as_secs_f64() / UPDATES as f64)
        })?;
        let ratio = median(times[0].iter().zip(&times[1]).map(|(one, all)| one / all).collect());
        let [one, all] = times.map(median);
        out += &format!("{name:<16}{one:>10.1} us{all:>10.1} us{ratio:>8.2}\n");
    }
    Ok(out)
}

/// The processor time of this thread, or of the whole process; 0 where it is not known.
fn processor_time(whole: bool) -> Duration {
    #[cfg(unix)]
    {
        use nix::time::{ClockId, clock_gettime};
        let [thread, process] =
            [ClockId::CLOCK_THREAD_CPUTIME_ID, ClockId::CLOCK_PROCESS_CPUTIME_ID];
        let time = clock_gettime(if whole { process } else { thread });
        time.map_or(Duration::ZERO, Duration::from)
    }
    #[cfg(not(unix))]
    Duration::ZERO
}

/// What an update of the default preset takes on one thread, and of [`GDG`] without bridge points:
/// whole runs in turns.
fn profile(map: &str, runs: usize) -> Result<String> {
    // Other programs on this machine do not count.
    PHASE_CLOCK.get_or_init(|| || processor_time(false));
    let grid = built_in(map);
    let mut spent = [[0.0; TrainingPhase::ALL.len()]; 2];
    let mut whole = [Vec::new(), Vec::new()];
    for turn in 0..runs {
        for (k, method) in ["gdg-bridge", "gdg"].into_iter().enumerate() {
            let run = Run { method: method.parse()?, seed: turn as u64, ..run() };
            let mut trainer = trainer_of(run, &grid, 1)?;
            let began = processor_time(true);
            while trainer.counters().updates < PROFILED_UPDATES {
                trainer.tick()?;
            }
            whole[k].push(processor_time(true).saturating_sub(began).as_secs_f64());
            for (spent, phase) in spent[k].iter_mut().zip(TrainingPhase::ALL) {
                *spent += trainer.profile().spent(phase).as_secs_f64();
            }
        }
    }
    let per_update = |seconds: f64| 1e6 * seconds / (runs as u64 * PROFILED_UPDATES) as f64;
    let mut out = format!("{map}, one update on one thread:     default        gdg\n");
    let mut row = |name: &str, times: [f64; 2]| {
        let [default, gdg] = times.map(per_update);
        out += &format!("  {name:<34}{default:>8.1} us{gdg:>8.1} us\n");
    };
    for (i, phase) in TrainingPhase::ALL.into_iter().enumerate() {
        row(&format!("{phase:?}"), spent.map(|spent| spent[i]));
    }
    row("all of these", spent.map(|spent| spent.iter().sum()));
    row("processor time", whole.each_ref().map(|whole| whole.iter().sum()));
    let ratio = median(whole[0].iter().zip(&whole[1]).map(|(a, b)| a / b).collect());
    Ok(out + &format!("  default / gdg: {ratio:.2}\n"))
}

/// Training on a built-in map on one thread and on several.
fn training(map: &str, threads: usize, runs: usize) -> Result<String> {
    let grid = built_in(map);
    let mut trainers = [trainer(&grid, 1)?, trainer(&grid, threads)?];
    let rates = in_turns(runs, &mut trainers, |trainer| {
        let (seconds, mut updates) = (trainer.seconds(), 0);
        while updates < TRAINED_UPDATES {
            updates += u64::from(trainer.tick()? == Tick::Update);
        }
        Ok(TRAINED_UPDATES as f64 / (trainer.seconds() - seconds))
    })?;
    let ([one, all], on_all) = (rates.map(median), on(threads));
    let out = format!("{map}: {one:.0} updates/s on one thread, {all:.0} on {on_all}\n");
    Ok(out)
}

/// What a checkpoint of the four rooms consists of, and how long saving and loading take.
fn checkpoint(threads: usize) -> Result<String> {
    let mut trainer = trainer(&built_in(MAPS[0]), threads)?;
    while trainer.counters().updates < SAVED_AFTER {
        trainer.tick()?;
    }
    let folder = tempfile::tempdir()?;
    let to = SaveTo::CreateNew(folder.path().join("run.safetensors"));
    let bytes = std::fs::read(train::save(&trainer, &to)?)?;
    let began = Instant::now();
    let again = train::from_bytes(&bytes, &Registry::builtin(), threads)?;
    let loaded = began.elapsed();
    // The first save may have waited for a bridge graph.
    let began = Instant::now();
    train::save(&again, &to)?;
    let [save, load] = [began.elapsed(), loaded].map(|took| 1e3 * took.as_secs_f64());
    let mut sizes = BTreeMap::from([("packed".to_owned(), bytes.len())]);
    for (name, part) in train::read_saved(&bytes)?.state.parts() {
        let part_of = name.split('.').next().unwrap_or_default().to_owned();
        *sizes.entry(part_of).or_insert(0) += part.len();
    }
    let mut out = format!("{}: checkpoint after {SAVED_AFTER} updates, ", MAPS[0]);
    out += &format!("saved in {save:.0} ms, loaded in {load:.0} ms\n");
    for (part, size) in sizes {
        out += &format!("  {part:<36}{:>8.2} MB\n", size as f64 / 1e6);
    }
    Ok(out)
}

/// Random pairs and transitions on a square map of `side` cells.
fn batch(rows: usize, side: f32) -> Batch {
    let (mut rng, last) = (rng(), side - 1.0);
    let mut numbers = |from: f32, to: f32| -> Vec<f32> {
        (0..2 * rows).map(|_| rng.random_range(from..to)).collect()
    };
    let (from, actions, goals) = (numbers(1.0, last), numbers(-1.0, 1.0), numbers(1.0, last));
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
        next: from.iter().zip(&actions).map(|(s, a)| s + a).collect(),
        from,
        actions,
        ..Batch::default()
    }
}

/// Measures both variants in turns: once to warm up, then `runs` times.
fn in_turns<T>(
    runs: usize,
    variants: &mut [T; 2],
    mut measure: impl FnMut(&mut T) -> Result<f64>,
) -> Result<[Vec<f64>; 2]> {
    let mut all = [Vec::new(), Vec::new()];
    for turn in 0..=runs {
        for (variant, found) in variants.iter_mut().zip(&mut all) {
            let number = measure(variant)?;
            found.extend((turn > 0).then_some(number));
        }
    }
    Ok(all)
}

/// A run of the default preset on `map`.
fn run() -> Run {
    let (method, settings) = (Method::default(), Settings::default());
    Run { method, preset: Preset::Default, seed: 1, settings }
}

fn trainer(map: &Arc<Grid>, threads: usize) -> Result<Trainer> {
    trainer_of(run(), map, threads)
}

fn trainer_of(run: Run, map: &Arc<Grid>, threads: usize) -> Result<Trainer> {
    Ok(Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), threads)?)
}

fn built_in(name: &str) -> Arc<Grid> {
    builtin(name).map_or_else(|| unreachable!("{name} is built in"), Arc::new)
}

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1)
}

fn on(threads: usize) -> String {
    counted(threads as u64, "thread")
}

fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value below which a share of all values lies.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (values.len() as f64 * share) as usize;
    values.get(at.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
