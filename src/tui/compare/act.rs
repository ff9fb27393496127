//! Executes actions, for both sides.

use crossterm::event::Event;

use super::refusal::reason;
use super::{Comparison, LETTERS};
use crate::tui::action::{Action, Mode, bindings};
use crate::tui::app::{App, view};
use crate::tui::dialog::Choice;
use crate::tui::interface::{Interface, TerminalRequest};
use crate::tui::lists;
use crate::tui::output::ExportKind;
use crate::tui::scene::maze::NOUN;
use gdg::viewer::Field;

impl Comparison {
    /// Performs an action.
    pub(super) fn act(&mut self, action: Action) {
        match action {
            Action::TogglePause => self.toggle_pause(),
            Action::ToggleEdit | Action::Tool(_) | Action::Apply | Action::Undo | Action::Redo => {
                self.edit(action);
            }
            Action::Move(..) | Action::Close if self.is_editing() => self.edit(action),
            Action::Close if self.is_past() => self.return_to_present(),
            Action::Back | Action::Forth => self.step_through_films(action == Action::Forth),
            Action::Field(forward) => self.next_field(forward),
            Action::NewGoal => {
                self.sides[0].app.act(action);
                self.goal_from(0);
            }
            Action::Move(..) | Action::GoalHere => {
                self.both(action);
                self.goal_from(0);
            }
            Action::StartHere => {
                let maze = self.sides[0].maze();
                self.start_race(maze.inspecting.unwrap_or(maze.goal), maze.goal);
            }
            Action::NewStart => {
                let goal = self.sides[0].maze().goal;
                let start = self.race.random_start(goal);
                self.start_race(start, goal);
            }
            Action::OnArrival => {
                self.race.on_arrival = self.race.on_arrival.next();
                self.notify(&format!("at the goal both @ will {}", self.race.on_arrival.name()));
            }
            Action::Axis => self.axis = self.axis.next(),
            Action::Larger(side) => {
                self.larger = Some(side).filter(|side| self.larger != Some(*side));
            }
            Action::NextLarger => {
                self.larger = self
                    .larger
                    .map_or(Some(0), |side| Some(side + 1).filter(|next| *next < LETTERS.len()));
            }
            // The dialogs of both belong to the first side.
            Action::Help | Action::SaveMap => self.sides[0].app.act(action),
            Action::Palette => self.open_palette(),
            Action::Export => {
                let list = lists::exports(&ExportKind::PICTURES, &format!("both {NOUN}s"));
                self.sides[0].app.screen.open(list);
            }
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => self.done = true,
            _ if is_available(action) => self.both(action),
            _ => self.refuse(action),
        }
    }

    /// Opens the list of actions: of those that comparisons have, and of the others, to say why.
    fn open_palette(&mut self) {
        let [first, _] = &self.sides;
        let (screen, scene) = (&first.app.screen, &first.app.scene);
        let fields = Field::ALL.into_iter().filter(|field| self.both_have(*field));
        let modes = [Mode::Comparing, Mode::EditingBoth];
        let list = lists::actions_of_comparisons(screen, scene, &modes, fields);
        self.sides[0].app.screen.open(list);
    }

    /// Handles an event while a dialog is open, and carries out what the user picks in it.
    pub(super) fn on_event_in_dialog(&mut self, event: &Event) {
        let app = &mut self.sides[0].app;
        app.screen.log.dismiss();
        app.on_event(event);
        // What a dialog says is not about the first side alone.
        if let Some(notice) = app.screen.log.take() {
            self.notify(&notice);
        }
        match self.sides[0].app.picked.take() {
            Some(Choice::Act(action)) => self.act(action),
            Some(Choice::Field(field)) => {
                self.return_to_present();
                self.show_field(field);
            }
            Some(Choice::Export(kind)) => self.export(kind),
            _ => {}
        }
    }

    /// Says why an action is not available in comparisons.
    pub(super) fn refuse(&mut self, action: Action) {
        let Some(binding) = bindings().find(|binding| binding.action == action) else { return };
        let what = self.sides[0].app.scene.wording(binding);
        let what = what.split(" (").next().unwrap_or(what);
        self.notify(&format!("not in a comparison: {what}; {}", reason(action)));
    }

    fn both(&mut self, action: Action) {
        self.sides.iter_mut().for_each(|side| side.app.act(action));
        // Zooming and panning depend on the size of the map on the screen.
        self.mirror(0);
    }

    /// Sets the goal of both to that of one side, and starts a race to it if it has changed.
    pub(super) fn goal_from(&mut self, side: usize) {
        let goal = self.sides[side].maze().goal;
        if goal != self.race.goal() {
            self.start_race(self.race.start(), goal);
        }
    }

    /// Pauses both, or resumes both if neither trains.
    fn toggle_pause(&mut self) {
        let trains =
            self.sides.each_ref().map(|side| side.app.snapshots().borrow().phase.is_training());
        let any = trains.contains(&true);
        for (side, _) in self.sides.iter_mut().zip(trains).filter(|(_, trains)| *trains == any) {
            side.app.act(Action::TogglePause);
        }
    }

    /// Colours both maps by the next field that both have.
    fn next_field(&mut self, forward: bool) {
        let shown = self.sides[0].app.screen.field;
        self.show_field(shown.cycle(forward, |field| self.both_have(field)));
    }

    fn both_have(&self, field: Field) -> bool {
        self.sides.iter().all(|side| side.app.scene.has_field(field, &side.app.screen))
    }

    fn show_field(&mut self, field: Field) {
        for App { screen, link, .. } in self.sides.iter_mut().map(|side| &mut side.app) {
            view::show_field(field, screen, link);
        }
    }
}

/// Whether a comparison has an action.
fn is_available(action: Action) -> bool {
    let modes = [Mode::Comparing, Mode::EditingBoth];
    bindings().any(|b| b.action == action && modes.into_iter().any(|mode| b.is_active(mode)))
}
