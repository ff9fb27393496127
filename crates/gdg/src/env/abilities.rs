//! What a world may offer beyond training: abilities that evaluation, edits, records and displays
//! use where they exist.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value};

use super::{EnvError, Environment, FirstLook, GroundTruth, Region, Task, TaskSet, WorldScene};
use crate::store::Store;

/// The abilities of a world; by default none.
///
/// A world lists the traits that it implements:
/// `Abilities { drawn: Some(self), ..Abilities::default() }`.
#[derive(Clone, Copy, Default)]
pub struct Abilities<'a> {
    /// What runs record of it.
    pub recorded: Option<&'a dyn Recorded>,
    pub episodes: Option<&'a dyn Episodes>,
    pub evaluated: Option<&'a dyn Evaluated>,
    /// How much of it has been explored.
    pub explored: Option<&'a dyn Explored>,
    pub editable: Option<&'a dyn Editable>,
    pub drawn: Option<&'a dyn Drawn>,
}

/// A world with a title, facts and data of its own.
pub trait Recorded {
    /// Returns its title, such as the map's name.
    fn title(&self) -> &str;

    /// Returns what tells it apart from other worlds of its title, the same in each of its runs:
    /// facts separated by commas, such as a size and a checksum. By default there is only one.
    fn fingerprint(&self) -> Option<String> {
        None
    }

    /// Returns facts for the run's records, by name; the first call may take seconds.
    fn facts(&self) -> Map<String, Value> {
        Map::new()
    }

    /// Identifies the given evaluation tasks; `None` for random ones.
    fn scenario(&self) -> Option<String> {
        None
    }

    /// Returns what users should know of the world now, and have not been told yet.
    fn take_warnings(&self) -> Vec<String> {
        Vec::new()
    }

    /// Returns how observations and actions of its own become states, goals and actions of the
    /// learner, for programs that run exported policies in it; `None` if they are the same.
    fn interface(&self) -> Option<Value> {
        None
    }

    /// Returns what a first look has found, by which other steps can be judged.
    fn first_look(&self) -> Option<FirstLook<'_>> {
        None
    }

    /// Turns a state of a file of recorded transitions into one of the world, if files have another
    /// unit or origin; the same for a goal or any position.
    fn own_state(&self, _state: &mut [f32]) {}

    /// Turns a state of the world into one of such a file.
    fn recorded_state(&self, _state: &mut [f32]) {}

    /// Writes the data that [`WorldKind::load`](super::WorldKind::load) reads. The trainer saves
    /// the agents' full states and the visits.
    fn save(&self, _store: &mut Store) {}

    /// Returns the memory in bytes that the world and its evaluation use, excluding the agents.
    fn memory_bytes(&self) -> u64 {
        0
    }
}

/// A world that defines where episodes begin or end.
pub trait Episodes {
    /// Whether, with [`Restart::Auto`](super::Restart::Auto), `agent` begins its next episode where
    /// it is: it once began at the world's own start, and no edit has cut it off from there. The
    /// default is a world without a start.
    fn stays(&self, _agent: usize) -> bool {
        false
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
}

/// A world with evaluation tasks of its own.
pub trait Evaluated: Sync {
    /// Returns evaluation tasks, `per_group` in each group; the first call may take seconds.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet, EnvError>;

    /// Returns how many tasks may run at once, where each agent takes memory and time of its own.
    fn tasks_at_once(&self) -> usize {
        usize::MAX
    }

    /// Returns the true distances if they are known; for evaluation and display only.
    fn ground_truth(&self) -> Option<Box<dyn GroundTruth + '_>> {
        None
    }

    /// Returns what heads straight for a goal, if the world knows such an action. Evaluations report
    /// how far it gets, as a baseline.
    fn straight_action(&self) -> Option<StraightAction> {
        None
    }
}

/// Writes the action that heads straight from a state for a goal, as if nothing were in the way.
pub type StraightAction = fn(&[f32], &[f32], &mut [f32]);

/// A world of countable places, such as cells. The trainer counts the agents' visits to them.
pub trait Explored {
    fn places(&self) -> usize;

    /// Returns the index of the place that `state` (`state_dim`) lies in.
    fn place(&self, state: &[f32]) -> usize;

    /// Returns the share of the world that has been explored, given the visits to each place.
    fn coverage(&self, visits: &[u32]) -> f64;
}

/// A world that an edited version can replace during a run.
pub trait Editable {
    /// Describes the changes when this world replaces `before` in a run.
    fn change_from(&self, before: &dyn Environment) -> Result<Change, EnvError>;

    /// Returns whether `action` in `state` could have led to `next`. Filters the stored transitions
    /// after an edit.
    fn is_possible(&self, state: &[f32], action: &[f32], next: &[f32]) -> bool;
}

/// A world that front ends draw.
pub trait Drawn {
    /// Returns what a front end draws, given the visits to each place of an [`Explored`] world.
    fn scene(&self, visits: &Arc<Vec<u32>>) -> WorldScene;

    /// Returns the states at which the film of a run shows D, or `None` if this world has no film.
    /// `goal_before` is the goal of the film so far, which it should keep. The number of places
    /// must not change during a run.
    fn probes(&self, _goal_before: Option<&[f32]>) -> Option<Probes> {
        None
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Whether distances may have grown, so that the learned ones are too short.
    pub may_lengthen: bool,
    /// Where steps may lead elsewhere than before; [`Region::everything`] if unknown.
    pub region: Region,
    pub summary: String,
    pub warning: Option<String>,
    /// Facts about the change for the run's records, by name.
    pub facts: Map<String, Value>,
}

/// Maximum number of places of a film. A frame then takes less time than two updates.
pub const MAX_PROBES: usize = 1_350;

/// The states at which a film shows D, and the goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Probes {
    /// The number of places, constant during a run. A place may have no state.
    pub places: usize,
    /// The place of each state, below `places`.
    pub place_of: Vec<u32>,
    /// `(states, state_dim)`.
    pub states: Vec<f32>,
    /// `(goal_dim)`.
    pub goal: Vec<f32>,
}
