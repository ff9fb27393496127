//! What actions do in a maze.

use std::sync::Arc;

use rand::RngExt;

use super::editor::offset_cell;
use crate::tui::action::Action;
use crate::tui::app::{App, maze_on};
use crate::tui::dialog::Question;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::raster::Viewport;
use gdg::engine::Command;
use gdg::map::{Cell, Grid};
use gdg::viewer::maze::{Request, cell_of_goal};

/// What is said where older edits cannot be undone.
const EDITS_DROPPED: &str =
    "older edits can no longer be undone: all together, they took too much memory";

impl App {
    /// Shows the maze of another run, with the goal that it was saved with, the map's own or a
    /// random one.
    pub(in crate::tui) fn start_maze(&mut self) {
        let map = self.screen.snapshot.scene.maze().map;
        self.screen.maze.map = map.clone();
        self.screen.maze.kept_map = map.clone();
        self.screen.maze.editor.clear_history();
        self.screen.maze.viewport = Viewport::default();
        self.inspect(None);
        self.viewer.request(Request::Directions(self.screen.overlays.has(Overlay::Directions)));
        let run = &self.screen.snapshot.run;
        let text = format!(
            "{} on {}, {} x {} cells",
            run.method.name(),
            map.name(),
            map.width(),
            map.height()
        );
        self.screen.log.record(&text, self.screen.snapshot.moment());
        let saved = cell_of_goal(&self.screen.snapshot.notes.goal, &map);
        let goal = saved.or(map.goals().first().copied()).unwrap_or_else(|| self.random_cell());
        self.set_goal(goal);
    }

