//! The quantity shown by colours.

/// The quantity shown by colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Field {
    /// D(., g) to the goal, by the critics.
    #[default]
    Learned,
    /// D(s, .) from the start of the walking agent.
    FromStart,
    /// D(s, .) + D(., g), from the start to the goal over each place: low at good bridge points, as in
    /// Figure 2 of the paper.
    OverEach,
    /// D(., g) along the bridge graph.
    Composed,
    /// True steps to the goal.
    True,
    /// Signed error of D(., g), relative to the true steps.
    Error,
    /// Number of visits by agents.
    Visits,
    /// Nothing.
    Plain,
}

impl Field {
    /// All fields.
    pub const ALL: [Self; 8] = [
        Self::Learned,
        Self::FromStart,
        Self::OverEach,
        Self::Composed,
        Self::True,
        Self::Error,
        Self::Visits,
        Self::Plain,
    ];

    /// Returns its name on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learned => "D to G",
            Self::FromStart => "D from S",
            Self::OverEach => "D(S,.)+D(.,G)",
            Self::Composed => "D via graph",
            Self::True => "true steps",
            Self::Error => "error of D",
            Self::Visits => "visits",
            Self::Plain => "map only",
        }
    }

    /// Returns other words that users may search for.
    pub fn words(self) -> &'static str {
        match self {
            Self::Learned => "distance to goal learned value function q_values critic",
            Self::FromStart => "distance from start",
            Self::OverEach => "bridges sum of distances over each place figure 2",
            Self::Composed => "distance along bridge graph planned",
            Self::True => "true distance ground truth shortest path optimal exact",
            Self::Error => "wrong mistakes accuracy difference",
            Self::Visits => "visit counts exploration density heatmap",
            Self::Plain => "map alone plain no colours off",
        }
    }

    /// Returns the next (or previous) field that is `available`; [`Self::Plain`] always has to be.
    #[must_use]
    pub fn cycle(self, forward: bool, available: impl Fn(Self) -> bool) -> Self {
        let count = Self::ALL.len();
        let mut at = self as usize;
        loop {
            at = (at + if forward { 1 } else { count - 1 }) % count;
            if available(Self::ALL[at]) {
                return Self::ALL[at];
            }
        }
    }

    /// Whether its values are numbers of steps.
    pub fn is_distance(self) -> bool {
        matches!(
            self,
            Self::Learned | Self::FromStart | Self::OverEach | Self::Composed | Self::True
        )
    }

    /// Whether its values depend on where the agent starts.
    pub fn depends_on_start(self) -> bool {
        matches!(self, Self::FromStart | Self::OverEach)
    }

    /// Whether its values mean nothing where no agent has been.
    pub fn fades(self) -> bool {
        self.depends_on_start() || matches!(self, Self::Learned | Self::Composed | Self::Plain)
    }
}
