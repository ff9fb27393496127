//! The mouse on an arm: goals, starts, turning and zooming.

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use super::ArmState;
use crate::tui::link::Link;
use crate::tui::projection::{Angle, Projection};
use crate::tui::screen::Screen;
use gdg::viewer::arm::Request;

/// Zoom factor of one wheel step.
const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// How far a drag by a character turns the free projection, in rad: around the vertical axis, and
/// up or down.
const TURN: [f32; 2] = [0.04, 0.08];

impl ArmState {
    /// Handles the mouse on the projections; returns whether it did anything.
    pub fn on_mouse(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        screen: &mut Screen,
        link: &mut Link,
    ) -> bool {
        let shown = &screen.layout.projections;
        let found = shown.iter().find(|projection| projection.frame.area.contains(at)).cloned();
        let from = self.dragged_from.take();
        if let (MouseEventKind::Drag(button), Some(from)) = (kind, from) {
            self.dragged_from = Some(at);
            match (button, found) {
                (MouseButton::Left, Some(projection)) if self.drags_goal(&projection) => {
                    let point = projection.point_at(at, self.goal);
                    self.set_goal(point, screen, link);
                }
                (_, found) => self.drag(button, [from, at], found.as_ref()),
            }
            return true;
        }
        let Some(projection) = found else { return false };
        let point = projection.point_at(at, self.goal);
        match kind {
            MouseEventKind::ScrollUp => self.zoom(WHEEL_ZOOM_FACTOR, Some(point)),
            MouseEventKind::ScrollDown => self.zoom(1.0 / WHEEL_ZOOM_FACTOR, Some(point)),
            MouseEventKind::Down(button) => {
                (self.shown.angle, self.turned) = (projection.angle, false);
                screen.on_first_use();
                self.dragged_from = Some(at);
                match button {
                    // There, a drag turns the projection; a click sets the goal once the button is
                    // released.
                    MouseButton::Left if projection.angle == Angle::Free => {}
                    MouseButton::Left => self.set_goal(point, screen, link),
                    MouseButton::Right => link.request(Request::Start(Some(point))),
                    MouseButton::Middle => {}
                }
            }
            MouseEventKind::Up(MouseButton::Left)
                if projection.angle == Angle::Free && from.is_some() =>
            {
                if !self.turned {
                    self.set_goal(point, screen, link);
                }
            }
            _ => return false,
        }
        true
    }

    /// Returns whether a drag over a projection moves the goal along.
    fn drags_goal(&self, over: &Projection) -> bool {
        self.shown.angle != Angle::Free && over.angle == self.shown.angle
    }

    /// Turns or moves what is shown along with the mouse.
    fn drag(&mut self, button: MouseButton, [from, to]: [Position; 2], over: Option<&Projection>) {
        let moved = |from: u16, to: u16| f32::from(to) - f32::from(from);
        let chosen = over.filter(|projection| projection.angle == self.shown.angle);
        match (button, chosen) {
            (MouseButton::Left, _) if self.shown.angle == Angle::Free => {
                let [right, down] = [moved(from.x, to.x), moved(from.y, to.y)];
                self.turned = true;
                self.shown.orbit.turn(-TURN[0] * right, TURN[1] * down);
            }
            (MouseButton::Middle, Some(projection)) => {
                let [was, at] = [from, to].map(|at| projection.point_at(at, [0.0; 3]));
                let focus = &mut self.shown.camera.focus;
                *focus = std::array::from_fn(|i| focus[i] + was[i] - at[i]);
            }
            _ => {}
        }
    }
}
