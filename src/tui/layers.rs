//! What the map can show besides itself.

use crate::train::Method;

/// What the map's colours stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Field {
    /// D(., g) to the goal, as the critics have it.
    #[default]
    Learned,
    /// D(s, .) from where the walking agent started.
    FromStart,
    /// D(., g) as the bridge graph composes it.
    Composed,
    /// The map's own steps to the goal.
    True,
    /// By how much D(., g) is longer or shorter than these.
    Error,
    /// How often agents were there.
    Visits,
    /// Nothing.
    Plain,
}

impl Field {
    const ALL: [Self; 7] =
        [Self::Learned, Self::FromStart, Self::Composed, Self::True, Self::Error, Self::Visits, Self::Plain];

    /// What it is called on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learned => "D to G",
            Self::FromStart => "D from S",
            Self::Composed => "D by bridges",
            Self::True => "true steps",
            Self::Error => "error of D",
            Self::Visits => "visits",
            Self::Plain => "map alone",
        }
    }

    /// The next one (or the one before) that there is for `method`.
    #[must_use]
    pub fn turn(self, forward: bool, method: &Method) -> Self {
        let count = Self::ALL.len();
        let mut at = self as usize;
        loop {
            at = (at + if forward { 1 } else { count - 1 }) % count;
            if Self::ALL[at] != Self::Composed || method.plans() {
                return Self::ALL[at];
            }
        }
    }

    /// Whether its values are steps.
    pub fn is_distance(self) -> bool {
        matches!(self, Self::Learned | Self::FromStart | Self::Composed | Self::True)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_forth_and_back_leads_round_and_home() {
        for method in &["gdg", "gdg-bridge"].map(|name| name.parse::<Method>().expect("a method")) {
            let there = (0..7).scan(Field::Learned, |field, _| {
                *field = field.turn(true, method);
                Some(*field)
            });
            let there: Vec<Field> = there.collect();
            assert_eq!(there.contains(&Field::Composed), method.plans());
            assert_eq!(Field::Learned.turn(true, method).turn(false, method), Field::Learned);
        }
    }
}
