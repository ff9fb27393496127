//! A question that is answered by a line of text.

use crossterm::event::{Event, KeyEvent};
use tui_input::backend::crossterm::EventHandler;
use tui_input::{Input, InputRequest};

/// The longest answer that is taken.
const MOST_CHARACTERS: usize = 500;

/// What the answer is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Question {
    /// The value of a setting.
    Setting(String),
    /// The name of a checkpoint.
    SaveAs,
    /// The name of a map file.
    SaveMap,
    /// Width and height of an empty map.
    NewMap,
    /// Width and height to make the map larger or smaller to.
    ResizeMap,
    /// The seed of a new run.
    Seed,
    /// Minutes between checkpoints.
    Autosave,
}

/// The question and what has been typed.
#[derive(Debug)]
pub struct Prompt {
    /// What is asked.
    pub title: String,
    /// What would be right.
    pub hint: String,
    /// What was wrong with the answer given last.
    pub error: Option<String>,
    /// What it is for.
    pub question: Question,
    typed: Input,
}

impl Prompt {
    /// A question with an answer to begin with.
    pub fn new(
        question: Question,
        title: impl Into<String>,
        hint: impl Into<String>,
        answer: impl Into<String>,
    ) -> Self {
        Self { title: title.into(), hint: hint.into(), error: None, question, typed: Input::new(answer.into()) }
    }

    /// What has been typed, and the cursor's column in it.
    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), self.typed.visual_cursor())
    }

    /// Takes a key.
    pub fn on_key(&mut self, key: KeyEvent) {
        self.error = None;
        if self.typed.value().chars().count() < MOST_CHARACTERS
            || !matches!(key.code, crossterm::event::KeyCode::Char(_))
        {
            self.typed.handle_event(&Event::Key(key));
        }
    }

    /// Takes pasted text.
    pub fn paste(&mut self, text: &str) {
        type_in(&mut self.typed, text);
    }
}

/// Types the first line of `text`, as far as there is room.
pub fn type_in(input: &mut Input, text: &str) {
    let room = MOST_CHARACTERS.saturating_sub(input.value().chars().count());
    for c in text.lines().next().unwrap_or_default().chars().filter(|c| !c.is_control()).take(room) {
        input.handle(InputRequest::InsertChar(c));
    }
}
