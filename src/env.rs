//! Environments: goal-conditioned worlds of many agents, without any reward.
//!
//! The learner sees an environment through [`Spec`] alone: how large states, goals and actions are, and how they
//! are scaled. It knows no map.

mod point_maze;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

pub use point_maze::PointMaze;

/// What an environment's numbers mean. Lengths are in the environment's own unit (cells of a maze, metres of an
/// arm).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// Middle of each state component's range; its length is the size of a state.
    pub state_centre: Vec<f32>,
    /// Half of each state component's range: `(state - centre) / half_range` lies in [-1, 1].
    pub state_half_range: Vec<f32>,
    /// Which state components are the goal that the state achieves; its length is the size of a goal.
    pub achieved: Vec<usize>,
    /// Size of an action; every component lies in [-1, 1].
    pub action_dim: usize,
    /// A goal is reached when the achieved goal is nearer than this (Euclidean).
    pub goal_radius: f32,
    /// Whether goals are positions in a space of few dimensions, where nearness is meaningful at every scale (so
    /// that multi-resolution encodings make sense).
    pub goals_are_positions: bool,
}

impl Spec {
    /// Numbers in a state.
    pub fn state_dim(&self) -> usize {
        self.state_centre.len()
    }

    /// Numbers in a goal.
    pub fn goal_dim(&self) -> usize {
        self.achieved.len()
    }

    /// The goal that `state` achieves, component by component.
    pub fn achieved<'a>(&'a self, state: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        self.achieved.iter().map(|i| state[*i])
    }

    /// Euclidean distance between the goal that `state` achieves and `goal`.
    pub fn goal_distance(&self, state: &[f32], goal: &[f32]) -> f32 {
        self.achieved(state).zip(goal).map(|(a, g)| (a - g) * (a - g)).sum::<f32>().sqrt()
    }

    /// Whether `state` is at `goal`.
    pub fn reached(&self, state: &[f32], goal: &[f32]) -> bool {
        self.goal_distance(state, goal) < self.goal_radius
    }
}

/// A world in which many agents move side by side, each on its own.
pub trait Environment: Send {
    /// What states, goals and actions are.
    fn spec(&self) -> &Spec;

    /// How many agents there are.
    fn agents(&self) -> usize;

    /// All agents' states, `(agents, state_dim)`.
    fn states(&self) -> &[f32];

    /// Puts `agent` at a random start.
    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng);

    /// Puts `agent` at `state`, or as near to it as the world allows.
    fn place(&mut self, agent: usize, state: &[f32]);

    /// A random goal that an agent at `agent`'s place could be asked to reach, into `goal` (`goal_dim`).
    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]);

    /// Moves every agent by one action; `actions` is `(agents, action_dim)` and clipped to [-1, 1].
    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng);
}
