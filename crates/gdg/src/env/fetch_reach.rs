//! The paper's first experiment: a 7-joint Fetch arm that reaches for points in space, as
//! FetchReach-v4 of gymnasium-robotics 1.4.2 on MuJoCo 3.3.7, in pure Rust.
//!
//! An action pulls the gripper, which points down, by a soft weld for 20 sub-steps of 2 ms;
//! gravity, joint limits and the table act on the arm. The state is the reference's observation, so
//! the joints are hidden from the learner. Over episodes within the task's space, positions are off
//! by about a millimetre or less on average (`tests/fetch_reach.rs`). The arm does not collide with
//! itself, the robot's head and base, or the table's sides.
//!
//! `fetch-reach-wall` puts a box between the left and the right half of the goals ([`WALL`]).

mod arm;
mod constraints;
mod dynamics;
mod model;
mod probe_lattice;
mod scene;

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Map, Value, json};

use super::{
    Abilities, DistanceUnit, Drawn, EnvError, EnvSettings, Environment, Episodes, Evaluated,
    Probes, Recorded, Scene, Spec, Task, TaskSet, WorldKind,
};
use arm::{Arm, STEP_SECS};
use constraints::Rows;
use model::GOAL_CENTRE;
pub use probe_lattice::ProbeLattice;
pub use scene::{ArmScene, Corners, Pose};
pub use scene::{WALL, Wall};
use scene::{guide, random_goal};

/// Registry entry of the arm.
pub const KIND: WorldKind = WorldKind {
    name: "fetch-reach",
    about: "a 7-joint arm that reaches for points in space",
    create: Some(|| Box::new(FetchReach::new(None, 0))),
    open: None,
    load: |_, _| Ok(Box::new(FetchReach::new(None, 0))),
    // As measured in docs/experiments.md: a few thousand steps are enough, so each is worth an
    // update.
    defaults: &["agents=8", "learning_starts=200", "env_steps_per_update=1"],
};

/// Registry entry of the arm with a wall.
pub const WALL_KIND: WorldKind = WorldKind {
    name: "fetch-reach-wall",
    about: "the same arm with a wall between the halves of its goals",
    create: Some(|| Box::new(FetchReach::new(Some(WALL), 0))),
    open: None,
    load: |_, _| Ok(Box::new(FetchReach::new(Some(WALL), 0))),
    // No goal lies in most of the space that excursions would explore.
    defaults: &["agents=8", "learning_starts=500", "env_steps_per_update=1", "frontier_epsilon=0"],
};

/// Length of an episode; reaching the goal does not end it.
const EPISODE_STEPS: u32 = 50;

/// A goal is reached when the grip is closer to it than this, in metres.
const GOAL_RADIUS: f32 = 0.05;

/// Goals lie at most this far from the grip at reset along each axis, in metres.
const GOAL_RANGE: f64 = 0.15;

/// Half the range of grip positions in metres: goals, and what exploration reaches beyond them.
const POSITION_RANGE: f32 = 0.25;

/// A full action moves the grip by this in steady motion, in metres per step.
const STRIDE: f32 = 0.033;

/// Goals and starts keep this distance from the wall's middle, in metres: the grip touches the wall
/// at 4 cm, and no goal is reached from the other side.
const WALL_CLEARANCE: f64 = 0.05;

/// With the wall, episodes begin this far to the left or to the right of it, in metres.
const WALL_START: f64 = 0.1;

/// Numbers of a state: grip position, finger positions, grip velocity in metres per step, finger
/// velocities.
const STATE: usize = 10;

/// Size of an action: pulls along x, y and z, and the gripper's opening, which has no effect.
const ACTION: usize = 4;

/// Number of distance groups that evaluations report.
const DISTANCE_GROUPS: usize = 5;

/// Arms that reach for points.
///
/// Every episode begins at the reference's reset state, where the arm rests; with the wall, at one
/// of two states, one on either side. So [`super::Restart::Anywhere`] and
/// [`super::Restart::StartCell`] are the same here.
pub struct FetchReach {
    wall: Option<Wall>,
    spec: Spec,
    noise: f32,
    /// Where episodes begin.
    starts: Vec<Arm>,
    arms: Vec<Arm>,
    /// `(agents, 10)`.
    states: Vec<f32>,
    rows: Rows,
}

