//! Environments: goal-conditioned worlds with many parallel agents and no reward.
//!
//! Each world is a submodule that implements [`Environment`]: it steps the agents and answers every
//! query from training, evaluation and the front ends. The learner sees only sizes and scales
//! ([`Spec`]). [`WORLDS`] lists the built-in worlds.

pub mod fetch_reach;
pub mod maze;
mod probes;
mod task;

use std::any::Any;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::map::Grid;
use crate::store::{Store, StoreError};
pub use fetch_reach::{ArmScene, FetchReach};
pub use maze::PointMaze;
pub use probes::{MAX_PROBES, Probes};
pub(crate) use task::{BUDGET_FACTOR, MAX_BUDGET_STEPS};
pub use task::{DistanceUnit, GroundTruth, NEAR_STEPS, Task, TaskSet, TruePairs};

/// The built-in worlds.
pub const WORLDS: [WorldKind; 3] = [maze::KIND, fetch_reach::KIND, fetch_reach::WALL_KIND];

/// Registry entry of a kind of world.
///
/// A run's settings are the preset's, then the world's [`defaults`](Self::defaults), then what the
/// user gives.
#[derive(Clone, Copy, Debug)]
pub struct WorldKind {
    /// Name in checkpoints and, for worlds that need no file, on the command line.
    pub name: &'static str,
    /// Short description.
    pub about: &'static str,
    /// Creates the world, if it needs no file.
    pub create: Option<fn() -> Box<dyn Environment>>,
    /// Loads the world that [`Environment::save`] wrote, without agents.
    pub load: fn(&Store) -> Result<Box<dyn Environment>, StoreError>,
    /// Settings of a run in this world that differ from the preset's, as `--set` takes them
    /// (`name=value`). They apply to presets that are not published ones; whatever the user gives
    /// wins.
    pub defaults: &'static [&'static str],
}

/// Where episodes begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restart {
    /// Where the episode before ended, the first one at the world's own start; at a random place if
    /// it has none.
    Auto,
    /// At a random place.
    Anywhere,
    /// At the world's own start: a map's `S`, or a random one if there are several.
    StartCell,
    /// Where the episode before ended, the first one at the world's own start or a random place.
    Never,
}

/// Settings common to all worlds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvSettings {
    /// Where episodes begin.
    pub restart: Restart,
    /// Standard deviation of the noise that the world adds to every action; 0 for none.
    pub noise: f32,
}

impl Default for EnvSettings {
    fn default() -> Self {
        Self { restart: Restart::Auto, noise: 0.0 }
    }
}

/// Sizes and scales of states, goals and actions. Lengths are in the environment's own unit (maze
/// cells, or metres for an arm).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Whether goals are positions in a low-dimensional space, where distance is meaningful at
    /// every scale, so that multi-resolution encodings make sense.
    pub goals_are_positions: bool,
}

impl Spec {
    /// Returns the state size.
    pub fn state_dim(&self) -> usize {
        self.state_centre.len()
    }

    /// Returns the goal size.
    pub fn goal_dim(&self) -> usize {
        self.achieved.len()
    }

    /// Scales `value` of state component `i` to [-1, 1]; returns 0 for a constant component.
    pub fn scaled(&self, i: usize, value: f32) -> f32 {
        let half = self.state_half_range[i];
        if half > 0.0 { (value - self.state_centre[i]) / half } else { 0.0 }
    }

    /// Returns the components of the goal that `state` achieves.
    pub fn achieved<'a>(&'a self, state: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        self.achieved.iter().map(|i| state[*i])
    }

    /// Returns the Euclidean distance between the goal that `state` achieves and `goal`.
    pub fn goal_distance(&self, state: &[f32], goal: &[f32]) -> f32 {
        self.achieved(state).zip(goal).map(|(a, g)| (a - g) * (a - g)).sum::<f32>().sqrt()
    }

    /// Returns whether `state` reaches `goal`.
    pub fn reached(&self, state: &[f32], goal: &[f32]) -> bool {
        self.goal_distance(state, goal) < self.goal_radius
    }
}

