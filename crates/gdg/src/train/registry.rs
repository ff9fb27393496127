//! The registry of worlds, learners and methods.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Result, TrainError};
use crate::bridge::Planner;
use crate::env::{EnvError, Environment, GymOptions, WORLDS, WorldKind};
use crate::learn::{LEARNERS, LearnerKind};
use crate::settings::{Preset, Setting};
use crate::store::{Store, StoreError};

const MAPS: &str = "maze";

/// Settings of plans, of D as it is learned, and of learning from rewards.
const OF_PLANS: &str = "graph_bounds actor_waypoints distillation short_pairs imagined_walks hop_steps \
                        bridge_epsilon planned_episodes frontier_epsilon open_loop progress_check lookahead";
const OF_D: &str = "distance_scale_steps n_step pessimism expectile greedy_targets model_check \
                    hindsight_bound unblock_actor max_distance_steps loss";
const OF_REWARDS: &str = "actor_l2 discount target_noise";

/// World and learner kinds by name: the built-in ones and those added by a program.
#[derive(Clone, Debug)]
pub struct Registry {
    worlds: Vec<WorldKind>,
    learners: Vec<LearnerKind>,
    /// How environments in Python are opened.
    pub options: GymOptions,
    /// Where the data of resumed runs are now, if they have moved.
    pub data: Option<PathBuf>,
}

impl Registry {
    pub fn builtin() -> Arc<Self> {
        Arc::new(Self {
            worlds: WORLDS.to_vec(),
            learners: LEARNERS.to_vec(),
            options: GymOptions::default(),
            data: None,
        })
    }

    /// Changes it, such as its `options`.
    #[must_use]
    pub fn with(self: Arc<Self>, change: impl FnOnce(&mut Self)) -> Arc<Self> {
        let mut registry = Arc::unwrap_or_clone(self);
        change(&mut registry);
        Arc::new(registry)
    }

    /// Adds a world; it replaces an earlier one of the same name.
    #[must_use]
    pub fn with_world(self: Arc<Self>, kind: WorldKind) -> Arc<Self> {
        self.with(|registry| {
            registry.worlds.retain(|known| known.name != kind.name);
            registry.worlds.insert(0, kind);
        })
    }

    /// Adds a learner; it replaces an earlier one of the same name.
    #[must_use]
    pub fn with_learner(self: Arc<Self>, kind: LearnerKind) -> Arc<Self> {
        self.with(|registry| {
            registry.learners.retain(|known| known.name != kind.name);
            registry.learners.insert(0, kind);
        })
    }

    pub fn worlds(&self) -> &[WorldKind] {
        &self.worlds
    }

    /// Returns the worlds that a name alone opens, without a file.
    pub fn named_worlds(&self) -> impl Iterator<Item = &WorldKind> {
        self.worlds.iter().filter(|kind| kind.create.is_some())
    }

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
            None => self.named_worlds().find(|kind| kind.name == name),
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

    pub fn learners(&self) -> &[LearnerKind] {
        &self.learners
    }

