//! Dialogs above a run or a comparison: the topmost one is drawn last, and gets every event.

use crossterm::event::{KeyCode, KeyEvent, MouseButton, MouseEventKind};
use ratatui::Frame;
use ratatui::layout::Position;

use super::action::Mode;
use super::dialog::{Choice, Dialog};
use super::keymap::Keymap;
use super::layout::{Click, ScreenLayout};
use super::render::{dialog, help};
use super::scene::Scene;
use super::screen::Screen;

#[derive(Debug)]
pub enum Reply {
    Stays,
    Closes,
    Accepts,
    Picks(Choice),
}

/// Draws the topmost dialog, if there is one, and records where it is.
pub fn draw_dialog(frame: &mut Frame, screen: &Screen, scene: &Scene, layout: &mut ScreenLayout) {
    let Some(top) = screen.dialogs.last() else { return };
    // What is below a dialog does not react to clicks.
    layout.forget_clicks();
    match top {
        Dialog::Help(help) => help::draw(frame, screen, scene, help, layout),
        Dialog::Pick(picker) => dialog::draw_picker(frame, picker, layout),
        Dialog::Ask(prompt) => dialog::draw_prompt(frame, screen, prompt, layout),
    }
}

impl Dialog {
    /// Handles a key; below the dialog, the screen is in mode `behind`.
    pub fn key(&mut self, key: KeyEvent, keymap: &Keymap, behind: Mode) -> Reply {
        match (self, key.code) {
            (Self::Help(help), _) => {
                let closes = help.on_key(key, keymap.action(key, behind));
                if closes { Reply::Closes } else { Reply::Stays }
            }
            (_, KeyCode::Esc) => Reply::Closes,
            (_, KeyCode::Enter) => Reply::Accepts,
            (Self::Pick(picker), _) => {
                if picker.on_key(key) {
                    Reply::Accepts
                } else {
                    Reply::Stays
                }
            }
            (Self::Ask(prompt), _) => {
                prompt.on_key(key);
                Reply::Stays
            }
        }
    }

    pub fn mouse(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> Reply {
        let lines = match kind {
            MouseEventKind::ScrollUp => -1,
            MouseEventKind::ScrollDown => 1,
            MouseEventKind::Down(MouseButton::Left) => return self.click(at, layout),
            _ => return Reply::Stays,
        };
        match self {
            Self::Help(help) => help.scroll(3 * lines),
            Self::Pick(picker) => picker.move_selection(lines),
            Self::Ask(_) => {}
        }
        Reply::Stays
    }

    fn click(&mut self, at: Position, layout: &ScreenLayout) -> Reply {
        let (rows, first) = layout.rows;
        match (layout.click(at), self) {
            (Some(Click::Answer), _) => Reply::Accepts,
            (Some(Click::Act(action)), _) => Reply::Picks(Choice::Act(action)),
            (Some(Click::Close), _) | (None, Self::Help(_)) => Reply::Closes,
            _ if !layout.dialog.contains(at) => Reply::Closes,
            (None, Self::Pick(picker)) => {
                // A click below the last item picks nothing.
                let picks = rows.contains(at) && picker.select(first + usize::from(at.y - rows.y));
                if picks { Reply::Accepts } else { Reply::Stays }
            }
            (None, Self::Ask(_)) => Reply::Stays,
        }
    }

    pub fn paste(&mut self, text: &str) {
        match self {
            Self::Help(help) => help.search_for(text),
            Self::Pick(picker) => picker.insert(text),
            Self::Ask(prompt) => prompt.insert(text),
        }
    }
}
