//! The paper's figures: what each shows, of which methods and how long they train.

use super::methods::{
    ARM_DDPG_DISTANCE, ARM_GDG, ARM_GDG_BRIDGE, ARM_GDG_DISTANCE, ARM_HER, DDPG, DEFAULT, Entry,
    GDG, GDG_BRIDGE, HER, OGBENCH, RANDOM, SORB, TRAP_DDPG, TRAP_DDPG_DISTANCE, TRAP_DEFAULT,
    TRAP_DEFAULT_GDG, TRAP_GDG, TRAP_GDG_BRIDGE,
};
use crate::experiment::plan::{Length, Plan};

/// Steps within which a goal has to be reached, as in the paper.
const MAX_STEPS: u32 = 500;

/// Tasks drawn at random at a time, as in the paper's Figure 3.
const RANDOM_TASKS: u32 = 200;

/// The map of Figure 6. The paper says that its local optimum is within 10 steps of the start, and its
/// goal more than 80 away.
const ONE_GOAL_MAP: &str = "dead-end";

/// Distances of the paths in Figure 5, in steps.
pub const PATH_DISTANCES: [u32; 4] = [90, 120, 150, 180];

/// Environment steps for the arm, and between two evaluations: multiples of the number of agents,
/// who step at once.
const ARM: ArmSteps = ArmSteps { quick: 3_000, paper: 10_000, every: 40 };

/// The same with the wall.
const ARM_WALL: ArmSteps = ArmSteps { quick: 8_000, paper: 20_000, every: 200 };

/// How long the arm trains under each budget, in environment steps.
struct ArmSteps {
    quick: u64,
    paper: u64,
    every: u64,
}

/// How much is trained for the figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Budget {
    /// Minutes.
    Quick,
    /// As much as in the paper.
    Paper,
}

impl Budget {
    /// All budgets.
    pub const ALL: [Self; 2] = [Self::Quick, Self::Paper];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Paper => "paper",
        }
    }

    /// Returns what it takes, in a sentence.
    pub fn about(self) -> &'static str {
        match self {
            Self::Quick => "All figures in 35 to 50 minutes on two cores",
            Self::Paper => {
                "As many episodes as in the paper, tested every 20,000, and the arm three times as \
                 long: days on one machine"
            }
        }
    }
}

/// A figure.
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub title: &'static str,
    /// The built-in map or world; `ogbench` if every entry has its own.
    pub world: &'static str,
    /// The methods.
    pub methods: &'static [Entry],
    /// What is drawn.
    pub shows: Shows,
    /// Whether every method trains with several seeds.
    pub several_seeds: bool,
    /// The paper's result of each method, by name.
    pub paper: &'static [(&'static str, &'static str)],
}

/// What a figure draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// A bridge point, the distances to and from it, and the walk along the plan.
    Bridge,
    /// Success over training.
    Success,
    /// The same, with the step from which on it is complete.
    CompleteSuccess,
    /// The same, with the path of a walk of the arm's grip.
    CompleteSuccessAndGripPath,
    /// Success by distance at the end.
    SuccessByDistance,
    /// Paths walked.
    Paths,
    /// Distance left to the map's goal, over training.
    DistanceLeft,
    /// Success over training on several datasets, with and without plans.
    Datasets,
}

/// The methods of Figures 3 and 4: the paper's five, our default and SoRB.
const COMPARED: &[Entry] = &[DEFAULT, GDG_BRIDGE, GDG, HER, DDPG, SORB, RANDOM];

/// All figures.
pub const FIGURES: [Figure; 8] = [
    Figure {
        name: "fig1",
        title: "Arm: success over training",
        world: "fetch-reach",
        methods: &[ARM_GDG_DISTANCE, ARM_DDPG_DISTANCE, ARM_GDG, ARM_HER],
        shows: Shows::CompleteSuccess,
        several_seeds: true,
        paper: &[("gdg-distance", "converges like DDPG"), ("ddpg-distance", "converges like GDG")],
    },
    Figure {
        name: "fig1-wall",
        title: "Arm with a wall: success over training, and paths of the grip",
        world: "fetch-reach-wall",
        methods: &[ARM_GDG, ARM_GDG_BRIDGE],
        shows: Shows::CompleteSuccessAndGripPath,
        several_seeds: true,
        paper: &[],
    },
    Figure {
        name: "fig2",
        title: "A bridge point in the four rooms",
        world: "fourrooms",
        methods: &[DEFAULT, GDG_BRIDGE],
        shows: Shows::Bridge,
        several_seeds: false,
        paper: &[],
    },
    Figure {
        name: "fig3",
        title: "City: success over training",
        world: "city",
        methods: COMPARED,
        shows: Shows::Success,
        several_seeds: true,
        paper: &[
            ("gdg-bridge", "about 0.8"),
            ("gdg", "about 0.5"),
            ("her", "about 0.2"),
            ("ddpg", "about 0.2"),
            ("random", "about 0"),
        ],
    },
    Figure {
        name: "fig4",
        title: "City: success by distance",
        world: "city",
        methods: COMPARED,
        shows: Shows::SuccessByDistance,
        several_seeds: true,
        paper: &[],
    },
    Figure {
        name: "fig5",
        title: "City: paths",
        world: "city",
        methods: &[DEFAULT, GDG_BRIDGE, GDG],
        shows: Shows::Paths,
        several_seeds: false,
        paper: &[],
    },
    Figure {
        name: "fig6",
        title: "Local optimum: distance left to the goal",
        world: ONE_GOAL_MAP,
        methods: &[
            TRAP_DEFAULT,
            TRAP_DEFAULT_GDG,
            TRAP_GDG_BRIDGE,
            TRAP_GDG,
            TRAP_DDPG,
            TRAP_DDPG_DISTANCE,
        ],
        shows: Shows::DistanceLeft,
        several_seeds: true,
        paper: &[
            ("gdg-bridge", "reaches the goal"),
            ("gdg", "reaches the goal"),
            ("ddpg", "does not reach it"),
            ("ddpg-distance", "does not reach it"),
        ],
    },
    Figure {
        name: "ogbench",
        title: "OGBench's point mazes: success over training on recorded data",
        world: "ogbench",
        methods: &OGBENCH,
        shows: Shows::Datasets,
        several_seeds: true,
        paper: &[],
    },
];

