//! The mouse on a run, where nothing is clickable: `scene` handles most of it.

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use super::{Cx, Session};
use crate::tui::action::Action;

impl Session {
    pub fn on_mouse(&mut self, kind: MouseEventKind, at: Position) {
        if self.moves_tour_on(kind) {
            return;
        }
        let Cx { screen, scene, link, .. } = &mut self.cx;
        if !screen.maximised && scene.on_mouse(kind, at, screen, link) {
            return;
        }
        match kind {
            MouseEventKind::ScrollUp => screen.scroll(-1),
            MouseEventKind::ScrollDown => screen.scroll(1),
            MouseEventKind::Down(MouseButton::Left | MouseButton::Right)
                if !screen.maximised
                    && (scene.is_editing() || screen.layout.map_pane.contains(at)) =>
            {
                let drawn = if scene.maze().is_some() { "map" } else { "picture" };
                screen.say(&format!("a click outside of the {drawn} changes nothing"));
            }
            _ => {}
        }
    }

    /// Has a click move the tour on; returns whether that is all it does. The click that ends the
    /// tour sets a goal.
    fn moves_tour_on(&mut self, kind: MouseEventKind) -> bool {
        let Some(tour) = self.screen.tour.as_ref().filter(|_| !self.scene.is_editing()) else {
            return false;
        };
        let last = tour.is_last;
        match kind {
            MouseEventKind::Down(MouseButton::Left) => self.act(Action::NextTourStep),
            MouseEventKind::Drag(MouseButton::Left) => {}
            _ => return false,
        }
        !last
    }
}
