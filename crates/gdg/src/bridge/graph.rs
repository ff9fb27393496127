//! The bridge graph: candidates connected by short paths that the agent can walk.

mod routes;

pub(crate) use routes::UNVERIFIED_FACTOR;
pub(super) use routes::{COST_UNITS_PER_STEP, FirstHop, HopOptions};
pub use routes::{LINK_CANDIDATES, Route};

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::candidates::{Candidates, UNOBSERVED, WalkRecord};
use super::settings::{BridgeSettings, EDGES_PER_CANDIDATE, late_after};
use crate::env::Spec;
use crate::job::Job;
use crate::learn::{Policy, Scratch};
use crate::store::{StoreError, planes};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    pub from: usize,
    pub to: usize,
    /// D(from, to) when the graph was built, in steps.
    pub distance: f32,
    /// Expected length in steps, with the overhead of passing a waypoint: D, or the observed steps
    /// where D is unreliable.
    pub length: f32,
    /// Planning cost in steps: the length, and more if only observed trajectories support the edge,
    /// or if walks along it or along other edges of its length failed.
    pub cost: f32,
    pub status: EdgeStatus,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeStatus {
    /// Not walked yet, or failed once since the latest arrival.
    Untried,
    /// The latest walk along it arrived in time.
    Confirmed,
    /// The latest two or more walks along it failed.
    Demoted,
}

impl EdgeStatus {
    pub const ALL: [Self; 3] = [Self::Untried, Self::Confirmed, Self::Demoted];
}

