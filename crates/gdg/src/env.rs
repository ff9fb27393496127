//! Environments: goal-conditioned worlds with many parallel agents and no reward.
//!
//! Each world is a submodule that implements [`Environment`], all that training needs, and whatever
//! of the [`Abilities`] it offers evaluation and front ends. The learner sees only sizes and scales
//! ([`Spec`]). [`WORLDS`] lists the built-in worlds.

mod abilities;
mod contact;
pub mod fetch_reach;
mod first_look;
mod goal_space;
pub mod gym;
pub mod maze;
mod region;
mod task;

use std::any::Any;
use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::job::Job;
use crate::map::Grid;
use crate::store::{Store, StoreError};
pub use abilities::{
    Abilities, Change, Drawn, Editable, Episodes, Evaluated, Explored, MAX_PROBES, Probes,
    Recorded, StraightAction,
};
pub use contact::Contact;
pub use fetch_reach::{ArmScene, FetchReach};
pub(crate) use first_look::{
    Agreement, DirectEffect, EffectWatch, FirstLook, RecordedStep, direct_effects, share,
};
pub use goal_space::{GoalSpace, Walls};
pub use gym::GymOptions;
pub use maze::PointMaze;
pub use region::Region;
pub(crate) use task::{BUDGET_FACTOR, MAX_BUDGET_STEPS};
pub use task::{DistanceUnit, GroundTruth, NEAR_STEPS, Task, TaskSet, TruePairs};

/// Largest magnitude of a component of a stored state or goal: sums of squares beyond it may
/// overflow.
pub(crate) const MAX_MAGNITUDE: f32 = 1e9;

/// Why a world fails, or cannot replace another in a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnvError {
    /// It cannot replace the run's world, or has not what the run needs.
    #[error("{0}")]
    Unfit(String),
    /// What is stored of the world cannot be loaded.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It is computed by another program, which has failed.
    #[error("{world}: {problem}{}", .details.iter().map(|line| format!("\n  {line}")).collect::<String>())]
    Failed {
        /// Title of the world, safe to display.
        world: String,
        /// What has happened, safe to display.
        problem: String,
        /// The last lines that the other program has written, safe to display.
        details: Vec<String>,
    },
    /// It took long although training was to stop.
    #[error("the environment was given up, as training was to stop")]
    Stopped,
}

pub const WORLDS: [WorldKind; 3] = [maze::KIND, fetch_reach::KIND, gym::KIND];

/// Registry entry of a kind of world.
///
/// A run's settings are the preset's, then the world's [`defaults`](Self::defaults), then what the
/// user gives.
#[derive(Clone, Copy, Debug)]
pub struct WorldKind {
    /// Name in checkpoints and, for worlds that need no file, on the command line.
    pub name: &'static str,
    pub about: &'static str,
    /// Creates the world, if it needs no file.
    pub create: Option<fn() -> Box<dyn Environment>>,
    /// Opens the world that the command line names by `NAME:ARGUMENT`, without agents, if it takes
    /// an argument.
    pub open: Option<OpenWorld>,
    /// Loads the world from what [`Recorded::save`] wrote, without agents.
    pub load: LoadWorld,
    /// Settings of a run in this world that differ from the preset's, as `--set` takes them
    /// (`name=value`). They do not apply to published presets; what the user gives wins.
    pub defaults: &'static [&'static str],
}

/// Opens a world, given what follows its name and a colon on the command line.
pub type OpenWorld = fn(&str, &GymOptions) -> Result<Box<dyn Environment>, EnvError>;

