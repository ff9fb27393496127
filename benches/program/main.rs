//! The learner's speed on this machine, as ratios of side-by-side runs: `cargo bench --bench
//! program`, with `-- --only PART` for a part alone.
//!
//! All variants of a case take turns within one process, so that a drifting machine speed affects
//! them equally; the table shows the median of many turns.

mod baseline;
mod cases;
mod checkpoint;
mod edits;
mod interface;
mod loads;
mod time_to;

use std::fmt::Display;
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use miette::{IntoDiagnostic, Report};
use serde::Serialize;

use gdg::map::builtin;
use gdg::text::counted;
use gdg::train::TrainError;
use gdg_tui::host::setup::parallel_jobs;

/// Shapes at which updates are measured: batch and width.
const SHAPES: [(usize, usize); 4] = [(64, 64), (64, 128), (64, 256), (256, 256)];

/// Maps on which whole runs of the default preset are measured.
const MAPS: [&str; 2] = ["fourrooms", "city"];

/// Environment variable from which candle reads its number of threads.
const CANDLE_THREADS: &str = "RAYON_NUM_THREADS";

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// One update of critic, model and actor, against plain candle-nn
    Updates,
    /// One update of the default preset, against candle's tape
    Default,
    /// Updates per second on built-in maps
    Training,
    /// Threads beside other programs
    Loads,
    /// Time to a success rate
    TimeTo,
    /// What the interface costs
    Interface,
    /// What a checkpoint consists of
    Checkpoint,
    /// How long an edit of the map holds training up
    Edits,
    /// Single operations
    Other,
}

/// All measurements; times are medians in microseconds.
#[derive(Debug, Serialize)]
struct Measurements {
    threads: usize,
    /// Peak multiply-add rate of one core, in GFLOP/s (two operations each).
    peak_gflops: f64,
    updates: Vec<UpdateTimes>,
    default_update: Option<DefaultUpdateTimes>,
    default_preset: Vec<DefaultTimes>,
    loads: Vec<LoadTimes>,
    time_to_success: Vec<TimeToSuccess>,
    /// For each kind of screen.
    interface: Vec<InterfaceTimes>,
    checkpoint: Option<CheckpointSize>,
    edits: Vec<EditTimes>,
    other: Vec<TimedOperation>,
}

/// One update of critic, model and actor at one shape.
#[derive(Debug, Serialize)]
struct UpdateTimes {
    batch: usize,
    width: usize,
    runs: usize,
    /// Plain candle-nn: Linear, autograd, AdamW.
    plain_us: f64,
    /// The fused update on one thread, and on all threads.
    fused_us: f64,
    fused_threads_us: f64,
    /// Speed-up of fused over plain on one thread; of all threads over one.
    speed_up: f64,
    threads_speed_up: f64,
    /// Speed of the fused update's matrix products, as a share of the core's peak.
    peak_share: f64,
}

/// One whole update of the default preset: on candle's tape (the setting `backend=tape`) and by the
/// kernels.
#[derive(Debug, Serialize)]
struct DefaultUpdateTimes {
    runs: usize,
    tape_us: f64,
    /// On one thread, and on all threads.
    kernels_us: f64,
    kernels_threads_us: f64,
    /// Speed-up of the kernels over the tape on one thread; of all threads over one.
    speed_up: f64,
    threads_speed_up: f64,
}

/// Complete training on a map with the default preset, in updates per second.
#[derive(Debug, Serialize)]
struct DefaultTimes {
    map: &'static str,
    runs: usize,
    one_thread: f64,
    all_threads: f64,
    phases: Vec<PhaseTimes>,
}

/// Training beside a load of all cores but one, in updates per second.
#[derive(Debug, Serialize)]
struct LoadTimes {
    load: &'static str,
    /// Whether it has the lower priority of training in the interface.
    lowered: bool,
    runs: usize,
    /// On one thread, on all threads, and on an automatic number of them.
    one: f64,
    fixed: f64,
    auto: f64,
    /// Speed of the automatic number, as a share of that of the best fixed one.
    ratio: f64,
}

/// Training from scratch until planned success first reaches a rate, for each seed; null if it
/// never does.
#[derive(Debug, Serialize)]
struct TimeToSuccess {
    map: &'static str,
    success: f64,
    /// By plans, and by the actor alone.
    reached: Vec<Reached>,
}

