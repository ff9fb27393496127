//! Carries out what keys and the mouse ask for in a maze: edits, goals, zooming and panning.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crossterm::event::{MouseButton, MouseEventKind};
use rand::RngExt;
use ratatui::layout::{Position, Rect};

use super::MazeState;
use super::editor::offset_cell;
use crate::tui::action::Action;
use crate::tui::dialog::{Prompt, Question};
use crate::tui::layout::ScreenLayout;
use crate::tui::link::TrainerLink;
use crate::tui::screen::Screen;
use crate::tui::viewport::{MapFrame, Viewport};
use gdg::engine::{EngineCommand, MakeWorld};
use gdg::env::PointMaze;
use gdg::files::named;
use gdg::map::{Cell, Grid};
use gdg::viewer::Request;

/// Zoom factor of one wheel step.
pub const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// The fewest cells shown across at maximum zoom.
const MIN_VISIBLE_CELLS: f32 = 4.0;

/// Share of the visible part that panning moves by.
const PAN_SHARE: f32 = 0.2;

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
    pub fn edit(&mut self, action: Action, screen: &mut Screen, link: &mut TrainerLink) {
        let map = self.map.clone();
        if matches!(action, Action::ToggleEdit | Action::Tool(_)) {
            screen.banner = Some(Instant::now());
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
                self.change_map_or_say(new, ["undone: ", "nothing to undo"], screen, link);
            }
            Action::Redo => {
                let new = self.editor.redo();
                self.change_map_or_say(new, ["redone: ", "nothing to redo"], screen, link);
            }
            _ => {}
        }
    }

    pub fn ask_file(&self, screen: &mut Screen) {
        let stem = self.map.name().trim_end_matches("-edited");
        let name = named(Path::new(""), stem, "-edited.txt").to_string_lossy().into_owned();
        let hint = "NAME.map: Moving AI, without S and G; NAME.txt: plain text";
        screen.open(Prompt::new(Question::SaveMap, "save the map as", hint, name));
    }

    pub fn random_cell(&self, link: &mut TrainerLink) -> Cell {
        let cells: Vec<Cell> = self.map.free_cells().collect();
        cells[link.rng.random_range(0..cells.len())]
    }

    /// Puts the goal at `cell`, or at the free cell nearest to it.
    pub fn set_goal(&mut self, cell: Cell, screen: &mut Screen, link: &mut TrainerLink) {
        if let Some(cell) = self.map.nearest_free(cell) {
            link.return_to_present(screen);
            self.goal = cell;
            let request = Request::Goal(Some(cell.centre().to_vec()), link.next_goal_request());
            link.request(request);
        }
    }

    /// Puts the goal where the user has clicked, or near it with a notice if that is a wall.
    pub fn set_goal_by_click(
        &mut self,
        clicked: Cell,
        screen: &mut Screen,
        link: &mut TrainerLink,
    ) {
        self.set_goal(clicked, screen, link);
        let goal = self.goal;
        if goal != clicked {
            say_wall(clicked, 'G', goal, screen);
        }
    }

    pub fn place_walker_by_click(&self, clicked: Cell, screen: &mut Screen, link: &TrainerLink) {
        place_walker(Some(clicked), screen, link);
        if let Some(start) = self.map.nearest_free(clicked).filter(|start| *start != clicked) {
            say_wall(clicked, '@', start, screen);
        }
    }

    pub fn inspect(&mut self, cell: Option<Cell>, link: &TrainerLink) {
        self.inspecting = cell;
        link.request(Request::Inspect(cell.or(self.hovered)));
    }

    pub fn change_map(
        &mut self,
        map: Option<Arc<Grid>>,
        screen: &mut Screen,
        link: &mut TrainerLink,
    ) {
        self.change_map_or_say(map, [""; 2], screen, link);
    }

    /// Switches to `map`, with a notice that begins with `done`, or says why there is `nothing`.
    pub fn change_map_or_say(
        &mut self,
        map: Option<Arc<Grid>>,
        [done, nothing]: [&'static str; 2],
        screen: &mut Screen,
        link: &mut TrainerLink,
    ) {
        let Some(map) = map else {
            if !nothing.is_empty() {
                screen.notify(nothing);
            }
            return;
        };
        if !link.command(EngineCommand::ChangeWorld(maze_on(map.clone()), done), screen) {
            return;
        }
        self.editor.settle(&self.map, &map);
        self.map = map;
        if !self.map.is_free(self.goal) {
            self.set_goal(self.goal, screen, link);
        }
    }

    fn toggle_edit(&mut self, link: &TrainerLink) {
        if self.editor.is_open() {
            self.editor.close();
        } else {
            self.editor.cursor = Some(self.inspecting.unwrap_or(self.goal));
            self.inspect(None, link);
        }
    }

    /// Moves the editor's cursor, the inspecting one or the goal, right and down.
    pub fn move_by(&mut self, by: [isize; 2], screen: &mut Screen, link: &mut TrainerLink) {
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
    fn move_goal(&mut self, [dx, dy]: [isize; 2], screen: &mut Screen, link: &mut TrainerLink) {
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

    /// Warns if no path leads from the walking agent to the goal, once per goal and map.
    pub fn warn_of_cut_off_goal(&mut self, screen: &mut Screen, link: &TrainerLink) {
        let view = &self.view;
        let no_path = view.goal.1 == link.goal_request && view.reach.shortest.is_none();
        let warned = |(goal, cut_off): &(u64, Arc<Vec<bool>>)| {
            *goal == view.goal.1 && Arc::ptr_eq(cut_off, &view.cut_off)
        };
        if no_path && view.cut_off.contains(&true) && !self.warned_of.as_ref().is_some_and(warned) {
            self.warned_of = Some((view.goal.1, view.cut_off.clone()));
            screen.notify("no path leads from @ to G: walls separate them");
        }
    }

    pub fn on_click(&mut self, cell: Cell, screen: &mut Screen, link: &mut TrainerLink) {
        self.hovered = None;
        screen.explains = false;
        if self.goal != cell {
            self.set_goal_by_click(cell, screen, link);
        }
    }

    pub fn drag_map(&mut self, from: Position, to: Position, layout: &ScreenLayout) {
        let Some(scale) = layout.map.as_ref().map(MapFrame::scale) else { return };
        let moved = |from: u16, to: u16| f32::from(from) - f32::from(to);
        self.pan_by([moved(from.x, to.x) / scale, 2.0 * moved(from.y, to.y) / scale], layout);
        self.dragged_from = Some(to);
    }

    /// Shows the part of the map clicked on the minimap; returns whether it was clicked.
    pub fn is_on_minimap(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        layout: &ScreenLayout,
    ) -> bool {
        let Some(minimap) = layout.minimap.as_ref().filter(|minimap| minimap.area.contains(at))
        else {
            return false;
        };
        if matches!(
            kind,
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left)
        ) {
            self.viewport.centre = minimap.middle_of(at);
            self.clamp_viewport(layout);
            return true;
        }
        false
    }

    /// Describes the cell under the mouse, unless a cursor is shown.
    pub fn hover(&mut self, cell: Option<Cell>, link: &TrainerLink) {
        if self.hovered != cell {
            self.hovered = cell;
            if self.inspecting.is_none() {
                link.request(Request::Inspect(cell));
            }
        }
    }

    /// Magnifies the map by a factor, keeping the place under `at` (by default the cursor or the
    /// goal) fixed; 0 shows the whole map.
    pub fn zoom(&mut self, by: f32, at: Option<Position>, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let cursor = self.inspecting.or(self.editor.cursor).unwrap_or(self.goal).centre();
        let fixed = at.map_or(cursor, |at| frame.middle_of(at));
        let at = at.or(frame.character_of(fixed));
        let most = (self.map.width().max(self.map.height()) as f32 / MIN_VISIBLE_CELLS).max(1.0);
        let zoom = (self.viewport.zoom * by).clamp(1.0, most);
        if zoom < 1.01 {
            self.viewport = Viewport::default();
            return;
        }
        // A character is twice as high as wide.
        let scale = frame.scale() * zoom / self.viewport.zoom;
        let pane = layout.map_pane;
        let off = at.map_or([0.0; 2], |at| {
            let from_middle = |at: u16, from: u16, size: u16| {
                f32::from(at) + 0.5 - f32::from(from) - f32::from(size) / 2.0
            };
            let down = from_middle(at.y, pane.y, pane.height.saturating_sub(1));
            [from_middle(at.x, pane.x, pane.width) / scale, 2.0 * down / scale]
        });
        self.viewport = Viewport { zoom, centre: [fixed[0] - off[0], fixed[1] - off[1]] };
    }

    pub fn pan(&mut self, dx: isize, dy: isize, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        self.pan_by([PAN_SHARE * width * dx as f32, PAN_SHARE * height * dy as f32], layout);
    }

    fn pan_by(&mut self, [across, down]: [f32; 2], layout: &ScreenLayout) {
        self.viewport.centre[0] += across;
        self.viewport.centre[1] += down;
        self.clamp_viewport(layout);
    }

    /// Keeps the visible part within the map, so that panning back takes effect at once.
    fn clamp_viewport(&mut self, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        let within = |middle: f32, shown: f32, all: f32| {
            middle.min(all - shown / 2.0).max((shown / 2.0).min(all / 2.0))
        };
        let [x, y] = self.viewport.centre;
        let (all_x, all_y) = (self.map.width() as f32, self.map.height() as f32);
        self.viewport.centre =
            [within(x, width.min(all_x), all_x), within(y, height.min(all_y), all_y)];
    }

    /// Moves the visible part, if necessary, to show the cursor or else the goal.
    pub fn scroll_into_view(&mut self, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let at = self.editor.cursor.or(self.inspecting).unwrap_or(self.goal).centre();
        let [left, top, width, height] = frame.raster.window;
        let inside = at[0] >= left && at[1] >= top && at[0] < left + width && at[1] < top + height;
        if self.viewport.zoom > 1.0 && !inside {
            self.viewport.centre = at;
        }
    }
}

fn say_wall(clicked: Cell, mark: char, at: Cell, screen: &mut Screen) {
    let wall = format!("{},{} is a wall", clicked.x, clicked.y);
    screen.notify(&format!("{wall}: {mark} is at the nearest free cell, {},{}", at.x, at.y));
}

/// Puts the walking agent at a cell, or at a random place.
pub fn place_walker(cell: Option<Cell>, screen: &mut Screen, link: &TrainerLink) {
    link.return_to_present(screen);
    link.request(Request::Start(cell.map(|cell| cell.centre().to_vec())));
}

pub fn nearest_within(area: Rect, at: Position) -> Position {
    let within = |at: u16, from: u16, size: u16| at.clamp(from, from + size.saturating_sub(1));
    Position::new(within(at.x, area.x, area.width), within(at.y, area.y, area.height))
}
