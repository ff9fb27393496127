//! The tools of the map editor.

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    #[default]
    Pencil,
    Eraser,
    Line,
    /// Draws walls around a rectangle.
    Rectangle,
    /// Fills an area of floor with wall, or of wall with floor.
    Fill,
    /// Adds, moves or removes a start.
    Start,
    /// Adds, moves or removes a goal.
    Goal,
}

impl Tool {
    /// All tools, in the order of their keys.
    pub const ALL: [Self; 7] = [
        Self::Pencil,
        Self::Eraser,
        Self::Line,
        Self::Rectangle,
        Self::Fill,
        Self::Start,
        Self::Goal,
    ];

    /// Returns its name, and what the mouse does with it.
    pub fn about(self) -> (&'static str, &'static str) {
        match self {
            Self::Pencil => ("wall", "drag: walls, right drag: floor"),
            Self::Eraser => ("floor", "drag: floor"),
            Self::Line => ("line", "drag: a wall, right drag: floor"),
            Self::Rectangle => ("box", "drag: an outline, right drag: floor"),
            Self::Fill => ("fill", "click: fill, or clear a wall"),
            Self::Start => ("start", "click: add or remove s, drag: move"),
            Self::Goal => ("goal", "click: add or remove g, drag: move"),
        }
    }

    /// Returns why using the tool has changed nothing; `None` if that is obvious.
    pub fn refusal(self) -> Option<&'static str> {
        match self {
            Self::Fill => Some("not filled: a map needs floor"),
            Self::Start => Some("a start needs floor"),
            Self::Goal => Some("a goal needs floor"),
            Self::Pencil | Self::Eraser | Self::Line | Self::Rectangle => None,
        }
    }
}
