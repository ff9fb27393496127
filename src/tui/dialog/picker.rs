//! A list to pick from, narrowed by typing.

use crossterm::event::{Event, KeyCode, KeyEvent};
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

use super::{Choice, cursor_column, insert_first_line};
use crate::tui::action::Action;

/// Rows that Page Up and Page Down move the selection by.
const PAGE: isize = 10;

/// One line of a list.
#[derive(Clone, Debug)]
pub struct Item {
    pub label: String,
    pub detail: String,
    /// The title above the first item of a group; empty for none.
    pub group: &'static str,
    /// Further lines below the list while the item is selected.
    pub below: Vec<String>,
    /// The name of its action; empty for none.
    pub name: &'static str,
    pub words: String,
    /// Whether it is marked, such as a setting that differs from its default.
    pub marked: bool,
    /// The key that picks it in a question.
    pub key: Option<char>,
    pub choice: Choice,
}

impl Item {
    pub fn new(label: impl Into<String>, detail: impl Into<String>, choice: Choice) -> Self {
        Self {
            label: label.into(),
            detail: detail.into(),
            group: "",
            below: Vec::new(),
            name: "",
            words: String::new(),
            marked: false,
            key: None,
            choice,
        }
    }

    #[must_use]
    pub fn on(self, key: char) -> Self {
        Self { key: Some(key), ..self }
    }

    #[must_use]
    pub fn within(self, group: &'static str) -> Self {
        Self { group, ..self }
    }
}

/// A row of a list.
#[derive(Clone, Copy, Debug)]
pub enum Row<'a> {
    /// The title of a group.
    Title(&'static str),
    /// An item, and whether it is selected.
    Item(&'a Item, bool),
}

/// Lists that are kept up to date while they are open, and others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListKind {
    Plain,
    Settings,
    /// The question whether to save before quitting.
    Quit,
}