impl Figure {
    /// Returns what a job of `method` does under `budget`. Figures on the same map have the same
    /// plans and share jobs.
    pub fn plan(&self, budget: Budget, method: &str) -> Plan {
        match self.world {
            "ogbench" => {
                let updates = if budget == Budget::Quick { 5_000 } else { 10_000 };
                Plan { last_tasks: 50, ..Plan::new(Length::Updates(updates), updates / 1_000, 10) }
            }
            "fetch-reach" => ARM.plan(budget),
            "fetch-reach-wall" => Plan { long_walk: true, ..ARM_WALL.plan(budget) },
            _ => self.maze_plan(budget, method),
        }
    }

    fn maze_plan(&self, budget: Budget, method: &str) -> Plan {
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
        let plan = Plan { max_steps: Some(MAX_STEPS), ..Plan::new(length, evaluations, 10) };
        match self.world {
            "city" => Plan {
                last_tasks: 100,
                random_tasks: Some(RANDOM_TASKS),
                walks: PATH_DISTANCES.to_vec(),
                ..plan
            },
            // One walk a time takes little, and it differs from one evaluation to the next.
            ONE_GOAL_MAP => Plan { evaluations: 5 * plan.evaluations, eval_tasks: 1, ..plan },
            _ => Plan { bridge: true, ..plan },
        }
    }

    /// Returns the number of seeds under a budget.
    pub fn seeds(&self, budget: Budget) -> u64 {
        match (self.several_seeds, self.world, budget) {
            (false, ..) => 1,
            (true, "ogbench", Budget::Paper) => 8,
            (true, ONE_GOAL_MAP | "ogbench", _) => 3,
            (true, ..) => 5,
        }
    }

    /// Returns whether it is one of the paper's.
    pub fn is_of_paper(&self) -> bool {
        self.shows != Shows::Datasets
    }
}

impl ArmSteps {
    /// Returns what every job does under `budget`: the tasks are those of an episode of the arm.
    fn plan(&self, budget: Budget) -> Plan {
        let steps = match budget {
            Budget::Quick => self.quick,
            // The paper gives no number; this shows that what was learned stays.
            Budget::Paper => self.paper,
        };
        Plan::new(Length::Steps(steps), steps / self.every, 20)
    }
}

#[cfg(test)]
mod tests {
    use super::super::datasets::published_on;
    use super::*;
    use gdg::map::builtin;
    use gdg::train::Registry;

    #[test]
    fn figures_name_worlds_and_methods_that_exist_and_show_our_default_on_maps() {
        for figure in FIGURES.iter().filter(|figure| figure.is_of_paper()) {
            let names: Vec<&str> = figure.methods.iter().map(|entry| entry.name).collect();
            let map = builtin(figure.world).is_some();
            assert!(map || Registry::builtin().world(figure.world).is_some(), "{}", figure.name);
            assert_eq!(map, names.contains(&"default"), "{}", figure.name);
            assert!(figure.paper.iter().all(|(name, _)| names.contains(name)), "{}", figure.name);
        }
    }

    #[test]
    fn every_dataset_has_a_map_and_published_results() {
        for entry in &OGBENCH {
            assert!(builtin(&entry.world("ogbench")).is_some(), "{}", entry.name);
            assert!(published_on(entry.name).is_some(), "{}", entry.name);
        }
    }

    #[test]
    fn figures_of_the_city_share_their_jobs() {
        let plans = |name: &str| {
            let figure = FIGURES.iter().find(|figure| figure.name == name).expect("a figure");
            [Budget::Quick, Budget::Paper].map(|budget| figure.plan(budget, "gdg"))
        };
        assert_eq!(plans("fig3"), plans("fig4"));
        assert_eq!(plans("fig3"), plans("fig5"));
        assert_eq!(plans("fig3")[1].marks(), (1..=10).map(|i| 20_000 * i).collect::<Vec<u64>>());
    }

    #[test]
    fn the_papers_curves_to_one_goal_train_equally_long() {
        let figure = FIGURES.iter().find(|figure| figure.name == "fig6").expect("a figure");
        for budget in Budget::ALL {
            let plans: Vec<Plan> =
                figure.paper.iter().map(|(name, _)| figure.plan(budget, name)).collect();
            assert_eq!(plans.len(), 4);
            assert!(plans.iter().all(|plan| *plan == plans[0]), "{budget:?}");
        }
    }

    #[test]
    fn the_arm_is_evaluated_after_whole_steps_of_all_agents() {
        let arm = |figure: &&Figure| figure.is_of_paper() && builtin(figure.world).is_none();
        for figure in FIGURES.iter().filter(arm) {
            let registry = Registry::builtin();
            let defaults = registry.world(figure.world).expect("a world").defaults;
            assert!(defaults.contains(&"agents=8"), "{defaults:?}");
            for budget in [Budget::Quick, Budget::Paper] {
                let marks = figure.plan(budget, "gdg").marks();
                assert!(marks.len() >= 40 && marks.iter().all(|mark| mark % 8 == 0), "{marks:?}");
            }
        }
    }
}
