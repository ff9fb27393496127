//! Evaluation against the truth of the map, on a random stream of its own.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::method::Method;
use super::run::Run;
use super::score::{DistanceScore, Score, Success, spearman};
use super::tasks::{Task, TaskSet};
use crate::bridge::{BridgeGraph, Experience, LINKS, Walker};
use crate::env::{Environment, PointMaze};
use crate::learn::{Nets, Policy, Scratch};
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};

/// Everything one evaluation found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// The actor alone.
    pub greedy: Score,
    /// The actor walking between bridge points, where the method plans.
    pub planned: Option<Score>,
    /// D against the truth.
    pub distance_error: DistanceError,
    /// The bridge graph against the truth, where there is one.
    pub bridges: Option<BridgeFacts>,
    /// Share of the cells of the map's largest component that an agent has been in while exploring.
    pub coverage: f64,
    /// The map's own task, from its first start to its first goal, where it has both.
    pub marked: Option<MarkedTask>,
}

impl Evaluation {
    /// What lists of checkpoints show of it, where it was made after `updates`.
    pub fn success(&self, updates: u64) -> Success {
        Success { updates, greedy: self.greedy.success, planned: self.planned.as_ref().map(|score| score.success) }
    }

    /// Whether every number is one: D may have grown beyond all bounds.
    pub fn is_sound(&self) -> bool {
        let DistanceError { mape, near_mape, bias, spearman, graph } = &self.distance_error;
        let graph = graph.iter().flat_map(|graph| [graph.mape, graph.near_mape, graph.bias]);
        let scores = std::iter::once(&self.greedy).chain(&self.planned);
        let of_score = |score: &Score| {
            let Score { success, spl, steps_ratio, by_distance } = score;
            let of_distance = |d: &DistanceScore| [d.distance_steps, d.success, d.spl];
            let all = by_distance.iter().flat_map(of_distance).chain([*success, *spl, *steps_ratio]);
            all.collect::<Vec<_>>()
        };
        let all = [*mape, *near_mape, *bias, *spearman, self.coverage];
        all.into_iter().chain(graph).chain(scores.flat_map(of_score)).all(f64::is_finite)
    }
}

/// The map's own task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarkedTask {
    /// By the actor alone.
    pub greedy: Journey,
    /// Between bridge points, where the method plans.
    pub planned: Option<Journey>,
}

/// How one task went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Journey {
    /// Whether the goal was reached in time.
    pub reached: bool,
    /// Steps taken.
    pub steps: u32,
    /// True steps from where it ended to the goal.
    pub left_steps: u32,
}

/// Error of the learned distance, by pairs of free cells that reach each other.
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
    /// The distance composed by the bridge graph, on the same pairs, where there is one.
    pub graph: Option<ComposedError>,
}

/// Error of the distance that the bridge graph composes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComposedError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
}

/// Size of the bridge graph and how many of its edges are false.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BridgeFacts {
    /// Bridge candidates.
    pub candidates: usize,
    /// Edges between them.
    pub edges: usize,
    /// Edges whose true distance is above 2 D + 4.
    pub false_edges: usize,
}

/// Pairs within this many steps count as near.
const NEAR_STEPS: u32 = 10;

/// Goals, starts for each, and near starts for each, that D's error is measured on.
const ERROR_PAIRS: (usize, usize, usize) = (48, 32, 12);

/// An evaluation with all that it needs: it can be carried out at any time, by any thread.
pub struct EvaluationJob {
    pub(super) run: Run,
    pub(super) world: PointMaze,
    pub(super) policy: Policy,
    /// Candidates and what was seen between them, for methods that plan.
    pub(super) experience: Option<Arc<Experience>>,
    /// How often an agent was in each cell, row-major.
    pub(super) visited: Vec<u32>,
    pub(super) rng: ChaCha8Rng,
}

impl EvaluationJob {
    /// Evaluates on `tasks`, against the truth.
    pub fn carry_out(self, tasks: &TaskSet) -> Evaluation {
        crate::faults::point("evaluation");
        let Self { run, world, policy, experience, visited, mut rng } = self;
        let (nets, mut scratch, rng) = (policy.nets(), Scratch::default(), &mut rng);
        let graph =
            experience.as_ref().map(|e| BridgeGraph::build(world.spec(), &run.bridge(), e, &nets, &mut scratch));
        let greedy = match run.method {
            Method::Random => Actor::Random { hold_steps: run.settings.train.random_hold_steps },
            _ => Actor::Greedy(&nets),
        };
        let planned = graph.as_ref().map(|graph| Actor::Planned(&nets, graph));
        let mut score = |actor: &Actor| Score::new(tasks, &walk(&world, &tasks.tasks, actor, rng).taken);
        let planned_score = planned.as_ref().map(&mut score);
        let greedy_score = score(&greedy);
        Evaluation {
            distance_error: distance_error(world.map(), &nets, graph.as_ref(), rng),
            bridges: graph.as_ref().map(|graph| bridge_facts(world.map(), graph)),
            coverage: coverage(world.map(), &visited),
            marked: marked_task(&world, (&greedy, planned.as_ref()), rng),
            greedy: greedy_score,
            planned: planned_score,
        }
    }
}

