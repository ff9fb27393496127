//! Evaluation against the world's ground truth, on its own random stream.

mod lockstep;

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::score::{
    BridgeFacts, ComposedError, DistanceError, Evaluation, MarkedTask, Score, TaskOutcome, spearman,
};
use crate::bridge::{BridgeGraph, Candidates, Edge, Guide, LINK_CANDIDATES};
use crate::env::{
    EnvError, Environment, Episodes, Evaluated, GroundTruth, NEAR_STEPS, Recorded, Task, TaskSet,
    TruePairs,
};
use crate::job::Job;
use crate::learn::{Acting, Policy, Scratch};
use lockstep::{Actor, run_tasks};

pub struct EvaluationJob {
    pub(super) world: Box<dyn Environment>,
    pub(super) policy: Arc<dyn Policy>,
    pub(super) acting: Acting,
    pub(super) candidates: Option<Arc<Candidates>>,
    pub(super) coverage: Option<f64>,
    /// Steps within which every goal has to be reached, instead of the task's own budget.
    pub(super) max_steps: Option<u32>,
    pub(super) task_rng: ChaCha8Rng,
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
    pub fn tasks(&self, per_group: usize) -> Result<TaskSet, EnvError> {
        self.world.tasks(per_group, &mut self.task_rng.clone())
    }

    /// Draws tasks like [`Self::tasks`] and evaluates on them, unless `job` is cancelled. Where the
    /// world fails, tries once more: a world in another process gets a new one, and the result is the
    /// same.
    pub fn evaluate(&self, per_group: usize, job: &Job) -> Result<Evaluation, EnvError> {
        let once = || self.run_unless(job, &self.tasks(per_group)?);
        once().or_else(|error| {
            if error == EnvError::Stopped {
                return Err(error);
            }
            log::warn!("the evaluation is tried once more: {error}");
            once()
        })
    }

    pub fn run(&self, tasks: &TaskSet) -> Result<Evaluation, EnvError> {
        self.run_unless(&Job::default(), tasks)
    }

    /// Like [`Self::run`]; fails with [`EnvError::Stopped`] once `job` is cancelled.
    pub fn run_unless(&self, job: &Job, tasks: &TaskSet) -> Result<Evaluation, EnvError> {
        crate::faults::point("evaluation");
        let (progress, stages) = (job, 1 + 2 * usize::from(self.candidates.is_some()));
        let mut stage = 0;
        progress.begin(stage, stages);
        let go_on = || if job.is_cancelled() { Err(EnvError::Stopped) } else { Ok(()) };
        let graph = self.graph(job);
        go_on()?;
        stage += usize::from(graph.is_some());
        let actor = self.actor(None);
        let planned = graph.as_ref().map(|graph| self.actor(Some(graph)));
        let (world, rng) = (&*self.world, &mut self.rng.clone());
        let mut score = |actor: &Actor| {
            progress.begin(stage, stages);
            stage += 1;
            let mut watch = |_: &[f32], over| {
                progress.set(over, tasks.tasks.len());
                !job.is_cancelled()
            };
            let runs = run_tasks(world, &tasks.tasks, actor, rng, &mut watch)?;
            go_on()?;
            Ok::<_, EnvError>(Score::new(tasks, &runs.taken))
        };
        let planned_score = planned.as_ref().map(&mut score).transpose()?;
        let alone = score(&actor)?;
        let mut truth = world.abilities().evaluated.and_then(Evaluated::ground_truth);
        let error = truth.as_mut().and_then(|truth| {
            let pairs = truth.pairs(rng);
            distance_error(&pairs, &*self.policy, graph.as_ref())
        });
        Ok(Evaluation {
            error,
            bridges: graph.as_ref().map(|graph| bridge_facts(graph, truth.as_deref_mut())),
            explored: self.coverage,
            marked: marked_task(world, truth.as_deref_mut(), &actor, planned.as_ref(), rng)?,
            alone,
            planned: planned_score,
            straight: self.straight_score(tasks)?,
            scenario: world.abilities().recorded.and_then(Recorded::scenario),
        })
    }

