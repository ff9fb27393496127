//! The methods that the figures compare.

use crate::bridge::Planner;
use crate::train::{Method, Preset, Registry};
use crate::view::Rgb;

/// A method in the figures.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its name in data, in names of jobs and in `--set NAME:...`.
    pub name: &'static str,
    /// Its name in figures.
    pub title: &'static str,
    /// The learner's name.
    pub learner: &'static str,
    /// The planner.
    pub planner: Planner,
    /// Name of the preset that its settings are based on.
    pub preset: &'static str,
    /// Settings that differ from the preset's, as `--set` takes them.
    pub set: &'static [&'static str],
    /// Its colour: from Okabe and Ito's palette, which colour-blind people can tell apart, or grey.
    pub colour: Rgb,
}

/// SoRB's environment, in which the paper compares its methods, adds noise to all actions (preset `paper` has it too).
const NOISE: &str = "env_noise=1";

/// All methods: our default, those that the paper compares, and SoRB, on which it builds.
pub const ENTRIES: [Entry; 8] = [
    Entry {
        name: "default",
        title: "default (ours)",
        learner: "gdg",
        planner: Planner::Bridges,
        preset: "default",
        set: &[NOISE],
        colour: (213, 94, 0),
    },
    Entry {
        name: "gdg-bridge",
        title: "GDG, bridges",
        learner: "gdg",
        planner: Planner::Bridges,
        preset: "paper",
        set: &[],
        colour: (0, 114, 178),
    },
    Entry {
        name: "gdg",
        title: "GDG",
        learner: "gdg",
        planner: Planner::None,
        preset: "paper",
        set: &[],
        colour: (86, 180, 233),
    },
    Entry {
        name: "her",
        title: "DDPG + HER",
        learner: "her",
        planner: Planner::None,
        preset: "tuned",
        set: &[NOISE],
        colour: (0, 158, 115),
    },
    Entry {
        name: "ddpg",
        title: "DDPG",
        learner: "ddpg",
        planner: Planner::None,
        preset: "tuned",
        set: &[NOISE],
        colour: (230, 159, 0),
    },
    Entry {
        name: "ddpg-distance",
        title: "DDPG, distance",
        learner: "ddpg-distance",
        planner: Planner::None,
        preset: "tuned",
        set: &[NOISE],
        colour: (204, 121, 167),
    },
    Entry {
        // As published: search over the distances of a value function.
        name: "sorb",
        title: "SoRB on HER",
        learner: "her",
        planner: Planner::Sorb,
        preset: "tuned",
        set: &[NOISE],
        colour: (0, 0, 0),
    },
    Entry {
        name: "random",
        title: "random",
        learner: "random",
        planner: Planner::None,
        preset: "paper",
        set: &[],
        colour: (150, 150, 150),
    },
];

impl Entry {
    /// Returns the entry called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        ENTRIES.iter().find(|entry| entry.name == name)
    }

    /// Returns its preset, if `registry` has its learner: a build may lack either.
    pub fn preset(&self, registry: &Registry) -> Option<Preset> {
        registry.learner(self.learner).is_ok().then(|| Preset::named(self.preset)).flatten()
    }

    /// Returns its learner and planner.
    pub fn method(&self) -> Method {
        Method { learner: self.learner.to_owned(), planner: self.planner }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::train::{Overrides, settings_from};

    #[test]
    fn names_and_colours_differ_and_settings_are_valid() {
        let names: BTreeSet<_> = ENTRIES.iter().map(|entry| entry.name).collect();
        let colours: BTreeSet<_> = ENTRIES.iter().map(|entry| entry.colour).collect();
        assert_eq!((names.len(), colours.len()), (ENTRIES.len(), ENTRIES.len()));
        let registry = Registry::builtin();
        assert!(
            ["default", "gdg-bridge", "gdg", "random"]
                .iter()
                .all(|name| { Entry::named(name).is_some_and(|entry| entry.preset(&registry).is_some()) })
        );
        for (entry, preset) in ENTRIES.iter().filter_map(|entry| Some((entry, entry.preset(&registry)?))) {
            let set: Vec<String> = entry.set.iter().map(|text| (*text).to_owned()).collect();
            assert!(settings_from(preset, &Overrides { config: None, set: &set }).is_ok(), "{}", entry.name);
        }
    }
}
