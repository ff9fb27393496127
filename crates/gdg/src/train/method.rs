//! Methods: a learner and a planner.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::bridge::Planner;
use crate::learn::LEARNERS;

/// A learner, which learns D and acts, and a planner, which plans over D.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Method {
    /// The name of the learner's [`crate::learn::LearnerKind`].
    pub learner: String,
    /// The planner over the learned distance.
    pub planner: Planner,
}

/// A named combination.
#[derive(Clone, Copy, Debug)]
pub struct NamedMethod {
    /// Its name on the command line and in records.
    pub name: &'static str,
    /// The learner's name.
    pub learner: &'static str,
    /// The planner.
    pub planner: Planner,
    /// Short description.
    pub about: &'static str,
}

/// The named combinations, default first. Any other is called `LEARNER+PLANNER`.
pub const METHODS: [NamedMethod; 8] = [
    NamedMethod {
        name: "gdg-bridge",
        learner: "gdg",
        planner: Planner::Bridges,
        about: "Explores and plans through bridge points",
    },
    NamedMethod {
        name: "gdg",
        learner: "gdg",
        planner: Planner::None,
        about: "Goal-distance gradient: the actor alone",
    },
    NamedMethod {
        name: "gdg-distance",
        learner: "gdg-distance",
        planner: Planner::None,
        about: "The same, D given: the straight line to the goal",
    },
    NamedMethod {
        name: "sorb",
        learner: "gdg",
        planner: Planner::Sorb,
        about: "Search on the replay buffer: unverified edges, one plan",
    },
    NamedMethod {
        name: "ddpg",
        learner: "ddpg",
        planner: Planner::None,
        about: "Deep deterministic policy gradient, sparse rewards",
    },
    NamedMethod {
        name: "her",
        learner: "her",
        planner: Planner::None,
        about: "The same with hindsight experience replay",
    },
    NamedMethod {
        name: "ddpg-distance",
        learner: "ddpg-distance",
        planner: Planner::None,
        about: "DDPG rewarded by straight-line distance",
    },
    NamedMethod {
        name: "random",
        learner: "random",
        planner: Planner::None,
        about: "Random actions without learning: the baseline",
    },
];

/// Error for a text that does not name a method.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown method {0:?}; {help}", help = method_names(LEARNERS.iter().map(|kind| kind.name)))]
pub struct UnknownMethod(String);

/// Lists all methods with these learners.
pub fn method_names(learners: impl Iterator<Item = &'static str>) -> String {
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
    /// Returns the name used on the command line and in records.
    pub fn name(&self) -> String {
        match METHODS.iter().find(|named| Self::from(*named) == *self) {
            Some(named) => named.name.to_owned(),
            None => format!("{}+{}", self.learner, self.planner.name()),
        }
    }

    /// Whether it plans over a graph at execution time.
    pub fn plans(&self) -> bool {
        self.planner != Planner::None
    }

    /// Whether it also uses bridges for exploration and learning.
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