    fn straight_score(&self, tasks: &TaskSet) -> Result<Option<Score>, EnvError> {
        let (world, mut rng) = (&*self.world, self.rng.clone());
        let straight = world.abilities().evaluated.and_then(Evaluated::straight_action);
        let Some(action) = straight.filter(|_| !tasks.tasks.is_empty()) else { return Ok(None) };
        // The second half of the evaluation's stream, so that other results do not depend on this
        // one.
        rng.set_word_pos(rng.get_word_pos() + (1 << 33));
        let actor = Actor { straight: Some(action), ..self.actor(None) };
        let runs = run_tasks(world, &tasks.tasks, &actor, &mut rng, &mut |_, _| true)?;
        Ok(Some(Score::new(tasks, &runs.taken)))
    }

    /// Builds the graph to plan on, for methods that plan, of which `job` is told how far it is; ends
    /// early once that is cancelled.
    pub fn graph(&self, job: &Job) -> Option<BridgeGraph> {
        let candidates = self.candidates.as_ref()?;
        let empty = BridgeGraph::empty(self.world.spec(), &candidates.settings);
        Some(empty.renewed(job, candidates, |_| true, &*self.policy, &mut Scratch::default()))
    }

    pub fn policy(&self) -> &dyn Policy {
        &*self.policy
    }

    /// Walks `task` as in an evaluation, with planning if the method plans.
    pub fn walk(&self, task: &Task) -> Result<TaskWalk, EnvError> {
        let (graph, mut states) = (self.graph(&Job::default()), Vec::new());
        let tasks = std::slice::from_ref(task);
        let mut watch = |state: &[f32], _| {
            states.push(state.to_vec());
            true
        };
        let actor = self.actor(graph.as_ref());
        let runs = run_tasks(&*self.world, tasks, &actor, &mut self.rng.clone(), &mut watch)?;
        let (mut plan, mut scratch) = (Vec::new(), Scratch::default());
        if let (Some(graph), Some(mut walker)) =
            (&graph, actor.guide.plan(&task.goal, &mut scratch))
        {
            actor.guide.aim(Some(&mut walker), &states[0], &task.goal, &mut scratch);
            plan.extend(walker.waypoints_ahead().into_iter().map(|i| graph.point(i).to_vec()));
            plan.push(task.goal.clone());
        }
        Ok(TaskWalk { plan, states, reached: runs.taken[0].is_some() })
    }

