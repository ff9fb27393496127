//! Walking to a goal through bridge points.

use super::graph::{BridgeGraph, Route};
use crate::learn::{Nets, Scratch};

/// So many late targets in a row mean that an agent is stuck.
const STUCK: u32 = 2;

/// What a walker heads for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The goal itself.
    Goal,
    /// A bridge candidate.
    Candidate(usize),
}

/// One agent's way to its goal: it commits to a waypoint until that is reached or late, then chooses anew.
#[derive(Clone, Debug)]
pub struct Walker {
    route: Route,
    target: Option<Target>,
    /// Steps since the walk began.
    clock: u32,
    /// Step at which the target is late.
    deadline: u32,
    /// Steps from the last waypoint reached to the goal: the next one must be nearer, or the walk could go to and fro
    /// between two waypoints for ever. Infinite at the start and after a target was late.
    remaining: f32,
    /// Targets in a row that were late.
    strikes: u32,
    /// Targets that were late, and until when they are banned.
    banned: Vec<(Target, u32)>,
}

impl Walker {
    /// A walk along `route`.
    pub fn new(route: Route) -> Self {
        Self { route, target: None, clock: 0, deadline: 0, remaining: f32::INFINITY, strikes: 0, banned: Vec::new() }
    }

    /// The ways that it walks by.
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// What it heads for, once it has taken a step.
    pub fn target(&self) -> Option<Target> {
        self.target
    }

    /// Where it heads for, `(goal_dim)`.
    fn aim<'a>(&'a self, graph: &'a BridgeGraph, target: Target) -> &'a [f32] {
        match target {
            Target::Goal => &self.route.goal,
            Target::Candidate(i) => graph.point(i),
        }
    }

    /// The goal to give the actor in `state` for the next step, `(goal_dim)`.
    pub fn step<'a>(
        &'a mut self,
        state: &[f32],
        graph: &'a BridgeGraph,
        nets: &Nets,
        scratch: &mut Scratch,
    ) -> &'a [f32] {
        let settings = graph.settings();
        let mut target = self.target;
        if let Some(current) = target {
            let reached = graph.spec().reached(state, self.aim(graph, current));
            let late = settings.progress_check && self.clock >= self.deadline;
            match current {
                Target::Candidate(i) if reached => {
                    self.remaining = self.route.steps[i];
                    self.strikes = 0;
                }
                _ if late && !reached => {
                    self.banned.push((current, self.clock + settings.ban_steps));
                    self.remaining = f32::INFINITY;
                    self.strikes += 1;
                }
                _ => {}
            }
            if late || reached {
                target = None;
            }
        }
        let clock = self.clock;
        self.banned.retain(|(_, until)| *until > clock);
        let target = target.unwrap_or_else(|| {
            let (target, distance) = self.choose(state, graph, nets, scratch);
            self.deadline = clock + (settings.late_factor * distance + settings.late_slack_steps) as u32;
            target
        });
        self.target = Some(target);
        self.clock += 1;
        self.aim(graph, target)
    }

    /// The best next target and D to it.
    ///
    /// Among the candidates around, the one that minimises D(s,w) + steps(w,g); the goal itself where D(s,g) is
    /// below the cut-off and not longer than the way round. Where no verified link leads anywhere, unverified ones
    /// count; where the graph knows no way at all, the goal is approached directly.
    fn choose(&self, state: &[f32], graph: &BridgeGraph, nets: &Nets, scratch: &mut Scratch) -> (Target, f32) {
        let around = graph.around(state);
        let mut goals: Vec<f32> = around.iter().flat_map(|i| graph.point(*i).iter().copied()).collect();
        goals.extend(&self.route.goal);
        let mut distances = vec![0.0; around.len() + 1];
        nets.distances(&state.repeat(around.len() + 1), &goals, &mut distances, scratch);
        let to_goal = distances[around.len()];
        let here = around.iter().zip(&distances).min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| *i);
        let allowed = |target: Target| self.banned.iter().all(|(b, _)| *b != target);
        let best = |verified: bool| {
            let options = around.iter().zip(&distances).filter_map(|(i, d)| {
                let cost = match (verified, graph.link(here, Some(*i), *d)) {
                    (true, cost) => cost?,
                    (false, cost) => cost.unwrap_or(2.0 * d),
                };
                let total = cost + self.route.steps[*i];
                let usable = total.is_finite()
                    && self.route.steps[*i] < self.remaining
                    && allowed(Target::Candidate(*i))
                    && !graph.spec().reached(state, graph.point(*i));
                usable.then_some((*i, *d, total))
            });
            // An agent that got nowhere twice stands where the actor does not move: the shortest hop away from there.
            let key = |option: &(usize, f32, f32)| if self.strikes >= STUCK { option.1 } else { option.2 };
            options.min_by(|a, b| key(a).total_cmp(&key(b)))
        };
        let waypoint = best(true).or_else(|| best(false));
        let direct = graph.link(here, self.route.nearest, to_goal).filter(|_| allowed(Target::Goal));
        match (waypoint, direct) {
            (Some((_, _, total)), Some(direct)) if direct <= total => (Target::Goal, to_goal),
            (Some((i, distance, _)), _) => (Target::Candidate(i), distance),
            (None, _) => (Target::Goal, to_goal),
        }
    }

    /// The waypoints still ahead, as candidates, in the order in which they would be walked.
    pub fn ahead(&self) -> Vec<usize> {
        let Some(Target::Candidate(mut at)) = self.target else { return Vec::new() };
        let mut ahead = vec![at];
        while self.route.next[at] as usize != at && ahead.len() <= self.route.next.len() {
            at = self.route.next[at] as usize;
            ahead.push(at);
        }
        ahead
    }
}
