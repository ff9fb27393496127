//! The mouse on an arm: goals, starts, turning and zooming.

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use crate::tui::app::App;
use crate::tui::projection::{Angle, Projection};
use gdg::viewer::arm::Request;

/// Zoom factor of one wheel step.
const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// How far a drag by a character turns the free projection, in rad: around the vertical axis, and
/// up or down.
const TURN: [f32; 2] = [0.04, 0.08];

impl App {
    /// Handles the mouse on the projections; returns whether it did anything.
    pub(in crate::tui) fn on_mouse_on_arm(&mut self, kind: MouseEventKind, at: Position) -> bool {
        let shown = &self.screen.layout.projections;
        let found = shown.iter().find(|projection| projection.frame.area.contains(at)).cloned();
        let from = self.dragged_from.take();
        if let (MouseEventKind::Drag(button), Some(from)) = (kind, from) {
            self.dragged_from = Some(at);
            self.drag(button, from, at, found.as_ref());
            return true;
        }
        let Some(projection) = found else { return false };
        let point = projection.point_at(at, self.screen.arm.goal);
        match kind {
            MouseEventKind::ScrollUp => self.zoom_arm(WHEEL_ZOOM_FACTOR, Some(point)),
            MouseEventKind::ScrollDown => self.zoom_arm(1.0 / WHEEL_ZOOM_FACTOR, Some(point)),
            MouseEventKind::Down(button) => {
                (self.screen.arm.shown.angle, self.screen.arm.turned) = (projection.angle, false);
                self.on_first_use();
                self.dragged_from = Some(at);
                match button {
                    // There, a drag turns the projection; a click sets the goal once the button is
                    // released.
                    MouseButton::Left if projection.angle == Angle::Free => {}
                    MouseButton::Left => self.set_arm_goal(point),
                    MouseButton::Right => self.viewer.request(Request::Start(Some(point))),
                    MouseButton::Middle => {}
                }
            }
            MouseEventKind::Up(MouseButton::Left)
                if projection.angle == Angle::Free && from.is_some() =>
            {
                if !self.screen.arm.turned {
                    self.set_arm_goal(point);
                }
            }
            _ => return false,
        }
        true
    }

    /// Handles a drag by one step.
    fn drag(
        &mut self,
        button: MouseButton,
        from: Position,
        to: Position,
        over: Option<&Projection>,
    ) {
        let moved = |from: u16, to: u16| f32::from(to) - f32::from(from);
        let [right, down] = [moved(from.x, to.x), moved(from.y, to.y)];
        let chosen = over.filter(|projection| projection.angle == self.screen.arm.shown.angle);
        match (button, chosen) {
            (MouseButton::Left, _) if self.screen.arm.shown.angle == Angle::Free => {
                self.screen.arm.turned = true;
                self.screen.arm.shown.orbit.turn(-TURN[0] * right, TURN[1] * down);
            }
            (MouseButton::Left, Some(projection)) => {
                let point = projection.point_at(to, self.screen.arm.goal);
                self.set_arm_goal(point);
            }
            (MouseButton::Middle, Some(projection)) => {
                let (at, was) =
                    (projection.point_at(to, [0.0; 3]), projection.point_at(from, [0.0; 3]));
                let focus = &mut self.screen.arm.shown.camera.focus;
                *focus = std::array::from_fn(|i| focus[i] + was[i] - at[i]);
            }
            _ => {}
        }
    }
}