/// A list with its search text and selection.
#[derive(Debug)]
pub struct Picker {
    pub title: String,
    /// What is shown above the items; empty for nothing.
    pub text: String,
    pub kind: ListKind,
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
        Self {
            title,
            text,
            kind: ListKind::Plain,
            keeps_groups: false,
            items,
            typed,
            shown,
            selected: 0,
        }
    }

    /// Makes it a list of this kind.
    #[must_use]
    pub fn of(self, kind: ListKind) -> Self {
        Self { kind, ..self }
    }

    pub fn button(&self) -> Option<(Action, &'static str)> {
        (self.kind == ListKind::Settings).then_some((Action::ResetSetting, "default"))
    }

    pub fn into_items(self) -> Vec<Item> {
        self.items
    }

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

    pub fn is_question(&self) -> bool {
        self.items.iter().any(|item| item.key.is_some())
    }

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

    pub fn most_rows(&self) -> usize {
        let titles = self
            .items
            .chunk_by(|a, b| a.group == b.group)
            .filter(|group| !group[0].group.is_empty());
        self.items.len() + titles.count()
    }

    pub fn items(&self) -> impl Iterator<Item = &Item> {
        self.items.iter()
    }

    pub fn item(&self) -> Option<&Item> {
        self.shown.get(self.selected).map(|i| &self.items[*i])
    }

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

    pub fn insert(&mut self, text: &str) {
        if !self.is_question() {
            insert_first_line(&mut self.typed, text);
            self.filter();
        }
    }

    /// Searches for a text if it is a part of an item's name.
    pub fn search_names(&mut self, text: &str) {
        let text = text.trim().to_lowercase().replace(' ', "_");
        if !text.is_empty() && self.items.iter().any(|item| item.label.contains(&text)) {
            self.insert(&text);
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

/// Scores of a typed word that equals a word or is its prefix, in an item's name, in its search
/// words and in its details; and of one inside a word of the name.
const NAME: [u32; 2] = [100, 70];
const WORDS: [u32; 2] = [90, 60];
const DETAIL: [u32; 2] = [30, 20];
const WITHIN_NAME: u32 = 40;

/// Bonus for a name that begins with a typed word, and for a word in both name and search words.
const FIRST: u32 = 5;
const IN_BOTH: u32 = 10;

/// Stop words.
const FILLERS: [&str; 7] = ["a", "an", "the", "of", "in", "to", "for"];

/// Ranks items by a search text.
struct Ranking {
    typed: String,
    /// Its words, without stop words unless there are no others.
    words: Vec<String>,
}

impl Ranking {
    /// Score of a name that the typed letters abbreviate.
    const GUESS: u32 = 1;

    fn new(typed: &str) -> Self {
        let typed = typed.trim().to_lowercase();
        let all: Vec<String> = typed.split_whitespace().map(str::to_owned).collect();
        let telling: Vec<String> =
            all.iter().filter(|word| !FILLERS.contains(&word.as_str())).cloned().collect();
        Self { typed, words: if telling.is_empty() { all } else { telling } }
    }

    /// Returns how well `item` matches, or `None` if it does not. Every typed word must match, or
    /// the typed letters must abbreviate the name.
    fn score(&self, item: &Item) -> Option<u32> {
        let name = item.label.to_lowercase();
        if self.typed.is_empty() {
            return Some(0);
        }
        if name == self.typed {
            return Some(u32::MAX);
        }
        // The action's own name comes first, with or without its hyphens.
        let own = item.name.replace('-', " ");
        if own == self.typed.replace('-', " ") {
            return Some(u32::MAX - 1);
        }
        let words = item.words.to_lowercase();
        let detail = item.detail.to_lowercase();
        let below = item.below.join(" ").to_lowercase();
        let of_one = |typed: &str| {
            let of_name = in_words(&name, typed, NAME)
                .map(|score| score + if name.starts_with(typed) { FIRST } else { 0 })
                .or(name.contains(typed).then_some(WITHIN_NAME));
            let of_detail = in_words(&detail, typed, DETAIL).max(in_words(&below, typed, DETAIL));
            let of_words = in_words(&words, typed, WORDS);
            let in_both = if of_name.is_some() && of_words.is_some() { IN_BOTH } else { 0 };
            of_name.max(of_words).max(of_detail).map(|score| score + in_both)
        };
        // Settings have underscores where users may type hyphens.
        let of = |typed: &String| of_one(typed).max(of_one(&typed.replace('-', "_")));
        let all: Option<u32> = self.words.iter().map(of).sum();
        all.or_else(|| abbreviates(&self.typed, &name).then_some(Self::GUESS))
    }
}

/// Returns whether `letters` abbreviates `name`: in order, each letter begins a word or directly
/// follows the letter before.
fn abbreviates(letters: &str, name: &str) -> bool {
    let (letters, name): (Vec<char>, Vec<char>) =
        (letters.chars().collect(), name.chars().collect());
    // The positions after each match of the letters so far.
    let mut ends = vec![0];
    for (n, letter) in letters.iter().enumerate() {
        let begins_word = |i: usize| i == 0 || !name[i - 1].is_alphanumeric();
        let matches =
            |i: usize| name[i] == *letter && (begins_word(i) || n > 0 && ends.contains(&i));
        let first = ends.iter().min().copied().unwrap_or(name.len());
        ends = (first..name.len()).filter(|i| matches(*i)).map(|i| i + 1).collect();
    }
    !ends.is_empty()
}

/// Returns the score of a word in a text: `[whole, begins]`.
fn in_words(text: &str, typed: &str, [whole, begins]: [u32; 2]) -> Option<u32> {
    let mut words =
        text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '@').flat_map(|word| {
            // The parts of a setting's name count as words as well.
            std::iter::once(word).chain(word.split('_'))
        });
    let best = |word: &str| match word {
        _ if word == typed => Some(whole),
        _ if word.starts_with(typed) => Some(begins),
        _ => None,
    };
    words.by_ref().filter_map(best).max()
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
