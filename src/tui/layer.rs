//! The layers above a run or a comparison: each draws itself, and handles keys and the mouse.

use std::ops::{Deref, DerefMut};

use crossterm::event::{KeyCode, KeyEvent, MouseButton, MouseEventKind};
use ratatui::Frame;
use ratatui::layout::Position;

use super::action::Mode;
use super::dialog::{Choice, Dialog, Help, Picker, Prompt};
use super::keymap::Keymap;
use super::layout::{Click, ScreenLayout};
use super::render::{dialog, help};
use super::scene::Scene;
use super::screen::Screen;

/// A layer above the run: while it is on top, it gets every event.
pub trait Layer {
    /// Draws it, and records where it is.
    fn draw(&self, frame: &mut Frame, screen: &Screen, scene: &Scene, layout: &mut ScreenLayout);

    /// Handles a key; below it, the screen is in mode `behind`.
    fn key(&mut self, key: KeyEvent, keymap: &Keymap, behind: Mode) -> Reply;

    fn mouse(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> Reply;

    fn paste(&mut self, text: &str);
}

/// What becomes of a layer after an event.
#[derive(Debug)]
pub enum Reply {
    Stays,
    /// Goes without an answer.
    Closes,
    Accepts,
    Picks(Choice),
}

/// Draws the topmost dialog, if there is one.
pub fn draw_dialog(frame: &mut Frame, screen: &Screen, scene: &Scene, layout: &mut ScreenLayout) {
    if let Some(top) = screen.dialogs.last() {
        // What is below a dialog does not react to clicks.
        layout.forget_clicks();
        top.draw(frame, screen, scene, layout);
    }
}

impl Deref for Dialog {
    type Target = dyn Layer;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Help(help) => help,
            Self::Pick(picker) => picker,
            Self::Ask(prompt) => prompt,
        }
    }
}

impl DerefMut for Dialog {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Help(help) => help,
            Self::Pick(picker) => picker,
            Self::Ask(prompt) => prompt,
        }
    }
}

/// Returns what a click on a dialog does, if it is on one of its buttons or outside.
fn reply_to_click(at: Position, layout: &ScreenLayout) -> Option<Reply> {
    match layout.click(at) {
        Some(Click::Answer) => Some(Reply::Accepts),
        Some(Click::Act(action)) => Some(Reply::Picks(Choice::Act(action))),
        None if layout.dialog.contains(at) => None,
        Some(Click::Close) | None => Some(Reply::Closes),
    }
}

impl Layer for Picker {
    fn draw(&self, frame: &mut Frame, screen: &Screen, _: &Scene, layout: &mut ScreenLayout) {
        dialog::draw_picker(frame, screen, self, layout);
    }

    fn key(&mut self, key: KeyEvent, keymap: &Keymap, _: Mode) -> Reply {
        let own = keymap.action(key, Mode::Settings).filter(|_| self.button().is_some());
        match (key.code, own) {
            (KeyCode::Esc, _) => Reply::Closes,
            (KeyCode::Enter, _) => Reply::Accepts,
            (_, Some(action)) => Reply::Picks(Choice::Act(action)),
            _ if self.on_key(key) => Reply::Accepts,
            _ => Reply::Stays,
        }
    }

    fn mouse(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> Reply {
        let (rows, first) = layout.rows;
        match kind {
            MouseEventKind::ScrollUp => self.move_selection(-1),
            MouseEventKind::ScrollDown => self.move_selection(1),
            MouseEventKind::Down(MouseButton::Left) => {
                // A click below the last item picks nothing.
                let picks = |this: &mut Self| {
                    rows.contains(at) && this.select(first + usize::from(at.y - rows.y))
                };
                return match reply_to_click(at, layout) {
                    Some(reply) => reply,
                    None if picks(self) => Reply::Accepts,
                    None => Reply::Stays,
                };
            }
            _ => {}
        }
        Reply::Stays
    }

    fn paste(&mut self, text: &str) {
        self.insert(text);
    }
}

impl Layer for Prompt {
    fn draw(&self, frame: &mut Frame, screen: &Screen, _: &Scene, layout: &mut ScreenLayout) {
        dialog::draw_prompt(frame, screen, self, layout);
    }

    fn key(&mut self, key: KeyEvent, _: &Keymap, _: Mode) -> Reply {
        match key.code {
            KeyCode::Esc => Reply::Closes,
            KeyCode::Enter => Reply::Accepts,
            _ => {
                self.on_key(key);
                Reply::Stays
            }
        }
    }

    fn mouse(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> Reply {
        let is_click = kind == MouseEventKind::Down(MouseButton::Left);
        is_click.then(|| reply_to_click(at, layout)).flatten().unwrap_or(Reply::Stays)
    }

    fn paste(&mut self, text: &str) {
        self.insert(text);
    }
}

impl Layer for Help {
    fn draw(&self, frame: &mut Frame, screen: &Screen, scene: &Scene, layout: &mut ScreenLayout) {
        help::draw(frame, screen, scene, self, layout);
    }

    fn key(&mut self, key: KeyEvent, keymap: &Keymap, behind: Mode) -> Reply {
        let [action, own] = [behind, Mode::Help].map(|mode| keymap.action(key, mode));
        if self.on_key(key, action, own) { Reply::Closes } else { Reply::Stays }
    }

    fn mouse(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> Reply {
        match (kind, layout.click(at)) {
            (MouseEventKind::ScrollUp, _) => self.scroll(-3),
            (MouseEventKind::ScrollDown, _) => self.scroll(3),
            (MouseEventKind::Down(_), Some(Click::Act(action))) => {
                return Reply::Picks(Choice::Act(action));
            }
            (MouseEventKind::Down(_), _) => return Reply::Closes,
            _ => {}
        }
        Reply::Stays
    }

    fn paste(&mut self, text: &str) {
        self.search_for(text);
    }
}
