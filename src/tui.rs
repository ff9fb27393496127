//! The terminal trainer: draws what the engine publishes and passes on what the user does.
//!
//! ```text
//! ┌ map ───────────────────────────────┬ training ┐
//! │ walls, D(., goal) as colours and   ├ success ─┤
//! │ contours, agents, start, goal,     ├ bridges ─┤
//! │ bridge candidates, planned path    ├ walk ────┤
//! ├────────────────────────────────────┴──────────┤
//! │ keys, or a notice                             │
//! └───────────────────────────────────────────────┘
//! ```
//!
//! Three threads: the engine trains, the viewer computes the distance field and walks the test agent, and this one
//! draws. None waits for another: each takes the latest that the others have published.

mod action;
mod app;
mod colour;
mod raster;
mod render;
mod terminal;
#[cfg(test)]
mod tests;
mod viewer;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crossterm::event::EventStream;
use futures_util::StreamExt;
use miette::{IntoDiagnostic, Report};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::cli::TrainArgs;
use crate::setup::Setup;
use crate::train::{self, Engine};
use app::App;
use terminal::Terminal;
use viewer::Viewer;

/// Shortest time between two frames.
const FRAME: Duration = Duration::from_millis(33);

/// Opens the trainer; the exit status once it is closed.
///
/// # Errors
/// What the terminal, training or saving report.
pub fn run(setup: Setup, args: &TrainArgs) -> Result<u8, Report> {
    let signal = Arc::new(AtomicUsize::new(0));
    for number in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register_usize(number, signal.clone(), number as usize).into_diagnostic()?;
    }
    let engine = Engine::start(setup.trainer, setup.diameter.steps, args.limits()).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let app = App::new(engine, viewer, args);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().into_diagnostic()?;
    let mut terminal = Terminal::enter().into_diagnostic()?;
    let result = runtime.block_on(event_loop(app, &mut terminal, &signal));
    drop(terminal);
    let app = result.into_diagnostic()?;
    let summary = app.summary();
    let trainer = app.close();
    println!("{summary}");
    if let (Some(path), Some(trainer)) = (&args.save, &trainer) {
        train::save(trainer, path)?;
        println!("saved {}", path.display());
    }
    Ok(match signal.load(Ordering::Relaxed) {
        0 => 0,
        number => 128 + number as u8,
    })
}

/// Draws and listens until the user or a signal ends it.
async fn event_loop(mut app: App, terminal: &mut Terminal, signal: &AtomicUsize) -> std::io::Result<App> {
    let mut events = EventStream::new();
    let mut snapshots = app.snapshots();
    let mut views = app.views();
    let mut frames = tokio::time::interval(FRAME);
    frames.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut changed = true;
    while !app.is_done() && signal.load(Ordering::Relaxed) == 0 {
        tokio::select! {
            event = events.next() => match event {
                Some(event) => {
                    app.on_event(&event?);
                    changed = true;
                }
                // Nobody is left at the keyboard.
                None => break,
            },
            Ok(()) = snapshots.changed() => {
                app.on_snapshot(snapshots.borrow_and_update().clone());
                changed = true;
            }
            Ok(()) = views.changed() => {
                app.on_view(views.borrow_and_update().clone());
                changed = true;
            }
            _ = frames.tick() => {
                if app.on_tick() || changed {
                    terminal.draw(|frame| render::draw(frame, &mut app))?;
                    changed = false;
                }
            }
        }
    }
    Ok(app)
}