impl FetchReach {
    /// Creates a world with `agents` arms at its first start.
    pub fn new(wall: Option<Wall>, agents: usize) -> Self {
        let [x, y, z] = GOAL_CENTRE.as_vec3().to_array();
        let spec = Spec {
            state_centre: [[x, y, z].as_slice(), &[0.0; 7]].concat(),
            state_half_range: components(POSITION_RANGE, STRIDE),
            change_scale: components(STRIDE, STRIDE),
            achieved: vec![0, 1, 2],
            action_dim: ACTION,
            goal_radius: GOAL_RADIUS,
            // They are, but the space is only ten goal radii across: grids just slow learning down
            // (see docs/experiments.md).
            position_scale: None,
        };
        let mut world = Self {
            starts: starts(wall.as_ref()),
            wall,
            spec,
            noise: 0.0,
            arms: Vec::new(),
            states: Vec::new(),
            rows: Rows::new(),
        };
        world.place(agents);
        world
    }

    /// Replaces all arms by `agents` new ones at the first start.
    fn place(&mut self, agents: usize) {
        self.arms = vec![self.starts[0]; agents];
        self.states = vec![0.0; agents * STATE];
        for agent in 0..agents {
            self.observe(agent);
        }
    }

    /// Computes an arm's state.
    fn observe(&mut self, agent: usize) {
        write_state(&self.arms[agent], &mut self.states[agent * STATE..(agent + 1) * STATE]);
    }

    /// Returns whether a position is to the left of the wall; false without a wall.
    fn is_left(&self, y: f64) -> bool {
        self.wall.is_some_and(|wall| y > wall.middle())
    }

    /// Draws a task, and returns it with its straight-line distance in metres. With the wall, start
    /// and goal are on different sides.
    fn random_task(&self, rng: &mut ChaCha8Rng) -> (f64, Task) {
        let start = &self.starts[rng.random_range(0..self.starts.len())];
        let from = start.frames().grip();
        let goal = loop {
            let goal = random_goal(self.wall.as_ref(), rng);
            if self.wall.is_none() || self.is_left(goal.y) != self.is_left(from.y) {
                break goal;
            }
        };
        let task = Task {
            start: start.full_state().to_vec(),
            goal: goal.as_vec3().to_array().to_vec(),
            shortest: None,
            group: 0,
        };
        (from.distance(goal), task)
    }
}

/// Returns a number for each component of a state: `position` and `velocity` of the grip, 0 for the
/// fingers' constants.
fn components(position: f32, velocity: f32) -> Vec<f32> {
    [[position; 3].as_slice(), &[0.0; 2], &[velocity; 3], &[0.0; 2]].concat()
}

/// Writes what the learner observes of `arm`.
fn write_state(arm: &Arm, state: &mut [f32]) {
    let frames = arm.frames();
    let per_step = frames.grip_velocity(&arm.velocities) * STEP_SECS;
    state.fill(0.0);
    state[..3].copy_from_slice(&frames.grip().as_vec3().to_array());
    state[5..8].copy_from_slice(&per_step.as_vec3().to_array());
}

/// Returns where episodes begin: the reset state, or the states that proportional control leads to
/// on both sides of the wall.
fn starts(wall: Option<&Wall>) -> Vec<Arm> {
    let Some(wall) = wall else { return vec![Arm::at_reset()] };
    let mut rows = Rows::new();
    let beside = [1.0, -1.0].map(|side| {
        let (mut arm, mut to) = (Arm::at_reset(), GOAL_CENTRE);
        to.y = wall.middle() + side * WALL_START;
        guide(&mut arm, to, None, &mut rows);
        arm
    });
    beside.to_vec()
}

