//! Ways through the bridge graph, and the distances that they compose.

use pathfinding::directed::dijkstra::dijkstra_all;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{BridgeGraph, nearest};
use crate::learn::{Policy, Scratch};

/// Costs are integers in this many parts of a step: shortest paths are then exact and the same everywhere.
const PARTS_PER_STEP: f32 = 1024.0;

/// Candidates around a state or goal that first and last links may lead to.
pub const LINKS: usize = 48;

/// States whose composed distances are computed together.
const COMPOSED_AT_ONCE: usize = 64;

/// Distances of the graph as training targets: pairs (candidate, goal candidate, steps).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distilled {
    /// Candidate, goal candidate and graph distance in steps.
    pub pairs: Vec<(u32, u32, f32)>,
}

/// The ways to one goal through the graph.
#[derive(Clone, Debug)]
pub struct Route {
    /// The goal, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Steps from each candidate to the goal through the graph; infinite where there is no way.
    pub steps: Vec<f32>,
    /// Each candidate's next one on that way; itself where the goal comes next.
    pub next: Vec<u32>,
    /// The candidate that is nearest to the goal by D.
    pub nearest: Option<usize>,
    /// Candidates from which the goal comes next, and what that costs in parts of a step.
    pub(in crate::bridge) links: Vec<(u32, u32)>,
}

/// Where a walk can go next.
pub(in crate::bridge) struct Options {
    /// The candidates around.
    pub candidates: Vec<FirstHop>,
    /// D to the goal itself.
    pub to_goal: f32,
    /// What going to the goal itself costs, where that link is verified.
    pub direct: Option<f32>,
}

/// A first hop to a candidate.
pub(in crate::bridge) struct FirstHop {
    pub candidate: usize,
    /// D to it.
    pub distance: f32,
    /// What the hop costs, where it is verified.
    pub cost: Option<f32>,
}

/// Nodes of a search: candidates, and the goal that it starts from.
const GOAL: u32 = u32::MAX;

impl BridgeGraph {
    /// The ways to `goal`: last links from candidates around it, then shortest paths back through the graph.
    pub fn route(&self, goal: &[f32], policy: &dyn Policy, scratch: &mut Scratch) -> Route {
        let (s, g) = (self.spec.state_dim(), self.spec.goal_dim());
        // Candidates around the goal by straight line; D then says how far they are.
        let mut around: Vec<(usize, f32)> = (0..self.candidates.len())
            .map(|i| (i, self.spec.goal_distance(&self.candidates.states()[i * s..(i + 1) * s], goal)))
            .collect();
        around.sort_by(|a, b| a.1.total_cmp(&b.1));
        around.truncate(LINKS);
        let states: Vec<f32> = around.iter().flat_map(|(i, _)| self.candidate(*i).iter().copied()).collect();
        let mut distances = vec![0.0; around.len()];
        policy.distances(&states, &goal.repeat(states.len() / s), &mut distances, scratch);
        debug_assert_eq!(goal.len(), g);
        let nearest = around.iter().zip(&distances).min_by(|a, b| a.1.total_cmp(b.1)).map(|((i, _), _)| *i);
        let links: Vec<(u32, u32)> = around
            .iter()
            .zip(&distances)
            .filter_map(|((i, _), d)| {
                Some((*i as u32, parts(self.link(Some(*i), nearest, *d)? + self.settings.hop_steps)))
            })
            .collect();
        self.route_by(goal, nearest, links)
    }

    /// The ways to candidate `i` as a goal.
    pub(super) fn route_to_candidate(&self, i: usize) -> Route {
        self.route_by(self.point(i), Some(i), vec![(i as u32, 0)])
    }

