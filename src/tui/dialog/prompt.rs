//! A question that is answered by a line of text.

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
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
    /// Nobody has touched the answer to begin with: typing replaces it.
    untouched: bool,
}

impl Prompt {
    /// A question with an answer to begin with.
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

    /// What has been typed, and the cursor's column in it.
    pub fn typed(&self) -> (&str, usize) {
        (self.typed.value(), self.typed.visual_cursor())
    }

    /// Whether typing replaces what is there.
    pub fn is_untouched(&self) -> bool {
        self.untouched && !self.typed.value().is_empty()
    }

    /// Takes a key.
    pub fn on_key(&mut self, key: KeyEvent) {
        self.error = None;
        let types = matches!(key.code, KeyCode::Char(_)) && !key.modifiers.contains(KeyModifiers::CONTROL);
        self.touch(types);
        if self.typed.value().chars().count() < MOST_CHARACTERS || !matches!(key.code, KeyCode::Char(_)) {
            self.typed.handle_event(&Event::Key(key));
        }
    }

    fn touch(&mut self, types: bool) {
        if std::mem::take(&mut self.untouched) && types {
            self.typed.reset();
        }
    }

    /// Takes pasted text.
    pub fn paste(&mut self, text: &str) {
        self.touch(true);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn press(prompt: &mut Prompt, code: KeyCode) {
        prompt.on_key(KeyEvent::new(code, KeyModifiers::NONE));
    }

    #[test]
    fn typing_replaces_the_answer_to_begin_with_unless_it_is_edited() {
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
