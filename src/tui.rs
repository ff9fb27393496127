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
mod editor;
mod measure;
mod raster;
mod render;
mod terminal;
#[cfg(test)]
mod tests;
mod viewer;

use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::EventStream;
use futures_util::StreamExt;
use miette::{IntoDiagnostic, Report};

use crate::cli::TrainArgs;
use crate::setup::{Setup, ending_signals};
use crate::train::{self, Engine};
use app::App;
pub use measure::Watched;
use terminal::Terminal;
use viewer::Viewer;

/// Shortest time between two frames: one that answers the user, and one that shows what has changed.
const ANSWER: Duration = Duration::from_millis(16);
const FRAME: Duration = Duration::from_millis(66);

/// Opens the trainer; the exit status once it is closed.
///
/// # Errors
/// What the terminal, training or saving report.
pub fn run(setup: Setup, args: &TrainArgs) -> Result<u8, Report> {
    let signal = ending_signals()?;
    let engine = Engine::start(setup.trainer, setup.diameter.steps, args.limits()).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let mut app = App::new(engine, viewer, args);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().into_diagnostic()?;
    let mut terminal = Terminal::enter().into_diagnostic()?;
    let shown = runtime.block_on(event_loop(&mut app, &mut terminal, &signal));
    drop(terminal);
    let summary = app.summary();
    let trainer = app.close();
    // Whatever happened to the terminal, what was learned is kept.
    let saved = match (&args.save, &trainer) {
        (Some(path), Some(trainer)) => train::save(trainer, path).map(|()| format!("\nsaved {}", path.display())),
        _ => Ok(String::new()),
    };
    // A terminal that has gone away cannot be told.
    let _ = writeln!(std::io::stdout(), "{summary}{}", saved.as_deref().unwrap_or_default());
    saved?;
    match signal.load(Ordering::Relaxed) {
        0 => shown.into_diagnostic().map(|()| 0),
        number => Ok(128 + number as u8),
    }
}

/// Draws and listens until the user or a signal ends it.
async fn event_loop(app: &mut App, terminal: &mut Terminal, signal: &AtomicUsize) -> std::io::Result<()> {
    let mut events = EventStream::new();
    let mut snapshots = app.snapshots();
    let mut views = app.views();
    let mut ticks = tokio::time::interval(ANSWER);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut pace = Pace { asked: true, ..Pace::default() };
    while !app.is_done() && signal.load(Ordering::Relaxed) == 0 {
        tokio::select! {
            event = events.next() => match event {
                Some(event) => {
                    app.on_event(&event?);
                    pace.asked = true;
                }
                // Nobody is left at the keyboard.
                None => break,
            },
            Ok(()) = snapshots.changed() => {
                app.on_snapshot(snapshots.borrow_and_update().clone());
                pace.changed = true;
            }
            Ok(()) = views.changed() => {
                app.on_view(views.borrow_and_update().clone());
                pace.changed = true;
            }
            _ = ticks.tick() => {
                pace.changed |= app.on_tick();
                if pace.is_due() {
                    terminal.draw(|frame| render::draw(frame, app))?;
                }
            }
        }
    }
    Ok(())
}

/// When to draw: at once for the user, at leisure for what changes by itself.
#[derive(Default)]
struct Pace {
    /// The user did something.
    asked: bool,
    /// There is something new to see.
    changed: bool,
    drawn: Option<Instant>,
}

impl Pace {
    /// Whether a frame is to be drawn now; then it counts as drawn.
    fn is_due(&mut self) -> bool {
        let due = self.asked || self.changed && self.drawn.is_none_or(|at| at.elapsed() >= FRAME);
        if due {
            *self = Self { drawn: Some(Instant::now()), ..Self::default() };
        }
        due
    }
}