/// Loads a world from a checkpoint. The options are those of the present command line.
pub type LoadWorld = fn(&Store, &GymOptions) -> Result<Box<dyn Environment>, EnvError>;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restart {
    /// Where the previous episode ended, the first one at the world's own start; at a random place
    /// in a world without a start.
    Auto,
    Anywhere,
    /// At the world's own start: a map's `S`, or a random one if there are several.
    StartCell,
    /// Where the previous episode ended, the first one at the world's own start or a random place.
    Never,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Goals {
    #[default]
    Anywhere,
    /// The goal of the world's own task, from its start: of a map, `G` from `S`.
    Map,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvSettings {
    pub restart: Restart,
    /// What agents are asked to reach. With [`Goals::Map`], episodes begin at the world's own start.
    pub goals: Goals,
    /// Standard deviation of the noise that the world adds to every action; 0 for none.
    pub noise: f32,
}

impl Default for EnvSettings {
    fn default() -> Self {
        Self { restart: Restart::Auto, goals: Goals::Anywhere, noise: 0.0 }
    }
}

impl EnvSettings {
    /// Returns an action in [-1, 1], after the noise.
    pub(crate) fn noisy(self, action: f32, rng: &mut ChaCha8Rng) -> f32 {
        let action = action.clamp(-1.0, 1.0);
        if self.noise <= 0.0 {
            return action;
        }
        let sample: f32 = StandardNormal.sample(rng);
        (action + self.noise * sample).clamp(-1.0, 1.0)
    }
}

/// A state component counts as no farther from the middle of its range than this many half ranges:
/// what is known of a range may be little.
pub const MOST_HALF_RANGES: f32 = 10.0;

/// A component moves in a step that changes it by more than this share of its typical change.
pub const LEAST_MOVE: f32 = 0.1;

/// Sizes and scales of states, goals and actions. Lengths are in the environment's own unit (maze
/// cells, or metres for an arm).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// Midpoint of each state component's range; the vector's length is the state size.
    pub state_centre: Vec<f32>,
    /// Half the range of each state component: `(state - centre) / half_range` lies in [-1, 1]. 0
    /// for a constant component.
    pub state_half_range: Vec<f32>,
    /// Typical change of each state component per step: the unit of the dynamics model's outputs. 0
    /// for a constant component.
    pub change_scale: Vec<f32>,
    /// Indices of the state components that form the achieved goal; the vector's length is the goal
    /// size.
    pub achieved: Vec<usize>,
    /// Size of an action; every component lies in [-1, 1].
    pub action_dim: usize,
    /// A goal is reached when the achieved goal is closer to it than this (Euclidean).
    pub goal_radius: f32,
    /// If goals are positions in a low-dimensional space, where distance is meaningful at every
    /// scale so that multi-resolution encodings make sense: how large what goals have to get around
    /// is, such as a cell of a maze, in the unit of length.
    pub position_scale: Option<f32>,
    /// What is close together where the achieved goal begins to move, as far as it has been found out.
    #[serde(default)]
    pub contacts: Vec<Contact>,
    /// Steps that an environment gives an agent, if it has a time limit. What takes far longer is as good
    /// as out of reach, such as a goal on a table for an object that has fallen off.
    #[serde(default)]
    pub time_limit: Option<u32>,
}

impl Spec {
    pub fn state_dim(&self) -> usize {
        self.state_centre.len()
    }

    pub fn goal_dim(&self) -> usize {
        self.achieved.len()
    }

    /// Scales `value` of state component `i` to [-1, 1], or at most [`MOST_HALF_RANGES`] either way
    /// where it is outside of its range; returns 0 for a constant component.
    pub fn scaled(&self, i: usize, value: f32) -> f32 {
        let half = self.state_half_range[i];
        let scaled = if half > 0.0 { (value - self.state_centre[i]) / half } else { 0.0 };
        scaled.clamp(-MOST_HALF_RANGES, MOST_HALF_RANGES)
    }

    /// Returns the typical change per step of the goal's component that changes most: what a step
    /// covers, in the unit of length.
    pub fn largest_change(&self) -> f32 {
        self.achieved.iter().map(|i| self.change_scale[*i]).fold(0.0, f32::max)
    }

    /// Returns the components of the goal that `state` achieves.
    pub fn achieved<'a>(&'a self, state: &'a [f32]) -> impl Iterator<Item = f32> + Clone + 'a {
        self.achieved.iter().map(|i| state[*i])
    }

    /// Returns the Euclidean distance between the goal that `state` achieves and `goal`.
    pub fn goal_distance(&self, state: &[f32], goal: &[f32]) -> f32 {
        self.achieved(state).zip(goal).map(|(a, g)| (a - g) * (a - g)).sum::<f32>().sqrt()
    }

    /// Returns whether `goal` is elsewhere than what `state` achieves, by more than what counts as rest.
    pub fn is_away(&self, state: &[f32], goal: impl IntoIterator<Item = f32>) -> bool {
        let least = LEAST_MOVE * self.largest_change();
        self.achieved(state).zip(goal).any(|(achieved, goal)| (goal - achieved).abs() > least)
    }

    /// Returns whether the step from `state` to `next` moves the achieved goal.
    pub fn goal_moves(&self, state: &[f32], next: &[f32]) -> bool {
        self.is_away(state, self.achieved(next))
    }

    pub fn reached(&self, state: &[f32], goal: &[f32]) -> bool {
        self.goal_distance(state, goal) < self.goal_radius
    }
}

/// A world in which many agents move in parallel, independently of each other: what training needs.
///
/// The first seven methods have no default. What else a world offers, for evaluation, edits, records
/// or display, it lists in its [`Abilities`].
///
/// A *state* is what the learner observes of an agent: `state_dim` numbers. A *full state* is
/// everything that the agent's future depends on, in the world's own layout: an arm's joints and
/// velocities as well as its gripper position.
pub trait Environment: Any + Send + Sync {
    /// Returns the name of its [`WorldKind`].
    fn kind(&self) -> &'static str;

    /// Returns the sizes and scales of states, goals and actions.
    fn spec(&self) -> &Spec;

    /// Returns all agents' states, `(agents, state_dim)`.
    fn states(&self) -> &[f32];

    /// Moves `agent` to a start state.
    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError>;

    /// Draws a random goal that `agent` could be asked to reach from its place, into `goal`
    /// (`goal_dim`).
    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]);

    /// Steps every agent by one action; `actions` is `(agents, action_dim)`. The world clips them
    /// to [-1, 1]: the trainer has done so during exploration, but not in evaluation and display.
    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError>;

    /// Begins the step that [`Self::end_step`] ends, for a world that computes it elsewhere: training
    /// goes on meanwhile. Returns whether it has begun, which it never has by default. Until it ends,
    /// the states are those before it, and the world is asked for nothing else.
    fn begin_step(&mut self, _actions: &[f32], _rng: &mut ChaCha8Rng) -> Result<bool, EnvError> {
        Ok(false)
    }

    /// Waits for the step begun; does nothing without one.
    fn end_step(&mut self) -> Result<(), EnvError> {
        Ok(())
    }

    /// Returns a copy of the world with the same settings and `agents` new agents. The agents'
    /// states are unspecified: callers restart them or set their full states.
    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError>;

    /// Returns whether the world itself has ended the episode of `agent`, which must restart before
    /// its next step; never by default.
    fn has_ended(&self, _agent: usize) -> bool {
        false
    }

    /// Takes note that what `agent` does no longer matters until it restarts, so that its steps need
    /// not be computed; the default computes them.
    fn retire(&mut self, _agent: usize) {}

    /// Switches to new settings. A world must honour all, or document which it ignores; the default
    /// ignores them. [`Goals::Map`] is only asked of worlds with a
    /// [default task](Episodes::default_task).
    fn configure(&mut self, _settings: &EnvSettings) {}

    /// Takes the job that says when training is to stop: a world that keeps its caller waiting then
    /// gives up soon, with [`EnvError::Stopped`]. The default never does.
    fn share_job(&mut self, _job: &Job) {}

    /// Takes scales from `walks`, `(steps, state_dim)` each, of a world that knew them only by a first
    /// look: of all components or, once training has begun, of those `beside_goal`. Returns whether
    /// they have changed, which they never have by default.
    fn rescale(&mut self, _walks: &[&[f32]], _beside_goal: bool) -> bool {
        false
    }

    /// Returns an agent's full state: for every agent the same number of components, at least one.
    /// The default is its state. A world overrides both this and [`Self::set_full_state`], or
    /// neither.
    fn full_state(&self, agent: usize) -> Vec<f64> {
        let dim = self.spec().state_dim();
        self.states()[agent * dim..(agent + 1) * dim].iter().map(|v| f64::from(*v)).collect()
    }

    /// Puts `agent` into a full state, or as close to it as the world allows if the state itself is
    /// not allowed. The numbers are finite and as many as [`Self::takes_full_state`] says, but come
    /// from a file: they may be out of range.
    ///
    /// Returns whether the world can do this, which the default cannot. In a world that cannot,
    /// resumed agents, all of them, and those of evaluations begin at start states.
    fn set_full_state(&mut self, _agent: usize, _full_state: &[f64]) -> Result<bool, EnvError> {
        Ok(false)
    }

    /// Returns whether [`Self::set_full_state`] takes `length` numbers from a file: by default as
    /// many as [`Self::full_state`] returns.
    fn takes_full_state(&self, length: usize) -> bool {
        length == self.full_state(0).len()
    }

    /// Returns what the world offers beyond training; nothing by default.
    fn abilities(&self) -> Abilities<'_> {
        Abilities::default()
    }
}

