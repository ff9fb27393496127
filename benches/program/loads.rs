//! What further threads bring beside another program, and how well their number is chosen.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::{built_in, median, on};
use gdg::engine::lower_priority;
use gdg::env::PointMaze;
use gdg::learn::Threads;
use gdg::train::{Method, Preset, Registry, Run, Settings, Tick, TrainError, Trainer};

/// Time for which the load that comes and goes is on, then off.
const HALF_PERIOD: Duration = Duration::from_secs(1);

/// What another program does with all cores but one, and the duration of a turn.
const LOADS: [(Load, Duration); 3] = [
    (Load::Idle, Duration::from_millis(500)),
    (Load::Busy, Duration::from_millis(500)),
    (Load::ComesAndGoes, Duration::from_secs(2)),
];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Load {
    Idle,
    Busy,
    ComesAndGoes,
}

impl Load {
    fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Busy => "busy",
            Self::ComesAndGoes => "1 s busy, 1 s idle",
        }
    }

    fn is_on(self, since_start: Duration) -> bool {
        match self {
            Self::Idle => false,
            Self::Busy => true,
            Self::ComesAndGoes => (since_start.as_secs() / HALF_PERIOD.as_secs()).is_multiple_of(2),
        }
    }
}

/// Measures training with one thread, with `threads` and with an automatic number up to that, in
/// turns: beside each load, at normal priority and at that of training in the interface.
pub fn measure(threads: usize, runs: usize) -> Result<String, TrainError> {
    let mut all = format!(
        "four rooms without bridges beside another program: updates/s on one thread, {}, an \
         automatic number, ratio to the best\n",
        on(threads)
    );
    for (load, turn) in LOADS {
        let _burners = Burners::start(load, threads - 1)?;
        for lowered in [false, true] {
            // A thread of its own, as its priority cannot be raised again.
            let measuring = thread::Builder::new().spawn(move || {
                if lowered {
                    lower_priority();
                }
                rates(threads, runs, turn)
            })?;
            let rates = measuring.join().unwrap_or_else(|_| unreachable!("it does not panic"))?;
            let [one, fixed, auto] = rates.clone().map(median);
            let best = if one > fixed { &rates[0] } else { &rates[1] };
            let ratios = rates[2].iter().zip(best).map(|(auto, best)| auto / best).collect();
            let priority = if lowered { ", low priority" } else { "" };
            let (what, ratio) = (format!("other cores {}{priority}", load.name()), median(ratios));
            all += &format!("  {what:<46}{one:>8.0}{fixed:>8.0}{auto:>8.0}{ratio:>8.2}\n");
        }
    }
    Ok(all)
}

/// Returns updates per second in each turn: of one thread, of `threads` and of the automatic number.
fn rates(threads: usize, runs: usize, duration: Duration) -> Result<[Vec<f64>; 3], TrainError> {
    let choices = [Threads::Fixed(1), Threads::Fixed(threads), Threads::Auto { most: threads }];
    let mut trainers = choices.into_iter().map(trainer).collect::<Result<Vec<_>, _>>()?;
    let mut rates = [const { Vec::new() }; 3];
    // The first turn is a warm-up.
    for turn in 0..=runs {
        for (trainer, rates) in trainers.iter_mut().zip(&mut rates) {
            let (began, mut updates) = (Instant::now(), 0_u32);
            while began.elapsed() < duration {
                updates += u32::from(trainer.tick()? == Tick::Update);
            }
            if turn > 0 {
                rates.push(f64::from(updates) / began.elapsed().as_secs_f64());
            }
        }
    }
    Ok(rates)
}

/// Creates a run that starts no threads but those that share its updates: without bridges.
fn trainer(threads: Threads) -> Result<Trainer, TrainError> {
    let Ok(method) = "gdg".parse::<Method>() else { unreachable!("it is a method") };
    let (preset, settings) = (Preset::Default, Settings::default());
    let run = Run { method, preset, seed: 1, settings };
    Trainer::new(run, &PointMaze::new(built_in("fourrooms"), 0), &Registry::builtin(), threads)
}

/// Threads at normal priority that keep cores busy; they end when this is dropped.
struct Burners {
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Burners {
    fn start(load: Load, cores: usize) -> Result<Self, TrainError> {
        let mut burners = Self { end: Arc::default(), threads: Vec::new() };
        for _ in 0..cores {
            let (began, end) = (Instant::now(), burners.end.clone());
            let burn = move || {
                while !end.load(Ordering::Relaxed) {
                    if load.is_on(began.elapsed()) {
                        (0..1000).for_each(|_| std::hint::spin_loop());
                    } else {
                        thread::sleep(Duration::from_millis(1));
                    }
                }
            };
            burners.threads.push(thread::Builder::new().spawn(burn)?);
        }
        Ok(burners)
    }
}

impl Drop for Burners {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}
