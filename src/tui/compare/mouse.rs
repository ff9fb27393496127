//! The mouse: what it does on one map happens on both.

use crossterm::event::{Event, MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

use super::Comparison;
use crate::tui::interface::Interface;
use crate::tui::layout::Click;

impl Comparison {
    pub(super) fn on_mouse(&mut self, mouse: MouseEvent) {
        let at = Position::new(mouse.column, mouse.row);
        if mouse.kind == MouseEventKind::Down(MouseButton::Left)
            && let Some(Click::Act(action)) = self.layout.click(at)
        {
            return self.act(action);
        }
        let left =
            [MouseEventKind::Down(MouseButton::Left), MouseEventKind::Drag(MouseButton::Left)];
        let moment = self.layout.charts.iter().find_map(|chart| chart.value_at(at));
        if let Some(moment) = moment.filter(|_| left.contains(&mouse.kind) && !self.is_editing()) {
            return self.look_at(moment);
        }
        // A drag belongs to the side on which it began.
        if !matches!(mouse.kind, MouseEventKind::Drag(_) | MouseEventKind::Up(_)) {
            let on = |side: &super::Side| side.app.screen.layout.map_pane.contains(at);
            let Some(own) = self.sides.iter().position(on) else { return };
            self.mouse_on = own;
        }
        let own = self.mouse_on;
        let cell = self.sides[own].app.screen.layout.map.as_ref();
        let cell = cell.and_then(|frame| frame.cell_at(at, &self.sides[own].maze().map));
        if mouse.kind == MouseEventKind::Down(MouseButton::Right) && !self.is_editing() {
            let start = cell.and_then(|cell| self.sides[own].maze().map.nearest_free(cell));
            match start {
                Some(start) => self.start_race(start, self.race.goal()),
                None => self.notify("a click outside of the map changes nothing"),
            }
            return;
        }
        let editing = self.is_editing();
        if editing {
            self.hold_editor(own);
        }
        self.sides[own].app.on_event(&Event::Mouse(mouse));
        if editing {
            return self.share_edit();
        }
        self.goal_from(own);
        self.mirror(own);
    }

    /// Shows the same part of the map, and describes the same cell, on the other side.
    pub(super) fn mirror(&mut self, own: usize) {
        let maze = self.sides[own].maze();
        let (viewport, hovered) = (maze.viewport, maze.hovered);
        self.sides[1 - own].app.in_maze(|maze, _, link| {
            maze.viewport = viewport;
            maze.hover(hovered, link);
        });
    }
}
