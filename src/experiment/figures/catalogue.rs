//! The figures: the chart of each, its methods, and how long they train.

use std::path::Path;

use miette::{Report, miette};

use crate::experiment::plan::{JobData, JobPlan, Length};
use gdg::bridge::Planner;
use gdg::draw::Rgb;
use gdg::job::Job;
use gdg::text::sanitized;
use gdg::train::{Dataset, Method, Preset};

#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its name in data, in names of jobs and in `--set NAME:...`.
    pub name: &'static str,
    pub title: &'static str,
    learner: &'static str,
    planner: Planner,
    pub preset: &'static str,
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

const DEFAULT_GDG: Entry = Entry {
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

const GDG: Entry = Entry {
    name: "gdg",
    title: "GDG",
    planner: Planner::None,
    colour: (86, 180, 233),
    ..GDG_BRIDGE
};

/// A rival that learns from sparse rewards, with hindsight.
const HER: Entry = Entry {
    name: "her",
    title: "DDPG + HER",
    learner: "her",
    planner: Planner::None,
    preset: "tuned",
    set: &[NOISE],
    dataset: None,
    colour: (0, 158, 115),
};

const DDPG: Entry =
    Entry { name: "ddpg", title: "DDPG", learner: "ddpg", colour: (230, 159, 0), ..HER };

const DDPG_DISTANCE: Entry = Entry {
    name: "ddpg-distance",
    title: "DDPG, distance",
    learner: "ddpg-distance",
    colour: (204, 121, 167),
    ..HER
};

/// SoRB as published: search over the distances of a value function.
const SORB: Entry =
    Entry { name: "sorb", title: "SoRB on HER", planner: Planner::Sorb, colour: (0, 0, 0), ..HER };

const RANDOM: Entry =
    Entry { name: "random", title: "random", learner: "random", colour: (150, 150, 150), ..GDG };

/// The local optimum: one goal, and what the published algorithms leave open, the same for all four
/// curves of the paper. One choice departs from the paper: errors are those of sqrt(D), as D grows to
/// a thousand behind the wall (see `docs/research/paper.md`).
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

const OGBENCH: [Entry; 8] = [
    on_dataset("medium-navigate", (86, 180, 233)),
    on_dataset("large-navigate", (0, 114, 178)),
    on_dataset("giant-navigate", (0, 0, 0)),
    on_dataset("teleport-navigate", (150, 150, 150)),
    on_dataset("medium-stitch", (230, 159, 0)),
    on_dataset("large-stitch", (213, 94, 0)),
    on_dataset("giant-stitch", (0, 158, 115)),
    on_dataset("teleport-stitch", (204, 121, 167)),
];

const fn on_dataset(name: &'static str, colour: Rgb) -> Entry {
    Entry { name, title: name, set: &[], dataset: Some(name), colour, ..DEFAULT }
}

impl Entry {
    /// Returns the map or world that it learns in, in a figure of `world`.
    pub fn world(&self, world: &str) -> String {
        let maze = self.dataset.and_then(|dataset| dataset.split('-').next());
        maze.map_or(world.to_owned(), |maze| format!("ogbench-pointmaze-{maze}"))
    }

    pub fn preset(&self) -> Preset {
        Preset::named(self.preset).unwrap_or(Preset::Default)
    }

    pub fn method(&self) -> Method {
        Method { learner: self.learner.to_owned(), planner: self.planner }
    }
}

/// Steps within which a goal has to be reached, as in the paper.
const MAX_STEPS: u32 = 500;

/// Tasks drawn at random at a time, as in the paper's Figure 3.
const RANDOM_TASKS: u32 = 200;

/// The map of Figure 6. The paper says that its local optimum is within 10 steps of the start, and its
/// goal more than 80 away.
const ONE_GOAL_MAP: &str = "dead-end";

/// Distances of the paths in Figure 5, in steps.
const PATH_DISTANCES: [u32; 4] = [90, 120, 150, 180];

/// How much is trained for the figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Budget {
    /// All figures in 35 to 50 minutes on two cores
    Quick,
    /// As many episodes as in the paper, tested every 20,000, and the arm three times as long: days
    /// on one machine
    Paper,
}

