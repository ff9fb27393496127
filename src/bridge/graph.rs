//! The bridge graph: candidates connected by short paths that the agent can walk.

mod routes;

pub(crate) use routes::{CHANGED_GOALS, CHANGED_MARGIN, GROWN_FACTOR, GROWN_SLACK_STEPS, SHRUNK_SLACK_STEPS};
pub use routes::{DistilledDistances, LINK_CANDIDATES, Route};

use std::sync::Arc;

use super::candidates::{Candidates, CandidatesState, UNOBSERVED, WalkRecord};
use super::settings::BridgeSettings;
use crate::env::Spec;
use crate::learn::{Policy, Scratch};
use crate::store::{Store, StoreError};

/// A directed edge between two candidates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Source candidate.
    pub from: usize,
    /// Target candidate.
    pub to: usize,
    /// D(from, to) by the most pessimistic critic when the graph was built, in steps.
    pub distance: f32,
    /// Planning cost in steps: D plus the overhead of passing a waypoint; higher if only observed trajectories support
    /// the edge or walks along it failed.
    pub cost: f32,
    /// Its record in practice.
    pub status: EdgeStatus,
}

/// An edge's record in practice.
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
    /// All of them.
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

/// A [`BridgeGraph`] as plain numbers, for checkpoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GraphState {
    /// The candidates and the paths observed between them.
    pub candidates: CandidatesState,
    /// Source and target of each edge.
    pub ends: Vec<u32>,
    /// D and cost of each edge.
    pub lengths: Vec<f32>,
}

impl GraphState {
    /// Writes the state to `store` under names that start with `prefix`.
    pub fn write(self, store: &mut Store, prefix: &str) {
        self.candidates.write(store, prefix);
        store.put(format!("{prefix}.ends"), self.ends);
        store.put(format!("{prefix}.lengths"), self.lengths);
    }

    /// Reads the state that [`Self::write`] wrote.
    ///
    /// # Errors
    /// Returns an error if a part is missing or has the wrong type.
    pub fn read(store: &Store, prefix: &str) -> Result<Self, StoreError> {
        Ok(Self {
            candidates: CandidatesState::read(store, prefix)?,
            ends: store.u32(&format!("{prefix}.ends"))?.to_vec(),
            lengths: store.f32(&format!("{prefix}.lengths"))?.to_vec(),
        })
    }
}

/// Exclusive upper bound on the lengths in a stored graph, in steps.
const MAX_EDGE_STEPS: f32 = 1e4;

/// Cost multiplier of a demoted edge.
pub(crate) const DEMOTED_FACTOR: f32 = 3.0;

/// Snapshot of candidates and edges at one point in training.
#[derive(Clone, Debug)]
pub struct BridgeGraph {
    spec: Spec,
    settings: BridgeSettings,
    candidates: Arc<Candidates>,
    edges: Vec<Edge>,
    /// `incoming[first[j]..first[j + 1]]`: indices of the edges that lead to j.
    incoming: Vec<u32>,
    first: Vec<u32>,
}

