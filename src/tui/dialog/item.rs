//! The lines of a list.

use super::Choice;

/// One line of a list.
#[derive(Clone, Debug)]
pub struct Item {
    /// The item's name.
    pub label: String,
    /// Further details.
    pub detail: String,
    /// The title above the first item of a group; empty for none.
    pub group: &'static str,
    /// Further lines below the list while the item is selected.
    pub below: Vec<String>,
    /// The name of its action; empty for none.
    pub name: &'static str,
    /// Additional search words.
    pub words: String,
    /// Whether it is marked, such as a setting that differs from its default.
    pub marked: bool,
    /// The key that picks it in a question.
    pub key: Option<char>,
    /// The effect of picking it.
    pub choice: Choice,
}

impl Item {
    /// Creates an item.
    pub fn new(label: impl Into<String>, detail: impl Into<String>, choice: Choice) -> Self {
        let (group, below, name, words, marked, key) =
            ("", Vec::new(), "", String::new(), false, None);
        Self {
            label: label.into(),
            detail: detail.into(),
            group,
            below,
            name,
            words,
            marked,
            key,
            choice,
        }
    }

    /// Makes a key pick the item.
    #[must_use]
    pub fn on(self, key: char) -> Self {
        Self { key: Some(key), ..self }
    }

    /// Puts the item into a group.
    #[must_use]
    pub fn within(self, group: &'static str) -> Self {
        Self { group, ..self }
    }
}
