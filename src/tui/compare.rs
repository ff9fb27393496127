//! Two methods side by side: each side is a run with its own trainer, viewer and [`App`], which
//! share nothing.
//!
//! The comparison forwards actions that apply to both, keeps map, goal, start and visible part of
//! the map equal, and starts the two walking agents at the same time.
//!
//! * `prepare`: the two trainers.
//! * `act`, `mouse`: user input; `refusal`: why some actions are not available.
//! * `edit`: editing the map of both.
//! * `past`: looking back at what both had learned.
//! * `race`: the walks of the two agents.
//! * `pace`, `curves`: success over environment steps, updates or seconds.
//! * `draw`, `facts`, `meaning`: the screen; `picture`: the screen in a file.

mod act;
mod curves;
mod draw;
mod edit;
mod facts;
mod meaning;
mod mouse;
mod pace;
mod past;
mod picture;
mod prepare;
mod race;
mod refusal;

use crossterm::event::Event;
use miette::{IntoDiagnostic, Report};
use ratatui::Frame;

use super::PreparedInterface;
use super::action::Mode;
use super::app::{App, Files, unbound, view};
use super::config::UiConfig;
use super::graphics::{Graphics, Picture, Redraw};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::keymap::Keymap;
use super::layout::ScreenLayout;
use super::log::{Log, Notice};
use super::scene::maze::place_walker;
use super::scene::{Cache, MazeState};
use crate::experiment::plot::Axis;
use gdg::engine::{Command, Engine, Snapshot};
use gdg::map::Cell;
use gdg::train::Limits;
use gdg::viewer::{OnArrival, View, Viewer};
use pace::Pace;
pub use prepare::{ComparisonOptions, Contender, Contestant, Contestants, prepare};
use race::Race;

/// The names of the sides.
pub const LETTERS: [char; 2] = ['A', 'B'];

/// The pause after an evaluation, as a multiple of its duration.
const EVALUATION_PAUSE_FACTOR: u32 = 2;

/// A run of a comparison.
struct Side {
    app: App,
    engine: Engine,
    /// Letter, method, preset, and settings of this side alone.
    title: String,
    /// What its colours and its preset mean, where that is not obvious.
    about: Option<meaning::Texts>,
    pace: Pace,
    /// What the next frame can reuse.
    cache: Cache,
}

/// Two runs on one screen.
pub struct Comparison {
    sides: [Side; 2],
    race: Race,
    axis: Axis,
    /// The side that is shown larger.
    larger: Option<usize>,
    /// The side with the mouse.
    mouse_on: usize,
    /// The side that holds the editor of the map.
    editor_at: usize,
    /// Whether the other side has yet to get the edited map.
    lags: bool,
    log: Log,
    /// Where things were last drawn, except for the maps.
    layout: ScreenLayout,
    /// Whether there was an internal error.
    failed: bool,
    done: bool,
    terminal_request: Option<TerminalRequest>,
}

/// Shows a comparison; returns the exit status, and what is said about files.
///
/// # Errors
/// Errors of the terminal or of training.
pub fn run(
    Contestants { both, warnings }: Contestants,
    interface: &mut PreparedInterface,
) -> Result<(u8, String), Report> {
    let PreparedInterface { config, keymap, notice, stage, .. } = interface;
    let mut comparison = Comparison::start(both, config, keymap, Limits::default())?;
    let notices: Vec<&str> =
        notice.iter().copied().chain(warnings.iter().map(String::as_str)).collect();
    if !notices.is_empty() {
        comparison.notify(&notices.join("; "));
    }
    stage.show(comparison, Comparison::close)
}

impl Side {
    fn start(
        Contestant { trainer, title, is_paused }: Contestant,
        config: &UiConfig,
        keymap: &Keymap,
        limits: Limits,
    ) -> Result<Self, Report> {
        let about = meaning::texts(trainer.run(), trainer.registry());
        let pace = Pace::of(trainer.history());
        // A method with slow evaluations must not be judged by its first steps.
        let evaluations = Command::PauseEvaluations(EVALUATION_PAUSE_FACTOR);
        // A saved run is shown as it was saved, without another update.
        let at_first = is_paused.then_some(Command::Pause).into_iter().chain([evaluations]);
        let engine = Engine::resume(trainer, limits, None, at_first).into_diagnostic()?;
        let viewer = Viewer::start(&engine).into_diagnostic()?;
        let mut app = App::new(engine.link(), viewer, config, keymap.clone(), Files::default());
        // The race decides where both go next.
        view::set_on_arrival(OnArrival::Wait, &mut app.screen, &app.link);
        // A comparison saves nothing, so a failed run needs no dialog: its title says what happened.
        app.saver.offers_nothing();
        app.hands_over = true;
        let cache = Cache::with_pictures();
        Ok(Self { app, engine, title, about, pace, cache })
    }

