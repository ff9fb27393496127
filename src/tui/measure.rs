//! The interface without a terminal, to measure what it costs.

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
use super::keymap::Keymap;
use super::theme::{Depth, Theme, ThemeName};
use super::{ANSWER, Pace, render};
use crate::train::{Command, Engine, Limits, Phase, Snapshot, TrainError, Trainer};
use crate::view::{View, Viewer};

/// A run with the interface open on a screen that nobody sees.
pub struct Watched {
    app: App,
    cache: render::Cache,
    terminal: Terminal<CrosstermBackend<Sink>>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<Arc<View>>,
}

/// What happened while a run was watched.
pub struct Watching {
    /// Updates a second.
    pub updates_per_second: f64,
    /// Time that each frame took, in microseconds.
    pub frames_us: Vec<f64>,
}

impl Watched {
    /// Opens the interface on `trainer`, with `columns` and `rows` of characters; training is paused.
    ///
    /// # Errors
    /// What the learner reports, or that a thread cannot be started.
    pub fn open(trainer: Trainer, (columns, rows): (u16, u16)) -> Result<Self, TrainError> {
        let engine = Engine::start(trainer, Limits::default())?;
        let viewer = Viewer::start(&engine)?;
        let keymap = Keymap::new(&BTreeMap::new()).map_err(|(_, what, _)| std::io::Error::other(what))?;
        let mut app = App::new(engine, viewer, (UiConfig::default(), keymap), Files::default());
        app.screen.theme = Theme::new(ThemeName::Dark, Depth::True);
        let viewport = Viewport::Fixed(Rect::new(0, 0, columns, rows));
        let terminal = Terminal::with_options(CrosstermBackend::new(sink()), TerminalOptions { viewport })?;
        let mut watched =
            Self { snapshots: app.snapshots(), views: app.views(), app, cache: render::Cache::default(), terminal };
        watched.command(Command::Pause, &Phase::Paused);
        Ok(watched)
    }

    /// Lets it train for `time`, drawing as the interface does.
    ///
    /// # Errors
    /// What the screen reports.
    pub fn watch(&mut self, time: Duration) -> std::io::Result<Watching> {
        let mut frames_us = Vec::new();
        let mut pace = Pace::default();
        self.command(Command::Resume, &Phase::Running);
        let (began, before) = (Instant::now(), self.app.screen.snapshot.counters.updates);
        while began.elapsed() < time {
            std::thread::sleep(ANSWER);
            if self.snapshots.has_changed().unwrap_or(false) {
                self.app.on_snapshot(self.snapshots.borrow_and_update().clone());
                pace.changed = true;
            }
            if self.views.has_changed().unwrap_or(false) {
                self.app.on_view(self.views.borrow_and_update().clone());
                pace.changed = true;
            }
            if pace.is_due() {
                let drawing = Instant::now();
                let mut places = None;
                let Self { app, cache, terminal, .. } = self;
                terminal.draw(|frame| places = Some(render::draw(frame, &app.screen, cache)))?;
                places.into_iter().for_each(|places| app.drawn(places));
                frames_us.push(drawing.elapsed().as_secs_f64() * 1e6);
            }
        }
        self.command(Command::Pause, &Phase::Paused);
        let updates = self.app.screen.snapshot.counters.updates - before;
        Ok(Watching { updates_per_second: updates as f64 / began.elapsed().as_secs_f64(), frames_us })
    }

    /// Gives a command and waits until it is carried out.
    fn command(&mut self, command: Command, then: &Phase) {
        self.app.command(command);
        while self.snapshots.borrow_and_update().phase != *then {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.app.on_snapshot(self.snapshots.borrow().clone());
    }
}
