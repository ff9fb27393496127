//! Dialogs on top of the screen: a list to pick from, such as the help, and a question to answer.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEventKind};
use ratatui::layout::Position;
use tui_input::backend::crossterm::EventHandler;
use tui_input::{Input, InputRequest};

use super::action::Action;
use super::theme::ThemeName;
use crate::tui::choices::ExportKind;
use crate::tui::layout::{Click, ScreenLayout};
use gdg::map::{Grid, RandomMapKind};
use gdg::text::display_width;
use gdg::train::{Method, Preset, Run};
use gdg::viewer::Field;

const MAX_CHARACTERS: usize = 500;

#[derive(Debug)]
pub enum Dialog {
    Pick(Picker),
    Ask(Prompt),
}

/// What an event does to a dialog.
#[derive(Debug)]
pub enum Reply {
    Stays,
    Closes,
    Accepts,
    Picks(Choice),
}

impl Dialog {
    /// Whether it is the question that quitting asks.
    pub fn asks_to_quit(&self) -> bool {
        let quits = |item: &Item| item.choice == Choice::Quit { save: false };
        matches!(self, Self::Pick(picker) if picker.items.iter().any(quits))
    }

    pub fn key(&mut self, key: KeyEvent) -> Reply {
        match (self, key.code) {
            (_, KeyCode::Esc) => Reply::Closes,
            // The key that opens the help closes it, too.
            (Self::Pick(list), KeyCode::Char('?')) if list.typed().0.is_empty() => Reply::Closes,
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
        if let Self::Pick(picker) = self {
            picker.move_selection(3 * lines);
        }
        Reply::Stays
    }

    fn click(&mut self, at: Position, layout: &ScreenLayout) -> Reply {
        let (rows, first) = layout.rows;
        match (layout.click(at), self) {
            (Some(Click::Answer), _) => Reply::Accepts,
            (Some(Click::Act(action)), _) => Reply::Picks(Choice::Act(action)),
            (Some(Click::Close), _) => Reply::Closes,
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
            Self::Pick(picker) => picker.insert(text),
            Self::Ask(prompt) => prompt.insert(text),
        }
    }
}

impl From<Picker> for Dialog {
    fn from(picker: Picker) -> Self {
        Self::Pick(picker)
    }
}

impl From<Prompt> for Dialog {
    fn from(prompt: Prompt) -> Self {
        Self::Ask(prompt)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Question {
    Setting(String),
    SaveAs,
    SaveMap,
}

/// A question and the answer typed so far.
#[derive(Debug)]
pub struct Prompt {
    pub title: String,
    /// What a valid answer looks like.
    pub hint: String,
    /// What was wrong with the last answer.
    pub error: Option<String>,
    pub question: Question,
    typed: Input,
    /// The initial answer has not been edited: typing replaces it.
    pub untouched: bool,
}

impl Prompt {
    pub fn new(
        question: Question,
        title: impl Into<String>,
        hint: impl Into<String>,
        answer: impl Into<String>,
    ) -> Self {
        Self {
            title: title.into(),
            hint: hint.into(),
            error: None,
            question,
            typed: Input::new(answer.into()),
            untouched: true,
        }
    }

    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), cursor_column(&self.typed))
    }

    pub fn on_key(&mut self, key: KeyEvent) {
        self.error = None;
        let types =
            matches!(key.code, KeyCode::Char(_)) && !key.modifiers.contains(KeyModifiers::CONTROL);
        self.touch(types);
        if self.typed.value().chars().count() < MAX_CHARACTERS
            || !matches!(key.code, KeyCode::Char(_))
        {
            self.typed.handle_event(&Event::Key(key));
        }
    }

    fn touch(&mut self, types: bool) {
        if std::mem::take(&mut self.untouched) && types {
            self.typed.reset();
        }
    }

    pub fn insert(&mut self, text: &str) {
        self.error = None;
        self.touch(true);
        insert_first_line(&mut self.typed, text);
    }
}

fn cursor_column(input: &Input) -> usize {
    let text = input.value();
    let end = text.char_indices().nth(input.cursor()).map_or(text.len(), |(at, _)| at);
    display_width(&text[..end])
}

/// Inserts the first line of `text`, as much of it as fits.
fn insert_first_line(input: &mut Input, text: &str) {
    let room = MAX_CHARACTERS.saturating_sub(input.value().chars().count());
    for c in text.lines().next().unwrap_or_default().chars().filter(|c| !c.is_control()).take(room)
    {
        input.handle(InputRequest::InsertChar(c));
    }
}

