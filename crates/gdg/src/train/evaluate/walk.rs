//! One task's walk, for display: the plan and the path taken.

use super::EvaluationJob;
use super::tasks::run_tasks_watched;
use crate::bridge::Guide;
use crate::env::{EnvError, Task};
use crate::job::Job;
use crate::learn::{Policy, Scratch};

/// The plan for a task, and the walk that followed it.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskWalk {
    /// Waypoints of the plan made at the start, ending with the goal, each `(goal_dim)`; none if
    /// the method does not plan.
    pub plan: Vec<Vec<f32>>,
    /// State at the start and after every step, each `(state_dim)`.
    pub states: Vec<Vec<f32>>,
    /// Whether the goal was reached in time.
    pub reached: bool,
}

impl EvaluationJob {
    /// Returns the frozen networks.
    pub fn policy(&self) -> &dyn Policy {
        &*self.policy
    }

    /// Walks `task` as in an evaluation, with planning if the method plans.
    ///
    /// # Errors
    /// The world fails.
    pub fn walk(&self, task: &Task) -> Result<TaskWalk, EnvError> {
        let (graph, mut states) = (self.graph(&Job::default()), Vec::new());
        let tasks = std::slice::from_ref(task);
        let mut watch = |state: &[f32], _| {
            states.push(state.to_vec());
            true
        };
        let actor = self.actor(graph.as_ref());
        let runs =
            run_tasks_watched(&*self.world, tasks, &actor, &mut self.rng.clone(), &mut watch)?;
        let plan = states.first().map_or(Vec::new(), |start| plan(actor.guide, start, &task.goal));
        Ok(TaskWalk { plan, states, reached: runs.taken[0].is_some() })
    }
}

/// Returns the waypoints from `start` to `goal`, the goal last; none without a graph.
fn plan(guide: Guide, start: &[f32], goal: &[f32]) -> Vec<Vec<f32>> {
    let mut scratch = Scratch::default();
    let (Some(graph), Some(mut walker)) = (guide.graph, guide.plan(goal, &mut scratch)) else {
        return Vec::new();
    };
    guide.aim(Some(&mut walker), start, goal, &mut scratch);
    let waypoints = walker.waypoints_ahead().into_iter().map(|i| graph.point(i).to_vec());
    waypoints.chain([goal.to_vec()]).collect()
}
