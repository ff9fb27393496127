//! The methods that the figures compare.

use gdg::bridge::Planner;
use gdg::draw::Rgb;
use gdg::train::{Method, Preset, Registry};

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
    /// The dataset of OGBench that it learns from instead of acting, in the built-in maze that
    /// this is of, if any.
    pub dataset: Option<&'static str>,
    /// Its colour: from Okabe and Ito's palette, which colour-blind people can tell apart, or grey.
    pub colour: Rgb,
}

/// SoRB's environment, in which the paper compares its methods, adds noise to all actions (preset
/// `paper` has it too).
const NOISE: &str = "env_noise=1";

/// Our default.
pub const DEFAULT: Entry = Entry {
    name: "default",
    title: "default (ours)",
    learner: "gdg",
    planner: Planner::Bridges,
    preset: "default",
    set: &[NOISE],
    dataset: None,
    colour: (213, 94, 0),
};

/// The same without bridge points: what the actor alone learns.
pub const DEFAULT_GDG: Entry = Entry {
    name: "default-gdg",
    title: "default, no bridges (ours)",
    planner: Planner::None,
    colour: (0, 158, 115),
    ..DEFAULT
};

/// The paper's method with bridge points, as published.
pub const GDG_BRIDGE: Entry = Entry {
    name: "gdg-bridge",
    title: "GDG, bridges",
    preset: "paper",
    set: &[],
    colour: (0, 114, 178),
    ..DEFAULT
};

/// The same without them.
pub const GDG: Entry = Entry {
    name: "gdg",
    title: "GDG",
    planner: Planner::None,
    colour: (86, 180, 233),
    ..GDG_BRIDGE
};

/// A rival that learns from sparse rewards, with hindsight.
pub const HER: Entry = Entry {
    name: "her",
    title: "DDPG + HER",
    learner: "her",
    planner: Planner::None,
    preset: "tuned",
    set: &[NOISE],
    dataset: None,
    colour: (0, 158, 115),
};

/// The same without hindsight.
pub const DDPG: Entry =
    Entry { name: "ddpg", title: "DDPG", learner: "ddpg", colour: (230, 159, 0), ..HER };

/// The same with the straight line as reward.
pub const DDPG_DISTANCE: Entry = Entry {
    name: "ddpg-distance",
    title: "DDPG, distance",
    learner: "ddpg-distance",
    colour: (204, 121, 167),
    ..HER
};

/// SoRB as published: search over the distances of a value function.
pub const SORB: Entry =
    Entry { name: "sorb", title: "SoRB on HER", planner: Planner::Sorb, colour: (0, 0, 0), ..HER };

/// Random actions.
pub const RANDOM: Entry =
    Entry { name: "random", title: "random", learner: "random", colour: (150, 150, 150), ..GDG };

/// The local optimum: one goal, and what the published algorithms leave open, the same for all four
/// curves of the paper. One choice departs from the paper: errors are those of sqrt(D), as D grows to
/// a thousand behind the wall (see `docs/paper.md`).
const ONE_GOAL: &[&str] = &[
    "goals=map",
    "near_goals=0",
    "restart=start-cell",
    "max_distance_steps=0",
    "episode_steps=500",
    "hidden=32",
    "grid_cells=[4,2,1,0.5]",
    "distance_scale_steps=10",
    "actor_bound=1",
    "learning_rate=3e-5",
    "buffer_size=100000",
    "tau=0.1",
    "loss=sqrt",
];

/// Our default with one goal.
pub const TRAP_DEFAULT: Entry = Entry { set: &[NOISE, "goals=map"], ..DEFAULT };

/// The same without bridge points.
pub const TRAP_DEFAULT_GDG: Entry = Entry { set: TRAP_DEFAULT.set, ..DEFAULT_GDG };

/// The paper's method with one goal and bridge points.
pub const TRAP_GDG_BRIDGE: Entry = Entry { set: ONE_GOAL, ..GDG_BRIDGE };

/// The same without them.
pub const TRAP_GDG: Entry = Entry { set: ONE_GOAL, ..GDG };

/// Rivals that act, explore and see as the paper's method does.
pub const TRAP_DDPG: Entry = Entry { preset: "paper", set: ONE_GOAL, ..DDPG };

/// The same with the straight line as reward.
pub const TRAP_DDPG_DISTANCE: Entry = Entry { preset: "paper", set: ONE_GOAL, ..DDPG_DISTANCE };

/// The arm: D is given as the straight line.
pub const ARM_GDG_DISTANCE: Entry = Entry {
    name: "gdg-distance",
    title: "GDG, distance",
    learner: "gdg-distance",
    colour: (213, 94, 0),
    ..ARM_GDG
};

/// The arm: V = -|s - g| is given, so Q is regressed on -|s' - g| at the next state s'.
pub const ARM_DDPG_DISTANCE: Entry = Entry { set: &["discount=0"], ..DDPG_DISTANCE };

/// The arm: sparse rewards.
pub const ARM_HER: Entry = Entry { set: &[], ..HER };

/// The arm: D is learned.
pub const ARM_GDG: Entry = Entry { preset: "default", ..GDG };

/// The arm: D is learned, with bridge points.
pub const ARM_GDG_BRIDGE: Entry = Entry { preset: "default", ..GDG_BRIDGE };

/// Our default on OGBench's datasets.
pub const OGBENCH: [Entry; 8] = [
    on_dataset("medium-navigate", (86, 180, 233)),
    on_dataset("large-navigate", (0, 114, 178)),
    on_dataset("giant-navigate", (0, 0, 0)),
    on_dataset("teleport-navigate", (150, 150, 150)),
    on_dataset("medium-stitch", (230, 159, 0)),
    on_dataset("large-stitch", (213, 94, 0)),
    on_dataset("giant-stitch", (0, 158, 115)),
    on_dataset("teleport-stitch", (204, 121, 167)),
];

/// Returns our default on a dataset.
const fn on_dataset(name: &'static str, colour: Rgb) -> Entry {
    Entry { name, title: name, set: &[], dataset: Some(name), colour, ..DEFAULT }
}

impl Entry {
    /// Returns the map or world that it learns in, in a figure of `world`.
    pub fn world(&self, world: &str) -> String {
        let maze = self.dataset.and_then(|dataset| dataset.split('-').next());
        maze.map_or(world.to_owned(), |maze| format!("ogbench-pointmaze-{maze}"))
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
    use crate::experiment::reproduce::FIGURES;
    use gdg::train::{Overrides, settings_from};

    #[test]
    fn names_and_colours_differ_within_a_figure_and_settings_are_valid() {
        let registry = Registry::builtin();
        assert!(
            [DEFAULT, GDG_BRIDGE, GDG, RANDOM]
                .iter()
                .all(|entry| entry.preset(&registry).is_some())
        );
        for figure in &FIGURES {
            let names: BTreeSet<_> = figure.methods.iter().map(|entry| entry.name).collect();
            let colours: BTreeSet<_> = figure.methods.iter().map(|entry| entry.colour).collect();
            let all = figure.methods.len();
            assert_eq!((names.len(), colours.len()), (all, all), "{}", figure.name);
            for (entry, preset) in
                figure.methods.iter().filter_map(|entry| Some((entry, entry.preset(&registry)?)))
            {
                let set: Vec<String> = entry.set.iter().map(|text| (*text).to_owned()).collect();
                let overrides = Overrides { set: &set, ..Overrides::default() };
                assert!(settings_from(preset, &overrides).is_ok(), "{}", entry.name);
            }
        }
    }
}
