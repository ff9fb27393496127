//! Probes: the states at which the film of a run shows D.

/// Maximum number of places of a film. A frame then takes less time than two updates.
pub const MAX_PROBES: usize = 1_350;

/// The states at which a film shows D, and the goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Probes {
    /// The number of places, constant during a run. A place may have no state.
    pub places: usize,
    /// The place of each state, below `places`.
    pub place_of: Vec<u32>,
    /// `(states, state_dim)`.
    pub states: Vec<f32>,
    /// `(goal_dim)`.
    pub goal: Vec<f32>,
}