    /// Performs an action that is about the maze.
    pub(in crate::tui) fn act_in_maze(&mut self, action: Action) {
        let maze = &mut self.screen.maze;
        let at_cursor = maze.inspecting.unwrap_or(maze.goal);
        let map = maze.map.clone();
        match action {
            Action::NewGoal => {
                let cell = self.random_cell();
                self.set_goal(cell);
            }
            Action::Move(dx, dy) => self.move_by(dx, dy),
            Action::GoalHere => self.set_goal(at_cursor),
            Action::StartHere => self.place_walker(Some(at_cursor)),
            Action::NewStart => self.place_walker(None),
            Action::Toggle(Overlay::Directions) => {
                self.viewer
                    .request(Request::Directions(self.screen.overlays.has(Overlay::Directions)));
            }
            Action::ZoomIn => self.zoom(1.5, None),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None),
            Action::ZoomOff => self.zoom(0.0, None),
            Action::Pan(dx, dy) => self.pan(dx, dy),
            Action::Inspect => {
                let at = maze.inspecting.is_none().then_some(maze.goal);
                self.inspect(at);
            }
            Action::ToggleEdit => self.toggle_edit(),
            Action::Tool(tool) => {
                if !self.screen.maze.editor.is_open() {
                    self.toggle_edit();
                }
                self.screen.maze.editor.select_tool(tool);
            }
            Action::Apply => {
                let new = maze.editor.apply(&map);
                let refusal = maze.editor.tool.refusal();
                self.change_map_or_say(new, refusal);
            }
            Action::Undo => {
                let new = maze.editor.undo(&map);
                let nothing =
                    if maze.editor.has_dropped_edits() { EDITS_DROPPED } else { "nothing to undo" };
                self.step_through_edits(new, "undone: ", nothing);
            }
            Action::Redo => {
                let new = maze.editor.redo(&map);
                self.step_through_edits(new, "done again: ", "nothing to redo");
            }
            Action::SaveMap => self.ask_map_file(),
            Action::NewMap => self.ask_size(Question::NewMap),
            Action::ResizeMap => self.ask_size(Question::ResizeMap),
            _ => {}
        }
    }

    fn random_cell(&mut self) -> Cell {
        let cells: Vec<Cell> = self.screen.maze.map.free_cells().collect();
        cells[self.rng.random_range(0..cells.len())]
    }

    /// Puts the goal at `cell`, or at the free cell nearest to it.
    pub(in crate::tui) fn set_goal(&mut self, cell: Cell) {
        if let Some(cell) = self.screen.maze.map.nearest_free(cell) {
            self.return_to_present();
            self.screen.maze.goal = cell;
            self.goal_requests += 1;
            self.viewer.request(Request::Goal(cell, self.goal_requests));
        }
    }

    /// Puts the goal where the user has clicked, and says where it is if that is a wall.
    pub(in crate::tui) fn set_goal_by_click(&mut self, clicked: Cell) {
        self.set_goal(clicked);
        let goal = self.screen.maze.goal;
        if goal != clicked {
            let wall = format!("{},{} is a wall", clicked.x, clicked.y);
            self.notify(&format!("{wall}: G is at the nearest free cell, {},{}", goal.x, goal.y));
        }
    }

    /// Puts the walking agent at a cell, or at a random place.
    pub(in crate::tui) fn place_walker(&mut self, cell: Option<Cell>) {
        self.return_to_present();
        self.viewer.request(Request::Start(cell));
    }

    /// Starts inspecting a cell, or stops with `None`.
    fn inspect(&mut self, cell: Option<Cell>) {
        self.screen.maze.inspecting = cell;
        self.viewer.request(Request::Inspect(cell.or(self.screen.maze.hovered)));
    }

    /// Switches to `map`, if given.
    pub(in crate::tui) fn change_map(&mut self, map: Option<Arc<Grid>>) {
        self.change_map_as("", map);
    }

    /// Switches to `map`, if given; the notice of what has changed begins with what was `done`.
    fn change_map_as(&mut self, done: &'static str, map: Option<Arc<Grid>>) {
        let Some(map) = map else { return };
        if !self.command(Command::ChangeWorld(maze_on(map.clone()), done)) {
            return;
        }
        self.screen.maze.map = map;
        if self.screen.maze.editor.drops_first_edits() {
            self.notify(EDITS_DROPPED);
        }
        if !self.screen.maze.map.is_free(self.screen.maze.goal) {
            self.set_goal(self.screen.maze.goal);
        }
    }

    /// Switches to `map`, or says why there is none.
    pub(in crate::tui) fn change_map_or_say(
        &mut self,
        map: Option<Arc<Grid>>,
        otherwise: Option<&str>,
    ) {
        if let Some(reason) = otherwise.filter(|_| map.is_none()) {
            self.notify(reason);
        }
        self.change_map(map);
    }

    /// Switches to `new`, an earlier or later map, and says so; or that there is `nothing`.
    fn step_through_edits(&mut self, new: Option<Arc<Grid>>, done: &'static str, nothing: &str) {
        if new.is_none() {
            self.notify(nothing);
        }
        self.change_map_as(done, new);
    }

    fn toggle_edit(&mut self) {
        if self.screen.maze.editor.is_open() {
            self.screen.maze.editor.close();
        } else {
            self.screen.maze.editor.cursor =
                Some(self.screen.maze.inspecting.unwrap_or(self.screen.maze.goal));
            self.inspect(None);
        }
    }

    fn move_by(&mut self, dx: isize, dy: isize) {
        if self.screen.maze.editor.is_open() {
            self.screen.maze.editor.move_cursor((dx, dy), &self.screen.maze.map.clone());
        } else if let Some(at) = self.screen.maze.inspecting {
            self.inspect(Some(offset_cell(at, (dx, dy), &self.screen.maze.map)));
        } else {
            self.move_goal(dx, dy);
        }
        self.scroll_into_view();
    }

    /// Moves the goal to the next free cell in that direction, jumping over walls.
    fn move_goal(&mut self, dx: isize, dy: isize) {
        let mut at = self.screen.maze.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if !self.screen.maze.map.contains(at) {
                return;
            }
            if self.screen.maze.map.is_free(at) {
                return self.set_goal(at);
            }
        }
    }

    /// Closes the editor or the cursor; returns whether one was open.
    pub(in crate::tui) fn close_in_maze(&mut self) -> bool {
        if self.screen.maze.editor.is_open() {
            self.screen.maze.editor.close();
        } else if self.screen.maze.inspecting.is_some() {
            self.inspect(None);
        } else {
            return false;
        }
        true
    }

    /// Has the viewer compute the field for the map's pixels.
    pub(in crate::tui) fn maze_drawn(&mut self, before: ScreenLayout) {
        match &self.screen.layout.map {
            Some(frame) if before.map.as_ref() != Some(frame) => {
                self.viewer.request(Request::Frame(frame.raster, Arc::new(frame.arrows())));
            }
            Some(_) => {}
            // The map is hidden behind a maximised pane.
            None => self.screen.layout.map = before.map,
        }
    }
}
