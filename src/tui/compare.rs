//! Two runs side by side: each is a session with its own trainer and viewer, which share nothing.
//!
//! The comparison performs actions on both, keeps map, goal, start and visible part of the map
//! equal, and starts the two walking agents at the same time.
//!
//! * `act`: what actions and the mouse do.
//! * `race`: the walks of the two agents.
//! * `draw`: the screen.
//! * `prepare`: the two trainers.

mod act;
mod draw;
mod prepare;
mod race;

use std::fmt::Write as _;

use miette::{IntoDiagnostic, Report};
use ratatui::Frame;

use super::action::Mode;
use super::config::UiConfig;
use super::interface::ClosedRun;
use super::keymap::Keymap;
use super::layout::ScreenLayout;
use super::log::{Log, Notice};
use super::scene::MazeState;
use super::scene::maze::place_walker;
use super::session::{Session, view};
use crate::experiment::plot::Axis;
use gdg::engine::{Command, Engine};
use gdg::map::Cell;
use gdg::train::Limits;
use gdg::viewer::{OnArrival, View, Viewer};
pub use prepare::{ComparisonOptions, Contender, Contestant, Contestants, prepare};
use race::Race;

/// The names of the sides.
pub const LETTERS: [char; 2] = ['A', 'B'];

/// The pause after an evaluation, as a multiple of its duration.
const EVALUATION_PAUSE_FACTOR: u32 = 2;

/// What is known of a side besides its session.
struct Side {
    /// Letter, method, preset, and settings of this side alone.
    title: String,
    /// What its colours and its preset mean, where that is not obvious.
    about: Option<String>,
}

pub struct Comparison {
    pub sessions: [Session; 2],
    sides: [Side; 2],
    race: Race,
    pub axis: Axis,
    larger: Option<usize>,
    /// The side with the mouse.
    mouse_on: usize,
    /// The side that holds the editor of the map.
    editor_at: usize,
    /// Whether the other side has yet to get the edited map.
    lags: bool,
    pub log: Log,
    /// Where things were last drawn, except for the maps.
    pub layout: ScreenLayout,
    failed: bool,
}

fn start_side(
    Contestant { trainer, title, is_paused }: Contestant,
    config: &UiConfig,
    keymap: &Keymap,
    limits: Limits,
) -> Result<(Session, Side, Engine), Report> {
    let side = Side { title, about: prepare::about(trainer.run(), trainer.registry()) };
    // A method with slow evaluations must not be judged by its first steps.
    let evaluations = Command::PauseEvaluations(EVALUATION_PAUSE_FACTOR);
    // A saved run is shown as it was saved, without another update.
    let at_first = is_paused.then_some(Command::Pause).into_iter().chain([evaluations]);
    let engine = Engine::resume(trainer, limits, None, at_first).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let mut session = Session::new(engine.link(), viewer, config, keymap.clone(), None);
    // The race decides where both go next.
    view::set_on_arrival(&mut session, OnArrival::Wait);
    // A failed run needs no dialog: its title says what happened.
    session.saver.offers = false;
    Ok((session, side, engine))
}

fn maze_of(session: &Session) -> &MazeState {
    session.scene.maze().expect("comparisons are prepared on maps, and do not leave them")
}

