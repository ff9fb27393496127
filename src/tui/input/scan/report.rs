//! Reports keys and pastes.

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};

use super::sequence::event_of;
use super::{Escape, Input, LONGEST_PASTE, Scanner};

impl Scanner {
    /// Reports the bytes held as a key.
    pub(super) fn report_held(&mut self) {
        self.found.extend(event_of(&self.held).map(Input::Event));
    }

    /// Reports the key Esc, unless it has been reported.
    pub(super) fn report_escape(&mut self) {
        if self.escape != Escape::Reported {
            self.report_key(KeyCode::Esc, KeyModifiers::NONE);
        }
    }

    /// Reports ESC and an introducer as a key with Alt, or as two keys.
    pub(super) fn report_introducer(&mut self) {
        let character = char::from(self.held[1]);
        let shift = if character.is_uppercase() { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
        let alt =
            if self.escape == Escape::Together { KeyModifiers::ALT } else { KeyModifiers::NONE };
        if self.escape == Escape::Apart {
            self.report_escape();
        }
        self.report_key(KeyCode::Char(character), shift | alt);
    }

    /// Reports a key.
    pub(super) fn report_key(&mut self, code: KeyCode, modifiers: KeyModifiers) {
        self.found.push(Input::Event(Event::Key(KeyEvent::new(code, modifiers))));
    }

    /// Reports a paste, without the last bytes.
    pub(super) fn report_paste(&mut self, without: usize) {
        self.held.truncate(self.held.len().saturating_sub(without).min(LONGEST_PASTE));
        let text = String::from_utf8_lossy(&self.held).into_owned();
        self.held = Vec::new();
        self.found.push(Input::Event(Event::Paste(text)));
    }
}
