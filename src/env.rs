//! Environments: goal-conditioned worlds of many agents, without any reward.
//!
//! A world is one folder here: it moves agents, and says everything about itself that training, evaluation and front
//! ends ask ([`Environment`]). The learner sees sizes and scales alone ([`Spec`]). [`WORLDS`] lists the built-in ones.

pub mod maze;
mod task;

use std::any::Any;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::map::Grid;
use crate::store::{Store, StoreError};
pub use maze::PointMaze;
pub use task::{NEAR_STEPS, Task, TaskSet, TruePairs, Truth};

/// The built-in worlds.
pub const WORLDS: [WorldKind; 1] = [maze::KIND];

/// A kind of world, as it is registered.
#[derive(Clone, Copy, Debug)]
pub struct WorldKind {
    /// Its name in checkpoints, and on the command line where it needs no file.
    pub name: &'static str,
    /// What it is, in a few words.
    pub about: &'static str,
    /// Makes one that needs no file.
    pub create: Option<fn() -> Box<dyn Environment>>,
    /// Makes the one that [`Environment::save`] wrote, without agents.
    pub load: fn(&Store) -> Result<Box<dyn Environment>, StoreError>,
}

/// Where episodes begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Restart {
    /// At a random place.
    Anywhere,
    /// At the world's own start: a map's `S` (one of them at random, if there are several).
    StartCell,
}

/// What can be set about every world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvSettings {
    /// Where episodes begin.
    pub restart: Restart,
    /// Standard deviation of the noise that the world adds to every action; 0 for none.
    pub noise: f32,
}

impl Default for EnvSettings {
    fn default() -> Self {
        Self { restart: Restart::Anywhere, noise: 0.0 }
    }
}

/// What an environment's numbers mean. Lengths are in the environment's own unit (cells of a maze, metres of an
/// arm).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// Middle of each state component's range; its length is the size of a state.
    pub state_centre: Vec<f32>,
    /// Half of each state component's range: `(state - centre) / half_range` lies in [-1, 1]. 0 for a component that
    /// never varies.
    pub state_half_range: Vec<f32>,
    /// How much each state component changes in a step, roughly: what the dynamics model's outputs are measured in.
    /// 0 for a component that never varies.
    pub change_scale: Vec<f32>,
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

    /// State component `i` of value `value`, scaled to [-1, 1]; 0 for one that never varies.
    pub fn scaled(&self, i: usize, value: f32) -> f32 {
        let half = self.state_half_range[i];
        if half > 0.0 { (value - self.state_centre[i]) / half } else { 0.0 }
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
///
/// A *state* is what the learner sees of an agent, `state_dim` numbers. A *whole state* is everything that the agent's
/// future depends on, in the world's own layout: joints and velocities of an arm as well as its gripper's position.
pub trait Environment: Any + Send + Sync {
    /// The name of its [`WorldKind`].
    fn kind(&self) -> &'static str;

    /// What it is called: a map's name.
    fn title(&self) -> &str;

    /// What states, goals and actions are.
    fn spec(&self) -> &Spec;

    /// How many agents there are.
    fn agents(&self) -> usize;

    /// All agents' states, `(agents, state_dim)`.
    fn states(&self) -> &[f32];

    /// An agent's whole state.
    fn whole(&self, agent: usize) -> Vec<f64>;

    /// Puts `agent` into a whole state, exactly; or as near to it as the world allows, where it allows it not.
    fn place(&mut self, agent: usize, whole: &[f64]);

    /// Puts `agent` at a start.
    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng);

    /// A random goal that an agent at `agent`'s place could be asked to reach, into `goal` (`goal_dim`).
    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]);

    /// Moves every agent by one action; `actions` is `(agents, action_dim)` and clipped to [-1, 1].
    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng);

    /// The same world for so many other agents, all at some start; its statistics begin again.
    fn fork(&self, agents: usize) -> Box<dyn Environment>;

    /// Goes on under other settings.
    fn configure(&mut self, _settings: &EnvSettings) {}

    /// Writes what [`WorldKind::load`] reads, and statistics of exploration if there are any. Agents' whole states are
    /// saved by the trainer.
    fn save(&self, store: &mut Store);

    /// Restores the statistics that [`Self::save`] wrote.
    ///
    /// # Errors
    /// That they do not fit this world.
    fn restore_statistics(&mut self, _store: &Store) -> Result<(), StoreError> {
        Ok(())
    }

    /// Counts where the agents are, for statistics of exploration. Called after each of their steps while they explore.
    fn count_visits(&mut self) {}

    /// Share of the world that agents have explored, where that can be said.
    fn coverage(&self) -> Option<f64> {
        None
    }

    /// Facts for records, by name; may take seconds the first time.
    fn facts(&self) -> Map<String, Value> {
        Map::new()
    }

    /// Tasks to evaluate on, `per_group` of each kind; may take seconds the first time. Unless a world knows better: from
    /// random starts to random goals, of unknown length.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> TaskSet {
        let mut world = self.fork(1);
        let tasks = (0..per_group).map(|_| {
            world.restart(0, rng);
            let mut goal = vec![0.0; world.spec().goal_dim()];
            world.sample_goal(0, rng, &mut goal);
            Task { start: world.whole(0), goal, shortest: None, group: 0 }
        });
        TaskSet { tasks: tasks.collect(), distances: vec![0.0] }
    }

    /// The one task that the world itself sets, from its own start to its own goal.
    fn own_task(&self) -> Option<Task> {
        None
    }

    /// The true distances, where they are known: for evaluation and display alone.
    fn truth(&self) -> Option<Box<dyn Truth + '_>> {
        None
    }

    /// Whether a step could have led from `state` by `action` to `next`: what an edited world is asked of stored
    /// transitions.
    fn is_possible(&self, _state: &[f32], _action: &[f32], _next: &[f32]) -> bool {
        true
    }

    /// What changed where this world takes the place of `before` in a run.
    ///
    /// # Errors
    /// That it cannot take its place.
    fn change_from(&self, _before: &dyn Environment) -> Result<Change, EnvError> {
        Err(EnvError::NotEditable(self.kind()))
    }

    /// What a front end draws.
    fn scene(&self) -> Scene {
        Scene::Nothing
    }

    /// Memory that it and its evaluation take, in bytes, besides the agents.
    fn memory_bytes(&self) -> u64 {
        0
    }
}

