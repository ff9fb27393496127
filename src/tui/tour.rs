//! The guided tour as shown on the screen.

/// A caption and its subject.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caption {
    /// Two or three short sentences.
    pub text: String,
    /// Positions that the box never covers; it points to the first.
    pub subject: Vec<[f32; 2]>,
    /// Signs drawn on the map.
    pub marks: Vec<([f32; 2], char)>,
    /// Whether its subject is currently visible.
    pub seen: bool,
}

/// The step shown.
#[derive(Clone, Debug)]
pub struct ShownStep {
    /// Its index.
    pub step: usize,
    /// Its title, with its number.
    pub title: String,
    /// Whether the tour waits for the user's first click, which ends it.
    pub is_last: bool,
    /// The current caption.
    pub caption: Caption,
}