impl dyn Environment {
    /// Returns the goal that the first agent achieves after a straight walk from the full state
    /// `from`: a random action, for a random number of at most `longest` steps. `None` if the world
    /// cannot set full states.
    pub fn near_goal(
        &mut self,
        from: &[f64],
        longest: u32,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<Vec<f32>>, EnvError> {
        let action: Vec<f32> =
            (0..self.spec().action_dim).map(|_| rng.random_range(-1.0..=1.0)).collect();
        if !self.set_full_state(0, from)? {
            return Ok(None);
        }
        for _ in 0..rng.random_range(1..=longest) {
            self.step(&action, rng)?;
        }
        Ok(Some(self.spec().achieved(self.states()).collect()))
    }

    /// `(state_dim)`.
    pub fn state(&self, agent: usize) -> &[f32] {
        let dim = self.spec().state_dim();
        &self.states()[agent * dim..(agent + 1) * dim]
    }

    pub fn agents(&self) -> usize {
        self.states().len() / self.spec().state_dim()
    }

    /// Returns the title, such as the map's name; the name of the kind if the world has none.
    pub fn title(&self) -> &str {
        self.abilities().recorded.map_or(self.kind(), |world| world.title())
    }

    /// Returns what tells the world apart from others of its title, if there are any.
    pub fn fingerprint(&self) -> Option<String> {
        self.abilities().recorded.and_then(Recorded::fingerprint)
    }

    /// Returns what users should know of the world now, and have not been told yet.
    pub fn take_warnings(&self) -> Vec<String> {
        self.abilities().recorded.map_or_else(Vec::new, Recorded::take_warnings)
    }

    pub(crate) fn first_look(&self) -> Option<FirstLook<'_>> {
        self.abilities().recorded.and_then(Recorded::first_look)
    }

