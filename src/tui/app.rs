//! The state of the screen, and what events do to it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossterm::event::{Event, KeyEventKind, MouseButton, MouseEvent, MouseEventKind};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ratatui::layout::Position;
use tokio::sync::watch;

use super::action::{Action, action_of};
use super::colour::Depth;
use super::editor::Editor;
use super::raster::MapFrame;
use super::render::Base;
use super::viewer::{Layer, Request, View, Viewer};
use crate::cli::TrainArgs;
use crate::map::{Cell, Grid};
use crate::train::{Command, Engine, Phase, Snapshot, Trainer};

/// How long a notice is shown.
const NOTICE: Duration = Duration::from_secs(4);

/// Most loss values kept for the curve; where there would be more, every other one goes.
const CURVE: usize = 1024;

/// Everything that the screen shows.
pub struct App {
    engine: Engine,
    viewer: Viewer,
    /// The map as the user last made it; the trainer follows.
    map: Arc<Grid>,
    pub editor: Editor,
    pub snapshot: Arc<Snapshot>,
    pub view: Arc<View>,
    /// The goal that distances are shown to.
    pub goal: Cell,
    /// The critic's loss from the beginning on, at equal distances.
    pub losses: Vec<f32>,
    /// Snapshots that one value of the curve stands for, and those since the last.
    curve_every: (usize, usize),
    /// Which distance is asked for.
    pub layer: Layer,
    pub show_help: bool,
    pub show_bridges: bool,
    pub show_agents: bool,
    pub depth: Depth,
    notice: Option<(String, Instant)>,
    /// Where the map was drawn last: clicks are understood by it.
    frame: Option<MapFrame>,
    /// What of the map pane did not change since then.
    pub base: Option<Base>,
    save_to: PathBuf,
    rng: ChaCha8Rng,
    done: bool,
}

impl App {
    /// The screen at its start: the map's own goal, or a random one.
    pub fn new(engine: Engine, viewer: Viewer, args: &TrainArgs) -> Self {
        let run = engine.run().clone();
        let name = format!("{}-{}-seed{}.safetensors", engine.map().name(), run.method.name(), run.seed);
        let snapshot = engine.snapshots().borrow().clone();
        let view = viewer.views().borrow().clone();
        let mut app = Self {
            map: engine.map().clone(),
            editor: Editor::default(),
            snapshot,
            view,
            goal: Cell::new(0, 0),
            losses: Vec::new(),
            curve_every: (1, 0),
            layer: Layer::default(),
            show_help: false,
            show_bridges: true,
            show_agents: true,
            depth: Depth::detect(),
            notice: None,
            frame: None,
            base: None,
            save_to: args.save.clone().unwrap_or_else(|| PathBuf::from("saves").join(name)),
            rng: ChaCha8Rng::seed_from_u64(run.seed),
            done: false,
            engine,
            viewer,
        };
        let first = app.engine.map().goals().first().copied();
        let goal = first.unwrap_or_else(|| app.random_cell());
        app.set_goal(goal);
        app
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
    pub fn run(&self) -> &crate::train::Run {
        self.engine.run()
    }

    /// Whether the user wants to leave.
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// The notice that is shown now.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_ref().map(|(text, _)| text.as_str())
    }

    /// Ends training; the trainer, unless it panicked.
    pub fn close(self) -> Option<Trainer> {
        self.engine.stop()
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
        let Some((updates, e)) = self.snapshot.evaluations.last() else { return text };
        let planned = e.planned.as_ref().map_or(String::new(), |p| format!("planned {:.2}, ", p.success));
        format!("{text}; at update {updates} success {planned}greedy {:.2}", e.greedy.success)
    }

    /// Takes a new snapshot.
    pub fn on_snapshot(&mut self, snapshot: Arc<Snapshot>) {
        if snapshot.counters.updates > self.snapshot.counters.updates {
            self.curve_every.1 += 1;
            if self.curve_every.1 >= self.curve_every.0 {
                self.curve_every.1 = 0;
                self.losses.push(snapshot.losses.critic);
            }
            if self.losses.len() > CURVE {
                let mut keep = false;
                self.losses.retain(|_| {
                    keep = !keep;
                    keep
                });
                self.curve_every.0 *= 2;
            }
        }
        if snapshot.notice.0 > self.snapshot.notice.0 {
            self.notify(snapshot.notice.1.clone());
        }
        self.snapshot = snapshot;
    }

    /// Takes a new view.
    pub fn on_view(&mut self, view: Arc<View>) {
        self.view = view;
    }

    /// Time has passed; whether that changes the screen.
    pub fn on_tick(&mut self) -> bool {
        let over = self.notice.as_ref().is_some_and(|(_, since)| since.elapsed() > NOTICE);
        if over {
            self.notice = None;
        }
        over
    }