    pub fn learner(&self, name: &str) -> Result<&LearnerKind> {
        let found = self.learners.iter().find(|kind| kind.name == name);
        found.ok_or_else(|| {
            let known = method_names(self.learners.iter().map(|kind| kind.name));
            TrainError::Other(format!("unknown learner {name:?}; {known}"))
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

    /// Whether a setting changes nothing in runs of `method`.
    pub fn is_idle(&self, setting: &Setting, method: &Method) -> bool {
        let of = |names: &str| names.split_whitespace().any(|name| name == setting.name);
        let rewarded = self.learner(&method.learner).map(|kind| kind.is_rewarded);
        !method.plans() && (setting.group == "bridges" || of(OF_PLANS))
            || rewarded.is_ok_and(|is| of(if is { OF_D } else { OF_REWARDS }))
    }

    pub(crate) fn load_world(&self, name: &str, store: &Store) -> Result<Box<dyn Environment>> {
        let missing = || format!("uses the world {name:?}, which this program does not have");
        let kind = self.world(name).ok_or_else(|| StoreError::inconsistent(missing()))?;
        (kind.load)(store, &self.options).map_err(|error| match error {
            EnvError::Store(error) => error.into(),
            failed => failed.into(),
        })
    }
}

/// A learner, which learns D and acts, and a planner, which plans over D.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Method {
    /// The name of the learner's [`crate::learn::LearnerKind`].
    pub learner: String,
    pub planner: Planner,
}

#[derive(Clone, Copy, Debug)]
pub struct NamedMethod {
    pub name: &'static str,
    pub learner: &'static str,
    pub planner: Planner,
    pub about: &'static str,
}

/// The named combinations, default first. Any other is called `LEARNER+PLANNER`.
pub const METHODS: [NamedMethod; 8] = [
    named("gdg-bridge", "gdg", Planner::Bridges, "Explores and plans through bridge points"),
    named("gdg", "gdg", Planner::None, "Goal-distance gradient: the actor alone"),
    named("gdg-distance", "gdg-distance", Planner::None, "The same, D given: the straight line"),
    named("sorb", "gdg", Planner::Sorb, "Search on the replay buffer: unverified edges, one plan"),
    named("ddpg", "ddpg", Planner::None, "Deep deterministic policy gradient, sparse rewards"),
    named("her", "her", Planner::None, "The same with hindsight experience replay"),
    named("ddpg-distance", "ddpg-distance", Planner::None, "DDPG rewarded by straight lines"),
    named("random", "random", Planner::None, "Random actions without learning: the baseline"),
];

const fn named(
    name: &'static str,
    learner: &'static str,
    planner: Planner,
    about: &'static str,
) -> NamedMethod {
    NamedMethod { name, learner, planner, about }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown method {0:?}; {help}", help = method_names(LEARNERS.iter().map(|kind| kind.name)))]
pub struct UnknownMethod(String);

fn method_names(learners: impl Iterator<Item = &'static str>) -> String {
    format!(
        "methods: {}, or LEARNER+PLANNER with a learner ({}) and a planner ({})",
        METHODS.map(|named| named.name).join(", "),
        learners.collect::<Vec<_>>().join(", "),
        Planner::ALL.map(Planner::name).join(", ")
    )
}

impl Default for Method {
    fn default() -> Self {
        Self::from(&METHODS[0])
    }
}

impl From<&NamedMethod> for Method {
    fn from(named: &NamedMethod) -> Self {
        Self { learner: named.learner.to_owned(), planner: named.planner }
    }
}

impl Method {
    pub fn name(&self) -> String {
        match METHODS.iter().find(|named| Self::from(*named) == *self) {
            Some(named) => named.name.to_owned(),
            None => format!("{}+{}", self.learner, self.planner.name()),
        }
    }

    pub fn plans(&self) -> bool {
        self.planner != Planner::None
    }

    pub fn bridges(&self) -> bool {
        self.planner == Planner::Bridges
    }
}

impl FromStr for Method {
    type Err = UnknownMethod;

    /// Parses the name of a combination or `LEARNER+PLANNER`. Whether the learner exists is up to
    /// the registry.
    fn from_str(text: &str) -> Result<Self, UnknownMethod> {
        if let Some(named) = METHODS.iter().find(|named| named.name == text) {
            return Ok(named.into());
        }
        let unknown = || UnknownMethod(text.to_owned());
        let (learner, planner) = text.split_once('+').ok_or_else(unknown)?;
        let planner =
            Planner::ALL.into_iter().find(|known| known.name() == planner).ok_or_else(unknown)?;
        Ok(Self { learner: learner.to_owned(), planner })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.name())
    }
}

impl Serialize for Method {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&self.name())
    }
}

impl<'de> Deserialize<'de> for Method {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
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

    #[test]
    fn every_method_name_parses_to_the_same_method() {
        for learner in ["gdg", "her", "random", "my-own"] {
            for planner in Planner::ALL {
                let method = Method { learner: learner.to_owned(), planner };
                assert_eq!(method.name().parse(), Ok(method.clone()), "{method}");
            }
        }
        assert_eq!(Method::default().name(), "gdg-bridge");
        assert_eq!("gdg+none".parse::<Method>().map(|m| m.name()), Ok("gdg".to_owned()));
        assert!("gdg+walls".parse::<Method>().is_err() && "gdgg".parse::<Method>().is_err());
    }
}
