//! Two runs side by side: each is a session with its own trainer and viewer, which share nothing.
//!
//! The comparison performs actions on both, keeps map, goal, start and visible part of the map
//! equal, and starts the two walking agents at the same time.
//!
//! * `race`: the walks of the two agents.
//! * `split_view`: the screen.
//! * `contenders`: the two trainers.

mod contenders;
mod race;
mod split_view;

use std::fmt::Write as _;
use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use miette::{IntoDiagnostic, Report};
use ratatui::Frame;
use ratatui::layout::Position;

use super::action::{Action, Binding, Both, Mode, binding_of};
use super::config::UiConfig;
use super::dialog::Choice;
use super::interface::ClosedRun;
use super::keymap::Keymap;
use super::layout::ScreenLayout;
use super::lists;
use super::log::{Log, Notice};
use super::scene::maze::place_walker;
use super::scene::{MazeState, legend};
use super::session::saving::unsaved;
use super::session::{Session, disk, watching};
use crate::experiment::plot::XAxis;
use crate::setup::outputs::is_same_file;
pub use contenders::{ComparisonOptions, Contender, Contestant, Contestants, prepare};
use gdg::engine::{Engine, EngineCommand};
use gdg::map::Cell;
use gdg::train::{Limits, SaveTo};
use gdg::viewer::{Field, OnArrival, View, Viewer};
use race::Race;

pub const LETTERS: [char; 2] = ['A', 'B'];

/// The pause after an evaluation, as a multiple of its duration.
const EVALUATION_PAUSE_FACTOR: u32 = 2;

pub struct Comparison {
    pub sessions: [Session; 2],
    /// Letter and method of each side, and what the other may not have.
    titles: [String; 2],
    race: Race,
    pub axis: XAxis,
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
    Contestant { trainer, title, file }: Contestant,
    config: &UiConfig,
    keymap: &Keymap,
    limits: Limits,
) -> Result<(Session, String, Engine), Report> {
    // A method with slow evaluations must not be judged by its first steps.
    let evaluations = EngineCommand::PauseEvaluations(EVALUATION_PAUSE_FACTOR);
    // A saved run is shown as it was saved, without another update.
    let at_first = file.is_some().then_some(EngineCommand::Pause).into_iter().chain([evaluations]);
    let engine = Engine::resume(trainer, limits, file, at_first).into_diagnostic()?;
    let viewer = Viewer::start(&engine).into_diagnostic()?;
    let mut session = Session::new(engine.link(), viewer, config, keymap.clone(), None);
    // The race decides where both go next.
    watching::set_on_arrival(&mut session, OnArrival::Wait);
    // A failed run needs no dialog: its title says what happened.
    session.saver.offers = false;
    Ok((session, title, engine))
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
        let ((first, a, engine), (mut second, b, other)) = (a?, b?);
        let file = second.saver.to.path().to_owned();
        if is_same_file(&file, first.saver.to.path()) {
            second.saver.to = SaveTo::CreateNew(file);
        }
        let (maze, seed) = (maze_of(&first), first.screen.run().seed);
        let (goal, race) = (maze.goal, Race::new(maze.map.clone(), seed));
        let mut comparison = Self {
            race,
            // What a method is allowed to experience.
            axis: XAxis::default(),
            mouse_on: 0,
            editor_at: 0,
            lags: false,
            log: Log::default(),
            layout: ScreenLayout::default(),
            failed: false,
            sessions: [first, second],
            titles: [a, b],
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
            session.in_maze(|maze, screen| {
                place_walker(Some(start), screen);
                maze.set_goal(goal, screen);
            });
        }
        let requests = self.sessions.each_ref().map(|session| session.screen.goal_request);
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
            XAxis::Updates => snapshot.counters.updates as f64,
            XAxis::Steps => snapshot.counters.env_steps as f64,
            XAxis::Seconds => snapshot.seconds,
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

    /// Follows the viewer of a side; the same distance has the same colour on both.
    pub fn follow(&mut self, own: usize, view: &View) {
        let session = &self.sessions[own];
        let ghost = view.reach.ghost.as_ref().filter(|_| !session.screen.run().method.plans());
        self.race.observe(own, view, ghost.is_some_and(legend::stands));
        let farthest = self.sessions.iter().map(|session| session.scene.own_farthest());
        let farthest = farthest.fold(1.0, f32::max);
        self.sessions.iter_mut().for_each(|session| session.screen.least_farthest = farthest);
    }

    pub fn on_tick(&mut self) -> bool {
        for failure in gdg::faults::take_failures() {
            let text = failure.to_string();
            self.log.add(&text, 0.0, 0, true);
            self.failed = true;
        }
        if self.lags {
            self.share_edit();
        }
        let has_plan = self.sessions.iter().any(|own| maze_of(own).view.reach.path.len() > 1);
        if has_plan && !self.race.is_planned {
            (self.race.is_planned, self.race.results) = (true, Default::default());
            self.start_race(self.race.start, self.race.goal);
        } else if let Some((start, goal)) = self.race.next_round() {
            self.start_race(start, goal);
        }
        let mut changed = self.log.on_tick();
        for session in &mut self.sessions {
            changed |= session.screen.log.on_tick();
            changed |= session.update_busy() | disk::on_tick(&mut session.cx);
        }
        let [a, b] = self.sessions.each_ref().map(|session| &session.screen.log);
        if let (Some(first), Some(second)) = (a.notice(), b.notice()) {
            // What both have done is one message.
            let is_error = first.is_error || second.is_error;
            let [left, right] = LETTERS;
            let both = format!("{left}: {}; {right}: {}", first.text, second.text);
            let text = if first.text == second.text { first.text } else { &both };
            // One side may say more later than the other.
            if self.log.notice().is_none_or(|shown| shown.text != text) {
                self.log.show(text, is_error);
                changed = true;
            }
        }
        changed
    }

    pub fn draw(&mut self, frame: &mut Frame) {
        self.sessions.iter_mut().for_each(|session| session.cache.begin());
        self.layout = split_view::draw(frame, self);
    }

    pub fn close(self, engines: impl Iterator<Item = Engine>) -> ClosedRun {
        let mut closed = ClosedRun { failed: self.failed, ..ClosedRun::default() };
        for ((session, engine), letter) in self.sessions.into_iter().zip(engines).zip(LETTERS) {
            let own = session.close(engine);
            let gap = if closed.summary.is_empty() { "" } else { "\n" };
            let _ = write!(closed.summary, "{gap}{letter}: {}", own.summary);
            closed.saved = closed.saved.and(own.saved);
            closed.failed |= own.failed;
        }
        closed
    }
}