    /// Passes a command on to the trainer; `false` where too many wait.
    pub fn command(&self, command: Command) -> bool {
        self.engine.send(command)
    }

    /// The user did something, or the terminal changed.
    pub fn on_event(&mut self, event: &Event) {
        match event {
            Event::Key(key) if key.kind != KeyEventKind::Release => {
                if let Some(action) = action_of(*key) {
                    self.act(action);
                }
            }
            Event::Mouse(mouse) if !self.show_help => self.on_mouse(*mouse),
            _ => {}
        }
    }

    /// Sets the goal, or draws.
    fn on_mouse(&mut self, mouse: MouseEvent) {
        let Some(frame) = &self.frame else { return };
        let at = Position::new(mouse.column, mouse.row);
        match mouse.kind {
            MouseEventKind::Down(button) | MouseEventKind::Drag(button) if self.editor.is_open() => match button {
                MouseButton::Left => self.editor.draw(at, false, frame, &self.map),
                MouseButton::Right => self.editor.draw(at, true, frame, &self.map),
                MouseButton::Middle => {}
            },
            MouseEventKind::Up(_) => {
                let new = self.editor.finish(&self.map.clone());
                self.change_map(new);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                if let Some(cell) = frame.cell_at(at, &self.map) {
                    self.set_goal(cell);
                }
            }
            _ => {}
        }
    }

    /// The map is to be this from now on.
    fn change_map(&mut self, map: Option<Arc<Grid>>) {
        let Some(map) = map else { return };
        if !self.command(Command::ChangeMap(map.clone())) {
            self.notify("the trainer is busy: try again".to_owned());
            return;
        }
        self.map = map;
        if !self.map.is_free(self.goal) {
            self.set_goal(self.goal);
        }
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::TogglePause => {
                let command = if self.snapshot.phase == Phase::Paused { Command::Resume } else { Command::Pause };
                self.command(command);
            }
            Action::NewGoal => {
                let cell = self.random_cell();
                self.set_goal(cell);
            }
            Action::MoveGoal(dx, dy) => match self.editor.cursor {
                Some(at) => {
                    let to = Cell::new(at.x.saturating_add_signed(dx), at.y.saturating_add_signed(dy));
                    let within = Cell::new(to.x.min(self.map.width() - 1), to.y.min(self.map.height() - 1));
                    self.editor.cursor = Some(within);
                }
                None => self.move_goal(dx, dy),
            },
            Action::ToggleEdit => {
                self.editor.cursor = if self.editor.is_open() { None } else { Some(self.goal) };
            }
            Action::Paint => {
                let new = self.editor.toggle(&self.map.clone());
                self.change_map(new);
            }
            Action::Undo => {
                let new = self.editor.undo(&self.map.clone());
                self.change_map(new);
            }
            Action::Redo => {
                let new = self.editor.redo(&self.map.clone());
                self.change_map(new);
            }
            Action::NewStart => self.viewer.ask(Request::NewStart),
            Action::NextLayer => {
                self.layer = self.layer.next(self.run().method);
                self.viewer.ask(Request::Layer(self.layer));
            }
            Action::ToggleBridges => self.show_bridges = !self.show_bridges,
            Action::ToggleAgents => self.show_agents = !self.show_agents,
            Action::Save => {
                self.notify(format!("saving {} ...", self.save_to.display()));
                if !self.command(Command::Save(self.save_to.clone())) {
                    self.notify("the trainer is busy: try again".to_owned());
                }
            }
            Action::ToggleHelp => self.show_help = !self.show_help,
            Action::Close if self.show_help => self.show_help = false,
            Action::Close => self.editor.cursor = None,
            Action::Quit => self.done = true,
        }
    }

    /// The next free cell in that direction, beyond walls too.
    fn move_goal(&mut self, dx: isize, dy: isize) {
        let mut at = self.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if at.x >= self.map().width() || at.y >= self.map().height() {
                return;
            }
            if self.map().is_free(at) {
                return self.set_goal(at);
            }
        }
    }

    fn random_cell(&mut self) -> Cell {
        let cells: Vec<Cell> = self.map.free_cells().collect();
        cells[self.rng.random_range(0..cells.len())]
    }

    fn set_goal(&mut self, cell: Cell) {
        if let Some(cell) = self.map().nearest_free(cell) {
            self.goal = cell;
            self.viewer.ask(Request::Goal(cell));
        }
    }

    fn notify(&mut self, text: String) {
        self.notice = Some((text, Instant::now()));
    }

    /// The map is now drawn at `frame`: the viewer computes its field for it.
    pub fn set_frame(&mut self, frame: MapFrame) {
        if self.frame.as_ref() != Some(&frame) {
            self.viewer.ask(Request::Window(frame.raster));
            self.frame = Some(frame);
        }
    }
}
