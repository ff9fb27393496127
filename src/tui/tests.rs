//! Tests of the interface on a buffer instead of a terminal.

mod actions;
mod after_keys;
mod compare;
mod dialogs;
mod found;
mod mouse;
mod past;
mod pixels;
mod saving;
pub(super) mod screens;
mod spaces;
mod staged;
mod tour;

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel, sync_channel};
use std::time::{Duration, Instant};

use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::{Position, Rect};
use ratatui::style::Color;
use tokio::sync::watch;

use super::action::{Action, Binding, Mode, bindings};
use super::app::{App, Base};
use super::config::UiConfig;
use super::dialog::Dialog;
use super::drawings::{ExportError, drawn};
use super::interface::Interface;
use super::keymap::Keymap;
use super::scene::{MazeState, Scene, SpaceState};
use super::session::{Cx, Session};
use super::theme::{ColourDepth, Theme, ThemeName};
use crate::tui::choices::{ExportKind, Tool};
use gdg::engine::{Engine, EngineCommand, EngineLink, Phase, Snapshot};
use gdg::env::{Environment, PointMaze};
use gdg::job::Job;
use gdg::map::{Cell, Grid, parse_map};
use gdg::train::{
    self, FilmFrame, Limits, Method, Preset, Registry, Run, RunDescription, SaveTo, Trainer,
};
use gdg::viewer::{Field, Request, View, Viewer};

const ROOMS: &str = "\
..........#.........
..........#.........
....................
..........#.........
..........#........G
";

fn trainer_in(world: &dyn Environment, method: Method, seed: u64) -> Trainer {
    let registry = Registry::builtin();
    let preset = registry.preset_of(&method);
    let mut settings = preset.settings();
    settings.learn.hidden = 16;
    settings.learn.buffer_size = 20_000;
    settings.bridge.candidates = 40;
    Trainer::new(Run { method, preset, seed, settings }, world, &registry, 1).expect("a trainer")
}

/// Returns an app that trains up to so many updates, if they are limited.
fn app_in(world: &dyn Environment, method: Method, most: Option<u64>, to: Option<PathBuf>) -> App {
    let limits = Limits { updates: most, ..Limits::default() };
    let engine = Engine::start(trainer_in(world, method, 1), limits).expect("an engine");
    let viewer = Viewer::start(&engine).expect("a viewer");
    let mut app = app_with(engine.link(), viewer, to.map(SaveTo::CreateNew));
    // Tests that fail while a run is saved leave nothing in the repository.
    app.saver.folder = std::env::temp_dir().join("gdg-tui-tests");
    let Session { saver, cx, .. } = &mut *app;
    saver.start_run(&cx.screen.snapshot);
    app
}

fn app_with(engine: EngineLink, viewer: Viewer, save: Option<SaveTo>) -> App {
    let mut app = App::new(Session::new(engine, viewer, &UiConfig::default(), keymap(), save));
    app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
    app.reading_patience = Duration::from_secs(20);
    app
}

fn app_on(map: Grid, method: Method) -> App {
    app_in(&PointMaze::new(Arc::new(map), 0), method, None, None)
}

fn app() -> App {
    app_on(rooms(), Method::default())
}

fn app_saving_to(path: &Path, method: Method, updates: Option<u64>) -> App {
    let world = PointMaze::new(Arc::new(rooms()), 0);
    app_in(&world, method, updates, Some(path.to_owned()))
}

/// Tests of a single run look into it.
impl Deref for App {
    type Target = Session;

    fn deref(&self) -> &Session {
        self.first()
    }
}

impl DerefMut for App {
    fn deref_mut(&mut self) -> &mut Session {
        self.first_mut()
    }
}

impl Session {
    fn drawn_map(&self) -> &Grid {
        &self.screen.snapshot.scene.maze().expect("a maze").map
    }

    fn maze(&self) -> &MazeState {
        self.scene.maze().expect("a maze")
    }

    fn maze_mut(&mut self) -> &mut MazeState {
        self.scene.maze_mut().expect("a maze")
    }

    fn space(&self) -> &SpaceState {
        match &self.scene {
            Scene::Space(space) => space,
            Scene::Maze(_) => panic!("a space"),
        }
    }

    fn set_arm_goal(&mut self, at: [f32; 3]) {
        let Cx { screen, scene, .. } = &mut self.cx;
        match scene {
            Scene::Space(space) => space.set_goal(at.to_vec(), screen),
            Scene::Maze(_) => panic!("an arm"),
        }
    }

    fn set_goal(&mut self, cell: Cell) {
        self.in_maze(|maze, screen| maze.set_goal(cell, screen));
    }

    fn change_cell(&mut self, cell: Cell, free: bool) {
        self.in_maze(|maze, screen| {
            let map = maze.map.with_cells([(cell, free)]).map(Arc::new);
            maze.change_map(map, screen);
        });
    }

