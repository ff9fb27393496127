//! The registry of worlds and learners.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::TrainError;
use super::method::{Method, method_names};
use crate::env::{EnvError, Environment, GymOptions, WORLDS, WorldKind};
use crate::learn::{LEARNERS, LearnerKind};
use crate::settings::Preset;
use crate::store::{Store, StoreError};

/// Name of the kind of world that maps are loaded into.
const MAPS: &str = "maze";

/// World and learner kinds by name: the built-in ones and those added by a program.
#[derive(Clone, Debug)]
pub struct Registry {
    worlds: Vec<WorldKind>,
    learners: Vec<LearnerKind>,
    options: GymOptions,
    data: Option<PathBuf>,
}

impl Registry {
    /// Returns a registry of the built-in worlds and learners.
    pub fn builtin() -> Arc<Self> {
        Arc::new(Self {
            worlds: WORLDS.to_vec(),
            learners: LEARNERS.to_vec(),
            options: GymOptions::default(),
            data: None,
        })
    }

    /// Sets where the data of resumed runs are now, if they have moved.
    #[must_use]
    pub fn with_data(self: Arc<Self>, data: Option<PathBuf>) -> Arc<Self> {
        let registry = Arc::unwrap_or_clone(self);
        Arc::new(Self { data, ..registry })
    }

    /// Returns where the data of resumed runs are now, if they have moved.
    pub fn data(&self) -> Option<&Path> {
        self.data.as_deref()
    }

    /// Sets the options of Gymnasium's environments.
    #[must_use]
    pub fn with_gym(self: Arc<Self>, options: GymOptions) -> Arc<Self> {
        let registry = Arc::unwrap_or_clone(self);
        Arc::new(Self { options, ..registry })
    }

    /// Has worlds of checkpoints only looked at, where that is possible: no process is started, and
    /// their agents cannot act.
    #[must_use]
    pub fn only_reading(self: Arc<Self>) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        registry.options.reads_only = true;
        Arc::new(registry)
    }

    /// Adds a world; it replaces an earlier one of the same name.
    #[must_use]
    pub fn with_world(self: Arc<Self>, kind: WorldKind) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        registry.worlds.retain(|known| known.name != kind.name);
        registry.worlds.insert(0, kind);
        Arc::new(registry)
    }

    /// Adds a learner; it replaces an earlier one of the same name.
    #[must_use]
    pub fn with_learner(self: Arc<Self>, kind: LearnerKind) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        registry.learners.retain(|known| known.name != kind.name);
        registry.learners.insert(0, kind);
        Arc::new(registry)
    }

    /// Returns the world kinds.
    pub fn worlds(&self) -> &[WorldKind] {
        &self.worlds
    }

    /// Returns the world kind called `name`.
    pub fn world(&self, name: &str) -> Option<&WorldKind> {
        self.worlds.iter().find(|kind| kind.name == name)
    }

    /// Returns the world kind that `name` opens on the command line: one that needs no file, or
    /// else the maze on the map of that name.
    pub fn world_opened_by(&self, name: &str) -> Option<&WorldKind> {
        self.world_without_file(name).or_else(|| self.world(MAPS))
    }

    /// Returns the world kind that `name` opens without a file: `NAME`, or `NAME:ARGUMENT`.
    pub fn world_without_file(&self, name: &str) -> Option<&WorldKind> {
        match name.split_once(':') {
            Some((kind, _)) => self.world(kind).filter(|kind| kind.open.is_some()),
            None => self.world(name).filter(|kind| kind.create.is_some()),
        }
    }

    /// Opens the world called `name`, without agents; `None` unless it needs no file.
    pub fn open(&self, name: &str) -> Option<Result<Box<dyn Environment>, EnvError>> {
        let kind = self.world_without_file(name)?;
        match (name.split_once(':'), kind.open, kind.create) {
            (Some((_, argument)), Some(open), _) => Some(open(argument, &self.options)),
            (None, _, Some(create)) => Some(Ok(create())),
            _ => None,
        }
    }

    /// Returns the learner kinds.
    pub fn learners(&self) -> &[LearnerKind] {
        &self.learners
    }

    /// Returns the learner kind called `name`.
    pub fn learner(&self, name: &str) -> Result<&LearnerKind, TrainError> {
        let found = self.learners.iter().find(|kind| kind.name == name);
        found.ok_or_else(|| {
            let known = method_names(self.learners.iter().map(|kind| kind.name));
            TrainError::UnknownLearner { name: name.to_owned(), known }
        })
    }

    /// Returns the preset that a run of `method` starts from unless another is given: the tuned one
    /// for learners that learn from a reward.
    pub fn preset_of(&self, method: &Method) -> Preset {
        match self.learner(&method.learner) {
            Ok(kind) if kind.is_rewarded => Preset::Tuned,
            // A run of an unknown learner cannot be created.
            _ => Preset::Default,
        }
    }

    /// Loads the world of the kind `name` saved in `store`, without agents.
    pub fn load_world(
        &self,
        name: &str,
        store: &Store,
    ) -> Result<Box<dyn Environment>, TrainError> {
        match self.world(name) {
            Some(kind) => (kind.load)(store, &self.options).map_err(|error| match error {
                EnvError::Store(error) => error.into(),
                failed => failed.into(),
            }),
            None => Err(StoreError::inconsistent(format!(
                "uses the world {name:?}, which this program does not have"
            ))
            .into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_registered_learner_that_needs_rewards_starts_from_the_tuned_preset() {
        let method: Method = "own+sorb".parse().expect("a method");
        let builtin = Registry::builtin();
        let ddpg = *builtin.learner("ddpg").expect("built in");
        assert_eq!(builtin.preset_of(&method), Preset::Default);
        let registry = builtin.with_learner(LearnerKind { name: "own", ..ddpg });
        assert_eq!(registry.preset_of(&method), Preset::Tuned);
        // It may also replace a built-in one.
        let registry =
            registry.with_learner(LearnerKind { name: "gdg", is_rewarded: true, ..ddpg });
        assert_eq!(registry.preset_of(&Method::default()), Preset::Tuned);
        assert_eq!(registry.learners().iter().filter(|kind| kind.name == "gdg").count(), 1);
    }
}