    fn actor<'a>(&'a self, graph: Option<&'a BridgeGraph>) -> Actor<'a> {
        let guide = Guide { policy: &*self.policy, graph };
        Actor { guide, acting: self.acting, straight: None, max_steps: self.max_steps }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct TaskWalk {
    /// Waypoints of the plan made at the start, ending with the goal, each `(goal_dim)`; none if
    /// the method does not plan.
    pub plan: Vec<Vec<f32>>,
    /// State at the start and after every step, each `(state_dim)`.
    pub states: Vec<Vec<f32>>,
    pub reached: bool,
}

fn marked_task(
    world: &dyn Environment,
    mut truth: Option<&mut (dyn GroundTruth + '_)>,
    alone: &Actor,
    planned: Option<&Actor>,
    rng: &mut ChaCha8Rng,
) -> Result<Option<MarkedTask>, EnvError> {
    let Some(task) = world.abilities().episodes.and_then(Episodes::default_task) else {
        return Ok(None);
    };
    let mut journey = |actor: &Actor| {
        let walked = run_tasks(world, std::slice::from_ref(&task), actor, rng, &mut |_, _| true)?;
        let end: Vec<f32> = world.spec().achieved(walked.env.states()).collect();
        let left = truth.as_mut().and_then(|truth| truth.steps(&end, &task.goal, u32::MAX)?[0]);
        let taken = walked.taken[0];
        // A goal counts as reached within its radius, from where there may still be a step.
        let left = left.map(|steps| if taken.is_some() { 0 } else { steps });
        Ok::<_, EnvError>(TaskOutcome {
            reached: taken.is_some(),
            steps: taken.unwrap_or_else(|| actor.budget(world, &task)),
            left_steps: left,
            left_straight: Some(world.spec().goal_distance(walked.env.states(), &task.goal)),
        })
    };
    let alone = journey(alone)?;
    Ok(Some(MarkedTask { alone, planned: planned.map(journey).transpose()? }))
}

/// Compares D, and D along `graph`, with ground truth; returns `None` if there are no pairs.
fn distance_error(
    groups: &[TruePairs],
    policy: &dyn Policy,
    graph: Option<&BridgeGraph>,
) -> Option<DistanceError> {
    if groups.iter().all(|group| group.steps.is_empty()) {
        return None;
    }
    let (mut composed, mut scratch) = (Vec::new(), Scratch::default());
    for TruePairs { goal, states, .. } in groups {
        if let Some(graph) = graph {
            let route = graph.route(goal, policy, &mut scratch);
            let (links, scratch) = (LINK_CANDIDATES, &mut scratch);
            composed.extend(graph.composed_distances(states, &route, links, policy, scratch));
        }
    }
    let truth: Vec<f64> =
        groups.iter().flat_map(|group| &group.steps).map(|steps| f64::from(*steps)).collect();
    let states: Vec<f32> = groups.iter().flat_map(|group| &group.states).copied().collect();
    let goals: Vec<f32> =
        groups.iter().flat_map(|group| group.goal.repeat(group.steps.len())).collect();
    let mut learned = vec![0.0; truth.len()];
    policy.distances(&states, &goals, &mut learned, &mut scratch);
    let near: Vec<bool> = groups.iter().flat_map(|group| &group.near).copied().collect();
    // Relative errors of `distances`: over pairs drawn at random, and over pairs within
    // `NEAR_STEPS`.
    let errors = |distances: &[f32]| {
        let mean = |counts: &dyn Fn(usize) -> bool, of: fn(f64) -> f64| {
            let error = |i: usize| of((f64::from(distances[i]) - truth[i]) / truth[i]);
            let errors: Vec<f64> = (0..truth.len()).filter(|i| counts(*i)).map(error).collect();
            errors.iter().sum::<f64>() / errors.len().max(1) as f64
        };
        let (drawn, close) = (|i: usize| !near[i], |i: usize| truth[i] <= f64::from(NEAR_STEPS));
        let (mape, near_mape) = (mean(&drawn, f64::abs), mean(&close, f64::abs));
        ComposedError { mape, near_mape, bias: mean(&drawn, |error| error) }
    };
    let kept: Vec<usize> = (0..near.len()).filter(|i| !near[*i]).collect();
    let (drawn, true_steps): (Vec<f64>, Vec<f64>) =
        kept.iter().map(|i| (f64::from(learned[*i]), truth[*i])).unzip();
    let ComposedError { mape, near_mape, bias } = errors(&learned);
    let graph = graph.map(|_| errors(&composed));
    Some(DistanceError { mape, near_mape, bias, spearman: spearman(&drawn, &true_steps), graph })
}

fn max_true_distance(length: f32) -> f32 {
    2.0 * length + 4.0
}

fn bridge_facts(graph: &BridgeGraph, truth: Option<&mut (dyn GroundTruth + '_)>) -> BridgeFacts {
    let false_edges = truth.map(|truth| {
        let of_candidate = |edges: &[Edge]| {
            let goals: Vec<f32> = edges.iter().flat_map(|e| graph.point(e.to)).copied().collect();
            let longest = edges.iter().map(|e| max_true_distance(e.length)).fold(0.0, f32::max);
            // No agent can stand where an edit has put a wall.
            let Some(steps) = truth.steps(graph.point(edges[0].from), &goals, longest as u32)
            else {
                return 0;
            };
            let is_false = |(steps, edge): (Option<u32>, &Edge)| {
                steps.is_none_or(|steps| steps as f32 > max_true_distance(edge.length))
            };
            steps.into_iter().zip(edges).filter(|pair| is_false(*pair)).count()
        };
        graph.edges().chunk_by(|a, b| a.from == b.from).map(of_candidate).sum()
    });
    BridgeFacts { candidates: graph.candidates().len(), edges: graph.edges().len(), false_edges }
}
