//! The controller: applies events to the screen, the trainer and the viewer.

mod act;
mod answer;
mod answer_error;
mod autosave;
mod exports;
mod files;
mod maze;
mod mouse;
mod offer;
mod saving;
mod time;
mod tour;
mod updates;
mod view;

use std::sync::Arc;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::Frame;
use tokio::sync::watch;

use super::action::{Action, Mode};
use super::config::UiConfig;
use super::dialog::{Choice, Dialog};
use super::graphics::{Graphics, Picture, Redraw};
use super::interface::{Interface, TerminalRequest};
use super::keymap::{self, Keymap};
use super::layout::ScreenLayout;
use super::link::Link;
use super::offer::Search;
use super::render;
use super::scene::{Cache, MazeState, Scene};
use super::screen::Screen;
use super::theme::ThemeName;
use autosave::Autosave;
use exports::Exports;
pub use files::remember_map;
use gdg::engine::{Command, EngineLink, Snapshot};
use gdg::faults::Failure;
use gdg::viewer::{Field, OnArrival, Request, View, Viewer};
pub use saving::Files;
use saving::Saving;
#[cfg(test)]
pub use tour::ALL_STEPS;
use tour::Tour;
pub use tour::{MAP as TOUR_MAP, run as tour_run};

/// What trainer and viewer publish.
struct Feed {
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<View>,
}

/// Forwards user input to trainer and viewer, and what they publish to the screen.
pub struct App {
    link: Link,
    feed: Feed,
    /// The state a frame is drawn from, but for the scene.
    pub screen: Screen,
    /// What is drawn in the place of the map.
    pub scene: Scene,
    /// When the run is saved automatically.
    pub(super) autosave: Autosave,
    exports: Exports,
    saving: Saving,
    /// Looks for a saved run to offer.
    pub search: Option<Search>,
    /// The guided tour, while it lasts.
    tour: Option<Tour>,
    /// Whether the tour begins with the next run.
    tour_requested: bool,
    /// Internal errors so far.
    failures: Vec<Failure>,
    done: bool,
    /// What the terminal has been asked to do.
    terminal_request: Option<TerminalRequest>,
    /// Whether the press of the mouse button that is down has had its effect, so that dragging on
    /// does nothing.
    press_is_spent: bool,
    /// What the next frame can reuse.
    cache: Cache,
    /// The theme in use, while others are shown that are selected in the list of themes.
    previewed_over: Option<ThemeName>,
}

impl App {
    /// Opens the screen on the run of `engine`, with the goal that the run was saved with, the map's
    /// own or a random one; `viewer` computes what it shows.
    pub fn new(
        engine: EngineLink,
        viewer: Viewer,
        config: &UiConfig,
        keymap: Keymap,
        files: Files,
    ) -> Self {
        let feed = Feed { snapshots: engine.snapshots(), views: viewer.views() };
        let snapshot = feed.snapshots.borrow().clone();
        let mut app = Self {
            autosave: Autosave::every(config.autosave_minutes),
            exports: Exports::default(),
            saving: Saving::new(files),
            search: None,
            tour: None,
            tour_requested: false,
            failures: Vec::new(),
            done: false,
            terminal_request: None,
            press_is_spent: false,
            cache: Cache::with_pictures(),
            previewed_over: None,
            scene: Scene::of(&snapshot),
            link: Link::new(engine, viewer, &snapshot),
            screen: Screen::new(config, keymap, snapshot),
            feed,
        };
        app.start_run();
        app
    }

    /// Returns to the present; returns whether the past was shown.
    fn return_to_present(&mut self) -> bool {
        self.in_scene(|_, screen, link| link.return_to_present(screen))
    }

