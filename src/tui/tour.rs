//! What is shown of the guided tour.

/// What the box says, and about what.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caption {
    /// Two or three short sentences.
    pub text: String,
    /// Positions that the box never covers; it points to the first.
    pub subject: Vec<[f32; 2]>,
    /// Signs drawn on the map.
    pub marks: Vec<([f32; 2], char)>,
    /// Whether what it explains is to be seen now.
    pub seen: bool,
}

/// The step that is shown.
#[derive(Clone, Debug)]
pub struct ShownStep {
    /// Its index.
    pub step: usize,
    /// Its title, with its number.
    pub title: String,
    /// Whether the tour waits for the user's first click, which ends it.
    pub is_last: bool,
    /// What the box says now.
    pub caption: Caption,
}
