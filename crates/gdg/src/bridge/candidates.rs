//! Bridge candidates, and the step counts that trajectories show between them.

mod paths;
mod spacing;

use std::collections::VecDeque;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::settings::{BridgeSettings, MAX_FACTOR};
use crate::env::Spec;
use crate::learn::{Axis, GoalIndex};
use crate::store::{StoreError, planes};
use paths::{AT_SHARE, HopOutcomes, KnownPaths, WalkedPath};

/// Step count between two candidates that no trajectory connected within the time window.
pub const UNOBSERVED: u16 = u16::MAX;

/// Upper bound on the ids that a run may assign.
const MAX_ID: u32 = 1 << 31;

/// Distance that candidates keep from each other even where walls separate them, in goal radii.
pub(crate) const MIN_SPACING_RADII: f32 = 1.0;

/// At the maximum number of candidates, a state becomes one only at this multiple of the spacing:
/// the others move apart for places that are out of their reach, not to fill gaps between them.
pub(crate) const NEWCOMER_FACTOR: f32 = 1.5;

/// Observed paths from a candidate that make its surroundings well known: a missing path is then
/// evidence of a wall.
pub(crate) const WELL_KNOWN_PATHS: usize = 8;

/// A path is a detour round a wall if it takes more than this multiple of the straight line's steps,
/// plus [`DETOUR_SLACK_STEPS`].
pub(crate) const DETOUR_FACTOR: f32 = 2.0;

/// Steps that a path may take beside the multiple before it is a detour.
pub(crate) const DETOUR_SLACK_STEPS: f32 = 4.0;

/// Steps that a trajectory from near one candidate to near another may take beyond those between
/// the candidates themselves.
pub(crate) const WALKED_SLACK_STEPS: f32 = 1.0;