/// A world in which many agents move in parallel, independently of each other.
///
/// A *state* is what the learner observes of an agent: `state_dim` numbers. A *full state* is
/// everything that the agent's future depends on, in the world's own layout: an arm's joints and
/// velocities as well as its gripper position.
pub trait Environment: Any + Send + Sync {
    /// Returns the name of its [`WorldKind`].
    fn kind(&self) -> &'static str;

    /// Returns its title, such as the map's name.
    fn title(&self) -> &str;

    /// Returns the sizes and scales of states, goals and actions.
    fn spec(&self) -> &Spec;

    /// Returns the number of agents.
    fn agents(&self) -> usize;

    /// Returns all agents' states, `(agents, state_dim)`.
    fn states(&self) -> &[f32];

    /// Returns an agent's full state: for every agent the same number of components, at least one.
    fn full_state(&self, agent: usize) -> Vec<f64>;

    /// Puts `agent` into a full state, or as close to it as the world allows if the state itself is
    /// not allowed. The numbers are finite and as many as [`Self::full_state`] returns, but come
    /// from a file: they may be out of range.
    fn set_full_state(&mut self, agent: usize, full_state: &[f64]);

    /// Moves `agent` to a start state.
    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng);

    /// Whether, with [`Restart::Auto`], `agent` begins its next episode where it is: it once began
    /// at the world's own start, and no edit has cut it off from there. The default is a world
    /// without a start.
    fn stays(&self, _agent: usize) -> bool {
        false
    }

    /// Draws a random goal that `agent` could be asked to reach from its place, into `goal`
    /// (`goal_dim`).
    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]);

    /// Steps every agent by one action; `actions` is `(agents, action_dim)`. The world clips them
    /// to [-1, 1]: the trainer has done so during exploration, but not in evaluation and display.
    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng);

    /// Writes the action that heads straight for `goal` from `state`, as if nothing were in the
    /// way, to `action` (`action_dim`); returns whether the world knows such an action. Evaluations
    /// report how far it gets: the floor for everything learned.
    fn straight_action(&self, _state: &[f32], _goal: &[f32], _action: &mut [f32]) -> bool {
        false
    }

    /// Returns a copy of the world with the same settings, `agents` new agents and empty
    /// statistics. In which state the agents are is up to the world: callers restart them or set
    /// their full states.
    fn fork(&self, agents: usize) -> Box<dyn Environment>;

    /// Switches to new settings. A world must honour both, or document that it ignores them; the
    /// default ignores them.
    fn configure(&mut self, _settings: &EnvSettings) {}

    /// Writes the data that [`WorldKind::load`] reads, and the exploration statistics if there are
    /// any. The trainer saves the agents' full states.
    fn save(&self, store: &mut Store);

    /// Restores the statistics that [`Self::save`] wrote.
    ///
    /// # Errors
    /// Returns an error if they do not fit this world.
    fn restore_statistics(&mut self, _store: &Store) -> Result<(), StoreError> {
        Ok(())
    }

    /// Counts the agents' places for the exploration statistics. Called after every exploration
    /// step.
    fn count_visits(&mut self) {}

    /// Returns the share of the world that the agents have explored, if it is defined.
    fn coverage(&self) -> Option<f64> {
        None
    }

    /// Returns facts for the run's records, by name; the first call may take seconds.
    fn facts(&self) -> Map<String, Value> {
        Map::new()
    }

    /// Returns evaluation tasks, `per_group` in each group; the first call may take seconds. The
    /// default draws random starts and goals, at unknown distances.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> TaskSet {
        let mut world = self.fork(1);
        let tasks = (0..per_group).map(|_| {
            world.restart(0, rng);
            let mut goal = vec![0.0; world.spec().goal_dim()];
            world.sample_goal(0, rng, &mut goal);
            Task { start: world.full_state(0), goal, shortest: None, group: 0 }
        });
        TaskSet { tasks: tasks.collect(), distances: vec![None], ..TaskSet::default() }
    }

    /// Returns the steps of an episode, if the world itself defines them: automatic episodes and
    /// evaluation tasks take as many. By default, episodes grow with what is known, and tasks take
    /// a multiple of their shortest path.
    fn episode_steps(&self) -> Option<u32> {
        None
    }

    /// Returns the task that the world itself defines, from its own start to its own goal, if any.
    fn default_task(&self) -> Option<Task> {
        None
    }

    /// Returns the true distances if they are known; for evaluation and display only.
    fn ground_truth(&self) -> Option<Box<dyn GroundTruth + '_>> {
        None
    }

    /// Returns whether `action` in `state` could have led to `next`. Filters the stored transitions
    /// after a world is edited.
    fn is_possible(&self, _state: &[f32], _action: &[f32], _next: &[f32]) -> bool {
        true
    }

    /// Describes the changes when this world replaces `before` in a run.
    ///
    /// # Errors
    /// Returns an error if it cannot replace `before`.
    fn change_from(&self, _before: &dyn Environment) -> Result<Change, EnvError> {
        Err(EnvError::NotEditable(self.kind()))
    }

    /// Returns what a front end draws.
    fn scene(&self) -> Scene {
        Scene::Nothing
    }

    /// Returns the states at which the film of a run shows D, or `None` if this world has no film.
    /// `goal_before` is the goal of the film so far, which it should keep. The number of places
    /// must not change during a run.
    fn probes(&self, _goal_before: Option<&[f32]>) -> Option<Probes> {
        None
    }

    /// Returns the memory in bytes that the world and its evaluation use, excluding the agents.
    fn memory_bytes(&self) -> u64 {
        0
    }
}

