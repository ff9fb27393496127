//! Shortest paths through the bridge graph, and the distances along them.

use std::collections::HashMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{BridgeGraph, Incoming, PlannedEdge};
use crate::job::Job;
use crate::learn::{
    ChangedDistances, DistancesByGoal, GoalIndex, NEAR_STEPS, Policy, Scratch, WAYPOINT_STEPS,
};

/// Resolution of path costs: as integers in this many parts of a step, they make shortest paths
/// exact and identical on every machine.
pub(in crate::bridge) const COST_UNITS_PER_STEP: f32 = 1024.0;

/// Number of candidates around a state or goal that are considered for first and last links.
pub const LINK_CANDIDATES: usize = 48;

/// Cost of a first or last link that no trajectory verifies, as a multiple of D. Only used where
/// there is no other.
pub(crate) const UNVERIFIED_FACTOR: f32 = 2.0;

const DISTANCE_BATCH: usize = 64;

/// A distance has changed if D is longer or shorter than its bound by more than this factor.
pub(crate) const CHANGED_MARGIN: f32 = 1.15;

/// Lower bound on a distance that has grown, as a multiple of the graph's distance.
pub(crate) const GROWN_FACTOR: f32 = 0.85;

/// Steps that are subtracted from this bound.
pub(crate) const GROWN_SLACK_STEPS: f32 = 2.0;

/// A distance has shrunk only if D exceeds the graph's, by that factor and by this many steps.
pub(crate) const SHRUNK_SLACK_STEPS: f32 = 1.0;

/// Buckets by the highest bit in which a cost differs from the latest one popped.
const BUCKETS: usize = u64::BITS as usize + 1;

/// The candidates that a search has reached and not left yet, cheapest first, for costs that never fall below the latest one popped: a
/// radix heap (Ahuja et al. 1990). With it, searches take 0.7 of the time they take with a binary
/// heap.
struct RadixHeap {
    latest: u64,
    buckets: [Vec<(u64, u32)>; BUCKETS],
}

impl RadixHeap {
    fn new() -> Self {
        Self { latest: 0, buckets: [const { Vec::new() }; BUCKETS] }
    }

    /// Adds a candidate that has been reached at `cost`, at least the latest one popped.
    fn push(&mut self, cost: u64, candidate: u32) {
        let bucket = u64::BITS - (cost ^ self.latest).leading_zeros();
        self.buckets[bucket as usize].push((cost, candidate));
    }

