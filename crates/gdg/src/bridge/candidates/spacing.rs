//! How close together candidates lie, and what they forget after an edit of the world.

use std::collections::HashMap;
use std::sync::Arc;

use pathfinding::directed::dijkstra::dijkstra_reach;

use super::{Candidates, KnownPaths, UNOBSERVED, Visit, WalkedPath};
use crate::bridge::BridgeSettings;
use crate::env::Region;
use crate::learn::GoalIndex;

/// The spacing grows to at most this share of the edge cut-off: edges could hardly connect
/// candidates farther apart. (The fastest agents move one goal radius per step.)
pub(crate) const MAX_SPACING_SHARE: f32 = 0.45;

/// Factor by which the spacing grows at a time; small, so that few more candidates retire than
/// necessary.
const SPACING_GROWTH: f32 = 1.02;

const SPACING_SHRINKAGE: f32 = 1.1;

/// Failures per arrival of hops, pooled over their lengths, above which candidates move closer
/// together, and space does not count as open.
pub(crate) const MANY_HOP_FAILURES: f32 = 0.2;

/// Observed paths, for each candidate of the target number, beyond which candidates move apart in
/// open space: the time to build and search a graph grows with its paths.
pub(crate) const MANY_PATHS: usize = 80;

/// Space is open where known paths join at least this share of the candidates that are less than
/// the edge cut-off apart in a straight line. Unexplored space counts as walls.
pub(crate) const OPEN_SHARE: f32 = 0.5;

const JUDGED_CANDIDATES: usize = 64;

/// Slack on the steps of a path, for both ends together: trajectories pass near candidates, not
/// through them.
const NEAR_STEPS: f32 = 2.0;

impl Candidates {
    /// Whether the spacing has to grow before there can be another candidate.
    pub(super) fn is_full(&self) -> bool {
        self.len() >= self.settings.max_candidates()
            || (!self.settings.verify_edges && self.exceeds_target())
    }

    fn exceeds_target(&self) -> bool {
        let BridgeSettings { candidates, edge_cutoff_steps, .. } = self.settings;
        self.len() >= candidates
            && self.spacing < MAX_SPACING_SHARE * edge_cutoff_steps * self.spec.goal_radius
    }

    /// Adapts the spacing of verified candidates to what trajectories and hops have shown. In open
    /// space, where hops seldom fail, they move apart if there are many paths between them.
    /// Otherwise, they move closer together if many hops fail: places between them become
    /// candidates when agents come by.
    pub fn adapt_spacing(&mut self) {
        if !self.settings.verify_edges {
            // Hops along unverified edges fail because of walls, at any spacing.
            return;
        }
        let many_hops_fail =
            self.hops.failures_within(self.settings.edge_cutoff_steps) > MANY_HOP_FAILURES;
        // Between thin walls, too, known paths may eventually join half of the close candidates.
        if self.is_crowded() && (self.is_open || (!many_hops_fail && self.is_space_open())) {
            self.is_open = true;
            while self.is_crowded() {
                self.move_apart();
            }
        } else if many_hops_fail && self.len() < self.settings.max_candidates() {
            self.spacing = (self.spacing / SPACING_SHRINKAGE).max(self.least_spacing());
        }
    }

    fn is_crowded(&self) -> bool {
        self.exceeds_target() && self.has_many_paths()
    }

    fn has_many_paths(&self) -> bool {
        self.paths.iter().map(|paths| paths.observed.len()).sum::<usize>()
            > MANY_PATHS * self.settings.candidates
    }

    fn is_space_open(&self) -> bool {
        let reach = self.settings.edge_cutoff_steps * self.spec.goal_radius;
        let ahead = |from: &u32| {
            let paths = &self.paths[*from as usize].observed;
            paths.iter().map(|path| (path.to, u32::from(path.fewest)))
        };
        let [mut close, mut joined] = [0u32; 2];
        for i in (0..self.len()).step_by(self.len().div_ceil(JUDGED_CANDIDATES).max(1)) {
            let reached = dijkstra_reach(&(i as u32), ahead);
            let reached =
                reached.take_while(|place| place.total_cost as f32 <= self.longest_way(reach));
            let steps: HashMap<u32, u32> =
                reached.map(|place| (place.node, place.total_cost)).collect();
            self.goal_index.for_each_within(self.goal_index.place(i), reach, |j, distance| {
                close += 1;
                joined += u32::from(
                    steps.get(&(j as u32)).is_some_and(|s| *s as f32 <= self.longest_way(distance)),
                );
            });
        }
        joined as f32 >= OPEN_SHARE * close as f32
    }

    /// Makes the spacing larger, and retires candidates that are now too close to an older one,
    /// unless trajectories show that a wall separates them and there is room.
    pub(super) fn move_apart(&mut self) {
        self.spacing *= SPACING_GROWTH;
        let full = self.len() >= self.settings.max_candidates();
        let (mut kept, mut places) = (Vec::new(), GoalIndex::new(&self.spec, &self.others));
        for i in 0..self.len() {
            let place = self.goal_index.place(i);
            let too_close = |k: usize, distance| full || self.may_be_joined(i, kept[k], distance);
            if !places.any_within(place, self.spacing, too_close) {
                kept.push(i);
                places.push(place);
            }
        }
        self.keep(&kept);
    }

