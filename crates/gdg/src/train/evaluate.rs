//! Evaluation against the world's ground truth, on its own random stream.

mod walk;

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::run::Run;
use super::score::{DistanceScore, Score, Success, spearman};
use crate::bridge::{BridgeGraph, Candidates, Edge, LINK_CANDIDATES, Walker};
use crate::env::{
    Environment, Episodes, Evaluated, GroundTruth, NEAR_STEPS, Spec, Task, TaskSet, TruePairs,
};
use crate::learn::{Acting, Policy, Scratch, look_ahead};
pub use walk::TaskWalk;

/// Results of one evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Score of the actor alone.
    pub greedy: Score,
    /// Score with planning over bridge points, if the method plans.
    pub planned: Option<Score>,
    /// Score of walking straight at the goal, if the world knows how: the floor for everything
    /// learned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub straight: Option<Score>,
    /// Error of D against ground truth, if that is known for any pair of states.
    pub distance_error: Option<DistanceError>,
    /// The bridge graph against ground truth, if there is a graph.
    pub bridges: Option<BridgeFacts>,
    /// Fraction of the world explored by the agents, if defined (in a maze: of the cells within
    /// reach).
    pub coverage: Option<f64>,
    /// The world's default task, if it has one (on a map: from its first start to its first goal).
    pub marked: Option<MarkedTask>,
}

impl Evaluation {
    /// Returns the summary for checkpoint lists of an evaluation made after `updates`.
    pub fn success(&self, updates: u64) -> Success {
        Success {
            updates,
            greedy: self.greedy.success,
            planned: self.planned.as_ref().and_then(|score| score.success),
        }
    }

    /// Returns the success rate with planning, or of the actor alone if the method does not plan;
    /// `None` without tasks.
    pub fn success_rate(&self) -> Option<f64> {
        self.planned.as_ref().unwrap_or(&self.greedy).success
    }

    /// Whether every number is finite: D may have diverged.
    pub fn is_finite(&self) -> bool {
        let scores = std::iter::once(&self.greedy).chain(&self.planned).chain(&self.straight);
        let of_score = |score: &Score| {
            let Score { success, spl, steps_ratio, by_distance } = score;
            let of_distance =
                |d: &DistanceScore| [d.distance_steps, d.distance_cm, d.success, d.spl];
            let ratios = [*success, *spl, *steps_ratio];
            by_distance.iter().flat_map(of_distance).chain(ratios).flatten().collect::<Vec<_>>()
        };
        let errors = self.distance_error.iter().flat_map(|error| {
            let DistanceError { mape, near_mape, bias, spearman, graph } = error;
            let graph = graph.iter().flat_map(|graph| [graph.mape, graph.near_mape, graph.bias]);
            graph.chain([*mape, *near_mape, *bias, *spearman]).collect::<Vec<_>>()
        });
        scores.flat_map(of_score).chain(errors).chain(self.coverage).all(f64::is_finite)
    }
}

/// Results on the world's default task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarkedTask {
    /// Result of the actor alone.
    pub greedy: TaskOutcome,
    /// Result with planning over bridge points, if the method plans.
    pub planned: Option<TaskOutcome>,
}

/// Outcome of one task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskOutcome {
    /// Whether the goal was reached in time.
    pub reached: bool,
    /// Steps taken.
    pub steps: u32,
    /// True steps from the final state to the goal; `u32::MAX` if unknown.
    pub left_steps: u32,
    /// Straight-line distance from the final state to the goal, in the world's unit of length;
    /// older files do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_straight: Option<f32>,
}

/// Error of the learned distance over pairs with a known true distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
    /// Spearman's rank correlation.
    pub spearman: f64,
    /// Error of D along the bridge graph on the same pairs, if there is a graph.
    pub graph: Option<ComposedError>,
}

/// Error of D along the bridge graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComposedError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
}

