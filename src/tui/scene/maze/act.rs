//! Carries out actions in a maze.

use std::path::Path;
use std::sync::Arc;

use rand::RngExt;

use super::MazeState;
use super::editor::offset_cell;
use crate::tui::action::Action;
use crate::tui::dialog::{Prompt, Question};
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::link::Link;
use crate::tui::raster::Viewport;
use crate::tui::screen::Screen;
use gdg::engine::{Command, MakeWorld};
use gdg::env::PointMaze;
use gdg::files::named;
use gdg::map::{Cell, Grid};
use gdg::viewer::maze::{Request, cell_of_goal};
use gdg::viewer::{MazeView, OnArrival};

const EDITS_DROPPED: &str = "older edits can no longer be undone: the history took too much memory";

/// Returns a function that builds the maze on `map` with the run's settings and scenario.
pub fn maze_on(map: Arc<Grid>) -> MakeWorld {
    Box::new(|world| {
        Ok(match PointMaze::downcast_ref(world) {
            Some(maze) => Box::new(maze.with_map(map)),
            None => Box::new(PointMaze::new(map, 0)),
        })
    })
}

impl MazeState {
    /// Shows the maze of another run, with the goal that it was saved with, the map's own or a
    /// random one.
    pub fn start(&mut self, screen: &mut Screen, link: &mut Link) {
        let Some(scene) = screen.snapshot.scene.maze() else { return };
        let map = scene.map.clone();
        // A new run on a drawn map leaves it in no file.
        if screen.snapshot.saved.is_some() || map.name() != self.map.name() {
            self.kept_map = map.clone();
        }
        self.map = map.clone();
        self.editor.clear_history();
        self.viewport = Viewport::default();
        self.inspect(None, link);
        link.request(Request::Directions(screen.overlays.has(Overlay::Directions)));
        let method = screen.run().method.name();
        let (name, width, height) = (map.name(), map.width(), map.height());
        let text = format!("{method} on {name}, {width} x {height} cells");
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        let saved = cell_of_goal(&screen.snapshot.notes.goal, &map);
        let goal = saved.or(map.goals().first().copied()).unwrap_or_else(|| self.random_cell(link));
        self.set_goal(goal, screen, link);
    }