/// Share of the largest component's cells that have been visited.
fn coverage(map: &Grid, visited: &[u32]) -> f64 {
    let components = StepSearch::new(map).components(map);
    let (mut cells, mut seen) = (0u32, 0u32);
    for cell in components.largest_cells(map) {
        cells += 1;
        seen += u32::from(visited[map.index(cell)] > 0);
    }
    f64::from(seen) / f64::from(cells.max(1))
}

/// Walks the map's own task.
fn marked_task(
    world: &PointMaze,
    (greedy, planned): (&Actor, Option<&Actor>),
    rng: &mut ChaCha8Rng,
) -> Option<MarkedTask> {
    let map = world.map();
    let (start, goal) = (*map.starts().first()?, *map.goals().first()?);
    let steps = StepSearch::new(map).from(goal).to_vec();
    let shortest = Some(steps[map.index(start)]).filter(|steps| *steps != UNREACHABLE)?;
    let task = Task { start, goal, shortest, group: 0 };
    let mut journey = |actor: &Actor| {
        let walked = walk(world, &[task], actor, rng);
        let at = walked.env.states();
        let left = steps[map.index(Cell::new(at[0] as usize, at[1] as usize))];
        let taken = walked.taken[0];
        Journey { reached: taken.is_some(), steps: taken.unwrap_or(task.budget()), left_steps: left }
    };
    Some(MarkedTask { greedy: journey(greedy), planned: planned.map(journey) })
}

/// Who walks.
enum Actor<'a> {
    Greedy(&'a Nets<'a>),
    Planned(&'a Nets<'a>, &'a BridgeGraph),
    Random { hold_steps: f32 },
}

/// How a number of tasks went.
struct Walked {
    /// Steps that each took, `None` where the goal was not reached in time.
    taken: Vec<Option<u32>>,
    /// Where the agents ended.
    env: PointMaze,
}

