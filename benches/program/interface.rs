//! The cost of the interface.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::cases::OPEN_MAP_SIDE;
use super::{median, on, quantile, trainer};
use gdg::engine::{Command, Engine, Phase};
use gdg::map::Grid;
use gdg::train::{Limits, TrainError};
use gdg_tui::tui::{MeasuredInterface, MeasuredScreen};

/// Columns and rows of the screen for the interface.
const SCREEN_SIZE: (u16, u16) = (200, 60);

/// Measures training on a large map with and without the interface, in turns: with each kind of
/// screen.
pub fn measure(threads: usize, runs: usize) -> Result<String, TrainError> {
    // Long enough for grounds of pictures that are drawn again and rest for up to two seconds.
    const TURN_DURATION: Duration = Duration::from_secs(3);
    let map = rooms();
    let trainer = || trainer(&map, 1, threads);
    // Trains and evaluates in the background, as the interface has it do.
    let alone = Alone(Engine::start(trainer()?, Limits::default())?);
    alone.command(Command::Pause, &Phase::Paused);
    let mut rates = Vec::new();
    let mut screens = Vec::new();
    for screen in MeasuredScreen::ALL {
        screens.push((
            MeasuredInterface::open(trainer()?, SCREEN_SIZE, screen)?,
            Vec::new(),
            Vec::new(),
        ));
    }
    for turn in 0..=runs {
        let rate = alone.measure(TURN_DURATION);
        for (measured, ratios, frames) in &mut screens {
            let measurement = measured.measure(TURN_DURATION)?;
            if turn > 0 {
                ratios.push(measurement.updates_per_second / rate);
                frames.extend(measurement.frames_us);
            }
        }
        if turn > 0 {
            rates.push(rate);
        }
    }
    let alone = median(rates);
    let mut out = format!(
        "256 x 256 cells: {alone:.0} updates/s on {}; with the interface at 200 x 60:\n",
        on(threads)
    );
    for (screen, (_, ratios, frames)) in MeasuredScreen::ALL.into_iter().zip(screens) {
        let (name, ratio) = (screen.name, median(ratios));
        let [frame, slow] = [0.5, 0.95].map(|share| quantile(frames.clone(), share) / 1e3);
        out += &format!("  {name:<16}{ratio:.2} of that; a frame {frame:.1} ms");
        out += &format!(", 95th percentile {slow:.1} ms\n");
    }
    Ok(out)
}

/// Training that nobody watches.
struct Alone(Engine);

impl Alone {
    /// Sends a command and waits until training is in phase `then`; returns the updates by then.
    fn command(&self, command: Command, then: &Phase) -> u64 {
        let snapshots = self.0.snapshots();
        self.0.send(command);
        while snapshots.borrow().phase != *then {
            std::thread::sleep(Duration::from_millis(1));
        }
        snapshots.borrow().counters.updates
    }

    /// Trains for `time`; returns updates per second.
    fn measure(&self, time: Duration) -> f64 {
        let before = self.command(Command::Resume, &Phase::Running);
        let began = Instant::now();
        std::thread::sleep(time);
        let took = began.elapsed().as_secs_f64();
        let updates = self.command(Command::Pause, &Phase::Paused) - before;
        updates as f64 / took
    }
}

/// Returns a map as large as the open one, of 31 x 31 rooms with doors.
pub fn rooms() -> Arc<Grid> {
    let wall = |x: usize, y: usize| x % 32 == 31 && y % 32 != 15 || y % 32 == 31 && x % 32 != 15;
    let free = (0..OPEN_MAP_SIDE * OPEN_MAP_SIDE)
        .map(|i| !wall(i % OPEN_MAP_SIDE, i / OPEN_MAP_SIDE))
        .collect();
    Arc::new(Grid::new("rooms", OPEN_MAP_SIDE, free, Vec::new(), Vec::new()))
}
