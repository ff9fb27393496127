//! The mouse: what is under it, and what its buttons and wheel do; zooming and panning.

use crossterm::event::{MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

use super::App;
use crate::map::Cell;
use crate::tui::dialog::Dialog;
use crate::tui::raster::Viewport;
use crate::tui::viewer::Request;

/// One turn of the wheel.
const WHEEL: f32 = 1.25;

/// The fewest cells that are shown across.
const LEAST_CELLS: f32 = 4.0;

/// Share of what is shown that panning moves by.
const PAN: f32 = 0.2;

impl App {
    pub(super) fn on_mouse(&mut self, mouse: MouseEvent) {
        let at = Position::new(mouse.column, mouse.row);
        if !self.dialogs.is_empty() {
            return self.on_mouse_in_dialog(mouse.kind, at);
        }
        let Some(frame) = self.places.map.clone() else { return };
        let cell = frame.cell_at(at, &self.map);
        match mouse.kind {
            MouseEventKind::Moved => self.hover(cell),
            MouseEventKind::ScrollUp if cell.is_some() => self.zoom(WHEEL, Some(at)),
            MouseEventKind::ScrollDown if cell.is_some() => self.zoom(1.0 / WHEEL, Some(at)),
            MouseEventKind::ScrollUp => self.scrolled += 1,
            MouseEventKind::ScrollDown => self.scrolled = self.scrolled.saturating_sub(1),
            MouseEventKind::Down(button) | MouseEventKind::Drag(button)
                if self.editor.is_open() && cell.is_some() && button != MouseButton::Middle =>
            {
                self.editor.draw(at, button == MouseButton::Right, &frame, &self.map);
            }
            MouseEventKind::Up(_) if self.editor.is_open() => {
                let new = self.editor.finish(&self.map.clone());
                self.change_map(new);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => match cell {
                Some(cell) => {
                    self.hovered = None;
                    if self.goal != cell {
                        self.set_goal(cell);
                    }
                }
                None => self.click_tab(at),
            },
            MouseEventKind::Down(MouseButton::Right) => {
                if let Some(cell) = cell {
                    self.viewer.ask(Request::Start(Some(cell)));
                }
            }
            _ => {}
        }
    }

    fn on_mouse_in_dialog(&mut self, kind: MouseEventKind, at: Position) {
        let (rows, first) = self.places.rows;
        match (self.dialogs.last_mut(), kind) {
            (Some(Dialog::Help(line)), MouseEventKind::ScrollUp) => *line = line.saturating_sub(3),
            (Some(Dialog::Help(line)), MouseEventKind::ScrollDown) => *line += 3,
            (Some(Dialog::Help(_)), MouseEventKind::Down(_)) => {
                self.dialogs.pop();
            }
            (Some(Dialog::Pick(picker)), MouseEventKind::ScrollUp) => picker.turn(-1),
            (Some(Dialog::Pick(picker)), MouseEventKind::ScrollDown) => picker.turn(1),
            (Some(Dialog::Pick(picker)), MouseEventKind::Down(MouseButton::Left)) if rows.contains(at) => {
                // Below the last item nothing is picked.
                let row = first + usize::from(at.y - rows.y);
                if picker.select(row) {
                    self.answer();
                }
            }
            _ => {}
        }
    }

    fn hover(&mut self, cell: Option<Cell>) {
        if self.hovered != cell {
            self.hovered = cell;
            if self.inspecting.is_none() {
                self.viewer.ask(Request::Inspect(cell));
            }
        }
    }

    fn click_tab(&mut self, at: Position) {
        let tab = self.places.tabs.iter().find(|(area, _)| area.contains(at)).map(|(_, pane)| *pane);
        if let Some(pane) = tab {
            (self.pane, self.scrolled) = (pane, 0);
        }
    }

    /// Shows the map so many times as large, with the place under `at` (or the middle) staying where it is; 0 for the
    /// whole map.
    pub(super) fn zoom(&mut self, by: f32, at: Option<Position>) {
        let Some(frame) = &self.places.map else { return };
        let cursor = self.inspecting.or(self.editor.cursor).unwrap_or(self.goal).centre();
        let fixed = at.map_or(cursor, |at| frame.middle_of(at));
        let at = at.or(frame.character_of(fixed));
        let most = (self.map.width().max(self.map.height()) as f32 / LEAST_CELLS).max(1.0);
        let zoom = (self.viewport.zoom * by).clamp(1.0, most);
        if zoom < 1.01 {
            self.viewport = Viewport::default();
            return;
        }
        // A character is as high as two are wide.
        let scale = frame.scale() * zoom / self.viewport.zoom;
        let pane = self.places.map_pane;
        let off = at.map_or([0.0; 2], |at| {
            let from_middle =
                |at: u16, from: u16, size: u16| f32::from(at) + 0.5 - f32::from(from) - f32::from(size) / 2.0;
            let down = from_middle(at.y, pane.y, pane.height.saturating_sub(1));
            [from_middle(at.x, pane.x, pane.width) / scale, 2.0 * down / scale]
        });
        self.viewport = Viewport { zoom, centre: [fixed[0] - off[0], fixed[1] - off[1]] };
    }

    /// Moves the part of the map that is shown.
    pub(super) fn pan(&mut self, dx: isize, dy: isize) {
        let Some(frame) = &self.places.map else { return };
        let [_, _, width, height] = frame.raster.window;
        self.viewport.centre[0] += PAN * width * dx as f32;
        self.viewport.centre[1] += PAN * height * dy as f32;
        self.clamp_viewport();
    }

    /// Keeps the middle of what is shown on the map, so that panning back answers at once.
    fn clamp_viewport(&mut self) {
        let Some(frame) = &self.places.map else { return };
        let [_, _, width, height] = frame.raster.window;
        let within =
            |middle: f32, shown: f32, all: f32| middle.min(all - shown / 2.0).max((shown / 2.0).min(all / 2.0));
        let [x, y] = self.viewport.centre;
        let (all_x, all_y) = (self.map.width() as f32, self.map.height() as f32);
        self.viewport.centre = [within(x, width.min(all_x), all_x), within(y, height.min(all_y), all_y)];
    }

    /// Moves what is shown so that the cursor, or else the goal, is seen.
    pub(super) fn keep_in_sight(&mut self) {
        let Some(frame) = &self.places.map else { return };
        let at = self.editor.cursor.or(self.inspecting).unwrap_or(self.goal).centre();
        let [left, top, width, height] = frame.raster.window;
        let inside = at[0] >= left && at[1] >= top && at[0] < left + width && at[1] < top + height;
        if self.viewport.zoom > 1.0 && !inside {
            self.viewport.centre = at;
        }
    }
}
