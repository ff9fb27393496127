//! The controller: applies events to the screen, the trainer and the viewer.

mod act;
mod answer;
mod answer_error;
mod autosave;
mod closing;
mod exports;
pub mod files;
mod mouse;
pub mod offer;
mod runs;
mod saving;
mod settings;
pub mod time;
mod tour;
mod updates;
pub mod view;

use std::sync::Arc;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::Frame;
use tokio::sync::watch;

use super::action::{Action, Mode};
use super::busy::{Busy, Lasting};
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
use exports::Exports;
pub use files::remember_map;
use gdg::engine::{Command, EngineLink, NextEvaluation, Snapshot};
use gdg::viewer::{Field, Request, View, Viewer};
pub use saving::Files;
use saving::Saver;
#[cfg(test)]
pub use tour::ALL_STEPS;
use tour::Guide;
pub use tour::{MAP as TOUR_MAP, run as tour_run};

/// What trainer and viewer publish.
struct Feed {
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<View>,
}

/// Forwards user input to trainer and viewer, and what they publish to the screen.
pub struct App {
    pub(super) link: Link,
    feed: Feed,
    /// The state a frame is drawn from, but for the scene.
    pub screen: Screen,
    /// What is drawn in the place of the map.
    pub scene: Scene,
    /// Saves the run.
    pub(super) saver: Saver,
    exports: Exports,
    /// Looks for a saved run to offer.
    pub search: Option<Search>,
    /// Leads through the tour.
    pub(super) guide: Guide,
    /// What the terminal has been asked to do.
    pub(super) terminal_request: Option<TerminalRequest>,
    /// Whether the press of the mouse button that is down has had its effect, so that dragging on
    /// does nothing.
    press_is_spent: bool,
    /// What the next frame can reuse.
    cache: Cache,
    /// The theme in use, while others are shown that are selected in the list of themes.
    previewed_over: Option<ThemeName>,
    /// Whether what the user picks from a list is left to somebody else: to a comparison, which
    /// does it on both sides. And what has been picked.
    pub(super) hands_over: bool,
    pub(super) picked: Option<Choice>,
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
            saver: Saver::new(files, config.autosave_minutes),
            exports: Exports::default(),
            search: None,
            guide: Guide::default(),
            terminal_request: None,
            press_is_spent: false,
            cache: Cache::with_pictures(),
            previewed_over: None,
            hands_over: false,
            picked: None,
            scene: Scene::of(&snapshot),
            link: Link::new(engine, viewer, &snapshot),
            screen: Screen::new(config, keymap, snapshot),
            feed,
        };
        app.start_run();
        app
    }

    /// Resets the screen for a new run.
    fn start_run(&mut self) {
        self.saver.start_run(&self.screen.snapshot);
        self.screen.log.start_run(&self.screen.snapshot.notes.log);
        self.screen.following = None;
        self.screen.offer = None;
        self.guide.forget(&mut self.screen);
        self.in_scene(|_, screen, link| link.return_to_present(screen));
        self.screen.layout = ScreenLayout::default();
        self.scene.enter(&self.screen.snapshot);
        if !self.scene.has_field(self.screen.field, &self.screen) {
            self.screen.field = Field::default();
        }
        // Another kind of scene has a worker of its own, which does not know these yet.
        self.link.request(Request::Field(self.screen.field));
        self.link.request(Request::OnArrival(self.screen.on_arrival));
        self.in_scene(Scene::start);
        if std::mem::take(&mut self.guide.is_requested) {
            self.begin_tour();
        }
    }

    /// Begins the tour of the run that is shown.
    pub(super) fn begin_tour(&mut self) {
        if self.screen.frozen {
            self.freeze(false);
        }
        self.guide.begin(&mut self.scene, &mut self.screen, &mut self.link);
    }

    /// Returns the engine's snapshots.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.link.engine().snapshots()
    }

    /// Returns the viewer's views.
    pub fn views(&self) -> watch::Receiver<View> {
        self.link.viewer().views()
    }

    /// Sends a command to the trainer. If too many are queued, shows a notice and returns `false`.
    pub fn command(&mut self, command: Command) -> bool {
        self.link.command(command, &mut self.screen)
    }

    /// Looks at what the trainer is doing; returns whether the screen changes.
    pub(in crate::tui) fn update_busy(&mut self) -> bool {
        let Self { link, screen, .. } = self;
        let evaluating = match screen.snapshot.next_evaluation {
            NextEvaluation::Running(since) => {
                Some(Lasting::now(since, &screen.snapshot.evaluation_progress))
            }
            _ => None,
        };
        let now = (Busy::now(link.engine()), evaluating);
        let before = (screen.busy, screen.evaluating);
        (screen.busy, screen.evaluating) = now;
        now != before
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
            Scene::Arm(_) | Scene::Goals(_) => T::default(),
        })
    }

    fn on_key(&mut self, key: KeyEvent) {
        self.screen.log.dismiss();
        let interrupt = key.code == KeyCode::Char('c') && key.modifiers == KeyModifiers::CONTROL;
        if interrupt && !self.screen.dialogs.is_empty() {
            // A second Ctrl-C quits without further questions.
            self.saver.is_done = true;
            return;
        }
        match self.screen.dialogs.last_mut() {
            None => match self.screen.keymap.action(key, self.scene.mode(&self.screen)) {
                Some(action) => self.act(action),
                None => say_unbound(key, &self.scene, &mut self.screen),
            },
            Some(Dialog::Help(_)) => self.on_key_in_help(key),
            Some(_) if key.code == KeyCode::Esc => self.dismiss(),
            Some(_) if key.code == KeyCode::Enter => self.answer(),
            Some(Dialog::Pick(_)) => self.on_key_in_list(key),
            Some(Dialog::Ask(prompt)) => prompt.on_key(key),
        }
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
        self.saver.cancel_quit(&mut self.screen, &self.link);
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

    fn on_tick(&mut self) -> bool {
        let Self { exports, saver, search, guide, scene, screen, link, .. } = self;
        exports.on_tick(screen, scene);
        saver.on_tick(scene, screen, link);
        let offer_changed = offer::on_tick(search, screen);
        let tour_changed = guide.on_tick(scene, screen, link);
        let log_changed = screen.log.on_tick();
        let read = files::on_tick(scene, screen);
        let busy_changed = self.update_busy();
        read || log_changed || offer_changed || tour_changed || busy_changed
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.terminal_request.take()
    }

    fn is_training(&self) -> bool {
        self.screen.snapshot.phase.is_training()
    }

    fn is_done(&self) -> bool {
        self.saver.is_done
    }

    fn set_graphics(&mut self, graphics: Option<Graphics>, redraw: Redraw) {
        (self.screen.graphics, self.screen.redraw) = (graphics, redraw);
    }

    fn report(&mut self, problem: &str) {
        self.screen.report(problem);
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
        self.catch_up();
        self.saver.on_signal(&self.scene, &self.screen);
    }
}

/// Says that a key does nothing, unless there is a notice.
fn say_unbound(key: KeyEvent, scene: &Scene, screen: &mut Screen) {
    if screen.log.notice().is_some() {
        return;
    }
    screen.say(&unbound(key, scene.is_editing(), &screen.keymap));
}

/// Returns the notice that a key does nothing.
pub fn unbound(key: KeyEvent, is_editing: bool, keymap: &Keymap) -> String {
    let [help, find] = [Action::Help, Action::Palette].map(|action| keymap.key_of(action));
    let place = if is_editing { "in the editor" } else { "here" };
    let key = keymap::name_of(key);
    format!("{key} does nothing {place} \u{b7} {help} help \u{b7} {find} all commands")
}
