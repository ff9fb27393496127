//! What actions and the mouse do in a comparison: the same on both sides.

use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use super::{Comparison, LETTERS, prepare};
use crate::tui::action::{Action, Both, binding_of};
use crate::tui::dialog::{Choice, Dialog, Help};
use crate::tui::lists;
use crate::tui::session::{Session, time, view};
use gdg::viewer::Field;

impl Comparison {
    /// Performs an action, or says why comparisons do not have it.
    pub fn act(&mut self, action: Action) {
        let Some(binding) = binding_of(action) else { return };
        match binding.both {
            Both::Each => self.both(action),
            Both::First => self.sessions[0].act(action),
            Both::Own(act) => act(self, action),
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
            Some(Choice::Act(action)) => self.act(*action),
            Some(Choice::Field(field)) => {
                self.sessions.iter_mut().for_each(|session| time::leave_past(session));
                self.show_field(*field);
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

    pub fn next_larger(&mut self, _: Action) {
        self.larger = match self.larger {
            None => Some(0),
            Some(side) => Some(side + 1).filter(|next| *next < LETTERS.len()),
        };
    }

    pub fn open_help(&mut self, _: Action) {
        let about = self.sides.each_ref().map(|side| (&*side.title, side.about.as_deref()));
        let help = Help::of_comparison(prepare::introduction(about));
        self.sessions[0].open(Dialog::Help(help));
    }

    /// Opens the list of actions: of those that comparisons have, and of the others, to say why.
    pub fn open_palette(&mut self, _: Action) {
        let Session { cx, .. } = &self.sessions[0];
        let fields = Field::ALL.into_iter().filter(|field| self.both_have(*field));
        let list = lists::actions_of_comparisons(&cx.screen, &cx.scene, fields);
        self.sessions[0].open(list);
    }

    pub fn close_top(&mut self, action: Action) {
        if self.is_editing() { self.edit(action) } else { self.both(action) }
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
        let is_edited = self.race.map != map;
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
        self.sessions[1 - own].in_maze(|maze, _, link| {
            maze.viewport = viewport;
            maze.hover(hovered, link);
        });
    }
}