/// What cannot fail in this world.
impl FetchReach {
    /// Moves `agent` to a start state, as [`Environment::restart`].
    pub fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) {
        // Without a choice, no random number is drawn.
        let start = if self.starts.len() > 1 { rng.random_range(0..self.starts.len()) } else { 0 };
        self.arms[agent] = self.starts[start];
        self.observe(agent);
    }

    /// Steps all arms. Noise is added to the action's first three components.
    pub fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) {
        let noise = self.noise;
        for (agent, action) in actions.chunks_exact(ACTION).enumerate() {
            let mut pull = [action[0], action[1], action[2]].map(|v| v.clamp(-1.0, 1.0));
            if noise > 0.0 {
                for v in &mut pull {
                    let sample: f32 = StandardNormal.sample(rng);
                    *v = (*v + noise * sample).clamp(-1.0, 1.0);
                }
            }
            self.arms[agent].step(pull.map(f64::from).into(), self.wall.as_ref(), &mut self.rows);
            self.observe(agent);
        }
    }

    /// Puts `agent` into a full state, as [`Environment::set_full_state`].
    pub fn set_full_state(&mut self, agent: usize, full_state: &[f64]) {
        self.arms[agent] = Arm::from_full_state(full_state);
        self.observe(agent);
    }

    /// Draws five times `per_group` tasks, in groups of equal size by start-goal distance. With the
    /// wall, start and goal are on different sides.
    pub fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> TaskSet {
        let mut drawn: Vec<(f64, Task)> =
            (0..DISTANCE_GROUPS * per_group).map(|_| self.random_task(rng)).collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut set = TaskSet { unit: DistanceUnit::Centimetres, ..TaskSet::default() };
        for (group, of_group) in drawn.chunks(per_group.max(1)).enumerate() {
            let mean = of_group.iter().map(|(distance, _)| 100.0 * distance).sum::<f64>()
                / of_group.len() as f64;
            set.distances.push(Some((10.0 * mean).round() / 10.0));
            set.tasks.extend(of_group.iter().map(|(_, task)| Task { group, ..task.clone() }));
        }
        set
    }
}

impl Environment for FetchReach {
    fn kind(&self) -> &'static str {
        if self.wall.is_some() { WALL_KIND.name } else { KIND.name }
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.states
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.restart(agent, rng);
        Ok(())
    }

    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        goal.copy_from_slice(&random_goal(self.wall.as_ref(), rng).as_vec3().to_array());
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.step(actions, rng);
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        let mut world = Self {
            wall: self.wall,
            spec: self.spec.clone(),
            noise: self.noise,
            starts: self.starts.clone(),
            arms: Vec::new(),
            states: Vec::new(),
            rows: Rows::new(),
        };
        world.place(agents);
        Ok(Box::new(world))
    }

    /// Honours the noise; see [`FetchReach`] for where episodes begin.
    fn configure(&mut self, settings: &EnvSettings) {
        self.noise = settings.noise;
    }

    fn full_state(&self, agent: usize) -> Vec<f64> {
        self.arms[agent].full_state().to_vec()
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool, EnvError> {
        self.set_full_state(agent, full_state);
        Ok(true)
    }

    fn abilities(&self) -> Abilities<'_> {
        Abilities {
            recorded: Some(self),
            episodes: Some(self),
            evaluated: Some(self),
            drawn: Some(self),
            ..Abilities::default()
        }
    }
}

impl Recorded for FetchReach {
    fn title(&self) -> &str {
        self.kind()
    }

    fn facts(&self) -> Map<String, Value> {
        let mut facts = json!({
            "episode_steps": EPISODE_STEPS,
            "goal_radius_cm": (100.0 * GOAL_RADIUS).round(),
            "success": "the goal was reached at any step of the episode",
        });
        if let Some(wall) = self.wall {
            facts["wall_m"] = json!([wall.low.to_array(), wall.high.to_array()]);
            facts["tasks"] = json!("from one side of the wall to the other");
        }
        Map::from_iter([("arm".to_owned(), facts)])
    }
}

impl Episodes for FetchReach {
    fn episode_steps(&self) -> Option<u32> {
        Some(EPISODE_STEPS)
    }
}

impl Evaluated for FetchReach {
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet, EnvError> {
        Ok(self.tasks(per_group, rng))
    }
}

impl Drawn for FetchReach {
    fn scene(&self, _: &Arc<Vec<u32>>) -> Scene {
        Scene::Arm(ArmScene::new(self.wall))
    }

    fn probes(&self, _: Option<&[f32]>) -> Option<Probes> {
        Some(probe_lattice::points(&ArmScene::new(self.wall)))
    }
}

#[cfg(test)]
mod tests;