impl BridgeGraph {
    /// Builds the graph from the current candidates and critics: an edge i -> j where D(i,j) is below the cut-off and,
    /// if edges need verification, some trajectory led from i to j in about D steps.
    pub fn build(
        spec: &Spec,
        settings: &BridgeSettings,
        candidates: &Arc<Candidates>,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> Self {
        let mut edges = Vec::new();
        let s = spec.state_dim();
        let (mut states, mut goals, mut distances) = (Vec::new(), Vec::new(), Vec::new());
        for from in 0..candidates.len() {
            let state = &candidates.states()[from * s..(from + 1) * s];
            let to: Vec<usize> = if settings.verify_edges {
                candidates.observed_from(from).collect()
            } else {
                let near = candidates.goal_index().nearest_few(candidates.goal_index().goal(from), LINK_CANDIDATES);
                near.into_iter().filter(|to| *to != from).collect()
            };
            states.clear();
            goals.clear();
            for to in &to {
                states.extend(state);
                goals.extend(candidates.goal_index().goal(*to));
            }
            distances.resize(to.len(), 0.0);
            policy.distances(&states, &goals, &mut distances, scratch);
            let found = to.iter().zip(&distances).filter_map(|(to, distance)| {
                let cost = link_cost(settings, *distance, candidates.observed(from, *to))?;
                let status = EdgeStatus::from(candidates.walk_record(from, *to));
                let cost = if status == EdgeStatus::Demoted { DEMOTED_FACTOR * cost } else { cost };
                let cost = cost + settings.hop_steps;
                Some(Edge { from, to: *to, distance: *distance, cost, status })
            });
            edges.extend(found);
        }
        Self::from_edges(spec, settings, candidates.clone(), edges)
    }

    /// Builds the graph from `edges`, which are sorted by source.
    fn from_edges(spec: &Spec, settings: &BridgeSettings, candidates: Arc<Candidates>, edges: Vec<Edge>) -> Self {
        let mut first = vec![0u32; candidates.len() + 1];
        edges.iter().for_each(|e| first[e.to + 1] += 1);
        (1..first.len()).for_each(|i| first[i] += first[i - 1]);
        let mut incoming: Vec<u32> = (0..edges.len() as u32).collect();
        incoming.sort_by_key(|i| edges[*i as usize].to);
        Self { spec: spec.clone(), settings: settings.clone(), candidates, edges, incoming, first }
    }

    /// Returns the graph as plain numbers, for a checkpoint.
    pub fn state(&self) -> GraphState {
        GraphState {
            candidates: self.candidates.state(),
            ends: self.edges.iter().flat_map(|e| [e.from as u32, e.to as u32]).collect(),
            lengths: self.edges.iter().flat_map(|e| [e.distance, e.cost]).collect(),
        }
    }

    /// Restores the graph from the `state` that [`Self::state`] returned.
    ///
    /// # Errors
    /// Returns an error if `state` is not that of a graph with these settings.
    pub fn from_state(spec: &Spec, settings: &BridgeSettings, state: &GraphState) -> Result<Self, StoreError> {
        let mut candidates = Candidates::new(spec, 0, settings);
        candidates.restore(&state.candidates)?;
        let (ends, lengths) = (state.ends.as_chunks::<2>().0, state.lengths.as_chunks::<2>().0);
        let known = |i: &u32| (*i as usize) < candidates.len();
        if ends.len() != lengths.len() || !ends.iter().flatten().all(known) || !ends.is_sorted_by_key(|ends| ends[0]) {
            return Err(StoreError::inconsistent("the stored bridge graph does not fit its candidates"));
        }
        if !lengths.iter().flatten().all(|length| (0.0..MAX_EDGE_STEPS).contains(length)) {
            return Err(StoreError::inconsistent("the stored bridge graph has edges of impossible length"));
        }
        let edges = ends.iter().zip(lengths).map(|([from, to], [distance, cost])| {
            let (from, to) = (*from as usize, *to as usize);
            let status = EdgeStatus::from(candidates.walk_record(from, to));
            Edge { from, to, distance: *distance, cost: *cost, status }
        });
        let edges = edges.collect();
        Ok(Self::from_edges(spec, settings, Arc::new(candidates), edges))
    }

    /// Returns all edges, sorted by source.
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

    /// Returns candidate `i` as a state, `(state_dim)`.
    pub fn candidate(&self, i: usize) -> &[f32] {
        let s = self.spec.state_dim();
        &self.candidates.states()[i * s..(i + 1) * s]
    }

    pub(super) fn settings(&self) -> &BridgeSettings {
        &self.settings
    }

    pub(super) fn spec(&self) -> &Spec {
        &self.spec
    }

    /// Returns the cost in steps of a link of length `distance` from a state near candidate `from` to a goal near `to`;
    /// `None` if it may not be used. Links are verified like edges, by the candidates nearest to their ends.
    pub(super) fn link(&self, from: Option<usize>, to: Option<usize>, distance: f32) -> Option<f32> {
        let (Some(from), Some(to)) = (from, to) else { return None };
        link_cost(&self.settings, distance, self.candidates.observed(from, to))
    }
}

/// Slack on observed steps: trajectories start and end up to a goal radius off, and exploration wanders.
pub(crate) const OBSERVED_SLACK_STEPS: f32 = 2.0;

/// A trajectory verifies D if it took at most this multiple of D, plus the slack.
pub(crate) const OBSERVED_FACTOR: f32 = 1.5;

/// Extra cost, beyond the observed steps, of a pair that trajectories connect although D is above the cut-off.
pub(crate) const OBSERVED_PENALTY_STEPS: f32 = 4.0;

/// Returns the cost of a path of length `distance` (by D) whose fewest observed steps are `observed`; `None` if it may
/// not be used.
fn link_cost(settings: &BridgeSettings, distance: f32, observed: u16) -> Option<f32> {
    let seen = observed != UNOBSERVED;
    let observed = f32::from(observed);
    if distance < settings.edge_cutoff_steps {
        let verified = seen && observed <= OBSERVED_FACTOR * distance + OBSERVED_SLACK_STEPS;
        return (verified || !settings.verify_edges).then_some(distance);
    }
    let kept = settings.keep_observed_edges && seen;
    kept.then(|| settings.edge_cutoff_steps.max(observed + OBSERVED_PENALTY_STEPS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::candidates::tests::line;

    /// Returns candidates in a row, each with an edge to the next; the last has no outgoing edge.
    fn row() -> BridgeGraph {
        let (spec, settings) = line(20);
        let mut candidates = Candidates::new(&spec, 1, &settings);
        (0..60).for_each(|step| candidates.visit(0, &[0.5 * step as f32, 0.5]));
        let edge = |i: usize| Edge { from: i, to: i + 1, distance: 3.0, cost: 3.0, status: EdgeStatus::Untried };
        let edges = (0..candidates.len() - 1).map(edge).collect();
        BridgeGraph::from_edges(&spec, &settings, candidates.frozen(), edges)
    }

    #[test]
    fn a_graph_round_trips_through_its_state_and_invalid_states_are_rejected() {
        let graph = row();
        let state = graph.state();
        let again = BridgeGraph::from_state(&graph.spec, &graph.settings, &state).expect("its own state");
        assert_eq!((again.state(), again.edges()), (state.clone(), graph.edges()));
        let wrong = [
            GraphState { ends: vec![0, 999], lengths: vec![1.0, 1.0], ..state.clone() },
            GraphState { ends: vec![1, 0, 0, 1], lengths: vec![1.0; 4], ..state.clone() },
            GraphState { lengths: Vec::new(), ..state },
        ];
        assert!(wrong.iter().all(|s| BridgeGraph::from_state(&graph.spec, &graph.settings, s).is_err()));
    }

    #[test]
    fn routes_sum_edge_costs_and_mark_unreachable_candidates() {
        let graph = row();
        let last = graph.candidates().len() - 1;
        let route = graph.route_to_candidate(last);
        assert!((0..=last).all(|i| route.steps[i] == 3.0 * (last - i) as f32), "{:?}", route.steps);
        assert!((0..last).all(|i| route.next[i] as usize == i + 1));
        let route = graph.route_to_candidate(0);
        assert!(route.steps[1..].iter().all(|s| s.is_infinite()), "edges are directed");
    }

    #[test]
    fn walks_that_fail_demote_an_edge_and_walks_that_arrive_confirm_it() {
        let status = |arrived, failed| EdgeStatus::from(WalkRecord { arrived, failed });
        assert_eq!(status(0, 0), EdgeStatus::Untried);
        assert_eq!(status(0, 1), EdgeStatus::Untried);
        assert_eq!(status(0, 2), EdgeStatus::Demoted);
        assert_eq!(status(9, 2), EdgeStatus::Demoted);
        assert_eq!(status(3, 0), EdgeStatus::Confirmed);
    }
}
