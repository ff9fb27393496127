//! A list to pick from, narrowed by typing.

use crossterm::event::{Event, KeyCode, KeyEvent};
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

use super::Choice;
use super::item::Item;
use super::prompt::cursor_column;
use super::ranking::Ranking;
use crate::tui::action::Action;

/// Rows that Page Up and Page Down move the selection by.
const PAGE: isize = 10;

/// A row of a list.
#[derive(Clone, Copy, Debug)]
pub enum Row<'a> {
    /// The title of a group.
    Title(&'static str),
    /// An item, and whether it is selected.
    Item(&'a Item, bool),
}

/// A list with its search text and selection.
#[derive(Debug)]
pub struct Picker {
    /// The title.
    pub title: String,
    /// What is shown above the items; empty for nothing.
    pub text: String,
    /// Another action on the selected item.
    pub button: Option<(Action, &'static str)>,
    /// Whether search results are sorted by group first, then by score.
    pub keeps_groups: bool,
    items: Vec<Item>,
    typed: Input,
    /// Indices of the items that match the search text, best first.
    shown: Vec<usize>,
    selected: usize,
}

impl Picker {
    /// Creates a list of all `items`, with the first one selected. If an item has a key, the list
    /// is a question: keys answer it instead of searching.
    pub fn new(title: impl Into<String>, items: Vec<Item>) -> Self {
        let shown = (0..items.len()).collect();
        let (title, typed) = (title.into(), Input::default());
        let text = String::new();
        Self { title, text, button: None, keeps_groups: false, items, typed, shown, selected: 0 }
    }

    /// Shows a text above the items.
    #[must_use]
    pub fn explaining(self, text: String) -> Self {
        Self { text, ..self }
    }

    /// Selects the first item whose choice satisfies `is`.
    #[must_use]
    pub fn selecting(mut self, is: impl Fn(&Choice) -> bool) -> Self {
        self.selected = self.items.iter().position(|item| is(&item.choice)).unwrap_or(0);
        self
    }

    /// Replaces the items; their number must stay the same.
    pub fn update(&mut self, items: Vec<Item>) {
        if items.len() == self.items.len() {
            self.items = items;
        }
    }

    /// Returns whether the list is a question.
    pub fn is_question(&self) -> bool {
        self.items.iter().any(|item| item.key.is_some())
    }

    /// Returns the search text and the cursor's column in it.
    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), cursor_column(&self.typed))
    }

    /// Returns the rows shown: the best matches first, or all items by group.
    pub fn rows(&self) -> Vec<Row<'_>> {
        let mut rows = Vec::new();
        let mut group = "";
        for (n, i) in self.shown.iter().enumerate() {
            let item = &self.items[*i];
            if self.typed.value().is_empty() && item.group != group {
                rows.push(Row::Title(item.group));
                group = item.group;
            }
            rows.push(Row::Item(item, n == self.selected));
        }
        rows
    }

    /// Returns the number of rows without a search text.
    pub fn most_rows(&self) -> usize {
        let titles = self
            .items
            .chunk_by(|a, b| a.group == b.group)
            .filter(|group| !group[0].group.is_empty());
        self.items.len() + titles.count()
    }

    /// Returns all items, shown or not.
    pub fn items(&self) -> impl Iterator<Item = &Item> {
        self.items.iter()
    }

    /// Returns the selected item.
    pub fn item(&self) -> Option<&Item> {
        self.shown.get(self.selected).map(|i| &self.items[*i])
    }

    /// Returns the selected item's choice.
    pub fn choice(&self) -> Option<&Choice> {
        self.item().map(|item| &item.choice)
    }

    /// Selects the item on a row of [`Self::rows`]; returns whether there is one.
    pub fn select(&mut self, row: usize) -> bool {
        let rows = self.rows();
        let there = matches!(rows.get(row), Some(Row::Item(..)));
        if there {
            self.selected = rows[..row].iter().filter(|row| matches!(row, Row::Item(..))).count();
        }
        there
    }

    /// Moves the selection.
    pub fn move_selection(&mut self, by: isize) {
        let last = self.shown.len().saturating_sub(1);
        self.selected = self.selected.saturating_add_signed(by).min(last);
    }

    /// Handles a key; returns whether it picks the selected item.
    pub fn on_key(&mut self, key: KeyEvent) -> bool {
        match key.code {
            KeyCode::Up => self.move_selection(-1),
            KeyCode::Down => self.move_selection(1),
            KeyCode::PageUp => self.move_selection(-PAGE),
            KeyCode::PageDown => self.move_selection(PAGE),
            KeyCode::Char(c) if self.is_question() => {
                let at =
                    self.items.iter().position(|item| item.key == Some(c.to_ascii_lowercase()));
                self.selected = at.unwrap_or(self.selected);
                return at.is_some();
            }
            _ if self.is_question() => {}
            // Elsewhere this starts a search; here, typing does.
            KeyCode::Char('/') if self.typed.value().is_empty() => {}
            _ => {
                let before = self.typed.value().to_owned();
                self.typed.handle_event(&Event::Key(key));
                if self.typed.value() != before {
                    self.filter();
                }
            }
        }
        false
    }

    /// Inserts pasted text.
    pub fn paste(&mut self, text: &str) {
        if !self.is_question() {
            super::prompt::insert_first_line(&mut self.typed, text);
            self.filter();
        }
    }

    /// Searches for a text if it is a part of an item's name.
    pub fn search_names(&mut self, text: &str) {
        let text = text.trim().to_lowercase().replace(' ', "_");
        if !text.is_empty() && self.items.iter().any(|item| item.label.contains(&text)) {
            self.paste(&text);
        }
    }

    fn filter(&mut self) {
        let ranking = Ranking::new(self.typed.value());
        let scored =
            self.items.iter().enumerate().filter_map(|(i, item)| Some((i, ranking.score(item)?)));
        let mut scored: Vec<(usize, u32)> = scored.collect();
        // Abbreviations count only if no word matches.
        if scored.iter().any(|(_, score)| *score > Ranking::GUESS) {
            scored.retain(|(_, score)| *score > Ranking::GUESS);
        }
        let group = |i: usize| {
            let first = || self.items.iter().position(|item| item.group == self.items[i].group);
            self.keeps_groups.then(first).flatten()
        };
        scored.sort_by_cached_key(|(i, score)| (group(*i), std::cmp::Reverse(*score), *i));
        self.shown = scored.into_iter().map(|(i, _)| i).collect();
        self.selected = 0;
    }
}

#[cfg(test)]
mod tests {
    use crossterm::event::KeyModifiers;

    use super::*;

    #[test]
    fn typing_narrows_the_list_to_the_best_matches() {
        let items = [
            ("loss_scale", "-"),
            ("batch", "64"),
            ("learning_rate", "0.001"),
            ("loss", "sqrt: relative accuracy"),
        ];
        let item = |(name, detail): (&str, &str)| Item::new(name, detail, Choice::Nothing);
        let mut picker = Picker::new("settings", items.map(item).to_vec());
        // Details are searched too, and the exact name comes first.
        for (keys, found) in [
            ("lr", Some("learning_rate")),
            ("accuracy", Some("loss")),
            ("loss", Some("loss")),
            ("losszzz", None),
            ("/accuracy", Some("loss")),
        ] {
            picker.on_key(KeyEvent::new(KeyCode::Char('u'), KeyModifiers::CONTROL));
            for c in keys.chars() {
                picker.on_key(KeyEvent::new(KeyCode::Char(c), KeyModifiers::NONE));
            }
            assert_eq!(picker.item().map(|item| item.label.as_str()), found, "{keys}");
        }
        picker.move_selection(-5);
        assert!(!picker.select(4), "the selection stays within the list");
    }
}
