//! The panes of the panel beside the map.

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pane {
    /// Phase, counters, rates, success.
    #[default]
    Training,
    /// Success, coverage, losses and errors over time.
    Curves,
    Walk,
    Legend,
    Log,
}

impl Pane {
    /// All panes, in the order of their keys, the most informative first.
    pub const ALL: [Self; 5] = [Self::Training, Self::Curves, Self::Walk, Self::Legend, Self::Log];

    pub fn name(self) -> &'static str {
        match self {
            Self::Training => "train",
            Self::Curves => "curves",
            Self::Walk => "walk",
            Self::Legend => "map",
            Self::Log => "log",
        }
    }

    #[must_use]
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }
}
