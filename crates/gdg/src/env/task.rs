//! Evaluation tasks, and the true distances to evaluate against.

use rand_chacha::ChaCha8Rng;

use super::{EnvError, Environment};

#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Full state in which the agent starts, if the world can set it, or what else the world itself
    /// takes for one; otherwise, it restarts.
    pub start: Vec<f64>,
    /// `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Length of the shortest path in steps, if known.
    pub shortest: Option<u32>,
    /// Index of its group in [`TaskSet::distances`].
    pub group: usize,
}

pub(crate) const MIN_BUDGET_STEPS: u32 = 500;

/// Step budget of a task, as a multiple of its shortest path.
pub(crate) const BUDGET_FACTOR: u32 = 3;

/// Maximum step budget of a task, so that evaluations end: as long as the longest episode.
pub(crate) const MAX_BUDGET_STEPS: u32 = 60_000;

impl Task {
    /// Returns the number of steps within which the goal has to be reached.
    pub fn budget(&self) -> u32 {
        let steps = BUDGET_FACTOR.saturating_mul(self.shortest.unwrap_or(0));
        steps.clamp(MIN_BUDGET_STEPS, MAX_BUDGET_STEPS)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DistanceUnit {
    #[default]
    Steps,
    /// The straight line from start to goal, in centimetres.
    Centimetres,
}

impl DistanceUnit {
    /// Returns its name after a number: `40 steps`, `15 cm`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steps => "steps",
            Self::Centimetres => "cm",
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct TaskSet {
    pub unit: DistanceUnit,
    /// Representative distance of each group, if known.
    pub distances: Vec<Option<f64>>,
    pub tasks: Vec<Task>,
}

impl TaskSet {
    /// Draws `count` tasks in one group, from random starts to random goals, at unknown distances.
    pub fn random(
        world: &dyn Environment,
        count: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, EnvError> {
        let mut world = world.fork(1)?;
        let tasks = (0..count).map(|_| {
            world.restart(0, rng)?;
            let mut goal = vec![0.0; world.spec().goal_dim()];
            world.sample_goal(0, rng, &mut goal);
            Ok(Task { start: world.full_state(0), goal, shortest: None, group: 0 })
        });
        let tasks = tasks.collect::<Result<_, EnvError>>()?;
        Ok(Self { tasks, distances: vec![None], ..Self::default() })
    }
}

/// Pairs within this many steps count as near.
pub const NEAR_STEPS: u32 = 10;

pub trait GroundTruth {
    /// Returns the fewest steps from the place `from` until each of `goals` counts as reached (see
    /// [`Spec::reached`](super::Spec::reached)), all `(goal_dim)`; `None` for a goal that is
    /// farther than `longest` or unreachable. Returns `None` overall if no agent can be at `from`.
    fn steps(&mut self, from: &[f32], goals: &[f32], longest: u32) -> Option<Vec<Option<u32>>>;

    /// Draws random pairs for measuring D's error, grouped by goal.
    fn pairs(&mut self, rng: &mut ChaCha8Rng) -> Vec<TruePairs>;
}

/// States and their true distances to one goal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruePairs {
    /// `(goal_dim)`.
    pub goal: Vec<f32>,
    /// `(pairs, state_dim)`.
    pub states: Vec<f32>,
    /// Fewest steps from each state to the goal, at least 1.
    pub steps: Vec<u32>,
    /// Which pairs were drawn from the near ones, for the error at short distances.
    pub near: Vec<bool>,
}
