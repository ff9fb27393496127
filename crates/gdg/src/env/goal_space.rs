//! The space of goals: what front ends draw of a world that they know nothing else about.

use std::fmt;
use std::sync::Arc;

use super::{EnvError, Environment, Episodes, Rendered, Spec, Walls};

/// A world without a picture of its own: its goals, states and steps.
#[derive(Clone)]
pub struct GoalSpace {
    kind: &'static str,
    title: String,
    spec: Spec,
    episode_steps: Option<u32>,
    walls: Option<Arc<Walls>>,
    /// Without agents, if it has not failed.
    world: Result<Arc<dyn Environment>, EnvError>,
}

impl GoalSpace {
    /// Returns the space of goals of `world`, with the walls of its maze, if it has one: the first two
    /// components of goals are positions in it.
    pub fn of(world: &dyn Environment, walls: Option<&Walls>) -> Self {
        Self {
            kind: world.kind(),
            title: world.title().to_owned(),
            spec: world.spec().clone(),
            episode_steps: world.abilities().episodes.and_then(Episodes::episode_steps),
            walls: walls.cloned().map(Arc::new),
            world: world.fork(0).map(Arc::from),
        }
    }

    /// Returns whether (x, y) lies in a wall of its maze or outside; not without a maze.
    pub fn is_wall(&self, at: [f32; 2]) -> bool {
        self.walls.as_ref().is_some_and(|walls| walls.cell_at(at).is_none_or(|i| walls.is_wall(i)))
    }

    /// Returns the sizes and scales of the world.
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// Returns the world with one agent, of which there are pictures if it renders any.
    pub fn world(&self) -> Result<Box<dyn Environment>, EnvError> {
        let world = self.world.clone()?;
        world.abilities().rendered.map_or_else(|| world.fork(1), Rendered::fork)
    }

    /// Returns the most steps that an agent may take to a goal, if the world itself defines them.
    pub fn episode_steps(&self) -> Option<u32> {
        self.episode_steps
    }

    /// Returns the range of a goal's component `i`: that of the maze, or of the state's component.
    pub fn range(&self, i: usize) -> [f32; 2] {
        if let Some(walls) = self.walls.as_ref().filter(|_| i < 2) {
            return walls.range(i);
        }
        let (spec, i) = (self.spec(), self.spec().achieved[i]);
        [-1.0, 1.0].map(|side| spec.state_centre[i] + side * spec.state_half_range[i])
    }

    /// Returns the name of a goal's component `i`.
    pub fn name(&self, i: usize) -> String {
        let named = self.spec().goal_dim() <= NAMES.len() && self.spec().position_scale.is_some();
        if named { NAMES[i].to_owned() } else { format!("g{i}") }
    }
}

/// Names of the components of positions.
const NAMES: [&str; 3] = ["x", "y", "z"];

/// Two are equal if nothing that is drawn differs.
impl PartialEq for GoalSpace {
    fn eq(&self, other: &Self) -> bool {
        (self.kind, &self.title, &self.spec, self.episode_steps, &self.walls)
            == (other.kind, &other.title, &other.spec, other.episode_steps, &other.walls)
    }
}

impl fmt::Debug for GoalSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GoalSpace").field("title", &self.title).finish_non_exhaustive()
    }
}