/// What picking an item does.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// Saves the run, then does something else.
    SaveFirst(Box<Choice>),
    /// Continues with other settings, method or preset, whatever becomes of the networks.
    Change(Box<Run>),
    Act(Action),
    /// Answers the question below, whatever that replaces.
    Answer(String),
    /// Asks for a setting's new value.
    Setting(String),
    Method(Method),
    Preset(Preset),
    Theme(ThemeName),
    Folder(PathBuf),
    OpenMap(PathBuf),
    OpenBuiltin(&'static str),
    OpenRandom(RandomMapKind),
    OpenEmpty,
    /// Asks whether to start a new run in the world called so, which needs no file.
    OpenWorld(&'static str),
    StartIn(&'static str),
    /// Starts the run again with another seed.
    Restart(u64),
    Field(Field),
    StartOn(Arc<Grid>),
    /// Continues with the same networks on another map of the current size.
    ContinueOn(Arc<Grid>),
    /// Loads a checkpoint; asks first if much would be lost.
    Load(PathBuf),
    LoadUnsaved(PathBuf),
    Export(ExportKind),
    Quit {
        save: bool,
    },
    Nothing,
}

/// Rows that Page Up and Page Down move the selection by.
const PAGE: isize = 10;

#[derive(Clone, Debug)]
pub struct Item {
    pub label: String,
    pub detail: String,
    /// The title above the first item of a group; empty for none.
    pub group: Cow<'static, str>,
    /// Further lines below the list while the item is selected.
    pub below: Vec<String>,
    pub words: String,
    /// Whether it is marked, such as a setting that differs from its preset.
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
            group: Cow::default(),
            below: Vec::new(),
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
    pub fn within(self, group: impl Into<Cow<'static, str>>) -> Self {
        Self { group: group.into(), ..self }
    }
}

#[derive(Clone, Copy, Debug)]
pub enum PickerRow<'a> {
    Title(&'a str),
    Item(&'a Item, bool),
}

/// A list with its search text and selection.
#[derive(Debug)]
pub struct Picker {
    pub title: String,
    /// What is shown above the items; empty for nothing.
    pub text: String,
    /// Whether it stays open below what is picked in it: the list of settings.
    pub stays: bool,
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
        Self { title, text: String::new(), stays: false, items, typed, shown, selected: 0 }
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

    pub fn insert_item(&mut self, at: usize, item: Item) {
        self.shown.push(self.items.len());
        self.items.insert(at, item);
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
    pub fn rows(&self) -> Vec<PickerRow<'_>> {
        let mut rows = Vec::new();
        let mut group: &str = "";
        for (n, i) in self.shown.iter().enumerate() {
            let item = &self.items[*i];
            if self.typed.value().is_empty() && item.group != group {
                group = &item.group;
                rows.push(PickerRow::Title(group));
            }
            rows.push(PickerRow::Item(item, n == self.selected));
        }
        rows
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
        let there = matches!(rows.get(row), Some(PickerRow::Item(..)));
        if there {
            self.selected =
                rows[..row].iter().filter(|row| matches!(row, PickerRow::Item(..))).count();
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
                let at = self.items.iter().position(|own| own.key == Some(c.to_ascii_lowercase()));
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

    fn filter(&mut self) {
        let typed = plain(self.typed.value());
        let scored =
            self.items.iter().enumerate().filter_map(|(i, item)| Some((i, score(&typed, item)?)));
        let mut scored: Vec<(usize, u32)> = scored.collect();
        scored.sort_by_key(|(i, score)| (std::cmp::Reverse(*score), *i));
        self.shown = scored.into_iter().map(|(i, _)| i).collect();
        self.selected = 0;
    }
}

/// What a match in an item's name, in its search words and in its details counts.
const WEIGHTS: [u32; 3] = [9, 5, 1];

/// Returns how well a search text fits an item, or `None` if one of its words is nowhere.
fn score(typed: &str, item: &Item) -> Option<u32> {
    let (label, detail) =
        (plain(&item.label), [std::slice::from_ref(&item.detail), &item.below[..]].concat());
    // A letter finds the actions with this key, of both cases.
    let is_key = matches!(item.choice, Choice::Act(_))
        && item.detail.to_lowercase().split(' ').any(|key| key == typed);
    if label == typed || is_key {
        return Some(u32::MAX);
    }
    let texts = [label, plain(&item.words), plain(&detail.join(" "))];
    let weighed = || texts.iter().zip(WEIGHTS);
    let of =
        |word| weighed().filter_map(|(text, weight)| Some(weight * closeness(text, word)?)).max();
    typed.split_whitespace().map(of).sum()
}

/// Returns how well a word fits a text: as one of its words, as the beginning of one, or within one.
fn closeness(text: &str, typed: &str) -> Option<u32> {
    let words = text.split(|c: char| !c.is_alphanumeric());
    let beginning = words.filter(|word| word.starts_with(typed));
    let best = beginning.map(|word| if word == typed { 3 } else { 2 }).max();
    best.or(text.contains(typed).then_some(1))
}

/// Returns a text in which `learning-rate`, `learning_rate` and `Learning rate` are the same.
fn plain(text: &str) -> String {
    text.trim().to_lowercase().replace(['-', '_'], " ")
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
            ("learning-r", Some("learning_rate")),
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
