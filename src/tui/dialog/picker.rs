//! A list to pick from, narrowed by typing.

use crossterm::event::{Event, KeyCode, KeyEvent};
use nucleo_matcher::pattern::{CaseMatching, Normalization, Pattern};
use nucleo_matcher::{Config, Matcher, Utf32Str};
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

use super::Choice;

/// Rows that Page Up and Page Down move the selection by.
const PAGE: isize = 10;

/// One line of a list.
#[derive(Clone, Debug)]
pub struct Item {
    /// The item's name.
    pub label: String,
    /// Further details.
    pub detail: String,
    /// What picking it does.
    pub choice: Choice,
}

impl Item {
    /// Creates an item.
    pub fn new(label: impl Into<String>, detail: impl Into<String>, choice: Choice) -> Self {
        Self { label: label.into(), detail: detail.into(), choice }
    }
}

/// A list with its search text and selection.
#[derive(Debug)]
pub struct Picker {
    /// The title.
    pub title: String,
    items: Vec<Item>,
    typed: Input,
    /// Indices of the items that match the search text, best first.
    shown: Vec<usize>,
    selected: usize,
}

impl Picker {
    /// Creates a list of all `items`, with the first one selected.
    pub fn new(title: impl Into<String>, items: Vec<Item>) -> Self {
        let shown = (0..items.len()).collect();
        Self { title: title.into(), items, typed: Input::default(), shown, selected: 0 }
    }

    /// Selects the first item whose choice satisfies `is`.
    #[must_use]
    pub fn selecting(mut self, is: impl Fn(&Choice) -> bool) -> Self {
        self.selected = self.items.iter().position(|item| is(&item.choice)).unwrap_or(0);
        self
    }

    /// Returns the search text and the cursor's column in it.
    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), self.typed.visual_cursor())
    }

    /// Returns the items shown, best first, and the index of the selected one.
    pub fn shown(&self) -> (impl Iterator<Item = &Item>, usize) {
        (self.shown.iter().map(|i| &self.items[*i]), self.selected)
    }

    /// Returns all items, shown or not.
    pub fn items(&self) -> impl Iterator<Item = &Item> {
        self.items.iter()
    }

    /// Returns the selected item's choice.
    pub fn choice(&self) -> Option<&Choice> {
        self.shown.get(self.selected).map(|i| &self.items[*i].choice)
    }

    /// Selects the shown item on row `row`; returns whether there is one.
    pub fn select(&mut self, row: usize) -> bool {
        let there = row < self.shown.len();
        if there {
            self.selected = row;
        }
        there
    }

    /// Moves the selection.
    pub fn move_selection(&mut self, by: isize) {
        let last = self.shown.len().saturating_sub(1);
        self.selected = self.selected.saturating_add_signed(by).min(last);
    }

    /// Handles a key.
    pub fn on_key(&mut self, key: KeyEvent) {
        match key.code {
            KeyCode::Up => self.move_selection(-1),
            KeyCode::Down => self.move_selection(1),
            KeyCode::PageUp => self.move_selection(-PAGE),
            KeyCode::PageDown => self.move_selection(PAGE),
            _ => {
                self.typed.handle_event(&Event::Key(key));
                self.filter();
            }
        }
    }

    /// Inserts pasted text.
    pub fn paste(&mut self, text: &str) {
        super::prompt::insert_first_line(&mut self.typed, text);
        self.filter();
    }

    fn filter(&mut self) {
        let pattern = Pattern::parse(self.typed.value(), CaseMatching::Ignore, Normalization::Smart);
        let mut matcher = Matcher::new(Config::DEFAULT);
        let mut buffer = Vec::new();
        let typed = self.typed.value().trim();
        let mut score = |item: &Item| {
            if item.label == typed {
                return Some(u32::MAX);
            }
            // A match in the label counts more than one in the detail.
            let of = |text: &str, matcher: &mut Matcher, buffer: &mut Vec<char>| {
                pattern.score(Utf32Str::new(text, buffer), matcher)
            };
            let label = of(&item.label, &mut matcher, &mut buffer).map(|s| 2 * s);
            label.max(of(&format!("{} {}", item.label, item.detail), &mut matcher, &mut buffer))
        };
        let scored = self.items.iter().enumerate().filter_map(|(i, item)| Some((i, score(item)?)));
        let mut scored: Vec<(usize, u32)> = scored.collect();
        scored.sort_by_key(|(i, score)| (std::cmp::Reverse(*score), *i));
        self.shown = scored.into_iter().map(|(i, _)| i).collect();
        self.selected = 0;
    }
}

#[cfg(test)]
mod tests {
    use crossterm::event::KeyModifiers;

    use super::*;

    fn picker() -> Picker {
        let item = |label: &str, detail: &str| Item::new(label, detail, Choice::Setting(label.to_owned()));
        Picker::new(
            "settings",
            vec![
                item("loss_scale", "-"),
                item("batch", "64"),
                item("learning_rate", "0.001"),
                item("loss", "sqrt: relative accuracy"),
            ],
        )
    }

    fn press(picker: &mut Picker, keys: &str) {
        keys.chars().for_each(|c| picker.on_key(KeyEvent::new(KeyCode::Char(c), KeyModifiers::NONE)));
    }

    #[test]
    fn typing_narrows_the_list_to_the_best_matches() {
        let mut picker = picker();
        press(&mut picker, "lrt");
        assert_eq!(picker.choice(), Some(&Choice::Setting("learning_rate".to_owned())));
        picker.on_key(KeyEvent::new(KeyCode::Char('u'), KeyModifiers::CONTROL));
        press(&mut picker, "accuracy");
        assert_eq!(picker.choice(), Some(&Choice::Setting("loss".to_owned())), "details are searched too");
        picker.on_key(KeyEvent::new(KeyCode::Char('u'), KeyModifiers::CONTROL));
        press(&mut picker, "loss");
        assert_eq!(picker.choice(), Some(&Choice::Setting("loss".to_owned())), "the exact name comes first");
        press(&mut picker, "zzz");
        assert_eq!(picker.choice(), None);
    }

    #[test]
    fn the_selection_stays_within_the_list() {
        let mut picker = picker();
        picker.move_selection(-5);
        assert_eq!(picker.shown().1, 0);
        picker.move_selection(99);
        assert_eq!(picker.shown().1, 3);
        assert!(!picker.select(4));
    }
}
