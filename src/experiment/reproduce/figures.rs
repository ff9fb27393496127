//! The paper's figures: what each shows, of which methods and how long they train.

use crate::cli::BudgetArg;
use crate::experiment::plan::{Length, Plan};

/// Steps within which a goal has to be reached, as in the paper.
const MAX_STEPS: u32 = 500;

/// Distances of the paths in Figure 5, in steps.
pub const PATH_DISTANCES: [u32; 4] = [90, 120, 150, 180];

/// A figure.
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The built-in map.
    pub map: &'static str,
    /// Names of the methods.
    pub methods: &'static [&'static str],
    /// What is drawn.
    pub shows: Shows,
    /// Whether every method trains with several seeds.
    pub several_seeds: bool,
    /// What the paper says of each method, by name.
    pub paper: &'static [(&'static str, &'static str)],
}

/// What a figure draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shows {
    /// A bridge point, the distances to and from it, and the walk along the plan.
    Bridge,
    /// Success over training.
    Success,
    /// Success by distance at the end.
    SuccessByDistance,
    /// Paths walked.
    Paths,
    /// Distance left to the map's goal, over training.
    DistanceLeft,
}

/// The methods of Figures 3 and 4: the paper's five, with our default and SoRB beside them.
const COMPARED: &[&str] = &["default", "gdg-bridge", "gdg", "her", "ddpg", "sorb", "random"];

/// All figures. Figure 1, the arm, is not among them: there is no such world.
pub const FIGURES: [Figure; 5] = [
    Figure {
        name: "fig2",
        title: "A bridge point in the four rooms",
        map: "fourrooms",
        methods: &["default", "gdg-bridge"],
        shows: Shows::Bridge,
        several_seeds: false,
        paper: &[],
    },
    Figure {
        name: "fig3",
        title: "City: success over training",
        map: "city",
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
        map: "city",
        methods: COMPARED,
        shows: Shows::SuccessByDistance,
        several_seeds: true,
        paper: &[],
    },
    Figure {
        name: "fig5",
        title: "City: paths",
        map: "city",
        methods: &["default", "gdg-bridge", "gdg"],
        shows: Shows::Paths,
        several_seeds: false,
        paper: &[],
    },
    Figure {
        name: "fig6",
        title: "Local optimum: distance left to the goal",
        map: "trap",
        methods: &["default", "gdg-bridge", "gdg", "ddpg", "ddpg-distance"],
        shows: Shows::DistanceLeft,
        several_seeds: true,
        paper: &[
            ("gdg-bridge", "reaches the goal"),
            ("gdg", "reaches the goal"),
            ("ddpg", "does not reach it"),
            ("ddpg-distance", "does not reach it"),
        ],
    },
];

impl Figure {
    /// Returns the figure called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        FIGURES.iter().find(|figure| figure.name == name)
    }

    /// Returns what a job of `method` does under `budget`. Figures on the same map have the same plans and share jobs.
    pub fn plan(&self, budget: BudgetArg, method: &str) -> Plan {
        let (updates, episodes) = match self.map {
            "city" => (60_000, 200_000),
            _ => (20_000, 100_000),
        };
        let length = match budget {
            // With batches of one agent's steps and no tricks, the paper's updates are cheaper and it needs more of them.
            BudgetArg::Quick if ["gdg", "gdg-bridge"].contains(&method) => Length::Updates(4 * updates),
            BudgetArg::Quick => Length::Updates(updates),
            // Our default needs a small part of what the paper's methods train for.
            BudgetArg::Paper if method == "default" => Length::Updates(5 * updates),
            BudgetArg::Paper => Length::Episodes(episodes),
        };
        let plan = Plan {
            length,
            // The paper tests every 20,000 episodes.
            evaluations: match length {
                Length::Updates(_) => 10,
                Length::Episodes(episodes) => episodes / 20_000,
            },
            eval_tasks: 10,
            last_tasks: 10,
            max_steps: Some(MAX_STEPS),
            walks: Vec::new(),
            bridge: false,
            picture: false,
        };
        match self.map {
            "city" => Plan { last_tasks: 100, walks: PATH_DISTANCES.to_vec(), ..plan },
            "trap" => Plan { evaluations: 2 * plan.evaluations, eval_tasks: 1, ..plan },
            _ => Plan { bridge: true, ..plan },
        }
    }

    /// Returns the number of seeds under a budget.
    pub fn seeds(&self) -> u64 {
        match (self.several_seeds, self.map) {
            (false, _) => 1,
            (true, "city") => 5,
            (true, _) => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::reproduce::methods::Entry;
    use crate::map::builtin;

    #[test]
    fn figures_name_maps_and_methods_that_exist_and_show_our_default() {
        for figure in &FIGURES {
            assert!(builtin(figure.map).is_some() && figure.methods.contains(&"default"), "{}", figure.name);
            assert!(figure.methods.iter().all(|name| Entry::named(name).is_some()), "{}", figure.name);
            assert!(figure.paper.iter().all(|(name, _)| figure.methods.contains(name)), "{}", figure.name);
        }
    }

    #[test]
    fn figures_of_the_city_share_their_jobs() {
        let plans = |name: &str| {
            let figure = Figure::named(name).expect("a figure");
            [BudgetArg::Quick, BudgetArg::Paper].map(|budget| figure.plan(budget, "gdg"))
        };
        assert_eq!(plans("fig3"), plans("fig4"));
        assert_eq!(plans("fig3"), plans("fig5"));
        assert_eq!(plans("fig3")[1].marks(), (1..=10).map(|i| 20_000 * i).collect::<Vec<u64>>());
    }
}