    pub fn act(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        let at_cursor = self.inspecting.unwrap_or(self.goal);
        match action {
            Action::NewGoal => {
                let cell = self.random_cell(link);
                self.set_goal(cell, screen, link);
            }
            Action::Move(dx, dy) => self.move_by([dx, dy], screen, link),
            Action::GoalHere => self.set_goal(at_cursor, screen, link),
            Action::StartHere => place_walker(Some(at_cursor), screen, link),
            Action::NewStart => place_walker(None, screen, link),
            Action::Toggle(Overlay::Directions) => {
                link.request(Request::Directions(screen.overlays.has(Overlay::Directions)));
            }
            Action::ZoomIn => self.zoom(1.5, None, &screen.layout),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None, &screen.layout),
            Action::ZoomOff => self.zoom(0.0, None, &screen.layout),
            Action::Pan(dx, dy) => self.pan(dx, dy, &screen.layout),
            Action::Inspect => {
                let at = self.inspecting.is_none().then_some(self.goal);
                self.inspect(at, link);
            }
            Action::SaveMap => self.ask_file(screen),
            _ => self.edit(action, screen, link),
        }
    }

    fn edit(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        let map = self.map.clone();
        if matches!(action, Action::ToggleEdit | Action::Tool(_)) {
            screen.show_banner();
        }
        match action {
            Action::ToggleEdit => self.toggle_edit(link),
            Action::Tool(tool) => {
                if !self.editor.is_open() {
                    self.toggle_edit(link);
                }
                self.editor.select_tool(tool);
            }
            Action::Apply => {
                let new = self.editor.apply(&map);
                let refusal = self.editor.tool.refusal();
                self.change_map_or_say(new, ["", refusal.unwrap_or_default()], screen, link);
            }
            Action::Undo => {
                let new = self.editor.undo();
                let nothing =
                    if self.editor.has_dropped { EDITS_DROPPED } else { "nothing to undo" };
                self.change_map_or_say(new, ["undone: ", nothing], screen, link);
            }
            Action::Redo => {
                let new = self.editor.redo();
                self.change_map_or_say(new, ["redone: ", "nothing to redo"], screen, link);
            }
            _ => {}
        }
    }

    fn ask_file(&self, screen: &mut Screen) {
        let stem = self.map.name().trim_end_matches("-edited");
        let name = named(Path::new(""), stem, "-edited.txt").to_string_lossy().into_owned();
        let hint = "NAME.map: Moving AI, without S and G; NAME.txt: plain text";
        screen.open(Prompt::new(Question::SaveMap, "save the map as", hint, name));
    }

    fn random_cell(&self, link: &mut Link) -> Cell {
        let cells: Vec<Cell> = self.map.free_cells().collect();
        cells[link.rng.random_range(0..cells.len())]
    }

    /// Puts the goal at `cell`, or at the free cell nearest to it.
    pub fn set_goal(&mut self, cell: Cell, screen: &mut Screen, link: &mut Link) {
        if let Some(cell) = self.map.nearest_free(cell) {
            link.return_to_present(screen);
            self.goal = cell;
            let request = Request::Goal(cell, link.next_goal_request());
            link.request(request);
        }
    }

    /// Puts the goal where the user has clicked, or near it with a notice if that is a wall.
    pub fn set_goal_by_click(&mut self, clicked: Cell, screen: &mut Screen, link: &mut Link) {
        self.set_goal(clicked, screen, link);
        let goal = self.goal;
        if goal != clicked {
            say_wall(clicked, 'G', goal, screen);
        }
    }

    /// Puts the walking agent where the user has clicked, or near it with a notice if that is a
    /// wall.
    pub fn place_walker_by_click(&self, clicked: Cell, screen: &mut Screen, link: &Link) {
        place_walker(Some(clicked), screen, link);
        if let Some(start) = self.map.nearest_free(clicked).filter(|start| *start != clicked) {
            say_wall(clicked, '@', start, screen);
        }
    }

    /// Starts inspecting a cell, or stops with `None`.
    fn inspect(&mut self, cell: Option<Cell>, link: &Link) {
        self.inspecting = cell;
        link.request(Request::Inspect(cell.or(self.hovered)));
    }

    /// Switches to `map`, if given.
    pub fn change_map(&mut self, map: Option<Arc<Grid>>, screen: &mut Screen, link: &mut Link) {
        self.change_map_or_say(map, [""; 2], screen, link);
    }

    /// Switches to `map`, with a notice that begins with `done`, or says why there is `nothing`.
    pub fn change_map_or_say(
        &mut self,
        map: Option<Arc<Grid>>,
        [done, nothing]: [&'static str; 2],
        screen: &mut Screen,
        link: &mut Link,
    ) {
        let Some(map) = map else {
            if !nothing.is_empty() {
                screen.notify(nothing);
            }
            return;
        };
        let is_taken = link.command(Command::ChangeWorld(maze_on(map.clone()), done), screen);
        self.editor.settle(&self.map, is_taken);
        if !is_taken {
            return;
        }
        self.map = map;
        if self.editor.drops_first_edits() {
            screen.notify(EDITS_DROPPED);
        }
        if !self.map.is_free(self.goal) {
            self.set_goal(self.goal, screen, link);
        }
    }

    fn toggle_edit(&mut self, link: &Link) {
        if self.editor.is_open() {
            self.editor.close();
        } else {
            self.editor.cursor = Some(self.inspecting.unwrap_or(self.goal));
            self.inspect(None, link);
        }
    }

    /// Moves the editor's cursor, the inspecting one or the goal by columns to the right and rows
    /// down.
    fn move_by(&mut self, by: [isize; 2], screen: &mut Screen, link: &mut Link) {
        if self.editor.is_open() {
            self.editor.move_cursor(by, &self.map.clone());
        } else if let Some(at) = self.inspecting {
            self.inspect(Some(offset_cell(at, by, &self.map)), link);
        } else {
            self.move_goal(by, screen, link);
        }
        self.scroll_into_view(&screen.layout);
    }

    /// Moves the goal to the next free cell in that direction, jumping over walls.
    fn move_goal(&mut self, [dx, dy]: [isize; 2], screen: &mut Screen, link: &mut Link) {
        let mut at = self.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if !self.map.contains(at) {
                return;
            }
            if self.map.is_free(at) {
                return self.set_goal(at, screen, link);
            }
        }
    }

    /// Closes the editor or the cursor; returns whether one was open.
    pub fn close(&mut self, link: &Link) -> bool {
        if self.editor.is_open() {
            self.editor.close();
        } else if self.inspecting.is_some() {
            self.inspect(None, link);
        } else {
            return false;
        }
        true
    }

    /// Has the viewer compute the field for the map's pixels; `before` is the previous layout.
    pub fn drawn(before: ScreenLayout, screen: &mut Screen, link: &Link) {
        match &screen.layout.map {
            Some(frame) if before.map.as_ref() != Some(frame) => {
                link.request(Request::Frame(frame.raster, Arc::new(frame.arrows())));
            }
            Some(_) => {}
            // The map is hidden behind a maximised pane.
            None => screen.layout.map = before.map,
        }
    }

    pub fn show(&mut self, view: Arc<MazeView>, screen: &mut Screen, link: &Link) {
        // Follow goals chosen by the walking agent itself, but not those older than the latest goal
        // request.
        if let (Some(goal), number) = view.goal
            && screen.on_arrival == OnArrival::Visit
            && number == link.goal_request
        {
            self.goal = goal;
        }
        self.view = view;
        self.warn_of_cut_off_goal(screen, link);
    }

    /// Warns if no path leads from the walking agent to the goal, once per goal and map.
    fn warn_of_cut_off_goal(&mut self, screen: &mut Screen, link: &Link) {
        let view = &self.view;
        let no_path = view.goal.1 == link.goal_request && view.walk.shortest.is_none();
        let warned = |(goal, cut_off): &(u64, Arc<Vec<bool>>)| {
            *goal == view.goal.1 && Arc::ptr_eq(cut_off, &view.cut_off)
        };
        if no_path && view.cut_off.contains(&true) && !self.warned_of.as_ref().is_some_and(warned) {
            self.warned_of = Some((view.goal.1, view.cut_off.clone()));
            screen.notify("no path leads from @ to G: walls separate them");
        }
    }
}

/// Says that what was clicked is a wall, and where `mark` is instead.
fn say_wall(clicked: Cell, mark: char, at: Cell, screen: &mut Screen) {
    let wall = format!("{},{} is a wall", clicked.x, clicked.y);
    screen.notify(&format!("{wall}: {mark} is at the nearest free cell, {},{}", at.x, at.y));
}

/// Puts the walking agent at a cell, or at a random place.
pub fn place_walker(cell: Option<Cell>, screen: &mut Screen, link: &Link) {
    link.return_to_present(screen);
    link.request(Request::Start(cell));
}
