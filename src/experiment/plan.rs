//! How long a job trains, when it evaluates, and what it measures at the end.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use gdg::train::{Counters, EvaluateAt, Limits};

/// Evaluations per job of a suite, equally spaced; the last one at the end.
const SUITE_EVALUATIONS: u64 = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Length {
    Updates(u64),
    Episodes(u64),
    /// Environment steps, summed over all agents, and the updates due then. All agents step at
    /// once, so it is passed by less than their number.
    Steps(u64),
}

impl Length {
    fn parts(self) -> (u64, &'static str, fn(&Counters) -> u64) {
        match self {
            Self::Updates(amount) => (amount, "updates", |done| done.updates),
            Self::Episodes(amount) => (amount, "episodes", |done| done.episodes),
            Self::Steps(amount) => (amount, "environment steps", |done| done.env_steps),
        }
    }

    pub fn amount(self) -> u64 {
        self.parts().0
    }

    pub fn unit(self) -> &'static str {
        self.parts().1
    }

    pub fn done(self, counters: &Counters) -> u64 {
        self.parts().2(counters)
    }
}

/// Recorded transitions that a job learns from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobData {
    #[serde(skip)]
    pub file: PathBuf,
    pub checksum: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobPlan {
    pub length: Length,
    /// Evaluations, equally spaced; the last one at the end.
    pub evaluations: u64,
    /// Tasks at each distance in these evaluations.
    pub eval_tasks: u32,
    /// Tasks at each distance in the last one.
    pub last_tasks: u32,
    /// Tasks drawn at random at the end, as Figure 3 of the paper has them, on a map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub random_tasks: Option<u32>,
    /// Steps within which every goal has to be reached, instead of the task's own budget.
    pub max_steps: Option<u32>,
    /// Distances, in steps, of one walk each at the end, on a map.
    pub walks: Vec<u32>,
    /// Whether to search for a bridge point at the end, on a map.
    pub bridge: bool,
    /// Whether to draw a picture at the end, of a map.
    pub picture: bool,
    /// What it learns from instead of acting, if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<JobData>,
}

impl JobPlan {
    /// Returns a plan with `evaluations` on `eval_tasks` at each distance, and nothing else.
    pub fn new(length: Length, evaluations: u64, eval_tasks: u32) -> Self {
        Self {
            length,
            evaluations,
            eval_tasks,
            last_tasks: eval_tasks,
            random_tasks: None,
            max_steps: None,
            walks: Vec::new(),
            bridge: false,
            picture: false,
            data: None,
        }
    }

    pub fn suite(updates: u64, eval_tasks: u32) -> Self {
        Self { picture: true, ..Self::new(Length::Updates(updates), SUITE_EVALUATIONS, eval_tasks) }
    }

    /// Returns after how many updates, episodes or steps to evaluate, in order.
    fn marks(&self) -> Vec<u64> {
        let (amount, all) = (u128::from(self.length.amount()), self.evaluations.max(1));
        let at = |i: u64| (amount * u128::from(i) / u128::from(all)) as u64;
        let mut marks: Vec<u64> = (1..=all).map(at).filter(|at| *at > 0).collect();
        marks.dedup();
        marks
    }

    pub fn schedule(&self) -> (EvaluateAt, Limits) {
        let (marks, none) = (self.marks(), Limits::default());
        match self.length {
            Length::Updates(n) => (EvaluateAt::Updates(marks), Limits { updates: Some(n), ..none }),
            Length::Episodes(n) => {
                (EvaluateAt::Episodes(marks), Limits { episodes: Some(n), ..none })
            }
            Length::Steps(n) => {
                (EvaluateAt::EnvSteps(marks), Limits { env_steps: Some(n), ..none })
            }
        }
    }

    /// Returns the tasks at each distance in an evaluation after `done` updates, episodes or steps.
    pub fn tasks_after(&self, done: u64) -> usize {
        (if done >= self.length.amount() { self.last_tasks } else { self.eval_tasks }) as usize
    }

    pub fn measures(&self) -> bool {
        self.bridge || !self.walks.is_empty() || self.random_tasks.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evaluations_are_equally_spaced_and_the_last_one_has_tasks_of_its_own() {
        let plan = |updates| JobPlan { last_tasks: 9, ..JobPlan::suite(updates, 2) };
        assert_eq!(plan(25).marks(), [2, 5, 7, 10, 12, 15, 17, 20, 22, 25]);
        assert_eq!(plan(3).marks(), [1, 2, 3]);
        assert_eq!((plan(100).tasks_after(75), plan(100).tasks_after(103)), (2, 9));
    }
}