    /// Returns the maze that is shown.
    fn maze(&self) -> &MazeState {
        self.app.scene.maze().expect("comparisons are prepared on maps, and do not leave them")
    }

    /// Processes what trainer and viewer have published, even if the screen is frozen.
    fn follow(&mut self, own: usize, race: &mut Race, snapshot: &Snapshot, view: &View) {
        self.pace.add(snapshot);
        observe(race, own, view);
    }
}

impl Comparison {
    /// Starts both runs.
    ///
    /// # Errors
    /// A learner fails, or a thread cannot be started.
    pub fn start(
        contestants: [Contestant; 2],
        config: &UiConfig,
        keymap: &Keymap,
        limits: Limits,
    ) -> Result<Self, Report> {
        let [a, b] = contestants.map(|contestant| Side::start(contestant, config, keymap, limits));
        Ok(Self::new([a?, b?]))
    }

    /// Opens the screen; both agents walk to the map's own goal, or to a random one.
    fn new(sides: [Side; 2]) -> Self {
        let (first, seed) = (sides[0].maze(), sides[0].app.screen.run().seed);
        let (goal, race) = (first.goal, Race::new(first.map.clone(), seed));
        let mut comparison = Self {
            race,
            // What a method is allowed to experience.
            axis: Axis::Steps,
            larger: None,
            mouse_on: 0,
            editor_at: 0,
            lags: false,
            log: Log::default(),
            layout: ScreenLayout::default(),
            failed: false,
            done: false,
            terminal_request: None,
            sides,
        };
        let start = comparison.race.random_start(goal);
        comparison.start_race(start, goal);
        comparison
    }

    /// Puts both agents at `start` and lets them walk to `goal`.
    fn start_race(&mut self, start: Cell, goal: Cell) {
        for side in &mut self.sides {
            // The goal comes last: a view with its number has both.
            side.app.in_maze(|maze, screen, link| {
                place_walker(Some(start), screen, link);
                maze.set_goal(goal, screen, link);
            });
        }
        let requests = self.sides.each_ref().map(|side| side.app.link.goal_request());
        self.race.begin(start, goal, requests);
    }

    /// Gives the same distance the same colour on both sides.
    fn share_colours(&mut self) {
        let farthest =
            self.sides.iter().map(|side| side.app.scene.own_farthest()).fold(1.0, f32::max);
        self.sides.iter_mut().for_each(|side| side.app.screen.least_farthest = farthest);
    }

    /// Shows a notice.
    fn notify(&mut self, text: &str) {
        self.log.show(text, false);
    }

    /// Returns the text of the current notice, and the notice: of the comparison, or of its runs.
    fn notice(&self) -> Option<(String, Notice<'_>)> {
        let own = self.log.notice().map(|notice| (notice.text.to_owned(), notice));
        let of = |i: usize| self.sides[i].app.screen.log.notice();
        own.or_else(|| match (of(0), of(1)) {
            (Some(a), Some(b)) if a.text == b.text => Some((a.text.to_owned(), a)),
            (Some(a), Some(b)) => {
                Some((format!("{}: {}; {}: {}", LETTERS[0], a.text, LETTERS[1], b.text), a))
            }
            (Some(notice), _) => Some((format!("{}: {}", LETTERS[0], notice.text), notice)),
            (None, Some(notice)) => Some((format!("{}: {}", LETTERS[1], notice.text), notice)),
            (None, None) => None,
        })
    }

    fn on_failures(&mut self) {
        for failure in gdg::faults::take_failures() {
            self.log.add(
                &format!("internal error in thread {}: {}", failure.thread, failure.message),
                0.0,
                0,
                true,
            );
            self.failed = true;
        }
    }
}

impl Comparison {
    /// Ends training.
    pub fn close(self) -> ClosedRun {
        let mut closed = ClosedRun { failed: self.failed, ..ClosedRun::default() };
        for (side, letter) in self.sides.into_iter().zip(LETTERS) {
            let own = side.app.close(side.engine, false);
            let gap = if closed.summary.is_empty() { "" } else { "\n" };
            closed.summary += &format!("{gap}{letter}: {}", own.summary);
            closed.saved = closed.saved.and(own.saved);
            closed.failed |= own.failed;
        }
        closed
    }
}

