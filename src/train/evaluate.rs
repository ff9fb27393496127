//! Evaluation against the truth of the map, on a random stream of its own.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::method::Method;
use super::run::Run;
use super::score::{Score, spearman};
use super::tasks::TaskSet;
use crate::bridge::{BridgeGraph, Experience, Walker};
use crate::env::{Environment, PointMaze};
use crate::learn::{Nets, Policy, Scratch};
use crate::map::{Cell, Grid, StepSearch, UNREACHABLE};

/// Everything one evaluation found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// The actor alone.
    pub greedy: Score,
    /// The actor walking between bridge points, where the method plans.
    pub planned: Option<Score>,
    /// D against the truth.
    pub distance_error: DistanceError,
    /// The bridge graph against the truth, where there is one.
    pub bridges: Option<BridgeFacts>,
}

/// Error of the learned distance, by pairs of free cells that reach each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DistanceError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
    /// Spearman's rank correlation.
    pub spearman: f64,
}

/// Size of the bridge graph and how many of its edges are false.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
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
    pub(super) experience: Option<Experience>,
    pub(super) rng: ChaCha8Rng,
}

impl EvaluationJob {
    /// Evaluates on `tasks`, against the truth.
    pub fn carry_out(self, tasks: &TaskSet) -> Evaluation {
        let Self { run, world, policy, experience, mut rng } = self;
        let (nets, mut scratch, rng) = (policy.nets(), Scratch::default(), &mut rng);
        let bridge = &run.settings.bridge;
        let graph = experience.as_ref().map(|e| BridgeGraph::build(world.spec(), bridge, e, &nets, &mut scratch));
        let planned = graph.as_ref().map(|graph| walk(&world, tasks, &Actor::Planned(&nets, graph), rng));
        let greedy = match run.method {
            Method::Random => Actor::Random { hold_steps: run.settings.train.random_hold_steps },
            _ => Actor::Greedy(&nets),
        };
        Evaluation {
            greedy: walk(&world, tasks, &greedy, rng),
            planned,
            distance_error: distance_error(world.map(), &nets, rng),
            bridges: graph.map(|graph| bridge_facts(world.map(), &graph)),
        }
    }
}

/// Who walks.
enum Actor<'a> {
    Greedy(&'a Nets<'a>),
    Planned(&'a Nets<'a>, &'a BridgeGraph),
    Random { hold_steps: f32 },
}

/// All tasks side by side; the steps each took, by its score.
fn walk(world: &PointMaze, set: &TaskSet, actor: &Actor, rng: &mut ChaCha8Rng) -> Score {
    let mut env = world.with_agents(set.tasks.len());
    let mut scratch = Scratch::default();
    let goals: Vec<[f32; 2]> = set.tasks.iter().map(|t| t.goal.centre()).collect();
    for (i, task) in set.tasks.iter().enumerate() {
        env.place(i, &task.start.centre());
    }
    let mut walkers: Vec<Walker> = match actor {
        Actor::Planned(nets, graph) => goals.iter().map(|g| Walker::new(graph.route(g, nets, &mut scratch))).collect(),
        _ => Vec::new(),
    };
    let mut taken: Vec<Option<u32>> = vec![None; set.tasks.len()];
    let mut active: Vec<usize> = (0..set.tasks.len()).collect();
    let mut actions = vec![0.0; 2 * set.tasks.len()];
    let (mut states, mut aims, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
    for clock in 0.. {
        active.retain(|&i| {
            let at = &env.states()[2 * i..2 * i + 2];
            if env.spec().reached(at, &goals[i]) {
                taken[i] = Some(clock);
            }
            taken[i].is_none() && clock < set.tasks[i].budget()
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
    Score::new(set, &taken)
}

/// Compares D with breadth-first search.
fn distance_error(map: &Grid, nets: &Nets, rng: &mut ChaCha8Rng) -> DistanceError {
    let mut search = StepSearch::new(map);
    let components = search.components(map);
    let cells: Vec<Cell> = components.largest_cells(map).collect();
    let (mut states, mut goals, mut truth, mut near) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ERROR_PAIRS.0 {
        let goal = cells[rng.random_range(0..cells.len())];
        let steps = search.from(goal);
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
    }
    let mut learned = vec![0.0; truth.len()];
    nets.distances(&states, &goals, &mut learned, &mut Scratch::default());
    let learned: Vec<f64> = learned.into_iter().map(f64::from).collect();
    let pairs = || learned.iter().zip(&truth).zip(&near).map(|((d, t), near)| ((d - t) / t, *t, *near));
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let all = |of: fn(f64) -> f64| mean(pairs().filter(|p| !p.2).map(|p| of(p.0)).collect());
    let kept: Vec<usize> = (0..near.len()).filter(|i| !near[*i]).collect();
    let only = |values: &[f64]| kept.iter().map(|i| values[*i]).collect::<Vec<_>>();
    DistanceError {
        mape: all(f64::abs),
        near_mape: mean(pairs().filter(|p| p.1 <= f64::from(NEAR_STEPS)).map(|p| p.0.abs()).collect()),
        bias: all(|e| e),
        spearman: spearman(&only(&learned), &only(&truth)),
    }
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