/// Walks all tasks side by side.
fn walk(world: &PointMaze, tasks: &[Task], actor: &Actor, rng: &mut ChaCha8Rng) -> Walked {
    let mut env = world.with_agents(tasks.len());
    let mut scratch = Scratch::default();
    let goals: Vec<[f32; 2]> = tasks.iter().map(|t| t.goal.centre()).collect();
    for (i, task) in tasks.iter().enumerate() {
        env.place(i, &task.start.centre());
    }
    let mut walkers: Vec<Walker> = match actor {
        Actor::Planned(nets, graph) => goals.iter().map(|g| Walker::new(graph.route(g, nets, &mut scratch))).collect(),
        _ => Vec::new(),
    };
    let mut taken: Vec<Option<u32>> = vec![None; tasks.len()];
    let mut active: Vec<usize> = (0..tasks.len()).collect();
    let mut actions = vec![0.0; 2 * tasks.len()];
    let (mut states, mut aims, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
    for clock in 0.. {
        active.retain(|&i| {
            let at = &env.states()[2 * i..2 * i + 2];
            if env.spec().reached(at, &goals[i]) {
                taken[i] = Some(clock);
            }
            taken[i].is_none() && clock < tasks[i].budget()
        });
        if active.is_empty() {
            break;
        }
        states.clear();
        aims.clear();
        for &i in &active {
            let state = &env.states()[2 * i..2 * i + 2];
            states.extend(state);
            match actor {
                Actor::Planned(nets, graph) => aims.extend(walkers[i].step(state, graph, nets, &mut scratch)),
                _ => aims.extend(goals[i]),
            }
        }
        chosen.resize(states.len(), 0.0);
        match actor {
            Actor::Greedy(nets) | Actor::Planned(nets, _) => nets.actions(&states, &aims, &mut chosen, &mut scratch),
            Actor::Random { hold_steps } => {
                for (&i, action) in active.iter().zip(chosen.chunks_exact_mut(2)) {
                    action.copy_from_slice(&actions[2 * i..2 * i + 2]);
                    if clock == 0 || rng.random::<f32>() < 1.0 / hold_steps {
                        action.fill_with(|| rng.random_range(-1.0..=1.0));
                    }
                }
            }
        }
        actions.fill(0.0);
        for (&i, action) in active.iter().zip(chosen.chunks_exact(2)) {
            actions[2 * i..2 * i + 2].copy_from_slice(action);
        }
        env.step(&actions, rng);
    }
    Walked { taken, env }
}

/// Compares D with breadth-first search.
fn distance_error(map: &Grid, nets: &Nets, graph: Option<&BridgeGraph>, rng: &mut ChaCha8Rng) -> DistanceError {
    let mut search = StepSearch::new(map);
    let components = search.components(map);
    let cells: Vec<Cell> = components.largest_cells(map).collect();
    let (mut states, mut goals, mut truth, mut near) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut composed, mut scratch) = (Vec::new(), Scratch::default());
    for _ in 0..ERROR_PAIRS.0 {
        let goal = cells[rng.random_range(0..cells.len())];
        let steps = search.from(goal);
        let first = states.len();
        let around: Vec<usize> = (0..steps.len()).filter(|i| (1..=NEAR_STEPS).contains(&steps[*i])).collect();
        let mut push = |i: usize, only_near: bool| {
            if steps[i] == 0 {
                return;
            }
            states.extend(map.cell(i).centre());
            goals.extend(goal.centre());
            truth.push(f64::from(steps[i]));
            near.push(only_near);
        };
        for _ in 0..ERROR_PAIRS.1 {
            push(map.index(cells[rng.random_range(0..cells.len())]), false);
        }
        for _ in 0..ERROR_PAIRS.2.min(around.len()) {
            push(around[rng.random_range(0..around.len())], true);
        }
        if let Some(graph) = graph {
            let route = graph.route(&goal.centre(), nets, &mut scratch);
            composed.extend(graph.composed(&states[first..], &route, LINKS, nets, &mut scratch));
        }
    }
    let mut learned = vec![0.0; truth.len()];
    nets.distances(&states, &goals, &mut learned, &mut scratch);
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    // Of all pairs drawn at random, and of those that are near: the relative errors of some distances.
    let errors = |distances: &[f32]| {
        let pairs = distances.iter().zip(&truth).zip(&near).map(|((d, t), near)| ((f64::from(*d) - t) / t, *t, *near));
        let pairs: Vec<_> = pairs.collect();
        let all = |of: fn(f64) -> f64| mean(pairs.iter().filter(|p| !p.2).map(|p| of(p.0)).collect());
        ComposedError {
            mape: all(f64::abs),
            near_mape: mean(pairs.iter().filter(|p| p.1 <= f64::from(NEAR_STEPS)).map(|p| p.0.abs()).collect()),
            bias: all(|e| e),
        }
    };
    let kept: Vec<usize> = (0..near.len()).filter(|i| !near[*i]).collect();
    let (drawn, true_steps): (Vec<f64>, Vec<f64>) = kept.iter().map(|i| (f64::from(learned[*i]), truth[*i])).unzip();
    let ComposedError { mape, near_mape, bias } = errors(&learned);
    let graph = graph.map(|_| errors(&composed));
    DistanceError { mape, near_mape, bias, spearman: spearman(&drawn, &true_steps), graph }
}

/// An edge of length D is false where its true distance is above this many steps.
fn longest_true(distance: f32) -> f32 {
    2.0 * distance + 4.0
}

/// Counts false edges, by the true distance between the candidates' cells.
fn bridge_facts(map: &Grid, graph: &BridgeGraph) -> BridgeFacts {
    let mut search = StepSearch::new(map);
    let cell = |i: usize| Cell::new(graph.point(i)[0] as usize, graph.point(i)[1] as usize);
    let mut false_edges = 0;
    for edges in graph.edges().chunk_by(|a, b| a.from == b.from) {
        let from = cell(edges[0].from);
        if !map.is_free(from) {
            continue;
        }
        let longest = edges.iter().map(|e| longest_true(e.distance)).fold(0.0, f32::max);
        let steps = search.within(from, longest as u32);
        let is_false = |to: Cell, distance: f32| {
            let truth = steps[map.index(to)];
            truth == UNREACHABLE || truth as f32 > longest_true(distance)
        };
        false_edges += edges.iter().filter(|e| is_false(cell(e.to), e.distance)).count();
    }
    BridgeFacts { candidates: graph.experience().len(), edges: graph.edges().len(), false_edges }
}
