//! The state of the screen, and what events do to it.

mod act;
mod answer;
mod files;
mod mouse;
mod news;
mod saving;

use std::sync::Arc;
use std::time::Instant;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ratatui::layout::Position;
use tokio::sync::watch;

use super::config::UiConfig;
use super::dialog::Dialog;
use super::editor::Editor;
use super::keymap::Keymap;
use super::layers::{Field, Overlays};
use super::log::Log;
use super::output::What;
use super::panes::Pane;
use super::places::Places;
use super::raster::{MapFrame, Marker, Viewport};
use super::theme::{Depth, Theme};
use super::viewer::{Request, Tour, View, Viewer};
use crate::env::PointMaze;
use crate::faults::Failure;
use crate::map::{Cell, Grid};
use crate::train::{Command, Engine, Run, Snapshot, Success};
pub use saving::Files;
use saving::Saving;

/// Everything that the screen shows.
pub struct App {
    engine: Engine,
    viewer: Viewer,
    pub keymap: Keymap,
    pub theme: Theme,
    /// The map as the user last made it; the trainer follows.
    map: Arc<Grid>,
    pub editor: Editor,
    pub snapshot: Arc<Snapshot>,
    pub view: Arc<View>,
    /// The goal that distances are shown to.
    pub goal: Cell,
    /// The number of the latest wish for a goal.
    goals_asked: u64,
    /// The cursor that tells about its cell, and the cell under the mouse.
    pub inspecting: Option<Cell>,
    pub hovered: Option<Cell>,
    pub log: Log,
    /// What the colours stand for.
    pub field: Field,
    pub overlays: Overlays,
    pub marker: Marker,
    pub viewport: Viewport,
    pub pane: Pane,
    pub maximised: bool,
    /// How far back curves and log are scrolled, in pages.
    pub scrolled: usize,
    pub log_scale: bool,
    pub tour: Tour,
    /// What lies on top, the last one uppermost.
    pub dialogs: Vec<Dialog>,
    /// Pausing has been asked for.
    pub pausing: bool,
    /// The screen stays as it is.
    pub frozen: bool,
    /// The agent that is followed instead of the walking one.
    pub following: Option<usize>,
    /// Where things were drawn last.
    pub places: Places,
    /// Where the map was taken hold of to be moved.
    dragged_from: Option<Position>,
    /// Minutes between checkpoints that are saved without being asked for; 0 for none.
    pub autosave_minutes: f64,
    autosaved: Instant,
    saving: Saving,
    /// What failed inside the program.
    failures: Vec<Failure>,
    rng: ChaCha8Rng,
    done: bool,
    /// The program is to be stopped until the shell lets it go on.
    suspending: bool,
    /// What is to be written to a file.
    export: Option<What>,
}

impl App {
    /// The screen at its start: the map's own goal, or a random one.
    pub fn new(engine: Engine, viewer: Viewer, (config, keymap): (UiConfig, Keymap), files: Files) -> Self {
        let snapshot = engine.snapshots().borrow().clone();
        let view = viewer.views().borrow().clone();
        let mut app = Self {
            keymap,
            theme: Theme::new(config.theme, Depth::detect()),
            map: snapshot.scene.maze().map,
            editor: Editor::default(),
            goal: Cell::new(0, 0),
            goals_asked: 0,
            inspecting: None,
            hovered: None,
            log: Log::default(),
            field: Field::default(),
            overlays: Overlays::default(),
            marker: config.marker,
            viewport: Viewport::default(),
            pane: Pane::default(),
            maximised: false,
            scrolled: 0,
            log_scale: false,
            tour: Tour::default(),
            dialogs: Vec::new(),
            pausing: false,
            frozen: false,
            following: None,
            places: Places::default(),
            dragged_from: None,
            autosave_minutes: config.autosave_minutes,
            autosaved: Instant::now(),
            saving: Saving::new(files),
            failures: Vec::new(),
            rng: ChaCha8Rng::seed_from_u64(snapshot.run.seed),
            done: false,
            suspending: false,
            export: None,
            snapshot,
            view,
            engine,
            viewer,
        };
        app.begin();
        app
    }

    /// Turns to a run that is new to the screen.
    fn begin(&mut self) {
        let snapshot = self.snapshot.clone();
        let (run, map) = (&snapshot.run, snapshot.scene.maze().map);
        self.map = map.clone();
        self.saving.begin(&self.snapshot);
        self.log.begin(&self.snapshot.log);
        self.editor.forget();
        (self.viewport, self.following) = (Viewport::default(), None);
        self.inspect(None);
        if self.field == Field::Composed && !run.method.plans() {
            self.field = Field::default();
            self.viewer.ask(Request::Field(self.field));
        }
        let text = format!("{} on {}, {} x {} cells", run.method.name(), map.name(), map.width(), map.height());
        self.log.note(&text, self.snapshot.counters.updates);
        let first = self.map.goals().first().copied();
        let goal = first.unwrap_or_else(|| self.random_cell());
        self.set_goal(goal);
    }