/// Updates the race from a view; both sides show mazes.
fn observe(race: &mut Race, side: usize, view: &View) {
    if let View::Maze(view) = view {
        race.observe(side, view);
    }
}

impl Interface for Comparison {
    async fn update(&mut self) {
        let [a, b] = &mut self.sides;
        let own = tokio::select! {
            () = a.app.update() => 0,
            () = b.app.update() => 1,
        };
        let app = &self.sides[own].app;
        let (snapshot, view) = (app.snapshots().borrow().clone(), app.views().borrow().clone());
        self.sides[own].follow(own, &mut self.race, &snapshot, &view);
        self.share_colours();
    }

    fn on_event(&mut self, event: &Event) {
        if !self.sides[0].app.screen.dialogs.is_empty() {
            return self.on_event_in_dialog(event);
        }
        match event {
            Event::Key(key) if !key.is_release() => {
                self.log.dismiss();
                self.sides.iter_mut().for_each(|side| side.app.screen.log.dismiss());
                let keymap = &self.sides[0].app.screen.keymap;
                let single = if self.is_editing() { Mode::Editing } else { Mode::Watching };
                match (keymap.action(*key, self.mode()), keymap.action(*key, single)) {
                    (Some(action), _) => self.act(action),
                    (None, Some(action)) => self.refuse(action),
                    (None, None) => self.notify(&unbound(*key, self.is_editing(), keymap)),
                }
            }
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            _ => {}
        }
    }

    fn on_tick(&mut self) -> bool {
        self.on_failures();
        if self.lags {
            self.share_edit();
        }
        if let Some((start, goal)) = self.race.next_round() {
            self.start_race(start, goal);
        }
        let mut changed = self.log.on_tick();
        for side in &mut self.sides {
            changed |= side.app.screen.log.on_tick();
            changed |= side.app.update_busy();
        }
        changed
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.terminal_request.take()
    }

    fn is_training(&self) -> bool {
        self.sides.iter().any(|side| side.app.is_training())
    }

    fn is_done(&self) -> bool {
        self.done || self.sides[0].app.is_done()
    }

    fn set_graphics(&mut self, graphics: Option<Graphics>, redraw: Redraw) {
        self.sides.iter_mut().for_each(|side| side.app.set_graphics(graphics, redraw));
    }

    fn report(&mut self, problem: &str) {
        self.log.add(problem, 0.0, 0, true);
    }

    fn pictures(&self) -> Vec<&Picture> {
        self.sides.iter().filter_map(|side| side.cache.picture()).collect()
    }

    fn draw(&mut self, frame: &mut Frame) {
        self.sides.iter_mut().for_each(|side| side.cache.begin());
        self.layout = draw::draw(frame, self);
    }

    fn on_signal(&mut self) {
        // Nothing is saved.
    }
}

#[cfg(test)]
impl Comparison {
    /// Returns both sides.
    pub fn apps(&mut self) -> [&mut App; 2] {
        self.sides.each_mut().map(|side| &mut side.app)
    }

    /// Shows a snapshot on a side.
    pub fn on_snapshot(&mut self, side: usize, snapshot: &std::sync::Arc<Snapshot>) {
        let Self { sides, race, .. } = self;
        sides[side].app.on_snapshot(snapshot.clone());
        sides[side].follow(side, race, snapshot, &View::default());
    }

    /// Shows a view on a side.
    pub fn on_view(&mut self, side: usize, view: &View) {
        self.sides[side].app.on_view(view.clone());
        observe(&mut self.race, side, view);
    }

    /// Shows the latest snapshots and views.
    pub fn refresh(&mut self) {
        for side in 0..2 {
            let app = &self.sides[side].app;
            let (snapshot, view) = (app.snapshots().borrow().clone(), app.views().borrow().clone());
            self.on_snapshot(side, &snapshot);
            self.on_view(side, &view);
        }
        self.share_colours();
    }

    /// Stops both runs and returns their trainers.
    pub fn stop(self) -> [Option<gdg::train::Trainer>; 2] {
        self.sides.map(|Side { app, engine, .. }| {
            drop(app);
            engine.stop()
        })
    }
}
