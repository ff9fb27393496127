//! What a worker says of its environment.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::frames::{Expected, MAX_TEXT_BYTES, Request};
use super::process::Worker;
use crate::env::task::MAX_BUDGET_STEPS;
use crate::env::{EnvError, Walls};
use crate::text::grouped;

/// What a worker says of its environment. A checkpoint keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Length of an observation.
    pub observed: usize,
    /// Length of the achieved goal that comes beside it; 0 if it is part of the observation.
    pub achieved: usize,
    /// Length of a desired goal.
    pub goal: usize,
    /// Lowest and highest action; `None` where there is no bound.
    pub low: Vec<Option<f32>>,
    /// See `low`.
    pub high: Vec<Option<f32>>,
    /// Length of an episode, if it is limited.
    pub time_limit: Option<u64>,
    /// Number of tasks of its own, chosen by `task_id` from 1.
    pub tasks: Option<u32>,
    /// Distance below which a goal is reached, if it says so.
    pub goal_radius: Option<f32>,
    /// Whether it has `compute_reward`.
    pub has_reward: bool,
    /// The walls of its maze, if it has one; positions in it are a goal's first two numbers.
    pub maze: Option<Walls>,
    /// Whether its full state can be saved and restored exactly, which has been tried.
    pub restorable: bool,
    /// Whether it renders pictures.
    pub renders: bool,
    /// Versions of Python and of packages.
    pub versions: BTreeMap<String, String>,
}

impl Description {
    /// Returns the length of a row: an observation and what is achieved.
    pub fn row(&self) -> usize {
        self.observed + self.achieved
    }

    /// Returns the lengths of observations, of goals achieved beside them, and of goals desired.
    pub fn sizes(&self) -> [usize; 3] {
        [self.observed, self.achieved, self.goal]
    }

    /// Returns the lowest and the highest action of each component. Where a bound is missing, the
    /// range is as long as [-1, 1]; without both, it is that.
    pub fn action_bounds(&self) -> impl Iterator<Item = [f32; 2]> + Clone {
        self.low.iter().zip(&self.high).map(|bounds| match bounds {
            (Some(low), Some(high)) => [*low, high.max(*low)],
            (Some(low), None) => [*low, low + 2.0],
            (None, Some(high)) => [high - 2.0, *high],
            (None, None) => [-1.0, 1.0],
        })
    }

    /// Returns the length of an episode, unless it is none: longer than evaluations may be.
    pub fn episode_steps(&self) -> Option<u32> {
        let limit = u32::try_from(self.time_limit?).ok()?;
        (limit <= MAX_BUDGET_STEPS).then_some(limit)
    }

    /// Returns warnings for its users.
    pub fn warnings(&self) -> Vec<String> {
        let huge = self.time_limit.is_some() && self.episode_steps().is_none();
        let huge = huge.then(|| {
            let most = grouped(MAX_BUDGET_STEPS.into());
            format!("its time limit is ignored: episodes have at most {most} steps")
        });
        self.unbounded_actions().into_iter().chain(huge).collect()
    }

    /// Returns a warning if some component of actions lacks a bound.
    pub fn unbounded_actions(&self) -> Option<String> {
        let mut bounds = self.low.iter().zip(&self.high);
        let at = bounds.position(|(low, high)| low.is_none() || high.is_none())?;
        let [low, high] = self.action_bounds().nth(at)?;
        let component = format!("component {at} of its actions has no bounds, or only one");
        Some(format!("{component}: actions stay from {low} to {high} there"))
    }

    /// Returns whether the numbers make sense.
    pub fn is_sound(&self) -> bool {
        const MOST: usize = 4096;
        let sizes = [self.observed, self.goal, self.low.len()];
        sizes.iter().all(|size| (1..=MOST).contains(size))
            && [0, self.goal].contains(&self.achieved)
            && self.low.len() == self.high.len()
            && self.tasks.is_none_or(|tasks| (1..=1_000).contains(&tasks))
            && self.maze.as_ref().is_none_or(Walls::is_sound)
    }
}

/// Asks a worker to open its environment and describe it.
///
/// # Errors
/// The environment cannot be opened, or is not supported.
pub fn describe(
    worker: &mut Worker,
    package: Option<&str>,
    id: &str,
) -> Result<Description, EnvError> {
    let config = serde_json::json!({ "package": package.unwrap_or_default(), "id": id });
    let expected = Expected::AtMost(MAX_TEXT_BYTES);
    let reply = worker.ask(Request::Open, config.to_string().as_bytes(), expected)?;
    worker.environments = 1;
    let found: Option<Description> = serde_json::from_slice(&reply).ok();
    found.filter(Description::is_sound).ok_or_else(|| {
        worker.fail("its worker describes it in a way that makes no sense".to_owned())
    })
}
