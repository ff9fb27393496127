//! What the map can show besides itself.

/// Something drawn on top of the colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// Lines that join places equally far away, with their distances.
    Contours,
    /// Where the actor would go.
    Directions,
    /// Agents that explore, and where they come from.
    Agents,
    /// Bridge candidates.
    Candidates,
    /// Edges of the bridge graph.
    Edges,
    /// The latest search for a bridge point.
    Search,
    /// The path that the walking agent plans.
    Path,
}

impl Overlay {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Contours, Self::Directions, Self::Agents, Self::Candidates, Self::Edges, Self::Search, Self::Path];

    /// What it is called on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Contours => "contours",
            Self::Directions => "actor's direction",
            Self::Agents => "exploring agents",
            Self::Candidates => "bridge candidates",
            Self::Edges => "bridge edges",
            Self::Search => "bridge search",
            Self::Path => "planned path",
        }
    }
}

/// Which overlays are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays([bool; Overlay::ALL.len()]);

impl Default for Overlays {
    fn default() -> Self {
        let shown = [Overlay::Contours, Overlay::Agents, Overlay::Candidates, Overlay::Path];
        Self(Overlay::ALL.map(|overlay| shown.contains(&overlay)))
    }
}

impl Overlays {
    /// Whether `overlay` is shown.
    pub fn has(self, overlay: Overlay) -> bool {
        self.0[overlay as usize]
    }

    /// Shows or hides `overlay`; whether it is shown now.
    pub fn toggle(&mut self, overlay: Overlay) -> bool {
        self.0[overlay as usize] = !self.0[overlay as usize];
        self.0[overlay as usize]
    }
}
