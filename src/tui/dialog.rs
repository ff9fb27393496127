//! Dialogs on top of the screen: the help, a list to pick from, a question to answer.

mod picker;

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use tui_input::backend::crossterm::EventHandler;
use tui_input::{Input, InputRequest};

use super::action::Action;
use super::output::ExportKind;
use super::theme::ThemeName;
use gdg::map::{Grid, RandomMapKind};
use gdg::text::display_width;
use gdg::train::{Method, Preset, Run};
use gdg::viewer::Field;
pub use picker::{Item, ListKind, Picker, Row};

/// The longest answer accepted, in characters.
const MAX_CHARACTERS: usize = 500;

/// A dialog on top of the screen.
#[derive(Debug)]
pub enum Dialog {
    Help(Help),
    Pick(Picker),
    Ask(Prompt),
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

/// What the answer is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Question {
    Setting(String),
    SaveAs,
    SaveMap,
    /// Width and height of an empty map.
    NewMap,
    /// The map's new width and height.
    ResizeMap,
    Seed,
    Autosave,
}

/// What an answer would lose: accepting it again confirms that.
#[derive(Debug, PartialEq, Eq)]
pub struct Warning {
    /// The format, and what of the map it has no place for.
    pub lost: Option<String>,
    pub replaced: Option<String>,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match (&self.lost, &self.replaced) {
            (Some(lost), replaced) => {
                let also = replaced.iter().map(|what| format!(", and {what} exists"));
                let also: String = also.collect();
                write!(f, "{lost}{also}; Enter again writes it without them")
            }
            (None, replaced) => {
                let what = replaced.as_deref().unwrap_or_default();
                write!(f, "{what} exists: Enter again replaces it")
            }
        }
    }
}

/// A question and the answer typed so far.
#[derive(Debug)]
pub struct Prompt {
    pub title: String,
    /// What a valid answer looks like.
    pub hint: String,
    /// What was wrong with the last answer.
    pub error: Option<String>,
    /// What the user has been warned of.
    pub warned_of: Option<Warning>,
    pub question: Question,
    typed: Input,
    /// The initial answer has not been edited: typing replaces it.
    untouched: bool,
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
            warned_of: None,
            question,
            typed: Input::new(answer.into()),
            untouched: true,
        }
    }

    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), cursor_column(&self.typed))
    }

    pub fn is_untouched(&self) -> bool {
        self.untouched && !self.typed.value().is_empty()
    }

    pub fn on_key(&mut self, key: KeyEvent) {
        (self.error, self.warned_of) = (None, None);
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

/// The help: what it is about, its scroll position and its search.
#[derive(Debug, Default)]
pub struct Help {
    /// The introduction to a comparison, if it is about one.
    pub comparison: Option<String>,
    /// The first line shown.
    pub first: usize,
    /// The lines that fit on the screen.
    pub page: usize,
    search: Input,
    /// Whether keys go to the search text.
    pub searching: bool,
}

impl Help {
    pub fn of_comparison(introduction: String) -> Self {
        Self { comparison: Some(introduction), ..Self::default() }
    }

    pub fn search(&self) -> &str {
        self.search.value()
    }

    pub fn scroll(&mut self, lines: isize) {
        self.first = self.first.saturating_add_signed(lines);
    }

    /// Scrolls by a page, except for one line that stays in view.
    fn scroll_page(&mut self, down: bool) {
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

    /// Searches for pasted text.
    pub fn search_for(&mut self, text: &str) {
        self.searching = true;
        insert_first_line(&mut self.search, text);
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

    fn clear_search(&mut self) {
        (self.searching, self.first) = (false, 0);
        self.search.reset();
    }
}

/// What picking an item does.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// Saves the run, then does something else.
    SaveFirst(Box<Choice>),
    /// Continues with another method, preset or settings, without asking what becomes of the
    /// networks.
    Change(Box<Run>),
    Act(Action),
    /// Asks for a setting's new value.
    Setting(String),
    Method(Method),
    Preset(Preset),
    Theme(ThemeName),
    Folder(PathBuf),
    OpenMap(PathBuf),
    OpenBuiltin(&'static str),
    OpenRandom(RandomMapKind),
    /// Asks whether to start a new run in the world called so, which needs no file.
    OpenWorld(&'static str),
    StartIn(&'static str),
    /// Starts the run again with another seed.
    Restart(u64),
    Field(Field),
    /// Starts a new run on a map, which may come from a file.
    StartOn(Arc<Grid>, Option<PathBuf>),
    /// Continues with the same networks on another map of the current size, which may come from a
    /// file.
    ContinueOn(Arc<Grid>, Option<PathBuf>),
    /// Loads a checkpoint; asks first if much would be lost.
    Load(PathBuf),
    /// Lays the curves of a checkpoint's run under those of this one.
    LayUnder(PathBuf),
    LoadUnsaved(PathBuf),
    Tour,
    Export(ExportKind),
    Quit {
        save: bool,
    },
    Nothing,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(prompt: &mut Prompt, code: KeyCode) {
        prompt.on_key(KeyEvent::new(code, KeyModifiers::NONE));
    }

    #[test]
    fn typing_replaces_the_initial_answer_unless_it_was_edited() {
        let prompt = || Prompt::new(Question::Seed, "seed", "", "12");
        let mut typed = prompt();
        press(&mut typed, KeyCode::Char('7'));
        press(&mut typed, KeyCode::Char('8'));
        assert_eq!(typed.typed().0, "78");
        let mut edited = prompt();
        press(&mut edited, KeyCode::Backspace);
        press(&mut edited, KeyCode::Char('7'));
        assert_eq!(edited.typed().0, "17");
        let mut pasted = prompt();
        pasted.insert("345");
        assert_eq!(pasted.typed().0, "345");
    }
}
