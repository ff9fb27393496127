//! The mouse in a maze: hovering, buttons and wheel; zooming and panning.

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::{Position, Rect};

use super::MazeState;
use crate::tui::layout::ScreenLayout;
use crate::tui::link::Link;
use crate::tui::raster::{MapFrame, Viewport};
use crate::tui::screen::Screen;
use gdg::map::Cell;
use gdg::viewer::maze::Request;

/// Zoom factor of one wheel step.
const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// The fewest cells shown across at maximum zoom.
const MIN_VISIBLE_CELLS: f32 = 4.0;

/// Share of the visible part that panning moves by.
const PAN_SHARE: f32 = 0.2;

impl MazeState {
    /// Handles the mouse on the map; returns whether it did anything.
    pub fn on_mouse(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        screen: &mut Screen,
        link: &mut Link,
    ) -> bool {
        let Some(frame) = &screen.layout.map.clone() else { return false };
        let drawing = self.editor.is_drawing();
        // A stroke that leaves the map continues along its edge.
        let at = if drawing && matches!(kind, MouseEventKind::Drag(_)) {
            nearest_within(frame.area, at)
        } else {
            at
        };
        let cell = frame.cell_at(at, &self.map);
        let dragged_from = self.dragged_from.take();
        if self.is_on_minimap(kind, at, &screen.layout) {
            return true;
        }
        let layout = &screen.layout;
        match kind {
            MouseEventKind::Moved => self.hover(cell, link),
            MouseEventKind::ScrollUp if cell.is_some() => {
                self.zoom(WHEEL_ZOOM_FACTOR, Some(at), layout);
            }
            MouseEventKind::ScrollDown if cell.is_some() => {
                self.zoom(1.0 / WHEEL_ZOOM_FACTOR, Some(at), layout);
            }
            MouseEventKind::Down(MouseButton::Middle) => self.dragged_from = Some(at),
            MouseEventKind::Drag(MouseButton::Middle) => {
                self.drag_map(dragged_from.unwrap_or(at), at, layout);
            }
            MouseEventKind::Down(button) | MouseEventKind::Drag(button)
                if self.editor.is_open() && cell.is_some() =>
            {
                self.editor.draw(at, button == MouseButton::Right, frame, &self.map);
            }
            MouseEventKind::Up(_) if self.editor.is_open() => {
                let new = self.editor.finish(&self.map.clone());
                let refusal = self.editor.tool.refusal().filter(|_| drawing);
                self.change_map_or_say(new, ["", refusal.unwrap_or_default()], screen, link);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                let Some(cell) = cell else { return false };
                self.on_click(cell, screen, link);
            }
            MouseEventKind::Down(MouseButton::Right) => {
                let Some(cell) = cell else { return false };
                self.place_walker_by_click(cell, screen, link);
            }
            _ => return false,
        }
        true
    }

    fn on_click(&mut self, cell: Cell, screen: &mut Screen, link: &mut Link) {
        self.hovered = None;
        screen.explains = false;
        if self.goal != cell {
            self.set_goal_by_click(cell, screen, link);
        }
    }

    fn drag_map(&mut self, from: Position, to: Position, layout: &ScreenLayout) {
        let Some(scale) = layout.map.as_ref().map(MapFrame::scale) else { return };
        let moved = |from: u16, to: u16| f32::from(from) - f32::from(to);
        self.pan_by([moved(from.x, to.x) / scale, 2.0 * moved(from.y, to.y) / scale], layout);
        self.dragged_from = Some(to);
    }

    /// Shows the part of the map clicked on the minimap; returns whether it was clicked.
    fn is_on_minimap(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> bool {
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
    pub fn hover(&mut self, cell: Option<Cell>, link: &Link) {
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

/// Returns the position in `area` nearest to `at`.
fn nearest_within(area: Rect, at: Position) -> Position {
    let within = |at: u16, from: u16, size: u16| at.clamp(from, from + size.saturating_sub(1));
    Position::new(within(at.x, area.x, area.width), within(at.y, area.y, area.height))
}
