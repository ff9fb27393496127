//! Tasks to evaluate on, and the truth to evaluate against.

use rand_chacha::ChaCha8Rng;

/// From a start to a goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// The whole state that the agent starts in.
    pub start: Vec<f64>,
    /// The goal, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Fewest steps that it takes, where that is known.
    pub shortest: Option<u32>,
    /// Which of the set's distances it belongs to.
    pub group: usize,
}

/// Steps after which a task has failed, at the soonest.
const LEAST_BUDGET_STEPS: u32 = 500;

/// A task has failed after so many times the fewest steps.
const BUDGET_FACTOR: u32 = 3;

impl Task {
    /// Steps within which the goal has to be reached.
    pub fn budget(&self) -> u32 {
        self.shortest.map_or(LEAST_BUDGET_STEPS, |steps| (BUDGET_FACTOR * steps).max(LEAST_BUDGET_STEPS))
    }
}

/// Tasks in groups of one distance each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TaskSet {
    /// Distance that stands for each group: steps, unless the world measures it otherwise.
    pub distances: Vec<f64>,
    /// The tasks, group by group.
    pub tasks: Vec<Task>,
}

/// Pairs within this many steps count as near.
pub const NEAR_STEPS: u32 = 10;

/// The true distances of a world.
pub trait Truth {
    /// Fewest steps from the place `from` to each of `goals`, all `(goal_dim)`; `None` for a goal that is farther than
    /// `longest` or cannot be reached. `None` altogether where `from` is no place that an agent can be in.
    fn steps(&mut self, from: &[f32], goals: &[f32], longest: u32) -> Option<Vec<Option<u32>>>;

    /// Random pairs that D's error is measured on, goal by goal.
    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs>;
}

/// States and their true distances to one goal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruePairs {
    /// The goal, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// `(pairs, state_dim)`.
    pub states: Vec<f32>,
    /// Fewest steps from each state to the goal, at least 1.
    pub steps: Vec<u32>,
    /// Which pairs were drawn among near ones alone, for the error of short distances.
    pub near: Vec<bool>,
}
