//! Measures the cost of the interface, without a terminal.

use std::collections::BTreeMap;
use std::io::{Sink, sink};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};
use tokio::sync::watch;

use super::app::App;
use super::config::UiConfig;
use super::graphics::patches::Patches;
use super::graphics::{Graphics, Redraw};
use super::interface::Interface;
use super::keymap::Keymap;
use super::session::Session;
use super::terminal::{FrameTimer, INPUT_FRAME_INTERVAL};
use super::theme::{ColourDepth, Theme, ThemeName};
use gdg::engine::{Engine, EngineCommand, Phase, Snapshot};
use gdg::train::{Limits, TrainError, Trainer};
use gdg::viewer::{View, Viewer};

/// A run with the interface open on an invisible screen.
pub struct MeasuredInterface {
    app: App,
    terminal: Terminal<CrosstermBackend<Sink>>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<Arc<View>>,
    patches: Option<(Patches, Graphics)>,
}

pub struct InterfaceMeasurement {
    pub updates_per_second: f64,
    /// Time taken by each frame, in microseconds.
    pub frames_us: Vec<f64>,
}

impl MeasuredInterface {
    /// Opens the interface with training paused; pictures have 10 x 20 pixels a character.
    pub fn open(
        trainer: Trainer,
        (columns, rows): (u16, u16),
        has_pictures: bool,
    ) -> Result<Self, TrainError> {
        let engine = Engine::start(trainer, Limits::default())?;
        let viewer = Viewer::start(&engine)?;
        let keymap = Keymap::new(&BTreeMap::new()).map_err(std::io::Error::other)?;
        let config = UiConfig::default();
        let session = Session::new(engine.link(), viewer, &config, keymap, None);
        let mut app = App::new(session);
        app.first_mut().screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
        let graphics = Graphics { character: (10, 20) };
        let patches = has_pictures.then(|| (Patches::default(), graphics));
        app.set_graphics(patches.as_ref().map(|(_, graphics)| *graphics), Redraw::All);
        let viewport = Viewport::Fixed(Rect::new(0, 0, columns, rows));
        let terminal =
            Terminal::with_options(CrosstermBackend::new(sink()), TerminalOptions { viewport })?;
        let mut measured = Self {
            snapshots: app.first().snapshots(),
            views: app.first().views(),
            app,
            terminal,
            patches,
        };
        measured.command(EngineCommand::Pause, &Phase::Paused);
        Ok(measured)
    }

    /// Trains for `time`, drawing as the interface does.
    pub fn measure(&mut self, time: Duration) -> std::io::Result<InterfaceMeasurement> {
        let mut frames_us = Vec::new();
        let mut timer = FrameTimer::default();
        self.command(EngineCommand::Resume, &Phase::Running);
        let (began, before) = (Instant::now(), self.app.first().screen.snapshot.counters.updates);
        while began.elapsed() < time {
            std::thread::sleep(INPUT_FRAME_INTERVAL);
            if self.snapshots.has_changed().unwrap_or(false) {
                self.app.first_mut().on_snapshot(self.snapshots.borrow_and_update().clone());
                timer.changed = true;
            }
            if self.views.has_changed().unwrap_or(false) {
                self.app.first_mut().on_view(self.views.borrow_and_update().clone());
                timer.changed = true;
            }
            if timer.is_due() {
                let Self { app, terminal, patches, .. } = self;
                let redraw = patches.as_ref().map_or(Redraw::All, |(own, _)| own.redraw(true));
                app.set_graphics(patches.as_ref().map(|(_, graphics)| *graphics), redraw);
                let drawing = Instant::now();
                let frame = terminal.draw(|frame| app.draw(frame))?;
                timer.drawn(false);
                if let Some((patches, graphics)) = patches {
                    std::hint::black_box(patches.update(
                        &app.pictures(),
                        frame.buffer,
                        *graphics,
                    )?);
                    timer.changed = patches.is_behind();
                }
                let took = drawing.elapsed();
                // Frames that reuse the previous picture do not count.
                if redraw != Redraw::Nothing {
                    frames_us.push(took.as_secs_f64() * 1e6);
                    patches
                        .iter_mut()
                        .for_each(|(patches, _)| patches.rest(Instant::now(), took, true));
                }
            }
        }
        self.command(EngineCommand::Pause, &Phase::Paused);
        let updates = self.app.first().screen.snapshot.counters.updates - before;
        Ok(InterfaceMeasurement {
            updates_per_second: updates as f64 / began.elapsed().as_secs_f64(),
            frames_us,
        })
    }

    fn command(&mut self, command: EngineCommand, then: &Phase) {
        self.app.first_mut().screen.command(command);
        while self.snapshots.borrow_and_update().phase != *then {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.app.first_mut().on_snapshot(self.snapshots.borrow().clone());
    }
}
