//! The help: its scroll position and search.

use crossterm::event::{Event, KeyCode, KeyEvent};
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

use crate::tui::action::Action;

/// The state of the help.
#[derive(Debug, Default)]
pub struct Help {
    /// The first line shown.
    pub first: usize,
    /// The lines that fit on the screen.
    pub page: usize,
    /// The search text.
    search: Input,
    /// Whether keys go to the search text.
    pub searching: bool,
}

impl Help {
    /// Returns the search text.
    pub fn search(&self) -> &str {
        self.search.value()
    }

    /// Scrolls by a number of lines.
    pub fn scroll(&mut self, lines: isize) {
        self.first = self.first.saturating_add_signed(lines);
    }

    /// Scrolls by a page, except for one line that stays in view.
    pub fn scroll_page(&mut self, down: bool) {
        let page = isize::try_from(self.page.saturating_sub(1).max(1)).unwrap_or(1);
        self.scroll(if down { page } else { -page });
    }

    /// Handles a key, which means `action` on the screen behind the help, and `own` in the help;
    /// returns whether the help is to close.
    pub fn on_key(&mut self, key: KeyEvent, action: Option<Action>, own: Option<Action>) -> bool {
        match (key.code, action) {
            (KeyCode::Up, _) => self.scroll(-1),
            (KeyCode::Down, _) => self.scroll(1),
            (KeyCode::PageUp, _) => self.scroll_page(false),
            (KeyCode::PageDown, _) => self.scroll_page(true),
            _ if self.searching => self.on_search_key(key),
            _ if own == Some(Action::SearchHelp) => self.searching = true,
            (_, Some(Action::Close)) if !self.search().is_empty() => self.clear_search(),
            (_, Some(Action::Help | Action::Close | Action::Quit)) => return true,
            (_, Some(Action::Move(0, dy))) => self.scroll(dy),
            (KeyCode::Char(' '), _) => self.scroll_page(true),
            (KeyCode::Home, _) => self.first = 0,
            (KeyCode::End, _) => self.first = usize::MAX,
            _ => {}
        }
        false
    }

    /// Handles a key while searching: Enter keeps the search, Esc ends it.
    fn on_search_key(&mut self, key: KeyEvent) {
        self.first = 0;
        match key.code {
            KeyCode::Enter => self.searching = false,
            KeyCode::Esc => self.clear_search(),
            _ => drop(self.search.handle_event(&Event::Key(key))),
        }
    }

    /// Shows everything again.
    pub fn clear_search(&mut self) {
        (self.searching, self.first) = (false, 0);
        self.search.reset();
    }

    /// Inserts pasted text into the search.
    pub fn paste(&mut self, text: &str) {
        self.searching = true;
        super::prompt::insert_first_line(&mut self.search, text);
    }
}