impl From<WalkRecord> for EdgeStatus {
    fn from(practice: WalkRecord) -> Self {
        match practice {
            WalkRecord { failed: 2.., .. } => Self::Demoted,
            WalkRecord { arrived: 1.., failed: 0 } => Self::Confirmed,
            _ => Self::Untried,
        }
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct StoredGraph {
    candidates: Arc<Candidates>,
    /// Source and target of each edge.
    from: Vec<u32>,
    to: Vec<u32>,
    /// D of each edge. All else follows from the candidates.
    #[serde(with = "planes")]
    distances: Vec<f32>,
}

pub(crate) const DEMOTED_FACTOR: f32 = 3.0;

#[derive(Clone, Debug)]
pub struct BridgeGraph {
    pub(super) candidates: Arc<Candidates>,
    edges: Vec<Edge>,
    /// `incoming[first[j]..first[j + 1]]`: the edges that lead to j.
    incoming: Vec<Incoming>,
    first: Vec<u32>,
    /// Their expected lengths, which searches do not need.
    lengths: Vec<f32>,
}

/// An edge in a backward search. Edges to the same target are adjacent in memory, as searches scan
/// all of them for each goal.
#[derive(Clone, Copy, Debug)]
struct Incoming {
    from: u32,
    cost_units: u32,
}

impl BridgeGraph {
    /// Builds the graph from the current candidates and critics: an edge i -> j where D(i,j) is
    /// below the cut-off and, if edges need verification, some trajectory led from i to j in about
    /// D steps, for the candidates j nearest to i.
    pub fn build(candidates: &Arc<Candidates>, policy: &dyn Policy, scratch: &mut Scratch) -> Self {
        let (now, never) = (|_| true, Job::default());
        Self::empty(&candidates.spec, &candidates.settings)
            .renewed(&never, candidates, now, policy, scratch)
    }

    pub(crate) fn empty(spec: &Spec, settings: &BridgeSettings) -> Self {
        Self::from_edges(Arc::new(Candidates::new(spec, 0, settings)), Vec::new())
    }

    /// Returns the graph of the current `candidates`: rebuilds the edges from those that are new or
    /// `is_due`, see [`Self::build`]; the others keep their D. Ends early, with an incomplete graph,
    /// once `job` is cancelled.
    pub(crate) fn renewed(
        &self,
        job: &Job,
        candidates: &Arc<Candidates>,
        is_due: impl Fn(usize) -> bool,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Self {
        let before = self.candidates();
        let mut rows = DistanceRows::new(candidates);
        for from in (0..candidates.len()).take_while(|_| !job.is_cancelled()) {
            job.set(from, candidates.len());
            let Some(old) = before.index_of(candidates.id(from)).filter(|_| !is_due(from)) else {
                rows.add(from, policy, scratch);
                continue;
            };
            let first = self.edges.partition_point(|edge| edge.from < old);
            for edge in self.edges[first..].iter().take_while(|edge| edge.from == old) {
                let to = candidates.index_of(before.id(edge.to));
                rows.edges.extend(to.and_then(|to| rows.edge(from, to, edge.distance)));
            }
        }
        Self::from_edges(candidates.clone(), rows.edges)
    }

    /// Builds the graph from `edges`, which are sorted by source.
    fn from_edges(candidates: Arc<Candidates>, edges: Vec<Edge>) -> Self {
        let mut first = vec![0u32; candidates.len() + 1];
        edges.iter().for_each(|e| first[e.to + 1] += 1);
        (1..first.len()).for_each(|i| first[i] += first[i - 1]);
        let mut by_target: Vec<&Edge> = edges.iter().collect();
        by_target.sort_by_key(|edge| edge.to);
        let incoming = by_target.iter().map(|edge| Incoming {
            from: edge.from as u32,
            cost_units: routes::cost_units(edge.cost),
        });
        let (incoming, lengths) =
            (incoming.collect(), by_target.iter().map(|edge| edge.length).collect());
        Self { candidates, edges, incoming, first, lengths }
    }

    pub(crate) fn stored(&self) -> StoredGraph {
        StoredGraph {
            candidates: self.candidates.clone(),
            from: self.edges.iter().map(|edge| edge.from as u32).collect(),
            to: self.edges.iter().map(|edge| edge.to as u32).collect(),
            distances: self.edges.iter().map(|edge| edge.distance).collect(),
        }
    }

    pub(crate) fn restored(
        spec: &Spec,
        settings: &BridgeSettings,
        stored: StoredGraph,
    ) -> Result<Self, StoreError> {
        let StoredGraph { candidates: own, from, to, distances } = stored;
        let mut candidates = Candidates::new(spec, 0, settings);
        candidates.restore(Arc::unwrap_or_clone(own))?;
        let misfit = "the stored bridge graph does not fit its candidates";
        let known = |i: &u32| (*i as usize) < candidates.len();
        let fits = [to.len(), distances.len()] == [from.len(); 2]
            && from.iter().chain(&to).all(known)
            && from.is_sorted()
            && distances.iter().all(|distance| (0.0..f32::INFINITY).contains(distance));
        StoreError::unless(fits, misfit)?;
        let rows = DistanceRows::new(&candidates);
        let edges = from.iter().zip(&to).zip(&distances).map(|((from, to), distance)| {
            rows.edge(*from as usize, *to as usize, *distance)
                .ok_or_else(|| StoreError::inconsistent(misfit))
        });
        let edges = edges.collect::<Result<_, _>>()?;
        Ok(Self::from_edges(Arc::new(candidates), edges))
    }

    /// Returns the edges, sorted by source.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the candidates, and the observations between them, as of when the graph was built.
    pub fn candidates(&self) -> &Candidates {
        &self.candidates
    }

    /// Returns candidate `i` as a goal, `(goal_dim)`.
    pub fn point(&self, i: usize) -> &[f32] {
        self.candidates.goal_index().goal(i)
    }

    /// Whether nothing but the goal tells `state` apart from candidate `i`.
    pub(super) fn is_of_kind(&self, i: usize, state: &[f32]) -> bool {
        let places = self.candidates.goal_index();
        self.candidates.others().is_empty() || places.is_like(i, &places.place_of(state))
    }

    /// Returns candidate `i` as a state, `(state_dim)`.
    pub(super) fn candidate(&self, i: usize) -> &[f32] {
        let s = self.candidates.spec.state_dim();
        &self.candidates.states()[i * s..(i + 1) * s]
    }

    /// Returns the link of length `distance`, by D, from a state near candidate `from` to a goal
    /// near one of `to`; `None` if it may not be used. Links are verified like edges, by the candidates
    /// nearest to their ends.
    pub(super) fn link(
        &self,
        from: Option<usize>,
        to: &[usize],
        distance: f32,
    ) -> Option<PlannedEdge> {
        let from = from?;
        let links =
            to.iter().filter_map(|to| PlannedEdge::new(&self.candidates, from, *to, distance));
        links.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }
}

/// The edges of a graph under construction, from one candidate after the other.
struct DistanceRows<'a> {
    candidates: &'a Candidates,
    /// Overhead of passing a waypoint, in steps.
    hop: f32,
    /// For each candidate, those from which some trajectory reached it.
    observed_into: Vec<Vec<u32>>,
    edges: Vec<Edge>,
    states: Vec<f32>,
    goals: Vec<f32>,
    distances: Vec<f32>,
}

impl<'a> DistanceRows<'a> {
    fn new(candidates: &'a Candidates) -> Self {
        let Candidates { spec, settings, .. } = candidates;
        let verified = settings.verify_edges && settings.keep_observed_edges;
        Self {
            candidates,
            hop: settings.hop_steps_in(spec),
            observed_into: if verified { candidates.observed_into() } else { Vec::new() },
            edges: Vec::new(),
            states: Vec::new(),
            goals: Vec::new(),
            distances: Vec::new(),
        }
    }

    fn add(&mut self, from: usize, policy: &dyn Policy, scratch: &mut Scratch) {
        let (s, to) = (self.candidates.spec.state_dim(), self.nearest(from));
        let state = &self.candidates.states()[from * s..(from + 1) * s];
        self.states.clear();
        self.goals.clear();
        for to in &to {
            self.states.extend(state);
            self.goals.extend(self.candidates.goal_index().goal(*to));
        }
        self.distances.resize(to.len(), 0.0);
        policy.distances(&self.states, &self.goals, &mut self.distances, scratch);
        for (to, distance) in to.iter().zip(&self.distances) {
            let edge = self.edge(from, *to, *distance);
            self.edges.extend(edge);
        }
    }

    /// Returns the candidates to which there may be an edge from `from`, in ascending order: where
    /// edges need verification, those with the shortest observed paths.
    fn nearest(&self, from: usize) -> Vec<usize> {
        let candidates = self.candidates;
        if !candidates.settings.verify_edges {
            let index = candidates.goal_index();
            let near = index.nearest_few(index.place(from), LINK_CANDIDATES);
            return near.into_iter().filter(|to| *to != from).collect();
        }
        let back = self.observed_into.get(from).into_iter().flatten().map(|to| *to as usize);
        let back = back.map(|to| (candidates.observed(to, from), to));
        let back = back.filter(|(_, to)| candidates.observed(from, *to) == UNOBSERVED);
        let ahead = candidates.observed_from(from).map(|(to, steps)| (steps, to));
        let mut near: Vec<(u16, usize)> = ahead.chain(back).collect();
        if near.len() > EDGES_PER_CANDIDATE {
            near.select_nth_unstable(EDGES_PER_CANDIDATE);
            near.truncate(EDGES_PER_CANDIDATE);
        }
        let mut near: Vec<usize> = near.into_iter().map(|(_, to)| to).collect();
        near.sort_unstable();
        near
    }

    fn edge(&self, from: usize, to: usize, distance: f32) -> Option<Edge> {
        let candidates = self.candidates;
        let PlannedEdge { length, cost } = PlannedEdge::new(candidates, from, to, distance)?;
        let status = EdgeStatus::from(candidates.walk_record(from, to));
        let cost = if status == EdgeStatus::Demoted { DEMOTED_FACTOR * cost } else { cost };
        let (length, cost) = (length + self.hop, cost + self.hop);
        Some(Edge { from, to, distance, length, cost, status })
    }
}

/// Slack on observed steps: trajectories start and end up to a goal radius off, and exploration
/// wanders.
pub(crate) const OBSERVED_SLACK_STEPS: f32 = 2.0;

/// A trajectory verifies D if it took at most this multiple of D, plus the slack.
pub(crate) const OBSERVED_FACTOR: f32 = 1.5;

/// Extra cost, beyond the observed steps, of a pair that trajectories connect although D says
/// otherwise.
pub(crate) const OBSERVED_PENALTY_STEPS: f32 = 4.0;

/// Extra cost of a pair that trajectories connect in the other direction alone. Only walking there
/// shows whether that is possible; without such edges, whatever lies behind a corridor that has
/// been walked one way would be out of reach.
pub(crate) const REVERSED_PENALTY_STEPS: f32 = 8.0;

/// A connection between two places that plans may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlannedEdge {
    pub length: f32,
    /// Planning cost in steps: higher where the length is uncertain, or where hops of this length
    /// often fail.
    pub cost: f32,
}

impl PlannedEdge {
    /// Returns the link from near candidate `from` to near candidate `to` that is `distance` steps
    /// long by D; `None` if it may not be used.
    fn new(candidates: &Candidates, from: usize, to: usize, distance: f32) -> Option<Self> {
        let settings = &candidates.settings;
        let observed = candidates.observed(from, to);
        let steps = candidates.steps_of_hop(distance, observed);
        let delay = candidates.hops().failures(steps) * late_after(steps);
        let verified = observed != UNOBSERVED
            && f32::from(observed) <= OBSERVED_FACTOR * distance + OBSERVED_SLACK_STEPS;
        if distance < settings.edge_cutoff_steps && (verified || !settings.verify_edges) {
            return Some(Self { length: distance, cost: steps + delay });
        }
        // Whoever heads for a place that the goal does not tell apart may pass by what has to be done
        // first: only where the straight way takes as long as the observed one is it the same way.
        if !settings.keep_observed_edges || !candidates.goal_index().are_alike(from, to) {
            return None;
        }
        let (steps, penalty) = match (observed, candidates.observed(to, from)) {
            (UNOBSERVED, UNOBSERVED) => return None,
            (UNOBSERVED, reversed) => (reversed, REVERSED_PENALTY_STEPS),
            (observed, _) => (observed, OBSERVED_PENALTY_STEPS),
        };
        let length = f32::from(steps).max(distance.min(settings.edge_cutoff_steps));
        Some(Self { length, cost: length + penalty + delay })
    }
}

#[cfg(test)]
mod tests {
    use pathfinding::directed::dijkstra::dijkstra_all;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::bridge::candidates::tests::walked;

