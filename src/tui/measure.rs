//! The interface without a terminal, to measure its cost.

use std::collections::BTreeMap;
use std::io::{Sink, sink};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};
use tokio::sync::watch;

use super::app::{App, Files};
use super::config::UiConfig;
use super::event_loop::{FrameTimer, INPUT_FRAME_INTERVAL, Interface};
use super::keymap::Keymap;
use super::theme::{ColourDepth, Theme, ThemeName};
use crate::train::{Command, Engine, Limits, Phase, Snapshot, TrainError, Trainer};
use crate::view::{View, Viewer};

/// A run with the interface open on an invisible screen.
pub struct MeasuredInterface {
    app: App,
    terminal: Terminal<CrosstermBackend<Sink>>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<View>,
}

/// Measurements of a watched run.
pub struct InterfaceMeasurement {
    /// Updates per second.
    pub updates_per_second: f64,
    /// Time taken by each frame, in microseconds.
    pub frames_us: Vec<f64>,
}

impl MeasuredInterface {
    /// Opens the interface on `trainer`, on a screen of `columns` by `rows` characters; training is paused.
    ///
    /// # Errors
    /// Errors of the learner, or a thread that cannot be started.
    pub fn open(trainer: Trainer, (columns, rows): (u16, u16)) -> Result<Self, TrainError> {
        let engine = Engine::start(trainer, Limits::default())?;
        let viewer = Viewer::start(&engine)?;
        let keymap = Keymap::new(&BTreeMap::new()).map_err(std::io::Error::other)?;
        let mut app = App::new(engine, viewer, (UiConfig::default(), keymap), Files::default());
        app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
        let viewport = Viewport::Fixed(Rect::new(0, 0, columns, rows));
        let terminal = Terminal::with_options(CrosstermBackend::new(sink()), TerminalOptions { viewport })?;
        let mut measured = Self { snapshots: app.snapshots(), views: app.views(), app, terminal };
        measured.command(Command::Pause, &Phase::Paused);
        Ok(measured)
    }

    /// Trains for `time`, drawing as the interface does.
    ///
    /// # Errors
    /// Errors of the screen.
    pub fn measure(&mut self, time: Duration) -> std::io::Result<InterfaceMeasurement> {
        let mut frames_us = Vec::new();
        let mut timer = FrameTimer::default();
        self.command(Command::Resume, &Phase::Running);
        let (began, before) = (Instant::now(), self.app.screen.snapshot.counters.updates);
        while began.elapsed() < time {
            std::thread::sleep(INPUT_FRAME_INTERVAL);
            if self.snapshots.has_changed().unwrap_or(false) {
                self.app.on_snapshot(self.snapshots.borrow_and_update().clone());
                timer.changed = true;
            }
            if self.views.has_changed().unwrap_or(false) {
                self.app.on_view(self.views.borrow_and_update().clone());
                timer.changed = true;
            }
            if timer.is_due() {
                let drawing = Instant::now();
                let Self { app, terminal, .. } = self;
                terminal.draw(|frame| app.draw(frame))?;
                frames_us.push(drawing.elapsed().as_secs_f64() * 1e6);
            }
        }
        self.command(Command::Pause, &Phase::Paused);
        let updates = self.app.screen.snapshot.counters.updates - before;
        Ok(InterfaceMeasurement { updates_per_second: updates as f64 / began.elapsed().as_secs_f64(), frames_us })
    }

    /// Sends a command and waits until training is in phase `then`.
    fn command(&mut self, command: Command, then: &Phase) {
        self.app.command(command);
        while self.snapshots.borrow_and_update().phase != *then {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.app.on_snapshot(self.snapshots.borrow().clone());
    }
}
