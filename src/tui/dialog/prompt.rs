//! A question answered with a line of text.

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use tui_input::backend::crossterm::EventHandler;
use tui_input::{Input, InputRequest};

use gdg::text::display_width;

/// The longest answer accepted, in characters.
const MAX_CHARACTERS: usize = 500;

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
    /// The map's new width and height.
    ResizeMap,
    /// The seed of a new run.
    Seed,
    /// Minutes between automatic checkpoints.
    Autosave,
}

/// A question and the answer typed so far.
#[derive(Debug)]
pub struct Prompt {
    /// The question's text.
    pub title: String,
    /// What a valid answer looks like.
    pub hint: String,
    /// What was wrong with the last answer.
    pub error: Option<String>,
    /// What the answer is for.
    pub question: Question,
    typed: Input,
    /// The initial answer has not been edited: typing replaces it.
    untouched: bool,
}

impl Prompt {
    /// Creates a question with an initial answer.
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

    /// Returns the text typed so far and the cursor's column in it.
    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), cursor_column(&self.typed))
    }

    /// Returns whether typing replaces the current text.
    pub fn is_untouched(&self) -> bool {
        self.untouched && !self.typed.value().is_empty()
    }

    /// Handles a key.
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

    /// Inserts pasted text.
    pub fn paste(&mut self, text: &str) {
        self.touch(true);
        insert_first_line(&mut self.typed, text);
    }
}

/// Returns the cursor's column in what has been typed.
pub fn cursor_column(input: &Input) -> usize {
    let text = input.value();
    let end = text.char_indices().nth(input.cursor()).map_or(text.len(), |(at, _)| at);
    display_width(&text[..end])
}

/// Inserts the first line of `text`, as much of it as fits.
pub fn insert_first_line(input: &mut Input, text: &str) {
    let room = MAX_CHARACTERS.saturating_sub(input.value().chars().count());
    for c in text.lines().next().unwrap_or_default().chars().filter(|c| !c.is_control()).take(room)
    {
        input.handle(InputRequest::InsertChar(c));
    }
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
        pasted.paste("345");
        assert_eq!(pasted.typed().0, "345");
    }
}
