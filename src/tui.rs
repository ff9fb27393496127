//! The terminal trainer: draws what the engine publishes and forwards user input.
//!
//! Three threads: the engine trains, the viewer ([`crate::view`]) computes distance fields and walks the test agent,
//! and this one draws.
//! No thread waits for another: each reads the latest state that the others have published.
//!
//! * `action`, `keymap`, `config`: the actions, their keys, and the user's configuration.
//! * `screen`: the state a frame is drawn from; `dialog`, `editor` and `log` are parts of it.
//! * `app`: the controller, which applies events to the screen, the trainer and the viewer.
//! * `render`: the panes; `raster`, `canvas`, `layers` and `theme` turn the map into characters.
//! * `export`: writes what is shown to files; `terminal`: the terminal itself; `record`: recordings of it.

mod action;
mod app;
mod canvas;
mod config;
mod dialog;
mod editor;
mod export;
mod keymap;
mod layers;
mod layout;
mod log;
mod measure;
mod output;
mod panes;
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
use crate::report::ExplainedError;
use crate::setup::Setup;
use crate::signals::TerminationSignal;
use crate::text::sanitized_lines;
use crate::train::Engine;
use crate::view::Viewer;
use app::{App, Files};
pub use config::{UiConfig, load as load_config, parse as parse_config, template as config_template};
pub use export::{PageColours, png_of};
pub use keymap::Keymap;
pub use measure::MeasuredInterface;
pub use record::LARGEST_SCREEN;
use record::Recorder;
use terminal::Terminal;
pub use terminal::run_guard as guard_terminal;

/// Minimum time between frames: after user input (`INPUT_FRAME_INTERVAL`), and after any other change
/// (`FRAME_INTERVAL`).
const INPUT_FRAME_INTERVAL: Duration = Duration::from_millis(16);
const FRAME_INTERVAL: Duration = Duration::from_millis(66);

/// Polling interval for signals and expiring notices.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// `FRAME_INTERVAL` while training is not running and only the walking agent moves: an idle program should use little
/// CPU.
const IDLE_FRAME_INTERVAL: Duration = Duration::from_millis(130);

/// The configuration and the recording, opened before the interface starts.
pub struct PreparedInterface {
    config: (UiConfig, Keymap),
    recorder: Option<Recorder>,
}

/// Reads the configuration and starts the recording. Called before anything else, since both can fail.
///
/// # Errors
/// The configuration is invalid, or the recording exists already or cannot be written.
pub fn prepare(args: &TrainArgs) -> Result<PreparedInterface, Report> {
    let config = config::load(args.ui_config.as_deref())
        .map_err(|e| ExplainedError::report(e.to_string(), e.help, e.excerpt))?;
    let recorder = args.record.as_deref().map(|path| Recorder::start(path, args.overwrite)).transpose()?;
    Ok(PreparedInterface { config, recorder })
}