    /// Resets the screen for a new run.
    fn start_run(&mut self) {
        self.saving.start_run(&self.screen.snapshot);
        self.screen.log.start_run(&self.screen.snapshot.notes.log);
        self.screen.following = None;
        self.screen.offer = None;
        self.forget_tour();
        self.return_to_present();
        self.screen.layout = ScreenLayout::default();
        self.scene.enter(&self.screen.snapshot);
        if !self.scene.has_field(self.screen.field, &self.screen) {
            self.screen.field = Field::default();
        }
        // Another kind of scene has a worker of its own, which does not know these yet.
        self.link.request(Request::Field(self.screen.field));
        self.link.request(Request::OnArrival(self.screen.on_arrival));
        self.in_scene(Scene::start);
        if std::mem::take(&mut self.tour_requested) {
            self.begin_tour();
        }
    }

    /// Returns the engine's snapshots.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.link.engine().snapshots()
    }

    /// Returns the viewer's views.
    pub fn views(&self) -> watch::Receiver<View> {
        self.link.viewer().views()
    }

    /// Returns whether the program is to quit.
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// Returns what the terminal has been asked for.
    #[cfg(test)]
    pub fn terminal_request(&self) -> Option<TerminalRequest> {
        self.terminal_request
    }

    /// Sends a command to the trainer. If too many are queued, shows a notice and returns `false`.
    pub fn command(&mut self, command: Command) -> bool {
        self.link.command(command, &mut self.screen)
    }

    /// Lets the scene react to something.
    pub(super) fn in_scene<T>(
        &mut self,
        react: impl FnOnce(&mut Scene, &mut Screen, &mut Link) -> T,
    ) -> T {
        let was_frozen = self.screen.frozen;
        let done = react(&mut self.scene, &mut self.screen, &mut self.link);
        if was_frozen && !self.screen.frozen {
            self.freeze(false);
        }
        done
    }

    /// Lets the maze react to something, if the scene is one.
    pub(super) fn in_maze<T: Default>(
        &mut self,
        react: impl FnOnce(&mut MazeState, &mut Screen, &mut Link) -> T,
    ) -> T {
        self.in_scene(|scene, screen, link| match scene {
            Scene::Maze(maze) => react(maze, screen, link),
            Scene::Arm(_) => T::default(),
        })
    }

    /// Handles a terminal event.
    pub fn on_event(&mut self, event: &Event) {
        match event {
            Event::Key(key) if key.kind != KeyEventKind::Release => self.on_key(*key),
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            Event::Paste(text) => match self.screen.dialogs.last_mut() {
                Some(Dialog::Pick(picker)) => picker.paste(text),
                Some(Dialog::Ask(prompt)) => prompt.paste(text),
                Some(Dialog::Help(help)) => help.paste(text),
                None => {}
            },
            _ => {}
        }
    }

    fn on_key(&mut self, key: KeyEvent) {
        self.screen.log.dismiss();
        let interrupt = key.code == KeyCode::Char('c') && key.modifiers == KeyModifiers::CONTROL;
        if interrupt && !self.screen.dialogs.is_empty() {
            // A second Ctrl-C quits without further questions.
            self.done = true;
            return;
        }
        match self.screen.dialogs.last_mut() {
            None => match self.screen.keymap.action(key, self.scene.mode(&self.screen)) {
                Some(action) => self.act(action),
                None => self.on_unbound_key(key),
            },
            Some(Dialog::Help(_)) => self.on_key_in_help(key),
            Some(_) if key.code == KeyCode::Esc => self.dismiss(),
            Some(_) if key.code == KeyCode::Enter => self.answer(),
            Some(Dialog::Pick(_)) => self.on_key_in_list(key),
            Some(Dialog::Ask(prompt)) => prompt.on_key(key),
        }
    }

    fn on_unbound_key(&mut self, key: KeyEvent) {
        if self.screen.log.notice().is_some() {
            return;
        }
        let keymap = &self.screen.keymap;
        let [help, find] = [Action::Help, Action::Palette].map(|action| keymap.key_of(action));
        let place = if self.scene.is_editing() { "in the editor" } else { "here" };
        let text = format!(
            "{} does nothing {place}   {help} help   {find} all commands",
            keymap::name_of(key)
        );
        self.say(&text);
    }

    fn on_key_in_list(&mut self, key: KeyEvent) {
        let settings = self.screen.keymap.action(key, Mode::Settings);
        let Some(Dialog::Pick(picker)) = self.screen.dialogs.last_mut() else { return };
        match settings.filter(|_| picker.button.is_some()) {
            Some(action) => self.act(action),
            None if picker.on_key(key) => self.answer(),
            None => self.preview(),
        }
    }

    /// Closes the topmost dialog without an answer.
    fn dismiss(&mut self) {
        self.screen.dialogs.pop();
        if let Some(name) = self.previewed_over.take() {
            view::set_theme(name, &mut self.screen);
        }
        self.cancel_quit();
    }

    /// Shows what is selected in the list of themes.
    fn preview(&mut self) {
        if let Some(Dialog::Pick(picker)) = self.screen.dialogs.last()
            && let Some(Choice::Theme(name)) = picker.choice().cloned()
        {
            self.previewed_over.get_or_insert(self.screen.theme.name);
            view::set_theme(name, &mut self.screen);
        }
    }

    /// Returns the number of the latest goal request.
    pub fn goal_request(&self) -> u64 {
        self.link.goal_request()
    }

    /// Colours the scene by a field.
    pub fn show_field(&mut self, field: Field) {
        view::show_field(field, &mut self.screen, &self.link);
    }

    /// Changes what the walking agent does at the goal.
    pub fn set_on_arrival(&mut self, on_arrival: OnArrival) {
        view::set_on_arrival(on_arrival, &mut self.screen, &self.link);
    }

    /// Shows a notice and logs it.
    pub fn notify(&mut self, text: &str) {
        self.screen.notify(text);
    }

    /// Shows a notice of what concerns the screen alone, which the log is not for.
    pub fn say(&mut self, text: &str) {
        self.screen.say(text);
    }

    /// Shows an error and logs it.
    pub fn report(&mut self, text: &str) {
        self.screen.report(text);
    }

    /// Handles a drawn frame: stores its places for clicks, and has the viewer compute what its
    /// pixels show.
    pub fn drawn(&mut self, layout: ScreenLayout) {
        let before = std::mem::replace(&mut self.screen.layout, layout);
        if let (Some(Dialog::Help(help)), Some(lines)) =
            (self.screen.dialogs.last_mut(), &self.screen.layout.help_lines)
        {
            (help.first, help.page) = (lines.start, lines.len());
        }
        self.scene.drawn(before, &mut self.screen, &self.link);
    }
}