impl Comparison {
    pub fn start(
        contestants: [Contestant; 2],
        config: &UiConfig,
        keymap: &Keymap,
        limits: Limits,
    ) -> Result<(Self, [Engine; 2]), Report> {
        let [a, b] = contestants.map(|contestant| start_side(contestant, config, keymap, limits));
        let ((first, a, engine), (second, b, other)) = (a?, b?);
        let (maze, seed) = (maze_of(&first), first.screen.run().seed);
        let (goal, race) = (maze.goal, Race::new(maze.map.clone(), seed));
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
            sessions: [first, second],
            sides: [a, b],
        };
        let start = comparison.race.random_start(goal);
        comparison.start_race(start, goal);
        Ok((comparison, [engine, other]))
    }

    fn maze(&self, side: usize) -> &MazeState {
        maze_of(&self.sessions[side])
    }

    fn start_race(&mut self, start: Cell, goal: Cell) {
        for session in &mut self.sessions {
            // The goal comes last: a view with its number has both.
            session.in_maze(|maze, screen, link| {
                place_walker(Some(start), screen, link);
                maze.set_goal(goal, screen, link);
            });
        }
        let requests = self.sessions.each_ref().map(|session| session.link.goal_request);
        self.race.begin(start, goal, requests);
    }

    pub fn notify(&mut self, text: &str) {
        self.log.show(text, false);
    }

    /// Returns the current notice: of the comparison, or else of one of its runs.
    fn notice(&self) -> Option<Notice<'_>> {
        let [a, b] = self.sessions.each_ref().map(|session| &session.screen.log);
        [&self.log, a, b].into_iter().find_map(Log::notice)
    }

    pub fn mode(&self) -> Mode {
        if self.is_editing() { Mode::EditingBoth } else { Mode::Comparing }
    }

    pub fn is_editing(&self) -> bool {
        self.maze(self.editor_at).editor.is_open()
    }

    /// Returns where an update is along the axis, as if all updates had been equally fast.
    fn along(&self, side: usize, updates: u64) -> f64 {
        let snapshot = &self.sessions[side].screen.snapshot;
        let all = match self.axis {
            Axis::Updates => snapshot.counters.updates as f64,
            Axis::Steps => snapshot.counters.env_steps as f64,
            Axis::Seconds => snapshot.seconds,
        };
        updates as f64 / snapshot.counters.updates.max(1) as f64 * all
    }

    pub async fn update(&mut self) {
        let [a, b] = &mut self.sessions;
        let own = tokio::select! {
            () = a.update() => 0,
            () = b.update() => 1,
        };
        let session = &self.sessions[own];
        let view = session.views().borrow().clone();
        self.follow(own, &view);
    }

    /// Processes what the viewer of a side has published, even if the screen is frozen; the same
    /// distance has the same colour on both sides.
    pub fn follow(&mut self, own: usize, view: &View) {
        if let View::Maze(view) = view {
            self.race.observe(own, view);
        }
        let farthest = self.sessions.iter().map(|session| session.scene.own_farthest());
        let farthest = farthest.fold(1.0, f32::max);
        self.sessions.iter_mut().for_each(|session| session.screen.least_farthest = farthest);
    }

    pub fn on_tick(&mut self) -> bool {
        for failure in gdg::faults::take_failures() {
            let text = format!("internal error in thread {}: {}", failure.thread, failure.message);
            self.log.add(&text, 0.0, 0, true);
            self.failed = true;
        }
        if self.lags {
            self.share_edit();
        }
        if let Some((start, goal)) = self.race.next_round() {
            self.start_race(start, goal);
        }
        let mut changed = self.log.on_tick();
        for session in &mut self.sessions {
            changed |= session.screen.log.on_tick();
            changed |= session.update_busy();
        }
        changed
    }

    pub fn draw(&mut self, frame: &mut Frame) {
        self.sessions.iter_mut().for_each(|session| session.cache.begin());
        self.layout = draw::draw(frame, self);
    }

    pub fn close(self, engines: impl Iterator<Item = Engine>) -> ClosedRun {
        let mut closed = ClosedRun { failed: self.failed, ..ClosedRun::default() };
        for ((session, engine), letter) in self.sessions.into_iter().zip(engines).zip(LETTERS) {
            let own = session.close(engine, false);
            let gap = if closed.summary.is_empty() { "" } else { "\n" };
            let _ = write!(closed.summary, "{gap}{letter}: {}", own.summary);
            closed.saved = closed.saved.and(own.saved);
            closed.failed |= own.failed;
        }
        closed
    }
}