/// Runs the trainer and returns the exit status.
///
/// # Errors
/// Errors of the terminal, of training or of saving.
pub fn run(
    setup: Setup,
    PreparedInterface { config, recorder }: PreparedInterface,
    args: &TrainArgs,
) -> Result<u8, Report> {
    let termination = TerminationSignal::listen(terminal::restore)?;
    let Setup { trainer, save, resumed, warning, .. } = setup;
    let engine = Engine::start(trainer, args.limits()).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let mut app = App::new(engine, viewer, config, Files { save, resumed });
    if let Some(warning) = warning {
        app.notify(&warning);
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().into_diagnostic()?;
    let mut terminal = Terminal::enter(recorder).into_diagnostic()?;
    let draw = || runtime.block_on(event_loop(&mut app, &mut terminal, &termination));
    let shown = catch_unwind(AssertUnwindSafe(draw));
    if termination.number().is_some() || !matches!(shown, Ok(Ok(()))) {
        app.on_signal();
    }
    // First, since writing to a terminal that is gone may block.
    let closed = app.close();
    drop(terminal);
    let _ = writeln!(std::io::stdout(), "{}", sanitized_lines(&closed.summary));
    closed.saved?;
    if let Some(status) = termination.status() {
        return Ok(status);
    }
    match shown {
        Err(_) => Err(miette::miette!(help = crate::logging::hint(), "an internal error ended the interface")),
        Ok(shown) => shown.into_diagnostic().map(|()| u8::from(closed.failed)),
    }
}

/// Handles events and draws frames until the user or a signal ends the loop.
async fn event_loop(app: &mut App, terminal: &mut Terminal, termination: &TerminationSignal) -> std::io::Result<()> {
    let mut events = EventStream::new();
    let mut snapshots = app.snapshots();
    let mut views = app.views();
    let mut timer = FrameTimer { immediate: true, ..FrameTimer::default() };
    let mut suspend_signals = SuspendSignals::listen()?;
    let mut cache = render::Cache::default();
    while !app.is_done() && termination.number().is_none() {
        tokio::select! {
            event = events.next() => match event {
                Some(event) => {
                    app.on_event(&event?);
                    timer.immediate = true;
                }
                // End of input: the terminal is gone.
                None => break,
            },
            Ok(()) = snapshots.changed() => {
                app.on_snapshot(snapshots.borrow_and_update().clone());
                timer.changed = true;
            }
            Ok(()) = views.changed() => {
                app.on_view(views.borrow_and_update().clone());
                timer.changed = true;
            }
            () = suspend_signals.next() => app.act(action::Action::Suspend),
            () = tokio::time::sleep(timer.until_due()) => {}
        }
        if app.take_suspend_request() {
            terminal.suspend()?;
            timer.immediate = true;
        }
        if let Some(kind) = app.take_export() {
            let notice = export::write(kind, &app.screen);
            app.notify(&notice);
        }
        timer.changed |= app.on_tick();
        timer.idle = !app.screen.snapshot.phase.is_training();
        if timer.is_due() {
            crate::faults::point("interface");
            let mut layout = None;
            terminal.draw(|frame| layout = Some(render::draw(frame, &app.screen, &mut cache)))?;
            layout.into_iter().for_each(|layout| app.drawn(layout));
        }
    }
    Ok(())
}

/// Requests by other processes to suspend (SIGTSTP).
struct SuspendSignals {
    #[cfg(unix)]
    signals: tokio::signal::unix::Signal,
}

impl SuspendSignals {
    fn listen() -> std::io::Result<Self> {
        Ok(Self {
            #[cfg(unix)]
            signals: tokio::signal::unix::signal(tokio::signal::unix::SignalKind::from_raw(
                signal_hook::consts::SIGTSTP,
            ))?,
        })
    }

    /// Waits for the next request.
    async fn next(&mut self) {
        #[cfg(unix)]
        if self.signals.recv().await.is_some() {
            return;
        }
        std::future::pending::<()>().await;
    }
}

/// Decides when to draw: at once after user input, less often for other changes.
#[derive(Default)]
struct FrameTimer {
    /// A frame is needed at once, as after user input.
    immediate: bool,
    /// What is shown has changed.
    changed: bool,
    /// Training is not running.
    idle: bool,
    last_drawn: Option<Instant>,
}

impl FrameTimer {
    /// Returns the time until the next frame or poll.
    fn until_due(&self) -> Duration {
        let interval = match self {
            Self { immediate: true, .. } => INPUT_FRAME_INTERVAL,
            Self { changed: true, idle: false, .. } => FRAME_INTERVAL,
            Self { changed: true, idle: true, .. } => IDLE_FRAME_INTERVAL,
            _ => return POLL_INTERVAL,
        };
        self.last_drawn.map_or(Duration::ZERO, |at| interval.saturating_sub(at.elapsed()))
    }

    /// Returns whether a frame is due; if so, counts it as drawn.
    fn is_due(&mut self) -> bool {
        let due = (self.immediate || self.changed) && self.until_due().is_zero();
        if due {
            *self = Self { last_drawn: Some(Instant::now()), ..Self::default() };
        }
        due
    }
}