/// When runs first reached the success rate, for each seed; `None` if never.
#[derive(Debug, Serialize)]
struct Reached {
    what: &'static str,
    updates: Vec<Option<f64>>,
    /// On all threads, without evaluations.
    seconds: Vec<Option<f64>>,
    median_updates: Option<f64>,
    /// Summed over all agents.
    median_env_steps: Option<f64>,
    median_seconds: Option<f64>,
}

/// Mean time per update of one phase of training.
#[derive(Debug, Serialize)]
struct PhaseTimes {
    phase: &'static str,
    one_thread_us: f64,
    all_threads_us: f64,
}

/// Training on a 256 x 256 map with the interface open at 200 x 60, compared to training alone.
#[derive(Debug, Serialize)]
struct InterfaceTimes {
    /// What the screen shows.
    screen: &'static str,
    runs: usize,
    /// Updates per second without the interface.
    alone: f64,
    /// Speed with the interface, as a share of that.
    ratio: f64,
    /// Time to draw a frame, with all that is sent to the terminal, and the 95th percentile.
    frame_us: f64,
    slow_frame_us: f64,
}

/// A checkpoint's size as plain numbers and as stored, and the time to save and load it.
#[derive(Debug, Serialize)]
struct CheckpointSize {
    map: &'static str,
    updates: u64,
    bytes: usize,
    stored_bytes: usize,
    save_ms: f64,
    load_ms: f64,
    parts: Vec<CheckpointPart>,
}

/// One part of a checkpoint.
#[derive(Debug, Serialize)]
struct CheckpointPart {
    part: &'static str,
    bytes: usize,
    stored_bytes: usize,
}

/// The longest that edits of the map hold training up.
#[derive(Debug, Serialize)]
struct EditTimes {
    map: String,
    threads: usize,
    edits: usize,
    /// Edges of the bridge graph.
    edges: usize,
    /// The longest edit.
    edit_ms: f64,
    /// The longest time without an update, in an edit or later.
    stall_ms: f64,
}

/// Another timed operation.
#[derive(Debug, Serialize)]
struct TimedOperation {
    what: &'static str,
    us: f64,
    runs: usize,
}