#[derive(Clone, Copy, Debug)]
pub struct Figure {
    pub name: &'static str,
    pub title: &'static str,
    /// The built-in map or world; `ogbench` if every entry has its own.
    pub world: &'static str,
    pub methods: &'static [Entry],
    pub shows: Shows,
    pub several_seeds: bool,
    pub paper: &'static [(&'static str, &'static str)],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// A bridge point, the distances to and from it, and the walk along the plan.
    Bridge,
    Success,
    SuccessByDistance,
    Paths,
    /// Distance left to the map's goal, over training.
    DistanceLeft,
    /// Success over training on several datasets, with and without plans.
    Datasets,
}

/// The methods of Figures 3 and 4: the paper's five, our default and SoRB.
const COMPARED: &[Entry] = &[DEFAULT, GDG_BRIDGE, GDG, HER, DDPG, SORB, RANDOM];

pub const FIGURES: [Figure; 7] = [
    Figure {
        methods: &[
            Entry {
                name: "gdg-distance",
                title: "GDG, distance",
                learner: "gdg-distance",
                preset: "default",
                colour: (213, 94, 0),
                ..GDG
            },
            // V = -|s - g| is given, so Q is regressed on -|s' - g| at the next state s'.
            Entry { set: &["discount=0"], ..DDPG_DISTANCE },
            Entry { preset: "default", ..GDG },
            Entry { set: &[], ..HER },
        ],
        paper: &[("gdg-distance", "converges like DDPG"), ("ddpg-distance", "converges like GDG")],
        ..of("fig1", "Arm: success over training", "fetch-reach", Shows::Success)
    },
    Figure {
        methods: &[DEFAULT, GDG_BRIDGE],
        several_seeds: false,
        ..of("fig2", "A bridge point in the four rooms", "fourrooms", Shows::Bridge)
    },
    Figure {
        methods: COMPARED,
        paper: &[
            ("gdg-bridge", "about 0.8"),
            ("gdg", "about 0.5"),
            ("her", "about 0.2"),
            ("ddpg", "about 0.2"),
            ("random", "about 0"),
        ],
        ..of("fig3", "City: success over training", "city", Shows::Success)
    },
    Figure {
        methods: COMPARED,
        ..of("fig4", "City: success by distance", "city", Shows::SuccessByDistance)
    },
    Figure {
        methods: &[DEFAULT, GDG_BRIDGE, GDG],
        several_seeds: false,
        ..of("fig5", "City: paths", "city", Shows::Paths)
    },
    Figure {
        methods: &[
            Entry { set: &[NOISE, "goals=map"], ..DEFAULT },
            Entry { set: &[NOISE, "goals=map"], ..DEFAULT_GDG },
            Entry { set: ONE_GOAL, ..GDG_BRIDGE },
            Entry { set: ONE_GOAL, ..GDG },
            // They act, explore and see as the paper's method does.
            Entry { preset: "paper", set: ONE_GOAL, ..DDPG },
            Entry { preset: "paper", set: ONE_GOAL, ..DDPG_DISTANCE },
        ],
        paper: &[
            ("gdg-bridge", "reaches the goal"),
            ("gdg", "reaches the goal"),
            ("ddpg", "does not reach it"),
            ("ddpg-distance", "does not reach it"),
        ],
        ..of("fig6", "Local optimum: distance left to the goal", ONE_GOAL_MAP, Shows::DistanceLeft)
    },
    Figure {
        title: "OGBench's point mazes: success over training on recorded data",
        methods: &OGBENCH,
        ..of("ogbench", "", "ogbench", Shows::Datasets)
    },
];

const fn of(name: &'static str, title: &'static str, world: &'static str, shows: Shows) -> Figure {
    Figure { name, title, world, methods: &[], shows, several_seeds: true, paper: &[] }
}

