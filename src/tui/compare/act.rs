//! Executes actions, for both sides.

use super::{Comparison, LETTERS};
use crate::tui::action::{Action, bindings};
use crate::tui::app::{App, view};
use crate::tui::interface::TerminalRequest;
use gdg::viewer::Field;

impl Comparison {
    /// Performs an action.
    pub(super) fn act(&mut self, action: Action) {
        match action {
            Action::TogglePause => self.toggle_pause(),
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
            Action::Help => self.sides[0].app.act(action),
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => self.done = true,
            _ => self.both(action),
        }
    }

    /// Notifies that an action is not available in comparisons.
    pub(super) fn refuse(&mut self, action: Action) {
        let Some(binding) = bindings().find(|binding| binding.action == action) else { return };
        let help = self.sides[0].app.screen.keymap.key_of(Action::Help);
        self.notify(&format!("a comparison has no \"{}\" ({help} shows its keys)", binding.name));
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
        let both_have = |field: Field| {
            self.sides.iter().all(|side| side.app.scene.has_field(field, &side.app.screen))
        };
        let field = self.sides[0].app.screen.field.cycle(forward, both_have);
        for App { screen, link, .. } in self.sides.iter_mut().map(|side| &mut side.app) {
            view::show_field(field, screen, link);
        }
    }
}
