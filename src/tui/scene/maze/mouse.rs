//! The mouse in a maze: hovering, buttons and wheel; zooming and panning.

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::{Position, Rect};

use crate::tui::app::App;
use crate::tui::raster::Viewport;
use gdg::map::Cell;
use gdg::viewer::maze::Request;

/// Zoom factor of one wheel step.
const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// The fewest cells shown across at maximum zoom.
const MIN_VISIBLE_CELLS: f32 = 4.0;

/// Share of the visible part that panning moves by.
const PAN_SHARE: f32 = 0.2;

impl App {
    /// Handles the mouse on the map; returns whether it did anything.
    pub(in crate::tui) fn on_mouse_in_maze(&mut self, kind: MouseEventKind, at: Position) -> bool {
        let Some(frame) = &self.screen.layout.map.clone() else { return false };
        let drawing = self.screen.maze.editor.is_drawing();
        // A stroke that leaves the map goes on along its edge.
        let at = if drawing && matches!(kind, MouseEventKind::Drag(_)) {
            nearest_within(frame.area, at)
        } else {
            at
        };
        let cell = frame.cell_at(at, &self.screen.maze.map);
        let dragged_from = self.dragged_from.take();
        if self.is_on_minimap(kind, at) {
            return true;
        }
        match kind {
            MouseEventKind::Moved => self.hover(cell),
            MouseEventKind::ScrollUp if cell.is_some() => self.zoom(WHEEL_ZOOM_FACTOR, Some(at)),
            MouseEventKind::ScrollDown if cell.is_some() => {
                self.zoom(1.0 / WHEEL_ZOOM_FACTOR, Some(at));
            }
            MouseEventKind::Down(MouseButton::Middle) => self.dragged_from = Some(at),
            MouseEventKind::Drag(MouseButton::Middle) => {
                let moved = |from: u16, to: u16| f32::from(from) - f32::from(to);
                let from = dragged_from.unwrap_or(at);
                self.pan_by([
                    moved(from.x, at.x) / frame.scale(),
                    2.0 * moved(from.y, at.y) / frame.scale(),
                ]);
                self.dragged_from = Some(at);
            }
            MouseEventKind::Down(button) | MouseEventKind::Drag(button)
                if self.screen.maze.editor.is_open()
                    && cell.is_some()
                    && button != MouseButton::Middle =>
            {
                self.screen.maze.editor.draw(
                    at,
                    button == MouseButton::Right,
                    frame,
                    &self.screen.maze.map,
                );
            }
            MouseEventKind::Up(_) if self.screen.maze.editor.is_open() => {
                let new = self.screen.maze.editor.finish(&self.screen.maze.map.clone());
                let refusal = self.screen.maze.editor.tool.refusal().filter(|_| drawing);
                self.change_map_or_say(new, refusal);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                if let Some(cell) = cell {
                    self.screen.maze.hovered = None;
                    self.on_first_use();
                    if self.screen.maze.goal != cell {
                        self.set_goal_by_click(cell);
                    }
                }
            }
            MouseEventKind::Down(MouseButton::Right) => {
                if cell.is_some() {
                    self.place_walker(cell);
                }
            }
            _ => return false,
        }
        true
    }