    fn change_snapshot(&mut self, change: impl FnOnce(&mut Snapshot)) {
        let mut snapshot = (*self.screen.snapshot).clone();
        change(&mut snapshot);
        self.on_snapshot(Arc::new(snapshot));
    }

    fn change_view(&mut self, change: impl FnOnce(&mut View)) {
        let mut view = (*self.maze().view).clone();
        change(&mut view);
        self.on_view(Arc::new(view));
    }

    fn shown_past(&self) -> Option<&FilmFrame> {
        self.scene.past()
    }
}

/// An app without a trainer and a viewer: its messages stay in the channels.
struct Still {
    app: App,
    commands: Receiver<EngineCommand>,
    requests: Receiver<Request>,
    snapshots: watch::Sender<Arc<Snapshot>>,
    _views: watch::Sender<Arc<View>>,
    /// What its trainer is doing.
    job: Job,
}

impl Deref for Still {
    type Target = App;

    fn deref(&self) -> &App {
        &self.app
    }
}

impl DerefMut for Still {
    fn deref_mut(&mut self) -> &mut App {
        &mut self.app
    }
}

impl Still {
    /// Carries out the app's requests to the trainer: pauses, and changes of run and speed.
    fn obey(&mut self) {
        while let Ok(command) = self.commands.try_recv() {
            let mut snapshot = (*self.app.screen.snapshot).clone();
            match command {
                EngineCommand::Pause => snapshot.phase = Phase::Paused,
                EngineCommand::Resume => snapshot.phase = Phase::Running,
                EngineCommand::LimitSpeed(speed) => snapshot.speed = speed,
                EngineCommand::Change(run) => snapshot.run = Arc::new(*run),
                _ => {}
            }
            self.publish(snapshot);
        }
    }

    fn publish(&mut self, snapshot: Snapshot) {
        let snapshot = Arc::new(snapshot);
        self.snapshots.send_replace(snapshot.clone());
        self.app.on_snapshot(snapshot);
    }
}

fn still_in(world: &dyn Environment, method: Method) -> Still {
    still_at(Snapshot::capture(&trainer_in(world, method, 1)).expect("a snapshot"))
}

fn still_at(snapshot: Snapshot) -> Still {
    let (sender, commands) = sync_channel(64);
    let (request, requests) = channel();
    let (publish, snapshots) = watch::channel(Arc::new(snapshot));
    let (show, views) = watch::channel(Arc::default());
    let job = Job::default();
    let engine = EngineLink::new(sender, snapshots, job.clone());
    let app = app_with(engine, Viewer::new(request, views), None);
    Still { app, commands, requests, snapshots: publish, _views: show, job }
}

fn still_on(map: Grid, method: Method) -> Still {
    still_in(&PointMaze::new(Arc::new(map), 0), method)
}

fn still() -> Still {
    still_on(rooms(), Method::default())
}

fn keymap() -> Keymap {
    Keymap::new(&BTreeMap::new()).expect("the table's keys")
}

/// Saves what `app` trains to a file in `folder` and describes it.
fn saved_run(folder: &Path, app: &App) -> RunDescription {
    let run = Run { method: gdg(), ..app.screen.run().clone() };
    let world = PointMaze::new(app.maze().map.clone(), 0);
    let trainer = Trainer::new(run, &world, &Registry::builtin(), 1).expect("a trainer");
    let path = train::save(&trainer, &SaveTo::CreateNew(folder.join("saved.safetensors")))
        .expect("a file");
    train::describe(&path).expect("a checkpoint")
}

fn export(kind: ExportKind, app: &mut App) -> Result<Vec<u8>, ExportError> {
    let Cx { screen, scene, .. } = &mut app.cx;
    drawn(kind, screen, scene)?()
}

fn gdg() -> Method {
    "gdg".parse().expect("a method")
}

fn rooms() -> Grid {
    parse_map("rooms", ROOMS.as_bytes()).expect("a map")
}

/// What keys are pressed on, and what is drawn.
pub(super) trait Driven {
    fn event(&mut self, event: &Event);

    fn frame(&mut self, frame: &mut ratatui::Frame);

    /// Carries out what has been asked of a trainer that is none.
    fn obey(&mut self) {}
}

impl<I: Interface> Driven for I {
    fn event(&mut self, event: &Event) {
        self.on_event(event);
    }

    fn frame(&mut self, frame: &mut ratatui::Frame) {
        self.draw(frame);
    }
}

impl Driven for Still {
    fn event(&mut self, event: &Event) {
        self.app.on_event(event);
    }

    fn frame(&mut self, frame: &mut ratatui::Frame) {
        self.app.draw(frame);
    }

    fn obey(&mut self) {
        Self::obey(self);
    }
}

pub(super) fn mouse(app: &mut (impl Driven + ?Sized), kind: MouseEventKind, at: Position) {
    let modifiers = KeyModifiers::NONE;
    app.event(&Event::Mouse(MouseEvent { kind, column: at.x, row: at.y, modifiers }));
}