/// What actions and the mouse do: the same on both sides.
impl Comparison {
    pub fn perform(&mut self, binding: &Binding) {
        match binding.both {
            Both::Each => self.both(binding.action),
            Both::First => binding.perform(&mut self.sessions[0]),
            Both::Own(act) => act(self, binding.action),
            Both::Refused => {
                let what = self.sessions[0].scene.wording(binding);
                let what = what.split(" (").next().unwrap_or(what);
                self.notify(&format!("not in a comparison: {what}"));
            }
        }
    }

    pub fn choose(&mut self, choice: Option<&Choice>) {
        // What a dialog says is not about the first side alone.
        if let Some(notice) = self.sessions[0].screen.log.take() {
            self.notify(&notice);
        }
        match choice {
            Some(Choice::Act(action)) => {
                binding_of(*action).into_iter().for_each(|binding| self.perform(binding));
            }
            Some(Choice::Field(field)) => {
                self.sessions.iter_mut().for_each(|session| watching::leave_past(session));
                self.show_field(*field);
            }
            Some(Choice::Export(kind)) => {
                self.sessions.iter_mut().for_each(|session| disk::export(*kind, &mut session.cx));
            }
            Some(Choice::Quit { save }) => {
                for Session { saver, cx, .. } in self.sessions.iter_mut().filter(|_| *save) {
                    saver.save_on_closing(cx);
                }
                self.sessions[0].saver.is_done = true;
            }
            // Other dialogs are the first side's.
            Some(choice) => self.sessions[0].choose(choice.clone()),
            None => {}
        }
    }

    fn both(&mut self, action: Action) {
        self.sessions.iter_mut().for_each(|session| session.act(action));
        // Zooming and panning depend on the size of the map on the screen.
        self.mirror(0);
    }

    /// Pauses both, or resumes both if neither trains.
    pub fn toggle_pause(&mut self, _: Action) {
        let trains = self.sessions.each_ref().map(|s| s.snapshots().borrow().phase.is_training());
        let any = trains.contains(&true);
        for (session, _) in self.sessions.iter_mut().zip(trains).filter(|(_, own)| *own == any) {
            watching::toggle_pause(session);
        }
    }

    /// Shows both as they were at an update of which both have a frame.
    pub fn step_through_film(&mut self, action: Action) {
        let [a, b] = self.sessions.each_ref().map(|own| own.screen.snapshot.film.clone());
        for (session, other) in self.sessions.iter_mut().zip([b, a]) {
            watching::step_through_film(session, action == Action::Forth, Some(&other));
        }
    }

    pub fn new_goal(&mut self, action: Action) {
        self.sessions[0].act(action);
        self.goal_from(0);
    }

    pub fn move_goal(&mut self, action: Action) {
        if self.is_editing() {
            return self.edit(action);
        }
        self.both(action);
        self.goal_from(0);
    }

    pub fn start_here(&mut self, _: Action) {
        let maze = self.maze(0);
        self.start_race(maze.inspecting.unwrap_or(maze.goal), maze.goal);
    }

    pub fn new_start(&mut self, _: Action) {
        let goal = self.maze(0).goal;
        let start = self.race.random_start(goal);
        self.start_race(start, goal);
    }

    pub fn next_on_arrival(&mut self, _: Action) {
        self.race.on_arrival = self.race.on_arrival.next();
        self.notify(&format!("at the goal both @ will {}", self.race.on_arrival.name()));
    }

