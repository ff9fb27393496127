//! Where the film of a run shows what was learned.

/// Maximum number of places of a film. A frame then takes less time than two updates.
pub const MAX_FILM_PLACES: usize = 1_350;

/// The states at which a film shows D, and the goal that it is to.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmPoints {
    /// The number of places, which stays the same as long as the run does. Not every place need
    /// have a state.
    pub places: usize,
    /// The place of each state, below `places`.
    pub place_of: Vec<u32>,
    /// `(states, state_dim)`.
    pub states: Vec<f32>,
    /// `(goal_dim)`.
    pub goal: Vec<f32>,
}
