//! The terminal trainer: draws what the engine publishes and passes on what the user does.
//!
//! Three threads: the engine trains, the viewer ([`crate::view`]) computes distance fields and walks the test agent,
//! and this one draws.
//! None waits for another: each takes the latest that the others have published.
//!
//! * `action`, `keymap`, `config`: what can be done, by which keys, and what users set for themselves.
//! * `screen`: the state that a frame is drawn from; `dialog`, `editor`, `log` are parts of it.
//! * `app`: the controller: what events do to the screen, and to trainer and viewer.
//! * `render`: panes; `raster`, `canvas`, `layers`, `theme` are how the map becomes characters.
//! * `export`: what is seen, as files; `terminal`: the terminal itself, and recordings of it.

mod action;
mod app;
mod canvas;
mod config;
mod dialog;
mod editor;
mod export;
mod keymap;
mod layers;
mod log;
mod measure;
mod output;
mod panes;
mod places;
mod raster;
mod record;
mod render;
mod screen;
mod terminal;
#[cfg(test)]
mod tests;
mod theme;

use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use crossterm::event::EventStream;
use futures_util::StreamExt;
use miette::{IntoDiagnostic, Report};

use crate::cli::TrainArgs;
use crate::report::Explained;
use crate::setup::Setup;
use crate::signals::Ending;
use crate::text::plain_lines;
use crate::train::Engine;
use crate::view::Viewer;
use app::{App, Files};
pub use config::{UiConfig, load as load_config, parse as parse_config, template as config_template};
pub use export::{Paper, png_of};
pub use keymap::Keymap;
pub use measure::Watched;
pub use record::LARGEST_SCREEN;
use record::Recorder;
use terminal::Terminal;
pub use terminal::watch as guard_terminal;

/// Shortest time between two frames: one that answers the user, and one that shows what has changed.
const ANSWER: Duration = Duration::from_millis(16);
const FRAME: Duration = Duration::from_millis(66);

/// How often it is looked whether a signal came or a notice has been shown long enough.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The latter while training waits and only the walking agent moves: a program that waits should cost little.
const IDLE_FRAME: Duration = Duration::from_millis(130);

/// What the interface needs of files.
pub struct Prepared {
    config: (UiConfig, Keymap),
    recorder: Option<Recorder>,
}

/// Reads the configuration and begins the recording: before anything else, as both can be wrong.
///
/// # Errors
/// What is wrong with the one file, or that the other is there already or cannot be written.
pub fn prepare(args: &TrainArgs) -> Result<Prepared, Report> {
    let config =
        config::load(args.ui_config.as_deref()).map_err(|e| Explained::report(e.to_string(), e.right, e.excerpt))?;
    let recorder = args.record.as_deref().map(|path| Recorder::begin(path, args.overwrite)).transpose()?;
    Ok(Prepared { config, recorder })
}

/// Opens the trainer; the exit status once it is closed.
///
/// # Errors
/// What the terminal, training or saving report.
pub fn run(setup: Setup, Prepared { config, recorder }: Prepared, args: &TrainArgs) -> Result<u8, Report> {
    let ending = Ending::listen(terminal::restore)?;
    let Setup { trainer, save, resumed, warning, .. } = setup;
    let engine = Engine::start(trainer, args.limits()).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let mut app = App::new(engine, viewer, config, Files { save, resumed });
    if let Some(warning) = warning {
        app.notify(&warning);
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().into_diagnostic()?;
    let mut terminal = Terminal::enter(recorder).into_diagnostic()?;
    let draw = || runtime.block_on(event_loop(&mut app, &mut terminal, &ending));
    let shown = catch_unwind(AssertUnwindSafe(draw));
    if ending.number().is_some() || !matches!(shown, Ok(Ok(()))) {
        app.on_signal();
    }
    // Before anything that a terminal which has gone away might hold up.
    let closed = app.close();
    drop(terminal);
    let _ = writeln!(std::io::stdout(), "{}", plain_lines(&closed.summary));
    closed.saved?;
    if let Some(status) = ending.status() {
        return Ok(status);
    }
    match shown {
        Err(_) => Err(miette::miette!(help = crate::logging::hint(), "an internal error ended the interface")),
        Ok(shown) => shown.into_diagnostic().map(|()| u8::from(closed.failed)),
    }
}

/// Draws and listens until the user or a signal ends it.
async fn event_loop(app: &mut App, terminal: &mut Terminal, ending: &Ending) -> std::io::Result<()> {
    let mut events = EventStream::new();
    let mut snapshots = app.snapshots();
    let mut views = app.views();
    let mut pace = Pace { asked: true, ..Pace::default() };
    let mut stops = Stops::listen()?;
    let mut cache = render::Cache::default();
    while !app.is_done() && ending.number().is_none() {
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
            () = stops.next() => app.act(action::Action::Suspend),
            () = tokio::time::sleep(pace.until_due()) => {}
        }
        if app.takes_suspension() {
            terminal.suspend()?;
            pace.asked = true;
        }
        if let Some(what) = app.takes_export() {
            let told = export::write(what, &app.screen);
            app.notify(&told);
        }
        pace.changed |= app.on_tick();
        pace.waits = !app.screen.snapshot.phase.trains();
        if pace.is_due() {
            crate::faults::point("interface");
            let mut places = None;
            terminal.draw(|frame| places = Some(render::draw(frame, &app.screen, &mut cache)))?;
            places.into_iter().for_each(|places| app.drawn(places));
        }
    }
    Ok(())
}

/// Requests of others to stop until told to go on (SIGTSTP).
struct Stops {
    #[cfg(unix)]
    signals: tokio::signal::unix::Signal,
}

impl Stops {
    fn listen() -> std::io::Result<Self> {
        Ok(Self {
            #[cfg(unix)]
            signals: tokio::signal::unix::signal(tokio::signal::unix::SignalKind::from_raw(
                signal_hook::consts::SIGTSTP,
            ))?,
        })
    }

    /// Waits for the next one.
    async fn next(&mut self) {
        #[cfg(unix)]
        if self.signals.recv().await.is_some() {
            return;
        }
        std::future::pending::<()>().await;
    }
}

/// When to draw: at once for the user, at leisure for what changes by itself.
#[derive(Default)]
struct Pace {
    /// The user did something.
    asked: bool,
    /// There is something new to see.
    changed: bool,
    /// Training waits.
    waits: bool,
    drawn: Option<Instant>,
}

impl Pace {
    /// Time until something is to be done.
    fn until_due(&self) -> Duration {
        let rest = match self {
            Self { asked: true, .. } => ANSWER,
            Self { changed: true, waits: false, .. } => FRAME,
            Self { changed: true, waits: true, .. } => IDLE_FRAME,
            _ => return LOOK_EVERY,
        };
        self.drawn.map_or(Duration::ZERO, |at| rest.saturating_sub(at.elapsed()))
    }

    /// Whether a frame is to be drawn now; then it counts as drawn.
    fn is_due(&mut self) -> bool {
        let due = (self.asked || self.changed) && self.until_due().is_zero();
        if due {
            *self = Self { drawn: Some(Instant::now()), ..Self::default() };
        }
        due
    }
}