    /// Shows the part of the map clicked on the minimap; returns whether it was clicked.
    fn is_on_minimap(&mut self, kind: MouseEventKind, at: Position) -> bool {
        let Some(minimap) =
            self.screen.layout.minimap.as_ref().filter(|minimap| minimap.area.contains(at))
        else {
            return false;
        };
        if matches!(
            kind,
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left)
        ) {
            self.screen.maze.viewport.centre = minimap.middle_of(at);
            self.clamp_viewport();
            return true;
        }
        false
    }

    /// Describes the cell under the mouse, unless a cursor is shown.
    pub(in crate::tui) fn hover(&mut self, cell: Option<Cell>) {
        if self.screen.maze.hovered != cell {
            self.screen.maze.hovered = cell;
            if self.screen.maze.inspecting.is_none() {
                self.viewer.request(Request::Inspect(cell));
            }
        }
    }

    /// Magnifies the map by a factor, keeping the place under `at` (by default the cursor or the
    /// goal) fixed; 0 shows the whole map.
    pub(super) fn zoom(&mut self, by: f32, at: Option<Position>) {
        let Some(frame) = &self.screen.layout.map else { return };
        let cursor = self
            .screen
            .maze
            .inspecting
            .or(self.screen.maze.editor.cursor)
            .unwrap_or(self.screen.maze.goal)
            .centre();
        let fixed = at.map_or(cursor, |at| frame.middle_of(at));
        let at = at.or(frame.character_of(fixed));
        let most = (self.screen.maze.map.width().max(self.screen.maze.map.height()) as f32
            / MIN_VISIBLE_CELLS)
            .max(1.0);
        let zoom = (self.screen.maze.viewport.zoom * by).clamp(1.0, most);
        if zoom < 1.01 {
            self.screen.maze.viewport = Viewport::default();
            return;
        }
        // A character is twice as high as wide.
        let scale = frame.scale() * zoom / self.screen.maze.viewport.zoom;
        let pane = self.screen.layout.map_pane;
        let off = at.map_or([0.0; 2], |at| {
            let from_middle = |at: u16, from: u16, size: u16| {
                f32::from(at) + 0.5 - f32::from(from) - f32::from(size) / 2.0
            };
            let down = from_middle(at.y, pane.y, pane.height.saturating_sub(1));
            [from_middle(at.x, pane.x, pane.width) / scale, 2.0 * down / scale]
        });
        self.screen.maze.viewport =
            Viewport { zoom, centre: [fixed[0] - off[0], fixed[1] - off[1]] };
    }

    /// Moves the visible part of the map.
    pub(super) fn pan(&mut self, dx: isize, dy: isize) {
        let Some(frame) = &self.screen.layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        self.pan_by([PAN_SHARE * width * dx as f32, PAN_SHARE * height * dy as f32]);
    }

    /// Moves the visible part of the map by a number of cells.
    fn pan_by(&mut self, [across, down]: [f32; 2]) {
        self.screen.maze.viewport.centre[0] += across;
        self.screen.maze.viewport.centre[1] += down;
        self.clamp_viewport();
    }

    /// Keeps the visible part within the map, so that panning back takes effect at once.
    fn clamp_viewport(&mut self) {
        let Some(frame) = &self.screen.layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        let within = |middle: f32, shown: f32, all: f32| {
            middle.min(all - shown / 2.0).max((shown / 2.0).min(all / 2.0))
        };
        let [x, y] = self.screen.maze.viewport.centre;
        let (all_x, all_y) =
            (self.screen.maze.map.width() as f32, self.screen.maze.map.height() as f32);
        self.screen.maze.viewport.centre =
            [within(x, width.min(all_x), all_x), within(y, height.min(all_y), all_y)];
    }

    /// Moves the visible part, if necessary, to show the cursor or else the goal.
    pub(super) fn scroll_into_view(&mut self) {
        let Some(frame) = &self.screen.layout.map else { return };
        let at = self
            .screen
            .maze
            .editor
            .cursor
            .or(self.screen.maze.inspecting)
            .unwrap_or(self.screen.maze.goal)
            .centre();
        let [left, top, width, height] = frame.raster.window;
        let inside = at[0] >= left && at[1] >= top && at[0] < left + width && at[1] < top + height;
        if self.screen.maze.viewport.zoom > 1.0 && !inside {
            self.screen.maze.viewport.centre = at;
        }
    }
}

/// Returns the position in `area` nearest to `at`.
fn nearest_within(area: Rect, at: Position) -> Position {
    let within = |at: u16, from: u16, size: u16| at.clamp(from, from + size.saturating_sub(1));
    Position::new(within(at.x, area.x, area.width), within(at.y, area.y, area.height))
}