/// Size of the bridge graph and number of false edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BridgeFacts {
    /// Bridge candidates.
    pub candidates: usize,
    /// Edges between them.
    pub edges: usize,
    /// Edges whose true distance exceeds 2 D + 4, if that is known.
    pub false_edges: Option<usize>,
}

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
    pub fn tasks(&self, per_group: usize) -> TaskSet {
        self.world.tasks(per_group, &mut self.task_rng.clone())
    }

    /// Evaluates on `tasks` against ground truth.
    pub fn run(&self, tasks: &TaskSet) -> Evaluation {
        crate::faults::point("evaluation");
        let graph = self.graph();
        let greedy = self.actor(None);
        let planned = graph.as_ref().map(|graph| self.actor(Some(graph)));
        let (policy, world, coverage, rng) =
            (&*self.policy, &*self.world, self.coverage, &mut self.rng.clone());
        let mut score =
            |actor: &Actor| Score::new(tasks, &run_tasks(world, &tasks.tasks, actor, rng).taken);
        let planned_score = planned.as_ref().map(&mut score);
        let greedy_score = score(&greedy);
        let mut truth = world.abilities().evaluated.and_then(Evaluated::ground_truth);
        Evaluation {
            distance_error: truth
                .as_mut()
                .and_then(|truth| distance_error(&truth.pairs(rng), policy, graph.as_ref())),
            bridges: graph.as_ref().map(|graph| bridge_facts(graph, truth.as_deref_mut())),
            coverage,
            marked: marked_task(world, truth.as_deref_mut(), (&greedy, planned.as_ref()), rng),
            greedy: greedy_score,
            planned: planned_score,
            straight: self.straight_score(tasks),
        }
    }

    /// Scores walking straight at the goals.
    fn straight_score(&self, tasks: &TaskSet) -> Option<Score> {
        let world = &*self.world;
        let policy = Straight { spec: world.spec(), world: world.abilities().evaluated? };
        let mut action = vec![0.0; world.spec().action_dim];
        let goal = &tasks.tasks.first()?.goal;
        if !policy.world.straight_action(world.fork(1).states(), goal, &mut action) {
            return None;
        }
        // The second half of the evaluation's stream, so that other results do not depend on this
        // one.
        let mut rng = self.rng.clone();
        rng.set_word_pos(rng.get_word_pos() + (1 << 33));
        let actor =
            Actor { policy: &policy, graph: None, hold_steps: None, max_steps: self.max_steps };
        Some(Score::new(tasks, &run_tasks(world, &tasks.tasks, &actor, &mut rng).taken))
    }

    /// Builds the graph to plan on, for methods that plan.
    fn graph(&self) -> Option<BridgeGraph> {
        let (spec, settings, policy) = (self.world.spec(), self.run.bridge(), &*self.policy);
        let candidates = self.candidates.as_ref()?;
        Some(BridgeGraph::build(spec, &settings, candidates, policy, &mut Scratch::default()))
    }

    /// Returns how agents act, with planning over `graph` if there is one.
    fn actor<'a>(&'a self, graph: Option<&'a BridgeGraph>) -> Actor<'a> {
        let hold_steps =
            (self.acting == Acting::AtRandom).then_some(self.run.settings.train.random_hold_steps);
        Actor { policy: &*self.policy, graph, hold_steps, max_steps: self.max_steps }
    }
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

/// Runs the world's default task.
fn marked_task(
    world: &dyn Environment,
    mut truth: Option<&mut (dyn GroundTruth + '_)>,
    (greedy, planned): (&Actor, Option<&Actor>),
    rng: &mut ChaCha8Rng,
) -> Option<MarkedTask> {
    let task = world.abilities().episodes?.default_task()?;
    let mut journey = |actor: &Actor| {
        let walked = run_tasks(world, std::slice::from_ref(&task), actor, rng);
        let end: Vec<f32> = world.spec().achieved(walked.env.states()).collect();
        let left = truth.as_mut().and_then(|truth| truth.steps(&end, &task.goal, u32::MAX)?[0]);
        let taken = walked.taken[0];
        TaskOutcome {
            reached: taken.is_some(),
            steps: taken.unwrap_or_else(|| actor.budget(world, &task)),
            left_steps: left.unwrap_or(u32::MAX),
            left_straight: Some(world.spec().goal_distance(walked.env.states(), &task.goal)),
        }
    };
    Some(MarkedTask { greedy: journey(greedy), planned: planned.map(journey) })
}

/// How the evaluated agents act.
#[derive(Clone, Copy)]
struct Actor<'a> {
    policy: &'a dyn Policy,
    /// The graph used for planning.
    graph: Option<&'a BridgeGraph>,
    /// Mean number of steps a random direction is held, if agents act at random.
    hold_steps: Option<f32>,
    /// Steps within which every goal has to be reached, instead of the task's own budget.
    max_steps: Option<u32>,
}

impl Actor<'_> {
    /// Returns the number of steps within which the goal of `task` has to be reached.
    fn budget(&self, world: &dyn Environment, task: &Task) -> u32 {
        let own = || world.abilities().episodes.and_then(Episodes::episode_steps);
        self.max_steps.or_else(own).unwrap_or_else(|| task.budget())
    }
}

/// Outcomes of several tasks.
struct TaskRuns {
    /// Steps per task; `None` if the goal was not reached in time.
    taken: Vec<Option<u32>>,
    /// The environment with the agents in their final states.
    env: Box<dyn Environment>,
}

/// Runs all tasks in lockstep, one agent per task.
fn run_tasks(
    world: &dyn Environment,
    tasks: &[Task],
    actor: &Actor,
    rng: &mut ChaCha8Rng,
) -> TaskRuns {
    run_tasks_watched(world, tasks, actor, rng, &mut |_| {})
}