    fn edge(from: usize, to: usize, cost: f32) -> Edge {
        Edge { from, to, distance: cost, length: cost, cost, status: EdgeStatus::Untried }
    }

    fn row(cost: f32) -> BridgeGraph {
        let (spec, settings, candidates) = walked(20, 29.5);
        let length = 3.0 + settings.hop_steps_in(&spec);
        let edges = (1..candidates.len())
            .map(|to| Edge { distance: 3.0, length, ..edge(to - 1, to, cost) })
            .collect();
        BridgeGraph::from_edges(candidates.frozen(), edges)
    }

    fn one_way() -> Candidates {
        let (.., candidates) = walked(20, 3.5);
        assert_eq!((candidates.observed(0, 1), candidates.observed(1, 0)), (3, UNOBSERVED));
        candidates
    }

    #[test]
    fn ways_that_only_trajectories_support_cost_more_and_the_way_back_most() {
        let mut candidates = one_way();
        let link = |from, to, distance| PlannedEdge::new(&candidates, from, to, distance);
        let known = |length, cost| Some(PlannedEdge { length, cost });
        assert_eq!(link(0, 1, 2.0), known(2.0, 2.0), "D and a trajectory agree");
        assert_eq!(link(0, 1, 0.5), known(3.0, 3.0 + OBSERVED_PENALTY_STEPS), "D is too short");
        assert_eq!(link(0, 1, 50.0), known(10.0, 10.0 + OBSERVED_PENALTY_STEPS), "D is too long");
        assert_eq!(
            link(1, 0, 2.0),
            known(3.0, 3.0 + REVERSED_PENALTY_STEPS),
            "the other way alone"
        );
        candidates.settings.keep_observed_edges = false;
        let link = |from, to, distance| PlannedEdge::new(&candidates, from, to, distance);
        assert_eq!([link(0, 1, 0.5), link(0, 1, 50.0), link(1, 0, 2.0)], [None; 3]);
        candidates.settings.verify_edges = false;
        assert_eq!(PlannedEdge::new(&candidates, 1, 0, 2.0), known(2.0, 2.0));
    }