/// What a front end draws for a world.
#[derive(Clone, Debug, Default)]
pub enum Scene {
    /// Nothing: the agents train without being drawn.
    #[default]
    Nothing,
    /// A grid map seen from above; states begin with the position (x, y) in cells, y down.
    Maze(MazeScene),
    /// An arm and what is around it; states begin with the position (x, y, z) of its grip in
    /// metres.
    Arm(ArmScene),
}

impl Scene {
    /// Returns the maze scene; for other worlds, one of a single cell.
    pub fn maze(&self) -> MazeScene {
        match self {
            Self::Maze(maze) => maze.clone(),
            Self::Nothing | Self::Arm(_) => MazeScene::default(),
        }
    }
}

/// A maze and its visit counts.
#[derive(Clone, Debug)]
pub struct MazeScene {
    /// The map.
    pub map: Arc<Grid>,
    /// Visit count of each cell, row-major.
    pub visits: Arc<Vec<u32>>,
}

impl Default for MazeScene {
    /// Returns a map of one cell.
    fn default() -> Self {
        Self { map: Arc::new(Grid::empty("no map", 1, 1)), visits: Arc::new(vec![0]) }
    }
}

/// What a world edit changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Whether distances may have grown, so that the learned ones are too short.
    pub may_lengthen: bool,
    /// Short description of the change.
    pub summary: String,
    /// Warning for the user, if any.
    pub warning: Option<String>,
    /// Facts about the change for the run's records, by name.
    pub facts: Map<String, Value>,
}

/// Why a world cannot replace another in a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnvError {
    /// The world cannot be edited.
    #[error("the world {0} cannot be edited")]
    NotEditable(&'static str),
    /// The world is of another kind.
    #[error("the run uses a world of kind {run}, not {other}")]
    KindMismatch {
        /// Kind of the run's world.
        run: &'static str,
        /// Kind of the other world.
        other: &'static str,
    },
    /// The map has another size.
    #[error("the map is {} x {}, but the run's map is {} x {}", map.0, map.1, run.0, run.1)]
    SizeMismatch {
        /// Columns and rows of the map.
        map: (usize, usize),
        /// Columns and rows of the run's map.
        run: (usize, usize),
    },
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
            goals_are_positions: true,
        }
    }
}
