//! What the panel beside the map can show.

/// A pane of the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pane {
    /// Phase, counters, rates, success.
    #[default]
    Training,
    /// Success, losses and errors over time.
    Curves,
    /// The agent that is followed.
    Walk,
    /// What the map shows, and in which colours.
    Legend,
    /// What happened.
    Log,
}

impl Pane {
    /// All of them, in the order of their keys.
    pub const ALL: [Self; 5] = [Self::Training, Self::Curves, Self::Walk, Self::Legend, Self::Log];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Training => "train",
            Self::Curves => "curves",
            Self::Walk => "walk",
            Self::Legend => "map",
            Self::Log => "log",
        }
    }

    /// The next one.
    #[must_use]
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }
}