    #[test]
    fn what_has_to_be_done_first_is_never_left_out() {
        let (spec, settings) = crate::bridge::candidates::tests::line(20);
        let spec = Spec { achieved: vec![0], action_dim: 1, ..spec };
        let mut candidates = Candidates::new(&spec, 1, &settings);
        candidates.tell_apart_by(&[crate::learn::Axis {
            component: 1,
            width: 0.5,
            low: 0.0,
            step: 0.5,
        }]);
        // To a key at 10 and back.
        for (x, key) in (0..=10).map(|x| (x, 0.0)).chain((0..10).rev().map(|x| (x, 1.0))) {
            let state = [x as f32, key];
            candidates.visit(0, &state, &state);
        }
        let at = |x: f32, key: f32| {
            let place = candidates.goal_index().place_of(&[x, key]);
            candidates.goal_index().nearest(&place).expect("a candidate").0
        };
        let [start, with_key, key] = [at(0.0, 0.0), at(0.0, 1.0), at(10.0, 0.0)];
        assert!(candidates.observed(start, with_key) != UNOBSERVED);
        let link = |from, to, distance| PlannedEdge::new(&candidates, from, to, distance);
        assert_eq!(link(start, with_key, 0.0), None, "D to the place leaves the key out");
        assert_eq!(link(with_key, start, 0.0), None, "the key is not lost again");
        assert!(link(start, key, 10.0).is_some());
    }

