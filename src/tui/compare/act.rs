//! What actions and the mouse do in a comparison: the same on both sides.

use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use super::{Comparison, LETTERS, draw, prepare};
use crate::tui::action::{Action, Both, Mode, binding_of};
use crate::tui::dialog::{Choice, Dialog, Help};
use crate::tui::export::{ExportError, in_full_colour, on_paper, picture, write_as};
use crate::tui::lists;
use crate::tui::output::ExportKind;
use crate::tui::scene::Cache;
use crate::tui::scene::maze::NOUN;
use crate::tui::session::{Session, time, view};
use crate::tui::theme::Theme;
use gdg::train::FilmFrame;
use gdg::viewer::Field;

/// The frames of a side's film, with their places along the axis.
type Frames = Vec<(f64, Arc<FilmFrame>)>;

impl Comparison {
    /// Performs an action, or says why comparisons do not have it.
    pub fn act(&mut self, action: Action) {
        let Some(binding) = binding_of(action) else { return };
        match binding.both {
            Both::Each => self.both(action),
            Both::First => self.sessions[0].act(action),
            Both::Own(act) => act(self, action),
            Both::Refused(why) => {
                let what = self.sessions[0].scene.wording(binding);
                let what = what.split(" (").next().unwrap_or(what);
                self.notify(&format!("not in a comparison: {what}; {why}"));
            }
        }
    }

    pub fn choose(&mut self, choice: Option<&Choice>) {
        // What a dialog says is not about the first side alone.
        if let Some(notice) = self.sessions[0].screen.log.take() {
            self.notify(&notice);
        }
        match choice {
            Some(Choice::Act(action)) => self.act(*action),
            Some(Choice::Field(field)) => {
                self.return_to_present();
                self.show_field(*field);
            }
            Some(Choice::Export(kind)) => self.export(*kind),
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
            time::toggle_pause(session);
        }
    }

    pub fn new_goal(&mut self, action: Action) {
        self.sessions[0].act(action);
        self.goal_from(0);
    }

    /// Moves the goal, or the cursor, or puts the goal at the cursor.
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

    pub fn make_larger(&mut self, action: Action) {
        if let Action::Larger(side) = action {
            self.larger = Some(side).filter(|side| self.larger != Some(*side));
        }
    }

    pub fn next_larger(&mut self, _: Action) {
        self.larger = match self.larger {
            None => Some(0),
            Some(side) => Some(side + 1).filter(|next| *next < LETTERS.len()),
        };
    }

    pub fn open_help(&mut self, _: Action) {
        let about = self.sides.each_ref().map(|side| (&*side.title, side.about.as_ref()));
        let help = Help::of_comparison(prepare::introduction(about));
        self.sessions[0].open(Dialog::Help(help));
    }

    /// Opens the list of actions: of those that comparisons have, and of the others, to say why.
    pub fn open_palette(&mut self, _: Action) {
        let Session { cx, .. } = &self.sessions[0];
        let fields = Field::ALL.into_iter().filter(|field| self.both_have(*field));
        let modes = &Mode::OF_COMPARISONS;
        let list = lists::actions_of_comparisons(&cx.screen, &cx.scene, modes, fields);
        self.sessions[0].open(list);
    }

    pub fn close_top(&mut self, action: Action) {
        if self.is_editing() {
            self.edit(action);
        } else if self.is_past() {
            self.return_to_present();
        } else {
            self.both(action);
        }
    }