/// Candidates spread over all visited states, and the fewest steps of any trajectory from near one
/// to near another.
///
/// Candidates persist. A state farther than the spacing from all of them becomes a new one. When
/// there are too many, the spacing grows and candidates that are now too close retire (streaming
/// farthest-point sampling). In open space, there are too many when the graph has more paths than
/// planning takes, otherwise only at the maximum number: between thin walls, the nearest candidate
/// in a straight line is likely to be on the other side unless they lie close. Where many walks
/// between them fail, the spacing shrinks again. *Near* a candidate means within a quarter of the
/// spacing, but at most the goal radius (the environment's own criterion for having arrived) and at
/// least half of it. The radius is this small because straight-line distance ignores thin walls and
/// touching corners.
///
/// A candidate has an index, which changes when others retire, and an id, which never changes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Candidates {
    #[serde(skip)]
    pub(super) spec: Spec,
    #[serde(skip)]
    pub(crate) settings: BridgeSettings,
    /// What tells candidates apart beside the goal.
    others: Vec<Axis>,
    /// Whether space has turned out to be open.
    is_open: bool,
    spacing: f32,
    /// `(candidates, state_dim)`.
    #[serde(with = "planes")]
    states: Vec<f32>,
    /// The candidates as goals. Shared with frozen copies until the next change.
    #[serde(skip)]
    goal_index: Arc<GoalIndex>,
    ids: Vec<u32>,
    next_id: u32,
    /// Observed paths from each candidate. Frozen copies share the rows that have not changed
    /// since.
    paths: Vec<Arc<KnownPaths>>,
    visits: Vec<VecDeque<Visit>>,
    clocks: Vec<u32>,
    hops: HopOutcomes,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WalkRecord {
    pub arrived: u16,
    /// Number of consecutive failures since the last arrival.
    pub failed: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Visit {
    step: u32,
    candidate: u32,
    /// Whether the agent was at the candidate itself, not only near it.
    exact: bool,
}

impl Candidates {
    pub fn new(spec: &Spec, agents: usize, settings: &BridgeSettings) -> Self {
        Self {
            spec: spec.clone(),
            settings: settings.clone(),
            others: Vec::new(),
            is_open: false,
            spacing: settings.candidate_spacing * spec.goal_radius,
            states: Vec::new(),
            goal_index: Arc::new(GoalIndex::new(spec, &[])),
            ids: Vec::new(),
            next_id: 0,
            paths: Vec::new(),
            visits: vec![VecDeque::new(); agents],
            clocks: vec![0; agents],
            hops: HopOutcomes::default(),
        }
    }

    /// Tells candidates apart by `others`, too. There must be none yet.
    pub fn tell_apart_by(&mut self, others: &[Axis]) {
        self.others = others.to_vec();
        self.goal_index = Arc::new(GoalIndex::new(&self.spec, others));
    }

    /// Returns what tells candidates apart beside the goal.
    pub fn others(&self) -> &[Axis] {
        &self.others
    }

    /// Returns a frozen copy without the agents' visits, for graphs to build on and share.
    #[must_use]
    pub fn frozen(&self) -> Arc<Self> {
        Arc::new(Self {
            spec: self.spec.clone(),
            settings: self.settings.clone(),
            others: self.others.clone(),
            states: self.states.clone(),
            goal_index: self.goal_index.clone(),
            ids: self.ids.clone(),
            paths: self.paths.clone(),
            visits: Vec::new(),
            clocks: Vec::new(),
            ..*self
        })
    }

    /// Replaces the candidates with `fresh` but continues the ids, so that outcomes of earlier
    /// walks are never attributed to new candidates; keeps the outcomes of hops, and the spacing if
    /// the initial one is the same.
    pub fn reset_to(&mut self, fresh: Self) {
        let is_same = self.least_spacing() == fresh.least_spacing();
        let spacing = if is_same { self.spacing } else { fresh.spacing };
        *self = Self { next_id: self.next_id, hops: self.hops, spacing, ..fresh };
    }

    fn least_spacing(&self) -> f32 {
        self.settings.candidate_spacing * self.spec.goal_radius
    }

    /// Returns the distance that candidates keep from each other even where walls separate them.
    fn min_spacing(&self) -> f32 {
        MIN_SPACING_RADII.min(self.settings.candidate_spacing) * self.spec.goal_radius
    }

    pub fn len(&self) -> usize {
        self.ids.len()
    }

    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Returns the candidates' states, `(candidates, state_dim)`.
    pub fn states(&self) -> &[f32] {
        &self.states
    }

    /// Returns the candidates as goals, `(candidates, goal_dim)`.
    pub fn points(&self) -> &[f32] {
        self.goal_index.goals()
    }

    /// Returns the candidates as goals, to search by position.
    pub fn goal_index(&self) -> &GoalIndex {
        &self.goal_index
    }

    /// Returns the fewest steps of any trajectory from near `from` to near `to`, or `UNOBSERVED`
    /// if there is none.
    pub fn observed(&self, from: usize, to: usize) -> u16 {
        if from == to {
            return 0;
        }
        self.paths[from].to(to as u32).map_or(UNOBSERVED, WalkedPath::steps)
    }

    /// Returns the candidates that some trajectory reached from near `from`, in ascending order, and
    /// the fewest steps to each.
    pub fn observed_from(&self, from: usize) -> impl Iterator<Item = (usize, u16)> {
        self.paths[from].certain().map(|(to, steps)| (to as usize, steps))
    }

    /// Returns, for each candidate, those from which some trajectory reached it, in ascending
    /// order.
    pub fn observed_into(&self) -> Vec<Vec<u32>> {
        let mut into = vec![Vec::new(); self.len()];
        for (from, paths) in self.paths.iter().enumerate() {
            paths.certain().for_each(|(to, _)| into[to as usize].push(from as u32));
        }
        into
    }

    /// Returns the id of candidate `i`, which stays the same when others retire.
    pub fn id(&self, i: usize) -> u32 {
        self.ids[i]
    }

    pub(super) fn index_of(&self, id: u32) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    pub(crate) fn walk_record(&self, from: usize, to: usize) -> WalkRecord {
        self.paths[from].practice.get(&self.ids[to]).copied().unwrap_or_default()
    }

    pub fn hops(&self) -> &HopOutcomes {
        &self.hops
    }

    /// Returns the expected steps of a hop: `distance`, by D, or `observed`, the fewest that
    /// trajectories took, whichever is more. Across thin walls D falls short, and agents that descend
    /// it stop at the wall.
    pub(super) fn steps_of_hop(&self, distance: f32, observed: u16) -> f32 {
        if !self.settings.verify_edges || observed == UNOBSERVED {
            return distance;
        }
        distance.max(f32::from(observed) - WALKED_SLACK_STEPS)
    }

    /// Records the outcome of a walk between two candidates, given by their ids, that was
    /// `distance` steps long by D.
    pub fn record_walk(&mut self, from: u32, to: u32, distance: f32, arrived: bool) {
        let (Some(row), Some(end)) = (self.index_of(from), self.index_of(to)) else {
            self.hops.record(distance, arrived);
            return;
        };
        self.hops.record(self.steps_of_hop(distance, self.observed(row, end)), arrived);
        if row == end {
            return;
        }
        let practice = Arc::make_mut(&mut self.paths[row]).practice.entry(to).or_default();
        if arrived {
            *practice = WalkRecord { arrived: practice.arrived.saturating_add(1), failed: 0 };
        } else {
            practice.failed = practice.failed.saturating_add(1);
        }
    }

    /// Returns the minimum distance between candidates, in the environment's unit of length.
    pub fn spacing(&self) -> f32 {
        self.spacing
    }

    fn near_radius(&self) -> f32 {
        (self.spacing / 4.0).clamp(0.5 * self.spec.goal_radius, self.spec.goal_radius)
    }

    /// Adds the next state of `agent`'s episode; `beside` is the state one step before or after it,
    /// or else the state itself.
    pub fn visit(&mut self, agent: usize, state: &[f32], beside: &[f32]) {
        let clock = self.clocks[agent];
        self.clocks[agent] += 1;
        let visits = &mut self.visits[agent];
        while visits
            .front()
            .is_some_and(|visit| clock - visit.step > self.settings.window_steps() as u32)
        {
            visits.pop_front();
        }
        let latest = visits.back().map(|visit| (visit.candidate as usize, clock - visit.step));
        let (nearest, distance) = self.nearest(state);
        let mut near = (distance < self.near_radius()).then_some(nearest);
        // Of what others have to retire for, more is asked.
        let makes_room = self.settings.verify_edges && self.len() >= self.settings.max_candidates();
        let spacing = if makes_room { NEWCOMER_FACTOR * self.spacing } else { self.spacing };
        let is_behind_a_wall = |(from, steps)| self.is_behind_a_wall(state, spacing, from, steps);
        if distance > spacing
            || (distance > self.min_spacing() && latest.is_some_and(is_behind_a_wall))
        {
            near = self.add(state, distance <= spacing);
        }
        let Some(to) = near else { return };
        let exact = self.is_at(to, state, beside);
        let visit = Visit { step: clock, candidate: to as u32, exact };
        let visits = &mut self.visits[agent];
        for from in visits.iter().filter(|from| from.candidate != visit.candidate) {
            let steps = (clock - from.step) as u16;
            let path = WalkedPath::new(visit.candidate, steps, [from.exact, exact]);
            KnownPaths::observe(&mut self.paths[from.candidate as usize], path);
        }
        visits.push_back(visit);
    }

    /// Whether the step between `state` and `beside` passes candidate `i` itself.
    fn is_at(&self, i: usize, state: &[f32], beside: &[f32]) -> bool {
        let ends = || self.spec.achieved(state).zip(self.spec.achieved(beside));
        let goal = self.goal_index.goal(i);
        let squared: f32 = ends().map(|(a, b)| (b - a).powi(2)).sum();
        let along: f32 = ends().zip(goal).map(|((a, b), g)| (b - a) * (g - a)).sum();
        let share = if squared > 0.0 { (along / squared).clamp(0.0, 1.0) } else { 0.0 };
        let miss: f32 = ends().zip(goal).map(|((a, b), g)| (a + share * (b - a) - g).powi(2)).sum();
        miss.sqrt() < AT_SHARE * self.near_radius()
    }

    pub fn pass(&mut self, agent: usize) {
        self.clocks[agent] += 1;
    }

    /// Ends `agent`'s episode: its next state does not follow from the previous one.
    pub fn end_episode(&mut self, agent: usize) {
        self.visits[agent].clear();
        self.clocks[agent] = 0;
    }

    /// Returns the candidate nearest to `state` and its distance, which is infinite without
    /// candidates.
    fn nearest(&self, state: &[f32]) -> (usize, f32) {
        self.goal_index.nearest(&self.goal_index.place_of(state)).unwrap_or((0, f32::INFINITY))
    }

    /// Whether trajectories show that `state` is far from all candidates within `spacing`:
    /// candidate `latest`, which its agent visited `steps` ago, has no short path to any of them.
    fn is_behind_a_wall(&self, state: &[f32], spacing: f32, latest: usize, steps: u32) -> bool {
        if self.paths[latest].observed.len() < WELL_KNOWN_PATHS {
            return false;
        }
        let joined = |i, distance| self.may_be_joined(latest, i, distance + steps as f32);
        !self.goal_index.any_within(&self.goal_index.place_of(state), spacing, joined)
    }

    /// Whether candidates `i` and `j` may be joined by a path that is not much longer than
    /// `distance`: such a path has been observed, or too little has been observed around them to
    /// tell.
    fn may_be_joined(&self, i: usize, j: usize, distance: f32) -> bool {
        let well_known = |i: usize| self.paths[i].observed.len() >= WELL_KNOWN_PATHS;
        // A path in doubt is no evidence of a wall.
        let is_short = |from: usize, to: usize| {
            let path = self.paths[from].to(to as u32);
            path.is_some_and(|path| f32::from(path.fewest) <= self.longest_way(distance))
        };
        i == j || !well_known(i) || !well_known(j) || is_short(i, j) || is_short(j, i)
    }

    /// Returns the steps that a path may take over this `distance` in a straight line unless it
    /// goes round a wall.
    fn longest_way(&self, distance: f32) -> f32 {
        DETOUR_FACTOR * distance / self.spec.goal_radius + DETOUR_SLACK_STEPS
    }

    /// Makes `state` a candidate, thinning the others if there is no room, and returns its index;
    /// `None` if it is too close to another at the new spacing. Where it is `behind_a_wall`, only
    /// the minimum spacing counts.
    fn add(&mut self, state: &[f32], behind_a_wall: bool) -> Option<usize> {
        while self.is_full() {
            self.move_apart();
            let spacing = if behind_a_wall { self.min_spacing() } else { self.spacing };
            if self.nearest(state).1 <= spacing {
                return None;
            }
        }
        self.states.extend(state);
        let place = self.goal_index.place_of(state);
        Arc::make_mut(&mut self.goal_index).push(&place);
        self.ids.push(self.next_id);
        self.paths.push(Arc::default());
        self.next_id += 1;
        Some(self.len() - 1)
    }

    pub fn restore(&mut self, stored: Self) -> Result<(), StoreError> {
        let Self {
            others,
            spacing,
            is_open,
            states,
            ids,
            next_id,
            paths,
            visits,
            clocks,
            hops,
            ..
        } = stored;
        let n = ids.len();
        let visits_fit = visits.iter().zip(&clocks).all(|(visits, clock)| {
            visits.iter().is_sorted_by_key(|visit| visit.step)
                && visits.iter().all(|v| (v.candidate as usize) < n && v.step < *clock)
        });
        // Where edges are unverified, newcomers thin out those of before.
        let fits = n <= MAX_FACTOR * self.settings.candidates
            && states.len() == n * self.spec.state_dim()
            && ids.is_sorted_by(|a, b| a < b)
            && ids.last().is_none_or(|last| *last < next_id)
            && next_id <= MAX_ID
            && paths.len() == n
            && paths.iter().enumerate().all(|(from, paths)| paths.fit(from, n))
            && [visits.len(), clocks.len()] == [self.clocks.len(); 2]
            && others.iter().all(|axis| axis.fits(&self.spec))
            && visits_fit;
        StoreError::unless(fits, "the stored bridge candidates do not fit these settings")?;
        // The spacing never falls below its initial value; from far below, it would take hours to
        // grow.
        let plausible = spacing >= 0.5 * self.least_spacing()
            && spacing.is_finite()
            && states.iter().all(|v| v.is_finite())
            && hops.is_plausible();
        StoreError::unless(plausible, "the stored bridge candidates contain values out of range")?;
        let mut goal_index = GoalIndex::new(&self.spec, &others);
        for state in states.chunks_exact(self.spec.state_dim()) {
            goal_index.push(&goal_index.place_of(state));
        }
        self.goal_index = Arc::new(goal_index);
        self.others = others;
        (self.spacing, self.is_open, self.states) = (spacing, is_open, states);
        (self.ids, self.next_id, self.paths) = (ids, next_id, paths);
        (self.visits, self.clocks, self.hops) = (visits, clocks, hops);
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::ops::Range;

    use super::*;
    use crate::env::tests::positions;

    /// Returns the spec of a line of a hundred goal radii, and settings for `candidates`
    /// candidates.
    pub fn line(candidates: usize) -> (Spec, BridgeSettings) {
        let spec = positions(&[(50.0, 50.0), (0.5, 50.0)]);
        (spec, BridgeSettings { candidates, ..BridgeSettings::default() })
    }

    fn walk(candidates: &mut Candidates, end: f32) {
        for step in 0..=(2.0 * end) as usize {
            let at = [0.5 * step as f32, 0.5];
            candidates.visit(0, &at, &at);
        }
        candidates.end_episode(0);
    }

    pub fn walked(candidates: usize, end: f32) -> (Spec, BridgeSettings, Candidates) {
        let (spec, settings) = line(candidates);
        let mut candidates = Candidates::new(&spec, 1, &settings);
        walk(&mut candidates, end);
        (spec, settings, candidates)
    }

    pub fn walk_corridor(candidates: &mut Candidates, y: f32, xs: Range<i32>) {
        for _ in 0..30 {
            xs.clone()
                .chain(xs.clone().rev().skip(1))
                .for_each(|x| candidates.visit(0, &[x as f32, y], &[x as f32, y]));
        }
        candidates.end_episode(0);
    }

    #[test]
    fn states_behind_a_wall_become_candidates_although_others_are_near() {
        let (spec, settings) = line(200);
        let settings =
            BridgeSettings { candidate_spacing: 2.5, edge_cutoff_steps: 20.0, ..settings };
        let mut candidates = Candidates::new(&spec, 1, &settings);
        // Two corridors two units apart; the second begins where there is no wall between it and
        // the first.
        walk_corridor(&mut candidates, 0.5, 40..81);
        walk_corridor(&mut candidates, 2.5, 0..81);
        let (points, _) = candidates.points().as_chunks::<2>();
        let behind = points.iter().filter(|at| at[1] == 2.5 && at[0] > 45.0);
        assert!(behind.count() > 8, "{points:?}");
        for (i, a) in points.iter().enumerate() {
            let near =
                |b: &[f32; 2]| spec.goal_distance(a, b) <= MIN_SPACING_RADII * spec.goal_radius;
            assert!(!points[i + 1..].iter().any(near), "some lie within the least spacing");
        }
    }

    #[test]
    fn others_retire_for_places_out_of_reach_but_not_to_fill_gaps() {
        let (spec, settings, mut candidates) = walked(5, 99.5);
        let (ids, spacing) = (candidates.ids.clone(), candidates.spacing());
        assert!(spacing > spec.goal_radius && ids.len() <= settings.max_candidates(), "{spacing}");
        // At other places of the same line, until gaps between candidates are filled.
        for offset in 1..20 {
            for i in 0..199 {
                let at = [0.5 * (i as f32 + offset as f32 / 20.0), 0.5];
                candidates.visit(0, &at, &at);
            }
            candidates.end_episode(0);
        }
        assert_eq!((&candidates.ids[..ids.len()], candidates.spacing()), (&ids[..], spacing));
        assert_eq!(candidates.len(), settings.max_candidates());
        candidates.visit(0, &[50.0, 40.0], &[50.0, 40.0]);
        assert!(candidates.nearest(&[50.0, 40.0]).1 == 0.0 && candidates.spacing() > spacing);
        assert!(candidates.len() <= settings.max_candidates());
    }

    #[test]
    fn a_candidate_across_a_corner_has_no_paths_through_the_wall() {
        let (spec, settings) = line(20);
        let mut candidates = Candidates::new(&spec, 1, &settings);
        // A dead end at (50.1, 50.1), beyond the corner (50, 50) from an aisle that leads by at
        // y = 49.8: from the aisle, the dead end is nearer than half a goal radius.
        let dead_end = [50.1, 50.1];
        for at in [dead_end, [50.5, 50.5], dead_end] {
            candidates.visit(0, &at, &at);
        }
        candidates.end_episode(0);
        let aisle = |x: usize| [0.9f32.mul_add(x as f32, 40.0), 49.8];
        for _ in 0..2 * usize::from(paths::DOUBT_PASSES) {
            (1..22).for_each(|x| candidates.visit(0, &aisle(x), &aisle(x - 1)));
            candidates.end_episode(0);
        }
        let near = candidates.nearest(&[49.9, 49.8]);
        assert!(near.0 == 0 && near.1 < candidates.near_radius(), "{near:?}");
        assert_eq!(candidates.observed_into()[0], [] as [u32; 0], "paths to the dead end");
        assert_eq!(candidates.observed_from(0).count(), 0, "paths from it");
        let others: usize =
            (1..candidates.len()).map(|i| candidates.observed_from(i).count()).sum();
        assert!(others > 5, "{others} paths along the aisle");
    }

    #[test]
    fn walk_records_count_failures_until_an_arrival_and_follow_candidates_when_others_retire() {
        let (spec, settings) = line(10);
        let settings = BridgeSettings { verify_edges: false, ..settings };
        let mut candidates = Candidates::new(&spec, 1, &settings);
        walk(&mut candidates, 15.0);
        let ids = candidates.ids.clone();
        let record = |arrived, failed| WalkRecord { arrived, failed };
        (0..2).for_each(|_| candidates.record_walk(ids[0], ids[1], 2.0, false));
        let both = [(0, 1), (1, 0)].map(|(a, b)| candidates.walk_record(a, b));
        assert_eq!(both, [record(0, 2), record(0, 0)]);
        for a in &ids {
            // Neither loops nor unknown candidates are recorded.
            ids.iter().chain([&12_345]).for_each(|b| candidates.record_walk(*a, *b, 2.0, true));
        }
        // Far enough for more candidates than the target, so that some have to retire.
        walk(&mut candidates, 60.0);
        let kept: Vec<usize> = ids.iter().filter_map(|id| candidates.index_of(*id)).collect();
        assert!((2..ids.len()).contains(&kept.len()), "{} stayed", kept.len());
        let records: usize = candidates.paths.iter().map(|paths| paths.practice.len()).sum();
        assert_eq!(records, kept.len() * (kept.len() - 1));
        assert_eq!(candidates.walk_record(kept[0], kept[1]), record(1, 0));
    }
}