/// Measures the learner's speed on this machine against plain candle-nn, and what the interface
/// costs.
#[derive(Parser)]
struct Args {
    /// Measure this part alone; may be given more than once [default: all]
    #[arg(long, value_name = "PART")]
    only: Vec<Part>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
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

fn main() -> Result<(), Report> {
    // Compare one thread to one thread, which is also candle at its best: it would spread its
    // operations over spinning threads. Candle reads the number of threads from the environment,
    // which can be set safely only for a new process.
    if std::env::var_os(CANDLE_THREADS).is_none() {
        let mut again = Command::new(std::env::current_exe().into_diagnostic()?);
        let status = again
            .args(std::env::args_os().skip(1))
            .env(CANDLE_THREADS, "1")
            .status()
            .into_diagnostic()?;
        std::process::exit(status.code().unwrap_or(1));
    }
    let args = Args::parse();
    let found = measure(&args.only, parallel_jobs(args.threads), args.runs.into())?;
    let text = if args.json {
        serde_json::to_string_pretty(&found).into_diagnostic()? + "\n"
    } else {
        found.table()
    };
    print!("{text}");
    Ok(())
}

/// Runs the measurements of some parts, of all if none are given.
fn measure(only: &[Part], threads: usize, runs: usize) -> Result<Measurements, Report> {
    let peak_gflops = median((0..9).map(|_| gdg::learn::kernel::multiply_add_gflops()).collect());
    let wanted = |part| only.is_empty() || only.contains(&part);
    let shapes = SHAPES.iter().filter(|_| wanted(Part::Updates));
    let updates =
        shapes.map(|(batch, width)| cases::updates(*batch, *width, threads, runs, peak_gflops));
    let updates = updates.collect::<Result<_, _>>().into_diagnostic()?;
    let default_update = wanted(Part::Default).then(|| cases::default_update(threads, runs));
    Ok(Measurements {
        threads,
        peak_gflops,
        updates,
        default_update: default_update.transpose().into_diagnostic()?,
        default_preset: of_maps(wanted(Part::Training), &|map| {
            cases::default_preset(map, threads, runs)
        })?,
        loads: if wanted(Part::Loads) {
            loads::measure(threads, runs).into_diagnostic()?
        } else {
            Vec::new()
        },
        time_to_success: of_maps(wanted(Part::TimeTo), &|map| {
            time_to::measure(map, threads, runs)
        })?,
        interface: if wanted(Part::Interface) {
            interface::measure(threads, runs).into_diagnostic()?
        } else {
            Vec::new()
        },
        checkpoint: wanted(Part::Checkpoint)
            .then(|| checkpoint::measure(MAPS[0], threads))
            .transpose()?,
        edits: if wanted(Part::Edits) { of_edits(threads).into_diagnostic()? } else { Vec::new() },
        other: if wanted(Part::Other) { cases::other().into_diagnostic()? } else { Vec::new() },
    })
}

/// Measures edits of a small and of a large map, on one thread and on all.
fn of_edits(threads: usize) -> Result<Vec<EditTimes>, TrainError> {
    let small = builtin(MAPS[0]).map(Arc::new);
    let maps = small.into_iter().chain([interface::rooms()]);
    let cases = maps.flat_map(|map| [1, threads].map(|threads| (map.clone(), threads)));
    cases.map(|(map, threads)| edits::measure(&map, threads)).collect()
}

/// Measures each of [`MAPS`], if `wanted`.
fn of_maps<T>(
    wanted: bool,
    measure: &dyn Fn(&'static str) -> Result<T, TrainError>,
) -> Result<Vec<T>, Report> {
    MAPS.iter()
        .filter(|_| wanted)
        .map(|map| measure(map))
        .collect::<Result<_, _>>()
        .into_diagnostic()
}

impl Measurements {
    fn on_threads(&self) -> String {
        counted(self.threads as u64, "thread")
    }

    fn table(&self) -> String {
        let mut out = format!("multiply-add peak of one core: {:.0} GFLOP/s\n\n", self.peak_gflops);
        self.add_updates(&mut out);
        self.add_default_preset(&mut out);
        self.add_loads(&mut out);
        out += "\n";
        self.add_times_to_success(&mut out);
        out += "\n";
        self.add_interface(&mut out);
        out += "\n";
        self.add_checkpoint(&mut out);
        for e in &self.edits {
            let on_threads = counted(e.threads as u64, "thread");
            let edits = counted(e.edits as u64, "edit");
            let edges = counted(e.edges as u64, "edge");
            out += &format!(
                "{}, {edges}, {on_threads}: longest of {edits} {:.0} ms, longest stall {:.0} ms\n",
                e.map, e.edit_ms, e.stall_ms
            );
        }
        for t in &self.other {
            out += &format!("{:<56}{:>10.1} us{:>7} runs\n", t.what, t.us, t.runs);
        }
        out
    }

    fn add_updates(&self, out: &mut String) {
        if !self.updates.is_empty() {
            *out += &format!("{:<12}{:>10}{:>10}{:>8}", "update", "plain", "fused", "ratio");
            *out += &format!("{:>8}{:>12}{:>8}{:>7}\n", "peak", self.on_threads(), "ratio", "runs");
        }
        for u in &self.updates {
            *out += &format!("{:<12}", format!("{} x {}", u.batch, u.width));
            *out += &format!("{:>7.0} us{:>7.0} us{:>8.2}", u.plain_us, u.fused_us, u.speed_up);
            let share = format!("{:.0} %", 100.0 * u.peak_share);
            *out += &format!(
                "{share:>8}{:>9.0} us{:>8.2}{:>7}\n",
                u.fused_threads_us, u.threads_speed_up, u.runs
            );
        }
    }

    fn add_default_preset(&self, out: &mut String) {
        let on_threads = self.on_threads();
        if let Some(u) = &self.default_update {
            let (tape, kernels, both) = (u.tape_us, u.kernels_us, u.kernels_threads_us);
            *out += &format!(
                "\ndefault preset, one update: {tape:.0} us on candle's tape, {kernels:.0} us "
            );
            *out += &format!("({:.1} times as fast), on {on_threads} {both:.0} us ", u.speed_up);
            *out +=
                &format!("({:.2} times as fast as on one; {} runs)\n", u.threads_speed_up, u.runs);
        }
        for d in &self.default_preset {
            let (map, one, all) = (d.map, d.one_thread, d.all_threads);
            *out += &format!("\n{map}, default preset: {one:.0} updates/s on one thread, ");
            *out += &format!("{all:.0} on {on_threads} ({} runs)\n", d.runs);
            for p in &d.phases {
                let (one, all) = (p.one_thread_us, p.all_threads_us);
                *out += &format!("  {:<36}{one:>8.1} us{all:>8.1} us\n", p.phase);
            }
        }
    }

    fn add_loads(&self, out: &mut String) {
        if let Some(first) = self.loads.first() {
            let (on_threads, runs) = (self.on_threads(), first.runs);
            *out +=
                "\nfour rooms without bridges beside another program: updates/s on one thread, ";
            *out +=
                &format!("{on_threads}, an automatic number, ratio to the best ({runs} runs)\n");
        }
        for LoadTimes { load, lowered, one, fixed, auto, ratio, .. } in &self.loads {
            let what =
                format!("other cores {load}{}", if *lowered { ", low priority" } else { "" });
            *out += &format!("  {what:<46}{one:>8.0}{fixed:>8.0}{auto:>8.0}{ratio:>8.2}\n");
        }
    }

    fn add_times_to_success(&self, out: &mut String) {
        for t in &self.time_to_success {
            let on_threads = self.on_threads();
            *out += &format!("{}: time to {} on {on_threads}\n", t.map, t.success);
            for r in &t.reached {
                let (s, n) =
                    (told(r.median_seconds.as_ref(), 1), told(r.median_updates.as_ref(), 0));
                let steps = told(r.median_env_steps.as_ref(), 0);
                *out += &format!("  {:<12}{s:>6} s, {n:>6} updates, {steps:>8} steps (", r.what);
                let seeds = r
                    .seconds
                    .iter()
                    .zip(&r.updates)
                    .map(|(s, n)| told(s.as_ref(), 1) + " s, " + &told(n.as_ref(), 0));
                *out += &(seeds.collect::<Vec<_>>().join("; ") + ")\n");
            }
        }
    }

    fn add_interface(&self, out: &mut String) {
        if let Some(i) = self.interface.first() {
            let (alone, on_threads) = (i.alone, self.on_threads());
            *out += &format!(
                "256 x 256 cells: {alone:.0} updates/s on {on_threads} ({} runs); ",
                i.runs
            );
            *out += "with the interface at 200 x 60:\n";
        }
        for i in &self.interface {
            let (ratio, frame, slow) = (i.ratio, i.frame_us / 1e3, i.slow_frame_us / 1e3);
            *out += &format!("  {:<16}{ratio:.2} of that; a frame {frame:.1} ms", i.screen);
            *out += &format!(", 95th percentile {slow:.1} ms\n");
        }
    }

    fn add_checkpoint(&self, out: &mut String) {
        let Some(c) = &self.checkpoint else { return };
        let mb = |bytes: usize| bytes as f64 / 1e6;
        *out += &format!("{}: checkpoint after {} updates, ", c.map, c.updates);
        *out += &format!("saved in {:.0} ms, loaded in {:.0} ms\n", c.save_ms, c.load_ms);
        let total = ("all", c.bytes, c.stored_bytes);
        let parts = c.parts.iter().map(|part| (part.part, part.bytes, part.stored_bytes));
        for (part, bytes, stored) in parts.chain([total]) {
            *out += &format!("  {part:<36}{:>8.2} MB{:>8.2} MB stored\n", mb(bytes), mb(stored));
        }
        *out += "\n";
    }
}

/// Formats a number with the given number of decimals; `never` without one.
fn told<T: Display>(number: Option<&T>, decimals: usize) -> String {
    number.map_or("never".to_owned(), |number| format!("{number:.decimals$}"))
}

/// Returns the time that `work` takes, in microseconds.
fn time_us(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_secs_f64() * 1e6
}

/// Returns the median.
fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// Returns the value below which a share of all values lies.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (values.len() as f64 * share) as usize;
    values.get(at.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
