//! The mouse: what is clickable, dialogs and the wheel; `scene` handles the rest.

use crossterm::event::{MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;

use super::{App, time};
use crate::tui::action::Action;
use crate::tui::dialog::Dialog;
use crate::tui::layout::Click;

impl App {
    pub(super) fn on_mouse(&mut self, mouse: MouseEvent) {
        let at = Position::new(mouse.column, mouse.row);
        match mouse.kind {
            MouseEventKind::Down(_) => self.press_is_spent = !self.screen.dialogs.is_empty(),
            MouseEventKind::Drag(_) if self.press_is_spent => return,
            MouseEventKind::Up(_) if std::mem::take(&mut self.press_is_spent) => return,
            _ => {}
        }
        if !self.screen.dialogs.is_empty() {
            return self.on_mouse_in_dialog(mouse.kind, at);
        }
        if mouse.kind == MouseEventKind::Down(MouseButton::Left)
            && let Some(Click::Act(action)) = self.screen.layout.click(at)
        {
            self.press_is_spent = true;
            return self.act(action);
        }
        let drawing = self.scene.is_drawing();
        let pressed = matches!(
            mouse.kind,
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left)
        );
        if let Some(at) = self
            .screen
            .layout
            .charts
            .iter()
            .find_map(|chart| chart.value_at(at))
            .filter(|_| pressed && !drawing)
        {
            return self.in_scene(|_, screen, link| time::look_at_curves(at, screen, link));
        }
        if self.moves_tour_on(mouse.kind) {
            return;
        }
        let kind = mouse.kind;
        if self.screen.maximised
            || !self.in_scene(|scene, screen, link| scene.on_mouse(kind, at, screen, link))
        {
            self.on_wheel(kind);
            self.on_click_outside(kind, at);
        }
    }

    /// Says that a click beside what is drawn does nothing.
    fn on_click_outside(&mut self, kind: MouseEventKind, at: Position) {
        let is_click = matches!(kind, MouseEventKind::Down(MouseButton::Left | MouseButton::Right));
        let expects_map = self.scene.is_editing() || self.screen.layout.map_pane.contains(at);
        if is_click && expects_map && !self.screen.maximised {
            let drawn = if self.scene.maze().is_some() { "map" } else { "picture" };
            self.screen.say(&format!("a click outside of the {drawn} changes nothing"));
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

    /// Scrolls curves and log.
    fn on_wheel(&mut self, kind: MouseEventKind) {
        match kind {
            MouseEventKind::ScrollUp => self.act(Action::Scroll(-1)),
            MouseEventKind::ScrollDown => self.act(Action::Scroll(1)),
            _ => {}
        }
    }

    fn on_mouse_in_dialog(&mut self, kind: MouseEventKind, at: Position) {
        let (rows, first) = self.screen.layout.rows;
        if let (Some(Dialog::Pick(_) | Dialog::Ask(_)), MouseEventKind::Down(MouseButton::Left)) =
            (self.screen.dialogs.last(), kind)
        {
            match self.screen.layout.click(at) {
                Some(Click::Answer) => return self.answer(),
                Some(Click::Act(action)) => return self.act(action),
                None if self.screen.layout.dialog.contains(at) => {}
                Some(Click::Close) | None => return self.dismiss(),
            }
        }
        match (self.screen.dialogs.last_mut(), kind) {
            (Some(Dialog::Help(help)), MouseEventKind::ScrollUp) => help.scroll(-3),
            (Some(Dialog::Help(help)), MouseEventKind::ScrollDown) => help.scroll(3),
            (Some(Dialog::Help(_)), MouseEventKind::Down(_)) => {
                match self.screen.layout.click(at) {
                    Some(Click::Act(action)) => self.act(action),
                    _ => self.dismiss(),
                }
            }
            (Some(Dialog::Pick(picker)), MouseEventKind::ScrollUp) => picker.move_selection(-1),
            (Some(Dialog::Pick(picker)), MouseEventKind::ScrollDown) => picker.move_selection(1),
            (Some(Dialog::Pick(picker)), MouseEventKind::Down(MouseButton::Left))
                if rows.contains(at) =>
            {
                // A click below the last item picks nothing.
                let row = first + usize::from(at.y - rows.y);
                if picker.select(row) {
                    self.answer();
                }
            }
            _ => {}
        }
        self.preview();
    }
}