    /// The engine's snapshots.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.engine.snapshots()
    }

    /// The viewer's views.
    pub fn views(&self) -> watch::Receiver<Arc<View>> {
        self.viewer.views()
    }

    /// The map.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// What is run.
    pub fn run(&self) -> &Run {
        &self.snapshot.run
    }

    /// Whether the user wants to leave.
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// Whether the program is to be stopped for now.
    #[cfg(test)]
    pub fn suspends(&self) -> bool {
        self.suspending
    }

    /// Whether the program is to be stopped for now; asked once for each time.
    pub fn takes_suspension(&mut self) -> bool {
        std::mem::take(&mut self.suspending)
    }

    /// What is to be written to a file; asked once for each time.
    pub fn takes_export(&mut self) -> Option<What> {
        self.export.take()
    }

    /// Updates that no checkpoint holds.
    pub fn unsaved_updates(&self) -> u64 {
        let saved = self.snapshot.saved.as_ref().map_or(0, |(updates, _)| *updates);
        self.snapshot.counters.updates.saturating_sub(saved)
    }

    /// The latest evaluation in brief.
    pub fn success(&self) -> Option<Success> {
        self.snapshot.evaluations.last().map(|(updates, e)| e.success(*updates))
    }

    /// What remains of the run on the terminal when the screen is gone.
    pub fn summary(&self) -> String {
        let counters = self.snapshot.counters;
        let text = format!(
            "{} on {}, seed {}: {} updates in {:.0} s, {} episodes",
            self.run().method.name(),
            self.map().name(),
            self.run().seed,
            counters.updates,
            self.snapshot.seconds,
            counters.episodes
        );
        match self.success() {
            Some(success) => format!("{text}; at update {} success {success}", success.updates),
            None => text,
        }
    }

    /// Passes a command on to the trainer; `false` where too many wait, which the user is told.
    pub fn command(&mut self, command: Command) -> bool {
        let sent = self.engine.send(command);
        if !sent {
            self.notify("the trainer is busy: try again");
        }
        sent
    }

    /// The user did something, or the terminal changed.
    pub fn on_event(&mut self, event: &Event) {
        match event {
            Event::Key(key) if key.kind != KeyEventKind::Release => self.on_key(*key),
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            Event::Paste(text) => match self.dialogs.last_mut() {
                Some(Dialog::Pick(picker)) => picker.paste(text),
                Some(Dialog::Ask(prompt)) => prompt.paste(text),
                _ => {}
            },
            _ => {}
        }
    }

    fn on_key(&mut self, key: KeyEvent) {
        let interrupt = key.code == KeyCode::Char('c') && key.modifiers == KeyModifiers::CONTROL;
        if interrupt && !self.dialogs.is_empty() {
            // Twice leaves without further questions.
            self.done = true;
            return;
        }
        match self.dialogs.last_mut() {
            None => {
                if let Some(action) = self.keymap.action(key, self.editor.is_open()) {
                    self.act(action);
                }
            }
            Some(Dialog::Help(_)) => self.on_key_in_help(key),
            Some(_) if key.code == KeyCode::Esc => {
                self.dialogs.pop();
                self.stay();
            }
            Some(_) if key.code == KeyCode::Enter => self.answer(),
            Some(Dialog::Pick(picker)) => picker.on_key(key),
            Some(Dialog::Ask(prompt)) => prompt.on_key(key),
        }
    }

    fn random_cell(&mut self) -> Cell {
        let cells: Vec<Cell> = self.map.free_cells().collect();
        cells[self.rng.random_range(0..cells.len())]
    }

    /// The goal at `cell`, or at the free cell nearest to it.
    pub fn set_goal(&mut self, cell: Cell) {
        if let Some(cell) = self.map.nearest_free(cell) {
            self.goal = cell;
            self.goals_asked += 1;
            self.viewer.ask(Request::Goal(cell, self.goals_asked));
        }
    }

    /// Asks about a cell, or no longer.
    fn inspect(&mut self, cell: Option<Cell>) {
        self.inspecting = cell;
        self.viewer.ask(Request::Inspect(cell.or(self.hovered)));
    }

    /// The map is to be this from now on.
    fn change_map(&mut self, map: Option<Arc<Grid>>) {
        let Some(map) = map else { return };
        let world = PointMaze::new(map.clone(), 0);
        if !self.command(Command::ChangeWorld(Box::new(world))) {
            return;
        }
        self.map = map;
        if !self.map.is_free(self.goal) {
            self.set_goal(self.goal);
        }
    }

    /// Tells the user something, and the log.
    pub fn notify(&mut self, text: &str) {
        self.log.add(text, self.snapshot.counters.updates);
    }

    /// The map is now drawn at `frame`: the viewer computes its field for it.
    pub fn set_frame(&mut self, frame: MapFrame) {
        if self.places.map.as_ref() != Some(&frame) {
            self.viewer.ask(Request::Frame(frame.clone()));
            self.places.map = Some(frame);
        }
    }
}