impl Figure {
    /// Returns what a job of `method` does under `budget`. Figures on the same map have the same
    /// plans and share jobs.
    pub fn plan(&self, budget: Budget, method: &str) -> JobPlan {
        match self.world {
            "ogbench" => {
                let updates = if budget == Budget::Quick { 5_000 } else { 10_000 };
                let plan = JobPlan::new(Length::Updates(updates), updates / 1_000, 10);
                JobPlan { last_tasks: 50, ..plan }
            }
            // Evaluations, every 40 environment steps, come after whole steps of all agents. The
            // paper gives no number of steps; its budget shows that what was learned stays.
            "fetch-reach" => {
                let steps = if budget == Budget::Quick { 3_000 } else { 10_000 };
                JobPlan::new(Length::Steps(steps), steps / 40, 20)
            }
            _ => self.maze_plan(budget, method),
        }
    }

    fn maze_plan(&self, budget: Budget, method: &str) -> JobPlan {
        let is_ours = ["default", "default-gdg"].contains(&method);
        // Updates, how many times as many for the paper's methods, and the paper's episodes.
        let (updates, times, episodes) = match self.world {
            "city" => (60_000, 4, 200_000),
            ONE_GOAL_MAP => (20_000, 5, 100_000),
            _ => (20_000, 4, 100_000),
        };
        // All four of the paper's curves take the same steps to one goal.
        let of_paper = ["gdg", "gdg-bridge"].contains(&method)
            || self.world == ONE_GOAL_MAP && ["ddpg", "ddpg-distance"].contains(&method);
        let length = match budget {
            // With batches of one agent's steps and no tricks, the paper's updates are cheaper and
            // it needs more of them.
            Budget::Quick if of_paper => Length::Updates(times * updates),
            // About as many steps as the paper's methods take are enough for our default.
            Budget::Quick if is_ours => Length::Updates(20_000),
            Budget::Quick => Length::Updates(updates),
            // Our default needs a small part of what the paper's methods train for.
            Budget::Paper if is_ours => Length::Updates(5 * updates),
            Budget::Paper => Length::Episodes(episodes),
        };
        // The paper tests every 20,000 episodes.
        let evaluations =
            if let Length::Episodes(episodes) = length { episodes / 20_000 } else { 10 };
        let plan = JobPlan { max_steps: Some(MAX_STEPS), ..JobPlan::new(length, evaluations, 10) };
        match self.world {
            "city" => JobPlan {
                last_tasks: 100,
                random_tasks: Some(RANDOM_TASKS),
                walks: PATH_DISTANCES.to_vec(),
                ..plan
            },
            // One walk a time takes little, and it differs from one evaluation to the next.
            ONE_GOAL_MAP => JobPlan { evaluations: 5 * plan.evaluations, eval_tasks: 1, ..plan },
            _ => JobPlan { bridge: true, ..plan },
        }
    }

    pub fn seeds(&self, budget: Budget) -> u64 {
        match (self.several_seeds, self.world, budget) {
            (false, ..) => 1,
            (true, "ogbench", Budget::Paper) => 8,
            (true, ONE_GOAL_MAP | "ogbench", _) => 3,
            (true, ..) => 5,
        }
    }

    pub fn is_among(&self, names: &[String]) -> bool {
        names.iter().any(|name| name == self.name || name == "all" && self.is_of_paper())
    }

    pub fn is_of_paper(&self) -> bool {
        self.shows != Shows::Datasets
    }
}

/// Success in per cent, in the order of [`PUBLISHED_METHODS`]; `None` where there is no number.
type PublishedSuccess = [Option<u8>; PUBLISHED_METHODS.len()];

/// Methods with published results: the first four as measured by Park et al. (OGBench,
/// arXiv:2410.20092), the others by their authors (arXiv:2510.07257, arXiv:2602.05031).
pub const PUBLISHED_METHODS: [&str; 6] = ["GCIVL", "QRL", "CRL", "HIQL", "GCIQL + TTGS", "ALPS"];

