//! Overlays on the map.

use super::theme::ColourDepth;

/// Something drawn over the map's colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// Contour lines of equal distance, labelled with it.
    Contours,
    /// Unvisited cells, and the edge of the known world.
    Unexplored,
    /// Exploring agents, their trails, and their goals at the frontier.
    Agents,
    Candidates,
    Edges,
    /// The latest search for a bridge point.
    Search,
    /// The path planned by the walking agent.
    Path,
}

impl Overlay {
    /// All overlays.
    pub const ALL: [Self; 7] = [
        Self::Contours,
        Self::Unexplored,
        Self::Agents,
        Self::Candidates,
        Self::Edges,
        Self::Search,
        Self::Path,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Contours => "contours",
            Self::Unexplored => "unvisited cells",
            Self::Agents => "exploring agents",
            Self::Candidates => "bridge candidates",
            Self::Edges => "bridge edges",
            Self::Search => "bridge search",
            Self::Path => "planned path",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays([bool; Overlay::ALL.len()]);

impl Overlays {
    /// Returns the default set: fewer without colours, where overlays would hide each other.
    pub fn by_default(depth: ColourDepth) -> Self {
        let mut shown =
            vec![Overlay::Contours, Overlay::Unexplored, Overlay::Agents, Overlay::Path];
        if depth != ColourDepth::Mono {
            shown.push(Overlay::Candidates);
        }
        Self(Overlay::ALL.map(|overlay| shown.contains(&overlay)))
    }

    pub fn has(self, overlay: Overlay) -> bool {
        self.0[overlay as usize]
    }

    /// Shows or hides `overlay`; returns whether it is now shown.
    pub fn toggle(&mut self, overlay: Overlay) -> bool {
        self.0[overlay as usize] = !self.0[overlay as usize];
        self.0[overlay as usize]
    }
}
