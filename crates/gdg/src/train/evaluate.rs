//! Evaluation against the world's ground truth, on its own random stream.

mod results;
mod tasks;
mod truth;

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::run::Run;
use super::score::Score;
use super::settings::RANDOM_HOLD_STEPS;
use crate::bridge::{BridgeGraph, Candidates, Guide};
use crate::env::{EnvError, Environment, Episodes, Evaluated, GroundTruth, Spec, Task, TaskSet};
use crate::job::Job;
use crate::learn::{Acting, Policy, Scratch};
pub use results::{BridgeFacts, ComposedError, DistanceError, Evaluation, MarkedTask, TaskOutcome};
use tasks::{Actor, run_tasks, run_tasks_watched};
use truth::{bridge_facts, distance_error};

/// A self-contained evaluation that can run at any time on any thread.
pub struct EvaluationJob {
    pub(super) run: Run,
    /// The world, without agents.
    pub(super) world: Box<dyn Environment>,
    pub(super) policy: Arc<dyn Policy>,
    pub(super) acting: Acting,
    /// Candidates and observed paths between them, for methods that plan.
    pub(super) candidates: Option<Arc<Candidates>>,
    pub(super) coverage: Option<f64>,
    /// Steps within which every goal has to be reached, instead of the task's own budget.
    pub(super) max_steps: Option<u32>,
    /// RNG for tasks.
    pub(super) task_rng: ChaCha8Rng,
    /// RNG for everything else.
    pub(super) rng: ChaCha8Rng,
}

impl EvaluationJob {
    /// Returns the evaluation with `max_steps` for every task, instead of the task's own budget.
    #[must_use]
    pub fn within(self, max_steps: Option<u32>) -> Self {
        Self { max_steps, ..self }
    }

    /// Draws `per_group` tasks at each distance, independently of the number of earlier
    /// evaluations.
    ///
    /// # Errors
    /// The world fails.
    pub fn tasks(&self, per_group: usize) -> Result<TaskSet, EnvError> {
        self.world.tasks(per_group, &mut self.task_rng.clone())
    }

    /// Draws tasks like [`Self::tasks`] and evaluates on them; returns `None` once `job` is
    /// cancelled. Where the world fails, tries once more: a world in another process gets a new one, and
    /// the result is the same.
    ///
    /// # Errors
    /// The world fails twice.
    pub fn evaluate(&self, per_group: usize, job: &Job) -> Result<Option<Evaluation>, EnvError> {
        let once = || self.run_unless(job, &self.tasks(per_group)?);
        once().or_else(|error| {
            if error == EnvError::Stopped {
                return Err(error);
            }
            log::warn!("the evaluation is tried once more: {error}");
            once()
        })
    }

    /// Evaluates on `tasks` against ground truth.
    ///
    /// # Errors
    /// The world fails.
    pub fn run(&self, tasks: &TaskSet) -> Result<Evaluation, EnvError> {
        let done = self.run_unless(&Job::default(), tasks)?;
        Ok(done.unwrap_or_else(|| unreachable!("nothing cancels it")))
    }

    /// Like [`Self::run`]; returns `None` once `job` is cancelled.
    ///
    /// # Errors
    /// The world fails.
    pub fn run_unless(&self, job: &Job, tasks: &TaskSet) -> Result<Option<Evaluation>, EnvError> {
        crate::faults::point("evaluation");
        let (progress, stages) = (job, 1 + 2 * usize::from(self.candidates.is_some()));
        let mut stage = 0;
        progress.begin(stage, stages);
        let graph = self.graph(job);
        stage += usize::from(graph.is_some());
        let greedy = self.actor(None);
        let planned = graph.as_ref().map(|graph| self.actor(Some(graph)));
        let (world, rng) = (&*self.world, &mut self.rng.clone());
        let mut score = |actor: &Actor| {
            progress.begin(stage, stages);
            stage += 1;
            let mut watch = |_: &[f32], over| {
                progress.set(over, tasks.tasks.len());
                !job.is_cancelled()
            };
            let runs = run_tasks_watched(world, &tasks.tasks, actor, rng, &mut watch)?;
            Ok::<_, EnvError>(Score::new(tasks, &runs.taken))
        };
        let planned_score = planned.as_ref().map(&mut score).transpose()?;
        let greedy_score = if job.is_cancelled() { None } else { Some(score(&greedy)?) };
        let Some(greedy_score) = greedy_score.filter(|_| !job.is_cancelled()) else {
            return Ok(None);
        };
        let mut truth = world.abilities().evaluated.and_then(Evaluated::ground_truth);
        let distance_error = truth.as_mut().and_then(|truth| {
            let pairs = truth.pairs(rng);
            distance_error(&pairs, &*self.policy, graph.as_ref())
        });
        Ok(Some(Evaluation {
            distance_error,
            bridges: graph.as_ref().map(|graph| bridge_facts(graph, truth.as_deref_mut())),
            coverage: self.coverage,
            marked: marked_task(world, truth.as_deref_mut(), &greedy, planned.as_ref(), rng)?,
            greedy: greedy_score,
            planned: planned_score,
            straight: self.straight_score(tasks)?,
        }))
    }

