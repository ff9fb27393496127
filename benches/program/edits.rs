//! How long an edit of the map holds training up.

use std::sync::Arc;
use std::time::Instant;

use super::{MAPS, built_in, interface, on, trainer};
use gdg::env::PointMaze;
use gdg::map::{Cell, Grid};
use gdg::train::{TrainError, Trainer};

/// Updates before the first edit.
const UPDATES: u64 = 4_000;

/// Updates after each edit in which training may be held up.
const WATCHED_UPDATES: u64 = 700;

/// Number of edits: a wall is built and removed in turns.
const EDITS: usize = 10;

/// Width and height of the wall, in cells.
const WALL: (usize, usize) = (2, 9);

/// Measures edits of a small and of a large map, on one thread and on all.
pub fn measure(threads: usize) -> Result<String, TrainError> {
    let maps = [built_in(MAPS[0]), interface::rooms()];
    let cases = maps.iter().flat_map(|map| [1, threads].map(|threads| (map, threads)));
    cases.map(|(map, threads)| edits_of(map, threads)).collect()
}

fn edits_of(map: &Arc<Grid>, threads: usize) -> Result<String, TrainError> {
    let mut trainer = trainer(map, 1, threads)?;
    train(&mut trainer, UPDATES)?;
    let walled = walled(map);
    let (mut edit_ms, mut stall_ms) = (0.0_f64, 0.0_f64);
    for edit in 0..EDITS {
        let world = PointMaze::new(if edit % 2 == 0 { walled.clone() } else { map.clone() }, 0);
        let began = Instant::now();
        trainer.change_world(&world)?;
        let took = 1e3 * began.elapsed().as_secs_f64();
        edit_ms = edit_ms.max(took);
        stall_ms = stall_ms.max(took).max(train(&mut trainer, WATCHED_UPDATES)?);
    }
    let edges = trainer.graph().map_or(0, |graph| graph.edges().len());
    let (map, threads) = (map.name(), on(threads));
    Ok(format!(
        "{map}, {edges} edges, {threads}: longest of {EDITS} edits {edit_ms:.0} ms, longest stall \
         {stall_ms:.0} ms\n"
    ))
}

/// Trains for a number of updates; returns the longest time without one, in milliseconds.
fn train(trainer: &mut Trainer, updates: u64) -> Result<f64, TrainError> {
    let last = trainer.counters().updates + updates;
    let (mut longest, mut began) = (0.0_f64, Instant::now());
    let mut before = trainer.counters().updates;
    while before < last {
        trainer.tick()?;
        if trainer.counters().updates > before {
            before = trainer.counters().updates;
            longest = longest.max(1e3 * began.elapsed().as_secs_f64());
            began = Instant::now();
        }
    }
    Ok(longest)
}

/// Returns the map with a wall around its middle.
fn walled(map: &Grid) -> Arc<Grid> {
    let (left, top) = ((map.width() - WALL.0) / 2, (map.height() - WALL.1) / 2);
    let cells = (0..WALL.0 * WALL.1).map(|i| Cell::new(left + i % WALL.0, top + i / WALL.0));
    let walled = map.with_cells(cells.map(|cell| (cell, false)));
    Arc::new(walled.unwrap_or_else(|| unreachable!("most cells stay free")))
}
