//! The worlds and learners that runs are made of.

use std::sync::Arc;

use super::error::TrainError;
use crate::env::{Environment, WORLDS, WorldKind};
use crate::learn::{LEARNERS, LearnerKind};
use crate::store::{Store, StoreError};

/// Kinds of worlds and learners by name: the built-in ones, and those that a program adds.
#[derive(Clone, Debug)]
pub struct Registry {
    worlds: Vec<WorldKind>,
    learners: Vec<LearnerKind>,
}

impl Registry {
    /// The built-in worlds and learners.
    pub fn builtin() -> Arc<Self> {
        Arc::new(Self { worlds: WORLDS.to_vec(), learners: LEARNERS.to_vec() })
    }

    /// The same and one more world; of two that share a name, the later one counts.
    #[must_use]
    pub fn with_world(self: Arc<Self>, kind: WorldKind) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        registry.worlds.insert(0, kind);
        Arc::new(registry)
    }

    /// The same and one more learner; of two that share a name, the later one counts.
    #[must_use]
    pub fn with_learner(self: Arc<Self>, kind: LearnerKind) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        registry.learners.insert(0, kind);
        Arc::new(registry)
    }

    /// The worlds.
    pub fn worlds(&self) -> &[WorldKind] {
        &self.worlds
    }

    /// The learners.
    pub fn learners(&self) -> &[LearnerKind] {
        &self.learners
    }

    /// The kind of learner called `name`.
    ///
    /// # Errors
    /// That there is none.
    pub fn learner(&self, name: &str) -> Result<&LearnerKind, TrainError> {
        let found = self.learners.iter().find(|kind| kind.name == name);
        found.ok_or_else(|| {
            let known: Vec<&str> = self.learners.iter().map(|kind| kind.name).collect();
            TrainError::UnknownLearner { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// The world that was written to `store`, without agents.
    ///
    /// # Errors
    /// That its kind is not known, or what is wrong with it.
    pub fn load_world(&self, store: &Store) -> Result<Box<dyn Environment>, StoreError> {
        // Before there were other worlds, checkpoints did not name theirs.
        let name = store.text("world").unwrap_or("maze");
        match self.worlds.iter().find(|kind| kind.name == name) {
            Some(kind) => (kind.load)(store),
            None => Err(StoreError::misfit(format!("is of the world {name:?}, which this program does not know"))),
        }
    }
}