const PUBLISHED: [(&str, PublishedSuccess); 8] = [
    published("medium-navigate", [63, 82, 29, 79], Some(91), None),
    published("large-navigate", [45, 86, 39, 58], Some(88), None),
    published("giant-navigate", [0, 68, 27, 46], Some(92), Some(67)),
    published("teleport-navigate", [45, 4, 24, 18], None, None),
    published("medium-stitch", [70, 80, 0, 74], Some(44), None),
    published("large-stitch", [12, 84, 0, 13], Some(29), Some(96)),
    published("giant-stitch", [0, 50, 0, 0], Some(98), Some(98)),
    published("teleport-stitch", [44, 9, 4, 34], None, Some(13)),
];

const fn published(
    dataset: &'static str,
    [gcivl, qrl, crl, hiql]: [u8; 4],
    ttgs: Option<u8>,
    alps: Option<u8>,
) -> (&'static str, PublishedSuccess) {
    (dataset, [Some(gcivl), Some(qrl), Some(crl), Some(hiql), ttgs, alps])
}

pub fn published_on(dataset: &str) -> Option<PublishedSuccess> {
    PUBLISHED.iter().find(|(name, _)| *name == dataset).map(|(_, success)| *success)
}

pub fn find_dataset(dataset: &str, folder: &Path) -> Result<JobData, Report> {
    let name = format!("pointmaze-{dataset}-v0.npz");
    let file = folder.join(&name);
    let checksum = Dataset::check_file(&file, &Job::default()).map_err(|error| {
        let help = format!(
            "put OGBench's {name} into {}: python/collect_ogbench.py writes it, and \
             ogbench.download_datasets, in Python, fetches it",
            folder.display()
        );
        miette!(help = help, "{}", sanitized(&error.to_string()))
    })?;
    Ok(JobData { file, checksum })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use gdg::map::builtin;
    use gdg::train::{Overrides, Registry, settings_from};

    #[test]
    fn figures_name_worlds_methods_and_settings_that_exist_and_show_our_default_on_maps() {
        let registry = Registry::builtin();
        for figure in &FIGURES {
            let (name, all) = (figure.name, figure.methods.len());
            let names: BTreeSet<_> = figure.methods.iter().map(|entry| entry.name).collect();
            let colours: BTreeSet<_> = figure.methods.iter().map(|entry| entry.colour).collect();
            assert_eq!((names.len(), colours.len()), (all, all), "{name}");
            assert!(figure.paper.iter().all(|(method, _)| names.contains(method)), "{name}");
            for entry in figure.methods {
                assert!(Preset::named(entry.preset).is_some(), "{}", entry.name);
                assert!(registry.learner(entry.learner).is_ok(), "{}", entry.name);
                let set: Vec<String> = entry.set.iter().map(|text| (*text).to_owned()).collect();
                let overrides = Overrides { set: &set, ..Overrides::default() };
                assert!(settings_from(entry.preset(), &overrides).is_ok(), "{}", entry.name);
                if !figure.is_of_paper() {
                    assert!(builtin(&entry.world("ogbench")).is_some(), "{}", entry.name);
                    assert!(published_on(entry.name).is_some(), "{}", entry.name);
                }
            }
            if figure.is_of_paper() {
                let map = builtin(figure.world).is_some();
                assert!(map || registry.world(figure.world).is_some(), "{name}");
                assert_eq!(map, names.contains("default"), "{name}");
            }
        }
    }

    #[test]
    fn figures_of_the_city_share_their_jobs_and_the_papers_curves_train_equally_long() {
        for budget in [Budget::Quick, Budget::Paper] {
            let [.., fig3, fig4, fig5, fig6, _] = FIGURES;
            let plan = |figure: Figure| figure.plan(budget, "gdg");
            assert!(plan(fig3) == plan(fig4) && plan(fig4) == plan(fig5));
            let plans: Vec<JobPlan> =
                fig6.paper.iter().map(|(name, _)| fig6.plan(budget, name)).collect();
            assert!(plans.len() == 4 && plans.iter().all(|plan| *plan == plans[0]), "{budget:?}");
        }
    }
}
