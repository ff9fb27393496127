//! The paper's first experiment: a 7-joint Fetch arm that reaches for points in space, as
//! FetchReach-v4 of gymnasium-robotics 1.4.2 on MuJoCo 3.3.7, in pure Rust.
//!
//! An action pulls the gripper, which points down, by a soft weld for 20 sub-steps of 2 ms;
//! gravity, joint limits and the table act on the arm. The state is the reference's observation, so
//! the joints are hidden from the learner. Over episodes within the task's space, positions are off
//! by about a millimetre or less on average (`tests/fetch_reach.rs`). The arm does not collide with
//! itself, the robot's head and base, or the table's sides.

mod arm;
mod constraints;
mod dynamics;
mod geometry;
mod model;

use std::sync::Arc;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};

use super::{
    Abilities, DistanceUnit, Drawn, EnvError, EnvSettings, Environment, Episodes, Evaluated,
    Probes, Recorded, Spec, Task, TaskSet, WorldKind, WorldScene,
};
use arm::{Arm, STEP_SECS};
use constraints::ConstraintRows;
pub use geometry::{ArmScene, Corners, Pose, ProbeLattice};
use geometry::{film_probes, random_goal};
use model::GOAL_CENTRE;

pub const KIND: WorldKind = WorldKind {
    name: "fetch-reach",
    about: "a 7-joint arm that reaches for points in space",
    create: Some(|| Box::new(FetchReach::new(0))),
    open: None,
    load: |_, _| Ok(Box::new(FetchReach::new(0))),
    // As measured in docs/research/tried.md: a few thousand steps are enough, so each is worth an
    // update.
    defaults: &["agents=8", "learning_starts=200", "env_steps_per_update=1"],
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

/// Numbers of a state: grip position, finger positions, grip velocity in metres per step, finger
/// velocities.
const STATE: usize = 10;

/// Size of an action: pulls along x, y and z, and the gripper's opening, which has no effect.
const ACTION: usize = 4;

const DISTANCE_GROUPS: usize = 5;

/// Arms that reach for points.
///
/// Every episode begins at the reference's reset state, where the arm rests, so
/// [`super::Restart::Anywhere`] and [`super::Restart::StartCell`] are the same here.
pub struct FetchReach {
    spec: Spec,
    settings: EnvSettings,
    arms: Vec<Arm>,
    /// `(agents, 10)`.
    states: Vec<f32>,
    rows: ConstraintRows,
}

impl FetchReach {
    pub fn new(agents: usize) -> Self {
        let [x, y, z] = GOAL_CENTRE.as_vec3().to_array();
        let spec = Spec {
            state_centre: [[x, y, z].as_slice(), &[0.0; 7]].concat(),
            state_half_range: components(POSITION_RANGE, STRIDE),
            change_scale: components(STRIDE, STRIDE),
            achieved: vec![0, 1, 2],
            action_dim: ACTION,
            goal_radius: GOAL_RADIUS,
            // They are, but the space is only ten goal radii across: grids just slow learning down
            // (see docs/research/tried.md).
            position_scale: None,
            contacts: Vec::new(),
            time_limit: None,
        };
        let mut world = Self {
            spec,
            settings: EnvSettings::default(),
            arms: vec![Arm::at_reset(); agents],
            states: vec![0.0; agents * STATE],
            rows: ConstraintRows::new(),
        };
        (0..agents).for_each(|agent| world.observe(agent));
        world
    }

    fn observe(&mut self, agent: usize) {
        let (arm, state) = (&self.arms[agent], &mut self.states[agent * STATE..][..STATE]);
        let frames = arm.frames();
        let per_step = frames.grip_velocity(&arm.velocities) * STEP_SECS;
        state.fill(0.0);
        state[..3].copy_from_slice(&frames.grip().as_vec3().to_array());
        state[5..8].copy_from_slice(&per_step.as_vec3().to_array());
    }

    /// Draws a task, and returns it with its straight-line distance in metres.
    fn random_task(rng: &mut ChaCha8Rng) -> (f64, Task) {
        // This number decides nothing: without it, tasks would not be those of published results.
        rng.next_u32();
        let (start, goal) = (Arm::at_reset(), random_goal(rng));
        let task = Task {
            start: start.full_state().to_vec(),
            goal: goal.as_vec3().to_array().to_vec(),
            shortest: None,
            group: 0,
        };
        (start.frames().grip().distance(goal), task)
    }
}

/// Returns a number for each component of a state: `position` and `velocity` of the grip, 0 for the
/// fingers' constants.
fn components(position: f32, velocity: f32) -> Vec<f32> {
    [[position; 3].as_slice(), &[0.0; 2], &[velocity; 3], &[0.0; 2]].concat()
}

impl Environment for FetchReach {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.states
    }

    fn restart(&mut self, agent: usize, _: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.arms[agent] = Arm::at_reset();
        self.observe(agent);
        Ok(())
    }

    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        goal.copy_from_slice(&random_goal(rng).as_vec3().to_array());
    }

    /// Steps all arms. Noise is added to the action's first three components.
    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        for (agent, action) in actions.chunks_exact(ACTION).enumerate() {
            let pull = [action[0], action[1], action[2]].map(|v| self.settings.noisy(v, rng));
            self.arms[agent].step(pull.map(f64::from).into(), &mut self.rows);
            self.observe(agent);
        }
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        Ok(Box::new(Self { settings: self.settings, ..Self::new(agents) }))
    }

    /// Honours the noise; see [`FetchReach`] for where episodes begin.
    fn configure(&mut self, settings: &EnvSettings) {
        self.settings = *settings;
    }

    fn full_state(&self, agent: usize) -> Vec<f64> {
        self.arms[agent].full_state().to_vec()
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool, EnvError> {
        self.arms[agent] = Arm::from_full_state(full_state);
        self.observe(agent);
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
        let facts = json!({
            "episode_steps": EPISODE_STEPS,
            "goal_radius_cm": (100.0 * GOAL_RADIUS).round(),
            "success": "the goal was reached at any step of the episode",
        });
        Map::from_iter([("arm".to_owned(), facts)])
    }
}

impl Episodes for FetchReach {
    fn episode_steps(&self) -> Option<u32> {
        Some(EPISODE_STEPS)
    }
}

impl Evaluated for FetchReach {
    /// Draws five times `per_group` tasks, in groups of equal size by start-goal distance.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet, EnvError> {
        let mut drawn: Vec<(f64, Task)> =
            (0..DISTANCE_GROUPS * per_group).map(|_| Self::random_task(rng)).collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut set = TaskSet { unit: DistanceUnit::Centimetres, ..TaskSet::default() };
        for (group, of_group) in drawn.chunks(per_group.max(1)).enumerate() {
            let mean = of_group.iter().map(|(distance, _)| 100.0 * distance).sum::<f64>()
                / of_group.len() as f64;
            set.distances.push(Some((10.0 * mean).round() / 10.0));
            set.tasks.extend(of_group.iter().map(|(_, task)| Task { group, ..task.clone() }));
        }
        Ok(set)
    }
}

impl Drawn for FetchReach {
    fn scene(&self, _: &Arc<Vec<u32>>) -> WorldScene {
        WorldScene::Arm(ArmScene)
    }

    fn probes(&self, _: Option<&[f32]>) -> Option<Probes> {
        Some(film_probes())
    }
}

#[cfg(test)]
mod tests;