impl Interface for App {
    async fn update(&mut self) {
        tokio::select! {
            Ok(()) = self.feed.snapshots.changed() => {
                let snapshot = self.feed.snapshots.borrow_and_update().clone();
                self.on_snapshot(snapshot);
            }
            Ok(()) = self.feed.views.changed() => {
                let view = self.feed.views.borrow_and_update().clone();
                self.on_view(view);
            }
            // Both threads have ended.
            else => std::future::pending().await,
        }
    }

    fn on_event(&mut self, event: &Event) {
        App::on_event(self, event);
    }

    fn on_tick(&mut self) -> bool {
        self.exports.on_tick(&mut self.screen, &self.scene);
        App::on_tick(self)
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.terminal_request.take()
    }

    fn is_training(&self) -> bool {
        self.screen.snapshot.phase.is_training()
    }

    fn is_done(&self) -> bool {
        self.done
    }

    fn set_graphics(&mut self, graphics: Option<Graphics>, redraw: Redraw) {
        (self.screen.graphics, self.screen.redraw) = (graphics, redraw);
    }

    fn report(&mut self, problem: &str) {
        App::report(self, problem);
    }

    fn pictures(&self) -> Vec<&Picture> {
        self.cache.picture().into_iter().collect()
    }

    fn draw(&mut self, frame: &mut Frame) {
        self.cache.begin();
        let layout = render::draw(frame, &self.screen, &self.scene, &mut self.cache);
        self.drawn(layout);
    }

    fn on_signal(&mut self) {
        App::on_signal(self);
    }
}
