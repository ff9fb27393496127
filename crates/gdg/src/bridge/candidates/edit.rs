//! What candidates forget after an edit of the world.

use std::sync::Arc;

use super::{Candidates, UNOBSERVED};
use crate::env::Region;

/// Slack on the steps of a path, for both ends together: trajectories pass near candidates, not
/// through them.
const NEAR_STEPS: f32 = 2.0;

impl Candidates {
    /// Returns the distance within which an edit of a region may affect paths from a candidate, in
    /// the environment's unit of length. (The fastest agents move one goal radius per step.)
    pub fn reach(&self) -> f32 {
        (self.window as f32 + NEAR_STEPS) * self.spec.goal_radius
    }

    /// Returns which candidates are within [`Self::reach`] of `region`.
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
        let reach = self.reach();
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
                to.is_ok_and(|to| is_out_of_reach(to as u32, self.window as f32))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{line, walk_corridor};
    use super::*;

    fn edit(low: f32, high: f32) -> Region {
        let mut region = Region::nothing();
        region.add(&[low, 0.0], &[high, 1.0], 1.0);
        region
    }

    #[test]
    fn an_edit_forgets_the_paths_that_may_lead_through_it_and_no_others() {
        let (spec, settings) = line(200);
        let mut candidates = Candidates::new(&spec, 1, &settings);
        walk_corridor(&mut candidates, 0.5, 0..100);
        let place = |candidates: &Candidates, i: usize| candidates.goal_index().goal(i)[0];
        let before = candidates.clone();
        let region = edit(50.0, 51.0);
        candidates.forget(&region, true, |state| !(50.0..51.0).contains(&state[0]));
        assert!(candidates.len() < before.len(), "no candidate is left in the wall");
        let mut kept = 0;
        for from in 0..candidates.len() {
            for (to, _) in candidates.observed_from(from) {
                let ends = [from, to].map(|i| place(&candidates, i));
                assert!((ends[0] < 50.0) == (ends[1] < 50.0), "{ends:?}");
                kept += 1;
            }
        }
        assert!(kept > before.len(), "{kept} paths");
        let [old, new] = [&before, &candidates].map(|candidates| {
            let [from, to] = [10.0, 12.0].map(|x| candidates.nearest(&[x, 0.5]).0);
            candidates.observed(from, to)
        });
        assert!(new == old && new != UNOBSERVED, "{new}");
    }

    #[test]
    fn an_edit_that_opens_the_world_forgets_failures_nearby_alone() {
        let (spec, settings) = line(200);
        let mut candidates = Candidates::new(&spec, 1, &settings);
        walk_corridor(&mut candidates, 0.5, 0..100);
        let index = candidates.goal_index();
        let pairs = [49.0, 10.0].map(|place| {
            [place, place + 3.0].map(|x| index.nearest(&[x, 0.5]).expect("candidates").0)
        });
        for [from, to] in pairs {
            let [from, to] = [from, to].map(|i| candidates.id(i));
            candidates.record_walk(from, to, 3.0, false);
        }
        let observed = |candidates: &Candidates| pairs.map(|[a, b]| candidates.observed(a, b));
        let before = observed(&candidates);
        candidates.forget(&edit(50.0, 51.0), false, |_| true);
        assert_eq!(observed(&candidates), before);
        let failed = pairs.map(|[from, to]| candidates.walk_record(from, to).failed);
        assert_eq!(failed, [0, 1]);
    }
}