/// Like [`run_tasks`]; calls `watch` with all agents' states at the start and after every step.
fn run_tasks_watched(
    world: &dyn Environment,
    tasks: &[Task],
    actor: &Actor,
    rng: &mut ChaCha8Rng,
    watch: &mut dyn FnMut(&[f32]),
) -> TaskRuns {
    let mut env = world.fork(tasks.len());
    let (s, a) = (env.spec().state_dim(), env.spec().action_dim);
    let mut scratch = Scratch::default();
    for (i, task) in tasks.iter().enumerate() {
        if !env.set_full_state(i, &task.start) {
            env.restart(i, rng);
        }
    }
    let mut walkers: Vec<Walker> = match actor.graph {
        Some(graph) => tasks
            .iter()
            .map(|task| Walker::new(graph.route(&task.goal, actor.policy, &mut scratch)))
            .collect(),
        None => Vec::new(),
    };
    let mut taken: Vec<Option<u32>> = vec![None; tasks.len()];
    let mut active: Vec<usize> = (0..tasks.len()).collect();
    let mut actions = vec![0.0; a * tasks.len()];
    let (mut states, mut aims, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
    for clock in 0.. {
        watch(env.states());
        active.retain(|&i| {
            let at = &env.states()[s * i..s * (i + 1)];
            if env.spec().reached(at, &tasks[i].goal) {
                taken[i] = Some(clock);
            }
            taken[i].is_none() && clock < actor.budget(world, &tasks[i])
        });
        if active.is_empty() {
            break;
        }
        states.clear();
        aims.clear();
        for &i in &active {
            let state = &env.states()[s * i..s * (i + 1)];
            states.extend(state);
            match actor.graph {
                Some(graph) => {
                    aims.extend(walkers[i].step(state, graph, actor.policy, &mut scratch));
                }
                None => aims.extend(&tasks[i].goal),
            }
        }
        chosen.resize(active.len() * a, 0.0);
        match actor.hold_steps {
            None => {
                actor.policy.actions(&states, &aims, &mut chosen, &mut scratch);
                if let Some(graph) = actor.graph {
                    let ahead: Vec<bool> =
                        active.iter().map(|i| walkers[*i].looks_ahead(graph)).collect();
                    look_ahead(actor.policy, &ahead, &states, &aims, &mut chosen, &mut scratch);
                }
            }
            Some(hold_steps) => {
                for (&i, action) in active.iter().zip(chosen.chunks_exact_mut(a)) {
                    action.copy_from_slice(&actions[a * i..a * (i + 1)]);
                    if clock == 0 || rng.random::<f32>() < 1.0 / hold_steps {
                        action.fill_with(|| rng.random_range(-1.0..=1.0));
                    }
                }
            }
        }
        actions.fill(0.0);
        for (&i, action) in active.iter().zip(chosen.chunks_exact(a)) {
            actions[a * i..a * (i + 1)].copy_from_slice(action);
        }
        env.step(&actions, rng);
    }
    TaskRuns { taken, env }
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
            composed.extend(graph.composed_distances(
                states,
                &route,
                LINK_CANDIDATES,
                policy,
                &mut scratch,
            ));
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
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    // Relative errors of `distances`: over pairs drawn at random, and over pairs within
    // `NEAR_STEPS`.
    let errors = |distances: &[f32]| {
        let pairs = distances
            .iter()
            .zip(&truth)
            .zip(&near)
            .map(|((d, t), near)| ((f64::from(*d) - t) / t, *t, *near));
        let pairs: Vec<_> = pairs.collect();
        let all =
            |of: fn(f64) -> f64| mean(pairs.iter().filter(|p| !p.2).map(|p| of(p.0)).collect());
        ComposedError {
            mape: all(f64::abs),
            near_mape: mean(
                pairs.iter().filter(|p| p.1 <= f64::from(NEAR_STEPS)).map(|p| p.0.abs()).collect(),
            ),
            bias: all(|e| e),
        }
    };
    let kept: Vec<usize> = (0..near.len()).filter(|i| !near[*i]).collect();
    let (drawn, true_steps): (Vec<f64>, Vec<f64>) =
        kept.iter().map(|i| (f64::from(learned[*i]), truth[*i])).unzip();
    let ComposedError { mape, near_mape, bias } = errors(&learned);
    let graph = graph.map(|_| errors(&composed));
    Some(DistanceError { mape, near_mape, bias, spearman: spearman(&drawn, &true_steps), graph })
}

/// Returns the true distance in steps above which an edge of this length is false.
fn max_true_distance(length: f32) -> f32 {
    2.0 * length + 4.0
}

/// Counts candidates, edges and, by true distance, false edges.
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