    /// Scores walking straight at the goals.
    fn straight_score(&self, tasks: &TaskSet) -> Result<Option<Score>, EnvError> {
        let (world, mut rng) = (&*self.world, self.rng.clone());
        let (Some(evaluated), Some(task)) = (world.abilities().evaluated, tasks.tasks.first())
        else {
            return Ok(None);
        };
        let policy = Straight { spec: world.spec(), world: evaluated };
        let mut action = vec![0.0; world.spec().action_dim];
        let state = vec![0.0; world.spec().state_dim()];
        if !policy.world.straight_action(&state, &task.goal, &mut action) {
            return Ok(None);
        }
        // The second half of the evaluation's stream, so that other results do not depend on this
        // one.
        rng.set_word_pos(rng.get_word_pos() + (1 << 33));
        let actor = Actor {
            guide: Guide { policy: &policy, graph: None },
            hold_steps: None,
            max_steps: self.max_steps,
        };
        Ok(Some(Score::new(tasks, &run_tasks(world, &tasks.tasks, &actor, &mut rng)?.taken)))
    }

    /// Builds the graph to plan on, for methods that plan; returns `None` once `job` is cancelled.
    /// Says how far it is, as one stage of its progress.
    pub fn graph(&self, job: &Job) -> Option<BridgeGraph> {
        let (spec, settings, policy) = (self.world.spec(), self.run.bridge(), &*self.policy);
        let candidates = self.candidates.as_ref()?;
        let now = |_| true;
        let empty = BridgeGraph::empty(spec, &settings);
        empty.renewed(job, candidates, now, policy, &mut Scratch::default())
    }

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

    /// Returns how agents act, with planning over `graph` if there is one.
    fn actor<'a>(&'a self, graph: Option<&'a BridgeGraph>) -> Actor<'a> {
        let hold_steps = (self.acting == Acting::AtRandom).then_some(RANDOM_HOLD_STEPS);
        let guide = Guide { policy: &*self.policy, graph };
        Actor { guide, hold_steps, max_steps: self.max_steps }
    }
}

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

/// Walks straight at the goal.
struct Straight<'a> {
    spec: &'a Spec,
    world: &'a dyn Evaluated,
}

impl Policy for Straight<'_> {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        let spec = self.spec;
        let pairs = states.chunks_exact(spec.state_dim()).zip(goals.chunks_exact(spec.goal_dim()));
        out.iter_mut()
            .zip(pairs)
            .for_each(|(d, (state, goal))| *d = spec.goal_distance(state, goal));
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        let spec = self.spec;
        let pairs = states.chunks_exact(spec.state_dim()).zip(goals.chunks_exact(spec.goal_dim()));
        for (action, (state, goal)) in out.chunks_exact_mut(spec.action_dim).zip(pairs) {
            self.world.straight_action(state, goal, action);
        }
    }
}

/// Returns the steps left at the end of a walk, given the true ones to the goal itself: a goal counts
/// as reached within its radius, from where there may still be a step.
fn left_steps(to_goal: Option<u32>, is_reached: bool) -> Option<u32> {
    to_goal.map(|steps| if is_reached { 0 } else { steps })
}

/// Runs the world's default task.
fn marked_task(
    world: &dyn Environment,
    mut truth: Option<&mut (dyn GroundTruth + '_)>,
    greedy: &Actor,
    planned: Option<&Actor>,
    rng: &mut ChaCha8Rng,
) -> Result<Option<MarkedTask>, EnvError> {
    let Some(task) = world.abilities().episodes.and_then(Episodes::default_task) else {
        return Ok(None);
    };
    let mut journey = |actor: &Actor| {
        let walked = run_tasks(world, std::slice::from_ref(&task), actor, rng)?;
        let end: Vec<f32> = world.spec().achieved(walked.env.states()).collect();
        let left = truth.as_mut().and_then(|truth| truth.steps(&end, &task.goal, u32::MAX)?[0]);
        let taken = walked.taken[0];
        let left = left_steps(left, taken.is_some());
        Ok::<_, EnvError>(TaskOutcome {
            reached: taken.is_some(),
            steps: taken.unwrap_or_else(|| actor.budget(world, &task)),
            left_steps: left,
            left_straight: Some(world.spec().goal_distance(walked.env.states(), &task.goal)),
        })
    };
    let greedy = journey(greedy)?;
    Ok(Some(MarkedTask { greedy, planned: planned.map(journey).transpose()? }))
}