    /// Quits; asks first if the map has been drawn and is in no file.
    pub fn quit(&mut self, _: Action) {
        if self.sessions.iter().all(|session| session.scene.has_unsaved_map()) {
            self.sessions[0].open(lists::quit_comparison());
        } else {
            self.sessions[0].saver.is_done = true;
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
        self.sessions.iter_mut().for_each(|session| view::show_field(session, field));
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
    pub(super) fn share_edit(&mut self) {
        let own = self.editor_at;
        let maze = self.maze(own);
        let (map, editor) = (maze.map.clone(), maze.editor.shown());
        let is_edited = *self.race.map() != map;
        self.lags |= is_edited;
        let lags = self.lags;
        let other = &mut self.sessions[1 - own];
        time::leave_past(other);
        self.lags = other.in_maze(|maze, screen, link| {
            maze.editor = editor;
            if lags {
                maze.change_map(Some(map.clone()), screen, link);
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

/// The mouse.
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
            return match cell.and_then(|cell| map.nearest_free(cell)) {
                Some(start) => self.start_race(start, self.race.goal),
                None => self.notify("a click outside of the map changes nothing"),
            };
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
        self.sessions[1 - own].in_maze(|maze, _, link| {
            maze.viewport = viewport;
            maze.hover(hovered, link);
        });
    }
}

/// Looking back at what both had learned, at the same place along the axis of the curves.
impl Comparison {
    pub(super) fn shown_updates(&self, side: usize) -> u64 {
        let screen = &self.sessions[side].screen;
        let past = screen.past.as_ref();
        past.map_or(screen.snapshot.updates(), |frame| screen.snapshot.learned(frame.updates))
    }

    pub(super) fn is_past(&self) -> bool {
        self.sessions.iter().any(|session| session.screen.past.is_some())
    }

    pub(super) fn along(&self, side: usize, updates: u64) -> f64 {
        self.sides[side].pace.at(updates as f64).along(self.axis)
    }

    pub(super) fn past_at(&self, side: usize) -> Option<f64> {
        let frame = self.sessions[side].screen.past.as_ref()?;
        Some(self.along(side, frame.updates))
    }

    fn frames(&self, side: usize) -> Frames {
        let film = self.sessions[side].screen.snapshot.film.iter();
        film.map(|frame| (self.along(side, frame.updates), frame.clone())).collect()
    }

    /// Goes back to the frame before the moment shown, or forth to the one after it, of the film
    /// that reaches farther along the axis; after its last one, to the present.
    pub fn step_through_films(&mut self, action: Action) {
        let forth = action == Action::Forth;
        let last = |side: usize| self.frames(side).last().map(|(at, _)| *at);
        let longer = usize::from(last(1) > last(0));
        let (frames, shown) = (self.frames(longer), self.past_at(longer));
        if frames.is_empty() {
            return self.notify("no film yet: it begins with the next picture");
        }
        let next = match shown {
            None if forth => return self.notify("this is the present"),
            Some(shown) if forth => frames.iter().find(|(at, _)| *at > shown),
            shown => {
                let before = |at: f64| shown.is_none_or(|shown| at < shown);
                let found = frames.iter().rfind(|(at, _)| before(*at));
                if found.is_none() {
                    return self.notify("this is the first picture of the films");
                }
                found
            }
        };
        match next {
            Some((at, _)) => self.look_at(*at),
            None => self.return_to_present(),
        }
    }

    /// Shows on each side the frame nearest to a place along the axis.
    pub fn look_at(&mut self, at: f64) {
        let off = |frame: &(f64, Arc<FilmFrame>)| (frame.0 - at).abs();
        for side in 0..LETTERS.len() {
            let frames = self.frames(side).into_iter();
            let nearest = frames.min_by(|a, b| off(a).total_cmp(&off(b)));
            time::look_at(&mut self.sessions[side], nearest.map(|(_, frame)| frame));
        }
    }

    fn return_to_present(&mut self) {
        self.sessions.iter_mut().for_each(|session| time::look_at(session, None));
    }
}

/// Pictures in files.
impl Comparison {
    pub fn pick_export(&mut self, _: Action) {
        let list = lists::exports(&ExportKind::PICTURES, &format!("both {NOUN}s"));
        self.sessions[0].open(list);
    }

    /// Writes a picture of both maps to a new file, and says where.
    fn export(&mut self, kind: ExportKind) {
        let [a, b] = self.sessions.each_ref().map(|session| session.screen.run().method.name());
        let name = format!("{}-{a}-{b}-{}", self.maze(0).map.name(), self.shown_updates(0));
        match write_as(&name, kind, "maps", self.contents(kind)) {
            Ok(notice) => self.log.show(&notice, false),
            Err(problem) => self.log.show(&problem, true),
        }
    }

    /// Returns a picture of both maps in characters, in full colour even on a terminal that has fewer
    /// colours.
    pub fn contents(&mut self, kind: ExportKind) -> Result<Vec<u8>, ExportError> {
        self.sessions.iter_mut().for_each(|session| session.screen.on_paper = true);
        let drawn = in_full_colour(self, Self::themes, |own| {
            let mut caches = [Cache::default(), Cache::default()];
            on_paper(own.layout.screen, |frame| {
                draw::draw_parts(frame, own, caches.each_mut()).maps
            })
        });
        self.sessions.iter_mut().for_each(|session| session.screen.on_paper = false);
        let (drawn, maps) = drawn?;
        picture(kind, &drawn, maps, &self.sessions[0].screen.theme.in_full_colour())
    }

    fn themes(&mut self) -> [&mut Theme; 2] {
        self.sessions.each_mut().map(|session| &mut session.cx.screen.theme)
    }
}