pub(super) fn click(app: &mut (impl Driven + ?Sized), button: MouseButton, at: Position) {
    mouse(app, MouseEventKind::Down(button), at);
    mouse(app, MouseEventKind::Up(button), at);
}

pub(super) fn type_text(app: &mut (impl Driven + ?Sized), text: &str) {
    text.chars().for_each(|c| press(app, KeyCode::Char(c)));
}

fn character_of(app: &App, cell: Cell) -> Position {
    let frame = app.screen.layout.map.clone().expect("the map is drawn");
    frame.character_of(cell.centre()).expect("the cell is shown")
}

pub(super) fn draw(
    app: &mut (impl Driven + ?Sized),
    width: u16,
    height: u16,
) -> Terminal<TestBackend> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a buffer");
    terminal.draw(|frame| app.frame(frame)).expect("a frame");
    terminal
}

pub(super) fn text(terminal: &Terminal<TestBackend>) -> String {
    let buffer = terminal.backend().buffer();
    let rows = buffer.content.chunks(usize::from(buffer.area.width));
    let rows = rows.map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>());
    rows.collect::<Vec<_>>().join("\n")
}

pub(super) fn shown_by(app: &mut (impl Driven + ?Sized), width: u16, height: u16) -> String {
    text(&draw(app, width, height))
}

pub(super) fn place_of(shown: &str, text: &str) -> Position {
    let mut lines = shown.lines().enumerate();
    let found = lines.find_map(|(y, line)| Some((y, line.split_once(text)?.0)));
    let (y, before) = found.unwrap_or_else(|| panic!("{text:?} is missing:\n{shown}"));
    Position::new(before.chars().count() as u16, y as u16)
}

fn notice(app: &App) -> String {
    app.screen.log.notice().map(|notice| notice.text.to_owned()).unwrap_or_default()
}

pub(super) fn press(app: &mut (impl Driven + ?Sized), code: KeyCode) {
    press_with(app, code, KeyModifiers::NONE);
}

pub fn press_with(app: &mut (impl Driven + ?Sized), code: KeyCode, modifiers: KeyModifiers) {
    app.event(&Event::Key(KeyEvent::new(code, modifiers)));
}

fn enter(app: &mut (impl Driven + ?Sized), text: &str) {
    press_with(app, KeyCode::Char('u'), KeyModifiers::CONTROL);
    type_text(app, text);
    press(app, KeyCode::Enter);
}

/// Applies what engine and viewer publish until `is` holds.
#[track_caller]
fn wait_until(app: &mut App, is: impl Fn(&App) -> bool) {
    let (snapshots, views) = (app.snapshots(), app.views());
    let began = Instant::now();
    while !is(app) {
        assert!(began.elapsed() < Duration::from_mins(1), "timed out: {}", notice(app));
        std::thread::sleep(Duration::from_millis(5));
        let (snapshot, view) = (snapshots.borrow().clone(), views.borrow().clone());
        app.on_snapshot(snapshot);
        app.on_view(view);
    }
}

#[test]
fn the_cursor_and_the_mouse_show_facts_about_a_cell() {
    let mut app = app();
    draw(&mut app, 120, 40);
    press(&mut app, KeyCode::Char('i'));
    (0..3).for_each(|_| press(&mut app, KeyCode::Left));
    let cell = Cell::new(16, 4);
    wait_until(&mut app, |app| app.maze().view.inspected.is_some_and(|facts| facts.cell == cell));
    let facts = app.maze().view.inspected.expect("facts");
    assert_eq!(facts.truth, Some(3));
    assert!(text(&draw(&mut app, 120, 40)).contains("cell 16,4: D "));
    press(&mut app, KeyCode::Enter);
    assert_eq!(app.maze().goal, cell);
    press(&mut app, KeyCode::Esc);
    // Hovering with the mouse does the same.
    let at = character_of(&app, Cell::new(2, 2));
    mouse(&mut app, MouseEventKind::Moved, at);
    wait_until(&mut app, |app| {
        app.maze().view.inspected.is_some_and(|facts| facts.cell == Cell::new(2, 2))
    });
    // Right clicks set the start of the walking agent.
    mouse(&mut app, MouseEventKind::Down(MouseButton::Right), at);
    wait_until(&mut app, |app| app.maze().view.reach.start == [2.5, 2.5]);
}

#[test]
fn the_walking_agent_can_visit_one_goal_after_another() {
    let mut app = app();
    draw(&mut app, 80, 24);
    press(&mut app, KeyCode::Char('t'));
    // A walk that starts at the goal arrives at once, whatever was learned.
    press(&mut app, KeyCode::Char('S'));
    let first = app.maze().goal;
    wait_until(&mut app, |app| app.maze().view.reach.finished.0 >= 1 && app.maze().goal != first);
}