    /// The ways to a goal whose last links are known.
    pub(in crate::bridge) fn route_by(&self, goal: &[f32], nearest: Option<usize>, links: Vec<(u32, u32)>) -> Route {
        let predecessors = |node: &u32| {
            let from_goal = if *node == GOAL { &links[..] } else { &[] };
            let incoming = match *node {
                GOAL => &[],
                j => &self.incoming[self.first[j as usize] as usize..self.first[j as usize + 1] as usize],
            };
            let edges = incoming.iter().map(|e| {
                let edge = &self.edges[*e as usize];
                (edge.from as u32, parts(edge.cost))
            });
            from_goal.iter().copied().chain(edges).collect::<Vec<_>>()
        };
        let mut steps = vec![f32::INFINITY; self.candidates.len()];
        let mut next: Vec<u32> = (0..steps.len() as u32).collect();
        for (node, (towards, cost)) in dijkstra_all(&GOAL, predecessors) {
            if node != GOAL {
                steps[node as usize] = cost as f32 / PARTS_PER_STEP;
                next[node as usize] = if towards == GOAL { node } else { towards };
            }
        }
        Route { goal: goal.to_vec(), steps, next, nearest, links }
    }

    /// D(s, g) as the graph composes it, for each of `states` `(rows, state_dim)`: the shortest way over verified links
    /// to one of the nearest `links` candidates, or D itself where that is shorter and below the cut-off, or where
    /// there is no such way.
    pub fn composed(
        &self,
        states: &[f32],
        route: &Route,
        links: usize,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Vec<f32> {
        let states: Vec<&[f32]> = states.chunks_exact(self.spec.state_dim()).collect();
        // Many at once: the networks take large batches better than small ones.
        let batches =
            states.chunks(COMPOSED_AT_ONCE).flat_map(|states| self.options(states, route, links, policy, scratch));
        let distances = batches.map(|options| {
            let over = options.candidates.iter().filter_map(|o| Some(o.cost? + route.steps[o.candidate]));
            over.chain(options.direct)
                .filter(|steps| steps.is_finite())
                .min_by(f32::total_cmp)
                .unwrap_or(options.to_goal)
        });
        distances.collect()
    }

    /// Where walks to `route`'s goal can go from each of `states`: to the nearest `links` candidates, or to the goal.
    pub(in crate::bridge) fn options(
        &self,
        states: &[&[f32]],
        route: &Route,
        links: usize,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Vec<Options> {
        let around: Vec<Vec<usize>> =
            states.iter().map(|state| nearest(&self.spec, &self.candidates, state, links)).collect();
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for (state, around) in states.iter().zip(&around) {
            from.extend(state.repeat(around.len() + 1));
            to.extend(around.iter().flat_map(|i| self.point(*i)));
            to.extend(&route.goal);
        }
        let mut distances = vec![0.0; to.len() / route.goal.len()];
        policy.distances(&from, &to, &mut distances, scratch);
        let mut rest = &distances[..];
        let options = around.into_iter().map(|around| {
            let (own, others) = rest.split_at(around.len() + 1);
            rest = others;
            let to_goal = own[around.len()];
            let here = around.iter().zip(own).min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| *i);
            let candidates = around.iter().zip(own).map(|(candidate, distance)| {
                let cost = self.link(here, Some(*candidate), *distance);
                FirstHop { candidate: *candidate, distance: *distance, cost }
            });
            Options { candidates: candidates.collect(), to_goal, direct: self.link(here, route.nearest, to_goal) }
        });
        options.collect()
    }

    /// Draws `goals` candidates and takes the graph distances to each from everywhere.
    pub fn distil(&self, goals: usize, rng: &mut ChaCha8Rng) -> Distilled {
        let mut pairs = Vec::new();
        for _ in 0..goals.min(self.candidates.len()) {
            let goal = rng.random_range(0..self.candidates.len());
            let route = self.route_to_candidate(goal);
            let reachable = route.steps.iter().enumerate().filter(|(i, s)| *i != goal && s.is_finite());
            // These ways begin exactly at a candidate, not somewhere near it.
            pairs.extend(reachable.map(|(i, s)| (i as u32, goal as u32, s - self.settings.hop_steps)));
        }
        Distilled { pairs }
    }
}

fn parts(cost: f32) -> u32 {
    (cost * PARTS_PER_STEP) as u32
}