    /// Returns evaluation tasks, `per_group` in each group: the world's own, or else random starts
    /// and goals at unknown distances. The first call may take seconds.
    pub fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet, EnvError> {
        match self.abilities().evaluated {
            Some(world) => world.tasks(per_group, rng),
            None => TaskSet::random(self, per_group, rng),
        }
    }
}

#[derive(Clone, Debug)]
pub enum WorldScene {
    /// The space of goals, of a world without a picture of its own.
    Goals(Box<GoalSpace>),
    /// A grid map seen from above; states begin with the position (x, y) in cells, y down.
    Maze(MazeScene),
    /// An arm and what is around it; states begin with the position (x, y, z) of its grip in
    /// metres.
    Arm(ArmScene),
}

impl WorldScene {
    pub fn maze(&self) -> Option<&MazeScene> {
        if let Self::Maze(maze) = self { Some(maze) } else { None }
    }
}

#[derive(Clone, Debug)]
pub struct MazeScene {
    pub map: Arc<Grid>,
    /// Visit count of each cell, row-major.
    pub visits: Arc<Vec<u32>>,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::Spec;

    /// Returns the spec of a world whose states, goals and actions are positions and moves along
    /// axes of these centres and half ranges.
    pub fn positions(axes: &[(f32, f32)]) -> Spec {
        Spec {
            state_centre: axes.iter().map(|(centre, _)| *centre).collect(),
            state_half_range: axes.iter().map(|(_, half)| *half).collect(),
            change_scale: vec![1.0; axes.len()],
            achieved: (0..axes.len()).collect(),
            action_dim: axes.len(),
            goal_radius: 1.0,
            position_scale: Some(1.0),
            contacts: Vec::new(),
            time_limit: None,
        }
    }
}
