//! The cost of the interface.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::cases::OPEN_MAP_SIDE;
use super::{InterfaceTimes, median};
use crate::env::PointMaze;
use crate::map::Grid;
use crate::train::{Method, Preset, Registry, Run, Settings, Tick, TrainError, Trainer};
use crate::tui::MeasuredInterface;

/// Columns and rows of the screen for the interface.
const SCREEN_SIZE: (u16, u16) = (200, 60);

/// Measures training on a large map with and without the interface, in turns.
pub fn measure((threads, runs): (usize, usize)) -> Result<InterfaceTimes, TrainError> {
    const TURN_DURATION: Duration = Duration::from_secs(1);
    let map = rooms();
    let trainer = || {
        let run = Run { method: Method::default(), preset: Preset::Default, seed: 1, settings: Settings::default() };
        Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), threads)
    };
    let mut alone = trainer()?;
    let mut measured = MeasuredInterface::open(trainer()?, SCREEN_SIZE)?;
    let (mut rates, mut ratios, mut frames) = (Vec::new(), Vec::new(), Vec::new());
    for turn in 0..=runs {
        let (began, mut updates) = (Instant::now(), 0);
        while began.elapsed() < TURN_DURATION {
            updates += u64::from(alone.tick()? == Tick::Update);
        }
        let rate = f64::from(updates as u32) / began.elapsed().as_secs_f64();
        let measurement = measured.measure(TURN_DURATION)?;
        if turn > 0 {
            rates.push(rate);
            ratios.push(measurement.updates_per_second / rate);
            frames.extend(measurement.frames_us);
        }
    }
    Ok(InterfaceTimes { runs, alone: median(rates), ratio: median(ratios), frame_us: median(frames) })
}

/// Returns a map as large as the open one, of 31 x 31 rooms with doors.
fn rooms() -> Arc<Grid> {
    let wall = |x: usize, y: usize| x % 32 == 31 && y % 32 != 15 || y % 32 == 31 && x % 32 != 15;
    let free = (0..OPEN_MAP_SIDE * OPEN_MAP_SIDE).map(|i| !wall(i % OPEN_MAP_SIDE, i / OPEN_MAP_SIDE)).collect();
    Arc::new(Grid::new("rooms", OPEN_MAP_SIDE, free, Vec::new(), Vec::new()))
}