/// What a front end draws of a world.
#[derive(Clone, Debug, Default)]
pub enum Scene {
    /// Nothing: agents train without a picture.
    #[default]
    Nothing,
    /// A grid map seen from above; states begin with the position (x, y) in cells, y down.
    Maze(MazeScene),
}

impl Scene {
    /// The maze; of another world, one of a single cell.
    pub fn maze(&self) -> MazeScene {
        match self {
            Self::Maze(maze) => maze.clone(),
            Self::Nothing => MazeScene::default(),
        }
    }
}

/// A maze, and where its agents have been.
#[derive(Clone, Debug)]
pub struct MazeScene {
    /// The map.
    pub map: Arc<Grid>,
    /// How often an agent was in each cell, row-major.
    pub visits: Arc<Vec<u32>>,
}

impl Default for MazeScene {
    /// A map of one cell.
    fn default() -> Self {
        Self { map: Arc::new(Grid::empty("no map", 1, 1)), visits: Arc::new(vec![0]) }
    }
}

/// What an edit of a world changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Whether distances may have grown, so that what was learned is too short.
    pub may_lengthen: bool,
    /// The change in a few words.
    pub what: String,
    /// What to beware of.
    pub warning: Option<String>,
    /// Its numbers for records, by name.
    pub facts: Map<String, Value>,
}

/// Why a world cannot take another's place in a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnvError {
    /// A world that cannot be edited.
    #[error("the world {0} cannot be edited")]
    NotEditable(&'static str),
    /// A world of another kind.
    #[error("the run is in a world of the kind {run}, not {other}")]
    OtherKind {
        /// The run's.
        run: &'static str,
        /// The other's.
        other: &'static str,
    },
    /// A map of another size.
    #[error("the map is {} x {}, the run's {} x {}", map.0, map.1, run.0, run.1)]
    OtherSize {
        /// Columns and rows of the map.
        map: (usize, usize),
        /// Columns and rows of the run's map.
        run: (usize, usize),
    },
}