    pub fn open_help(&mut self, _: Action) {
        let methods = self.sessions.each_ref().map(|session| &session.screen.run().method);
        let own = || contenders::introduction(methods);
        let introduction = if self.is_editing() { lists::EDITOR.to_owned() } else { own() };
        let Session { cx, .. } = &self.sessions[0];
        let fields = Field::ALL.into_iter().filter(|field| self.both_have(*field));
        let modes = [self.mode(), Mode::EditingBoth];
        // There is no room for a pane with the legend.
        let signs = legend::lines(&*cx.scene, &cx.screen);
        let more = fields.map(lists::field_item).chain(signs.iter().map(lists::sign_item));
        let help = lists::help_in(&modes, &cx.screen, &cx.scene, &introduction, more);
        self.sessions[0].open(help);
    }

    pub fn close_top(&mut self, action: Action) {
        if self.is_editing() { self.edit(action) } else { self.both(action) }
    }

    pub fn quit(&mut self, _: Action) {
        let own =
            |(session, letter): (&Session, char)| Some(format!("{letter}: {}", unsaved(session)?));
        let lost: Vec<String> = self.sessions.iter().zip(LETTERS).filter_map(own).collect();
        if lost.is_empty() {
            self.sessions[0].saver.is_done = true;
        } else {
            self.sessions[0].open(lists::quit_choices(lost.join("; "), "a file of each run"));
        }
    }

    /// Sets the goal of both to that of one side, and starts a race to it if it has changed.
    fn goal_from(&mut self, side: usize) {
        let goal = self.maze(side).goal;
        if goal != self.race.goal {
            self.start_race(self.race.start, goal);
        }
    }

    /// Colours both maps by the next field that both have.
    pub fn next_field(&mut self, action: Action) {
        let shown = self.sessions[0].screen.field;
        self.show_field(shown.cycle(action == Action::Field(true), |field| self.both_have(field)));
    }

    fn both_have(&self, field: Field) -> bool {
        self.sessions.iter().all(|session| session.scene.has_field(field, &session.screen))
    }

    fn show_field(&mut self, field: Field) {
        self.sessions.iter_mut().for_each(|session| watching::show_field(session, field));
    }
}

/// Editing the map of both: one side holds the editor, and the other follows it.
impl Comparison {
    /// Moves the editor to a side, with the edits that it can undo.
    fn hold_editor(&mut self, own: usize) {
        if self.editor_at == own {
            return;
        }
        let [a, b] = self.sessions.each_mut().map(|session| session.cx.scene.maze_mut());
        if let (Some(a), Some(b)) = (a, b) {
            std::mem::swap(&mut a.editor, &mut b.editor);
            self.editor_at = own;
        }
    }

    pub fn edit(&mut self, action: Action) {
        self.sessions[self.editor_at].act(action);
        self.share_edit();
    }

    /// Has the other side show the editor, and train on the map of the side that holds it. If its
    /// trainer is too busy, it follows later.
    fn share_edit(&mut self) {
        let own = self.editor_at;
        let maze = self.maze(own);
        let (map, editor) = (maze.map.clone(), maze.editor.shown());
        let is_edited = self.race.map != map;
        self.lags |= is_edited;
        let lags = self.lags;
        let other = &mut self.sessions[1 - own];
        watching::leave_past(other);
        self.lags = other.in_maze(|maze, screen| {
            maze.editor = editor;
            if lags {
                maze.change_map(Some(map.clone()), screen);
            }
            lags && !Arc::ptr_eq(&maze.map, &map)
        });
        if is_edited {
            self.race.change_map(map);
        }
        self.goal_from(own);
        self.mirror(own);
    }
}

impl Comparison {
    pub fn on_mouse(&mut self, kind: MouseEventKind, at: Position) {
        // A drag belongs to the side on which it began.
        if !matches!(kind, MouseEventKind::Drag(_) | MouseEventKind::Up(_)) {
            let on = |session: &Session| session.screen.layout.map_pane.contains(at);
            let Some(own) = self.sessions.iter().position(on) else { return };
            self.mouse_on = own;
        }
        let (own, editing) = (self.mouse_on, self.is_editing());
        if kind == MouseEventKind::Down(MouseButton::Right) && !editing {
            let map = &self.maze(own).map;
            let cell = self.sessions[own].screen.layout.map.as_ref();
            let cell = cell.and_then(|frame| frame.cell_at(at, map));
            if let Some(start) = cell.and_then(|cell| map.nearest_free(cell)) {
                self.start_race(start, self.race.goal);
            }
            return;
        }
        if editing {
            self.hold_editor(own);
        }
        self.sessions[own].on_mouse(kind, at);
        if editing {
            return self.share_edit();
        }
        self.goal_from(own);
        self.mirror(own);
    }

    /// Shows the same part of the map, and describes the same cell, on the other side.
    fn mirror(&mut self, own: usize) {
        let maze = self.maze(own);
        let (viewport, hovered) = (maze.viewport, maze.hovered);
        self.sessions[1 - own].in_maze(|maze, screen| {
            maze.viewport = viewport;
            maze.hover(hovered, screen);
        });
    }
}