    #[test]
    fn where_d_falls_short_of_what_was_walked_hops_cost_what_was_walked() {
        let (.., mut candidates) = walked(200, 39.5);
        let paths = candidates.observed_from(0).collect::<Vec<_>>();
        let (to, walked) = *paths.iter().find(|(_, steps)| *steps >= 6).expect("a path");
        let (walked, [from, end]) = (f32::from(walked) - 1.0, [0, to].map(|i| candidates.id(i)));
        let short = walked - 2.0;
        for arrived in [true, false, false] {
            candidates.record_walk(from, end, short, arrived);
        }
        assert_eq!(candidates.hops().failures(short), 0.0);
        let failures = candidates.hops().failures(walked);
        assert!(failures > 0.5, "{failures}");
        let link = |distance| PlannedEdge::new(&candidates, 0, to, distance).expect("a link");
        assert_eq!(link(short).cost, walked + failures * late_after(walked));
        assert_eq!((link(short).length, link(walked + 1.0).cost), (short, walked + 1.0));
    }

    #[test]
    fn routes_cost_as_much_as_those_of_a_library_and_lead_along_edges() {
        let line = row(3.0);
        let count = line.candidates().len();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for density in [0.05, 0.2, 0.8] {
            let pairs = (0..count).flat_map(|from| (0..count).map(move |to| (from, to)));
            let mut edges: Vec<Edge> = Vec::new();
            for (from, to) in pairs.filter(|(from, to)| from != to) {
                if rng.random::<f64>() < density {
                    // Whole steps, so that many paths are equally long.
                    edges.push(edge(from, to, rng.random_range(1..5) as f32));
                }
            }
            let graph = BridgeGraph::from_edges(line.candidates.clone(), edges);
            let back = |to: &usize| {
                let incoming = graph.edges().iter().filter(|edge| edge.to == *to);
                incoming.map(|edge| (edge.from, edge.cost as u64)).collect::<Vec<_>>()
            };
            let (route, expected) = (graph.route_to_candidate(0), dijkstra_all(&0, back));
            for i in 1..count {
                let cost = expected.get(&i).map_or(f32::INFINITY, |(_, cost)| *cost as f32);
                assert_eq!(route.costs[i], cost, "{i}");
                let next = route.next[i] as usize;
                let edge = graph.edges().iter().find(|edge| (edge.from, edge.to) == (i, next));
                assert!(
                    edge.map_or(next == i, |edge| cost == edge.cost + route.costs[next]),
                    "{i}"
                );
            }
        }
    }

    #[test]
    fn walks_that_fail_demote_an_edge_and_walks_that_arrive_confirm_it() {
        use EdgeStatus::{Confirmed, Demoted, Untried};
        for (arrived, failed, status) in
            [(0, 0, Untried), (0, 1, Untried), (0, 2, Demoted), (9, 2, Demoted), (3, 0, Confirmed)]
        {
            assert_eq!(EdgeStatus::from(WalkRecord { arrived, failed }), status);
        }
    }
}