    /// Keeps only these candidates, given in ascending order.
    pub(super) fn keep(&mut self, kept: &[usize]) {
        let s = self.spec.state_dim();
        let mut new_index = vec![None; self.len()];
        kept.iter().enumerate().for_each(|(new, old)| new_index[*old] = Some(new as u32));
        let mut places = GoalIndex::new(&self.spec, &self.others);
        kept.iter().for_each(|i| places.push(self.goal_index.place(*i)));
        let ids: Vec<u32> = kept.iter().map(|i| self.ids[*i]).collect();
        let paths = kept.iter().map(|i| {
            let KnownPaths { observed, practice } = &*self.paths[*i];
            let observed = observed
                .iter()
                .filter_map(|path| Some(WalkedPath { to: new_index[path.to as usize]?, ..*path }));
            let alive = |id: &u32| ids.binary_search(id).is_ok();
            let practice =
                practice.iter().filter(|(id, _)| alive(id)).map(|(id, practice)| (*id, *practice));
            Arc::new(KnownPaths { observed: observed.collect(), practice: practice.collect() })
        });
        self.paths = paths.collect();
        self.states = kept.iter().flat_map(|i| self.states[i * s..(i + 1) * s].to_vec()).collect();
        self.goal_index = Arc::new(places);
        self.ids = ids;
        for visits in &mut self.visits {
            let moved = visits.iter().filter_map(|visit| {
                Some(Visit { candidate: new_index[visit.candidate as usize]?, ..*visit })
            });
            *visits = moved.collect();
        }
    }
}

impl Candidates {
    /// Returns the distance within which an edit of a region may affect paths from a candidate, in
    /// the environment's unit of length. (The fastest agents move one goal radius per step.)
    pub fn reach(&self) -> f32 {
        (self.settings.window_steps() as f32 + NEAR_STEPS) * self.spec.goal_radius
    }

    pub fn near(&self, region: &Region) -> Vec<bool> {
        self.distances_from(region).into_iter().map(|distance| distance <= self.reach()).collect()
    }

    fn distances_from(&self, region: &Region) -> Vec<f32> {
        let distance = |i| region.distance(self.goal_index.goal(i).iter().copied());
        (0..self.len()).map(distance).collect()
    }

    /// Forgets, after an edit of `region`, the candidates that are not `valid` states and the
    /// outcomes of walks that the edit may have affected; if the edit may have blocked paths, also
    /// those that are long enough to have led through the region. Ends all episodes.
    pub fn forget(&mut self, region: &Region, blocks: bool, valid: impl Fn(&[f32]) -> bool) {
        (0..self.visits.len()).for_each(|agent| self.end_episode(agent));
        let s = self.spec.state_dim();
        let kept: Vec<usize> =
            (0..self.len()).filter(|i| valid(&self.states[i * s..(i + 1) * s])).collect();
        if kept.len() < self.len() {
            self.keep(&kept);
        }
        let (distances, radius) = (self.distances_from(region), self.spec.goal_radius);
        let (reach, window) = (self.reach(), self.settings.window_steps() as f32);
        for (paths, from) in self.paths.iter_mut().zip(&distances) {
            if *from > reach {
                continue;
            }
            let is_out_of_reach =
                |to: u32, steps: f32| from + distances[to as usize] > (steps + NEAR_STEPS) * radius;
            let paths = Arc::make_mut(paths);
            if blocks {
                paths.observed.retain(|path| {
                    let known = Some(path.steps()).filter(|steps| *steps != UNOBSERVED);
                    is_out_of_reach(path.to, f32::from(known.unwrap_or(path.fewest)))
                });
            }
            let ids = &self.ids;
            paths.practice.retain(|id, _| {
                let to = ids.binary_search(id);
                to.is_ok_and(|to| is_out_of_reach(to as u32, window))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{line, walk_corridor};
    use super::*;

    #[test]
    fn candidates_move_closer_together_where_many_walks_fail() {
        let (spec, settings) = line(10);
        // Long paths, so that there are many along a line.
        let settings = BridgeSettings { edge_cutoff_steps: 40.0, ..settings };
        let mut candidates = Candidates::new(&spec, 1, &settings);
        let line = |candidates: &mut Candidates| walk_corridor(candidates, 0.5, 0..100);
        line(&mut candidates);
        candidates.adapt_spacing();
        let (open, spacing) = (candidates.len(), candidates.spacing());
        assert!(open <= 4 * 10 && spacing > 2.0, "{open} candidates, {spacing} apart");
        (0..10).for_each(|_| candidates.adapt_spacing());
        assert_eq!(candidates.spacing(), spacing, "no walk has failed");
        for _ in 0..100 {
            candidates.record_walk(0, 1, 4.0, false);
            candidates.adapt_spacing();
        }
        assert_eq!(candidates.spacing(), settings.candidate_spacing * spec.goal_radius);
        line(&mut candidates);
        assert!((2 * open..=8 * 10).contains(&candidates.len()), "{}", candidates.len());
        candidates.adapt_spacing();
        assert!(!candidates.has_many_paths(), "not closer than planning has time for");
    }
}