    /// Removes the cheapest entry for which `is_wanted` holds; others may be dropped or returned.
    fn pop(&mut self, is_wanted: impl Fn(u64, u32) -> bool) -> Option<(u64, u32)> {
        while self.buckets[0].is_empty() {
            let bucket = self.buckets.iter().position(|bucket| !bucket.is_empty())?;
            let mut entries = std::mem::take(&mut self.buckets[bucket]);
            entries.retain(|(cost, candidate)| is_wanted(*cost, *candidate));
            self.latest = entries.iter().map(|(cost, _)| *cost).min().unwrap_or(self.latest);
            // All of them go to lower buckets.
            entries.drain(..).for_each(|(cost, candidate)| self.push(cost, candidate));
            self.buckets[bucket] = entries;
        }
        self.buckets[0].pop()
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Route {
    /// The goal, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Cost of the cheapest path from each candidate to the goal through the graph, in steps;
    /// infinite if there is none.
    #[serde(skip)]
    pub costs: Vec<f32>,
    /// Each candidate's successor on that path; the candidate itself if the goal comes next.
    #[serde(skip)]
    pub next: Vec<u32>,
    /// The edge to that successor, as its place in the list of incoming edges.
    #[serde(skip)]
    pub(in crate::bridge) edges: Vec<u32>,
    /// The candidate nearest to the goal, of each kind that there is near it.
    pub nearest: Vec<usize>,
    /// Candidates linked to the goal, and the cost of each link in parts of a step.
    pub(in crate::bridge) links: Vec<(u32, u32)>,
    pub(in crate::bridge) has_unverified_links: bool,
}

impl Route {
    /// Returns for each candidate the first one on its path that is at least [`WAYPOINT_STEPS`]
    /// away, or the last one; `lengths` are those of the paths, in steps.
    fn waypoints(&self, lengths: &[f32]) -> Vec<u32> {
        let waypoint = |start: usize| {
            let mut at = start;
            while self.next[at] as usize != at && lengths[start] - lengths[at] < WAYPOINT_STEPS {
                at = self.next[at] as usize;
            }
            at as u32
        };
        (0..lengths.len()).map(waypoint).collect()
    }
}

pub(in crate::bridge) struct HopOptions {
    pub candidates: Vec<FirstHop>,
    pub to_goal: f32,
    pub direct: Option<PlannedEdge>,
}

pub(in crate::bridge) struct FirstHop {
    pub candidate: usize,
    pub distance: f32,
    pub link: Option<PlannedEdge>,
}

impl BridgeGraph {
    pub(crate) fn hop_steps(&self) -> f32 {
        self.candidates.settings.hop_steps_in(&self.candidates.spec)
    }

    /// Finds the shortest paths to `goal`: last links from the candidates around it, then a
    /// backward search through the graph.
    pub fn route(&self, goal: &[f32], policy: &dyn Policy, scratch: &mut Scratch) -> Route {
        let nearby = self.distances_to(goal, policy, scratch);
        let places = self.candidates.goal_index();
        let mut nearest: Vec<usize> = Vec::new();
        let mut by_distance = nearby.clone();
        by_distance.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (i, _) in by_distance {
            if nearest.iter().all(|other| !places.are_alike(*other, i)) {
                nearest.push(i);
            }
        }
        let links = nearby.iter().filter_map(|(i, distance)| {
            let cost = self.link(Some(*i), &nearest, *distance)?.cost + self.hop_steps();
            Some((*i as u32, cost_units(cost)))
        });
        let links = links.collect();
        self.route_from_links(goal, nearest, links)
    }

    /// Finds the shortest paths to the goal of `route` again, with all links to it, verified or
    /// not. On large maps, candidates come and go, and those that `route` links to the goal may not
    /// have incoming edges yet. Returns `None` if it has them already, or if links need not be
    /// verified.
    pub(in crate::bridge) fn route_by_unverified_links(
        &self,
        route: &Route,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Option<Route> {
        if route.has_unverified_links || !self.candidates.settings.verify_edges {
            return None;
        }
        let mut links = route.links.clone();
        let is_linked = |i: usize| route.links.iter().any(|(linked, _)| *linked as usize == i);
        let nearby = self
            .distances_to(&route.goal, policy, scratch)
            .into_iter()
            .filter(|(i, _)| !is_linked(*i));
        links.extend(nearby.map(|(i, distance)| {
            let cost = UNVERIFIED_FACTOR * distance + self.hop_steps();
            (i as u32, cost_units(cost))
        }));
        let route = self.route_from_links(&route.goal, route.nearest.clone(), links);
        Some(Route { has_unverified_links: true, ..route })
    }

    /// Returns the candidates around `goal` and D from each to it: preselected by straight lines,
    /// as there are too many.
    fn distances_to(
        &self,
        goal: &[f32],
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Vec<(usize, f32)> {
        let nearby = self.candidates.goal_index().nearest_few(goal, LINK_CANDIDATES);
        let states: Vec<f32> =
            nearby.iter().flat_map(|i| self.candidate(*i).iter().copied()).collect();
        let mut distances = vec![0.0; nearby.len()];
        policy.distances(&states, &goal.repeat(nearby.len()), &mut distances, scratch);
        nearby.into_iter().zip(distances).collect()
    }

    pub(super) fn route_to_candidate(&self, i: usize) -> Route {
        // Whoever is there has arrived, whatever else tells the states apart.
        let places = self.candidates.goal_index();
        let mut links = vec![(i as u32, 0)];
        places.for_each_within(self.point(i), self.candidates.spec.goal_radius, |j, _| {
            links.extend((!places.are_alike(i, j)).then_some((j as u32, 0)));
        });
        links.sort_unstable();
        self.route_from_links(self.point(i), vec![i], links)
    }

    pub(in crate::bridge) fn route_from_links(
        &self,
        goal: &[f32],
        nearest: Vec<usize>,
        links: Vec<(u32, u32)>,
    ) -> Route {
        // Dijkstra's algorithm over candidates by number. (A library's search, which hashes nodes,
        // took a sixth of the training time in open rooms, where most candidates have hundreds of
        // edges.) 64 bits hold the sum of many maximal costs; an overflow could create cycles.
        let mut best = vec![u64::MAX; self.candidates.len()];
        let mut next: Vec<u32> = (0..best.len() as u32).collect();
        let mut edges = vec![0; best.len()];
        let mut reached = RadixHeap::new();
        for (candidate, cost) in &links {
            best[*candidate as usize] = u64::from(*cost).min(best[*candidate as usize]);
            reached.push(u64::from(*cost), *candidate);
        }
        let is_best = |best: &[u64], ahead, candidate: u32| ahead <= best[candidate as usize];
        while let Some((ahead, candidate)) = reached.pop(|cost, i| is_best(&best, cost, i)) {
            if !is_best(&best, ahead, candidate) {
                continue; // A cheaper path was found since.
            }
            let [first, end] = [0, 1].map(|k| self.first[candidate as usize + k]);
            let incoming = &self.incoming[first as usize..end as usize];
            for (edge, Incoming { from, cost_units }) in (first..).zip(incoming) {
                let (at, cost) = (*from as usize, ahead + u64::from(*cost_units));
                if cost < best[at] {
                    (best[at], next[at], edges[at]) = (cost, candidate, edge);
                    reached.push(cost, *from);
                }
            }
        }
        let in_steps =
            |cost| if cost == u64::MAX { f32::INFINITY } else { cost as f32 / COST_UNITS_PER_STEP };
        let costs = best.into_iter().map(in_steps).collect();
        let goal = goal.to_vec();
        Route { goal, costs, next, edges, nearest, links, has_unverified_links: false }
    }

    /// Returns the expected length of the path of `route` from each candidate, in steps; infinite
    /// if there is none. `last` is the length of the last link, from a candidate to the goal.
    fn lengths(&self, route: &Route, last: impl Fn(u32) -> f32) -> Vec<f32> {
        let mut lengths: Vec<Option<f32>> =
            route.costs.iter().map(|c| c.is_infinite().then_some(*c)).collect();
        let mut path = Vec::new();
        for start in 0..lengths.len() as u32 {
            let mut at = start;
            while lengths[at as usize].is_none() && route.next[at as usize] != at {
                path.push(at);
                at = route.next[at as usize];
            }
            let mut length = *lengths[at as usize].get_or_insert_with(|| last(at));
            while let Some(from) = path.pop() {
                length += self.lengths[route.edges[from as usize] as usize];
                lengths[from as usize] = Some(length);
            }
        }
        lengths.into_iter().flatten().collect()
    }

    /// Returns D(s, g) along the bridge graph for each of `states` `(rows, state_dim)`: the
    /// shortest path that starts with a verified link to one of the nearest `links` candidates; or
    /// D itself if that is shorter and below the cut-off, or if there is no such path.
    pub fn composed_distances(
        &self,
        states: &[f32],
        route: &Route,
        links: usize,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Vec<f32> {
        let linked: Vec<u32> = route.links.iter().map(|(i, _)| *i).collect();
        let from: Vec<f32> =
            linked.iter().flat_map(|i| self.candidate(*i as usize).iter().copied()).collect();
        let mut last = vec![0.0; linked.len()];
        policy.distances(&from, &route.goal.repeat(linked.len()), &mut last, scratch);
        let last: HashMap<u32, f32> = linked.into_iter().zip(last).collect();
        let hop = self.hop_steps();
        let lengths =
            self.lengths(route, |i| last.get(&i).map_or(f32::INFINITY, |distance| distance + hop));
        let states: Vec<&[f32]> = states.chunks_exact(self.candidates.spec.state_dim()).collect();
        // Batched, as the networks are more efficient on large batches.
        let batches = states.chunks(DISTANCE_BATCH).flat_map(|states| {
            let starts = states.iter().map(|state| (*state, self.nearby(state, links)));
            self.options(&starts.collect::<Vec<_>>(), route, policy, scratch)
        });
        let distances = batches.map(|options| {
            let over = options
                .candidates
                .iter()
                .filter_map(|o| Some(o.link?.length + lengths[o.candidate]));
            over.chain(options.direct.map(|direct| direct.length))
                .filter(|steps| steps.is_finite())
                .min_by(f32::total_cmp)
                .unwrap_or(options.to_goal)
        });
        distances.collect()
    }

    /// Returns the `count` candidates nearest to `state` in a straight line, nearest first.
    pub(in crate::bridge) fn nearby(&self, state: &[f32], count: usize) -> Vec<usize> {
        let at = self.candidates.goal_index().place_of(state);
        self.candidates.goal_index().nearest_few(&at, count)
    }

    /// Returns the options for walking to `route`'s goal from each of `starts`: a state with some
    /// candidates around it, and the goal.
    pub(in crate::bridge) fn options(
        &self,
        starts: &[(&[f32], Vec<usize>)],
        route: &Route,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Vec<HopOptions> {
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for (state, nearby) in starts {
            from.extend(state.repeat(nearby.len() + 1));
            to.extend(nearby.iter().flat_map(|i| self.point(*i)));
            to.extend(&route.goal);
        }
        let mut distances = vec![0.0; to.len() / route.goal.len()];
        policy.distances(&from, &to, &mut distances, scratch);
        let mut rest = &distances[..];
        let places = self.candidates.goal_index();
        let options = starts.iter().map(|(state, nearby)| {
            let here = places.place_of(state);
            let (own, others) = rest.split_at(nearby.len() + 1);
            rest = others;
            let to_goal = own[nearby.len()];
            let alike = nearby.iter().zip(own).filter(|(i, _)| places.is_like(**i, &here));
            let here = alike.min_by(|a, b| a.1.total_cmp(b.1)).map(|(i, _)| *i);
            let candidates = nearby.iter().zip(own).map(|(candidate, distance)| {
                let link = self.link(here, &[*candidate], *distance);
                FirstHop { candidate: *candidate, distance: *distance, link }
            });
            HopOptions {
                candidates: candidates.collect(),
                to_goal,
                direct: self.link(here, &route.nearest, to_goal),
            }
        });
        options.collect()
    }

    /// Draws `goals` candidates and finds the graph distances to each from all candidates that
    /// reach it; changed distances are to be found to the first `checked` of them. Returns `None` if
    /// no other candidate reaches any.
    pub fn distil(
        &self,
        goals: usize,
        checked: usize,
        rng: &mut ChaCha8Rng,
    ) -> Option<DistancesByGoal> {
        let (count, hop_steps) = (self.candidates.len(), self.hop_steps());
        let goals = goals.min(count);
        let checked = checked.min(goals);
        let (mut pairs, mut far) = (Vec::new(), Vec::new());
        let mut by_goal = DistancesByGoal {
            places: Vec::new(),
            goals: GoalIndex::new(&self.candidates.spec, &[]),
            steps: Vec::new(),
            waypoints: Vec::new(),
            checked,
            nearest_checked: vec![0; count],
            pairs: Vec::new(),
            near: 0,
            hop_steps,
            walks_arrive: self.candidates.hops().arrive(self.candidates.settings.edge_cutoff_steps),
        };
        let mut nearest = vec![f32::INFINITY; count];
        for number in 0..goals {
            let goal = rng.random_range(0..count);
            let route = self.route_to_candidate(goal);
            let lengths = self.lengths(&route, |_| 0.0);
            let reachable = lengths.iter().enumerate().filter(|(i, s)| *i != goal && s.is_finite());
            for (i, steps) in reachable {
                let is_near = steps - hop_steps < NEAR_STEPS;
                let pairs = if is_near { &mut pairs } else { &mut far };
                pairs.push((number * count + i) as u32);
            }
            if number < checked {
                let goals = nearest.iter_mut().zip(&mut by_goal.nearest_checked);
                for ((least, to), steps) in goals.zip(&lengths) {
                    if steps < least {
                        (*least, *to) = (*steps, number as u32);
                    }
                }
            }
            by_goal.places.push(goal as u32);
            by_goal.goals.push(self.point(goal));
            by_goal.waypoints.extend(route.waypoints(&lengths));
            by_goal.steps.extend(lengths);
        }
        by_goal.near = pairs.len();
        pairs.append(&mut far);
        by_goal.pairs = pairs;
        (!by_goal.pairs.is_empty()).then_some(by_goal)
    }

    /// Finds the distances that have changed since the networks learned them: those of `by_goal`
    /// that are far longer or shorter along the graph than D says. Ends early once `job` is
    /// cancelled.
    pub fn changed_distances(
        &self,
        by_goal: &DistancesByGoal,
        policy: &dyn Policy,
        scratch: &mut Scratch,
        job: &Job,
    ) -> ChangedDistances {
        let (count, hop) = (self.candidates.len(), self.hop_steps());
        let mut changed = ChangedDistances::default();
        let mut distances = vec![0.0; count];
        let places = by_goal.checked_places();
        for (goal, lengths) in places.iter().zip(by_goal.steps.chunks_exact(count)) {
            if job.is_cancelled() {
                break;
            }
            job.set(changed.goals.len(), places.len());
            changed.goals.push(*goal);
            let goals = self.point(*goal as usize).repeat(count);
            policy.distances(self.candidates.states(), &goals, &mut distances, scratch);
            for (steps, distance) in lengths.iter().zip(&distances) {
                // These paths start exactly at a candidate, so their first hop has no overhead.
                let steps = (steps - hop).max(0.0);
                let lower = GROWN_FACTOR * steps - GROWN_SLACK_STEPS;
                let grown = steps.is_finite() && lower > CHANGED_MARGIN * distance;
                let shrunk = *distance > CHANGED_MARGIN * steps + SHRUNK_SLACK_STEPS;
                changed.lower.push(if grown { lower } else { 0.0 });
                changed.upper.push(if shrunk { steps } else { f32::MAX });
            }
        }
        changed
    }
}

pub(super) fn cost_units(cost: f32) -> u32 {
    (cost * COST_UNITS_PER_STEP) as u32
}
