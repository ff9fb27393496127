//! What trajectories and walks have shown of the ways between candidates.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{UNOBSERVED, WalkRecord};

/// A path that this many trajectories have shown is in doubt unless some began at its start itself,
/// and some ended at its end itself. Agents are near a candidate in a straight line, also across a
/// corner at which two free cells touch: from there, paths lead through the wall.
pub(super) const DOUBT_PASSES: u8 = 6;

/// An agent is at a candidate itself if it steps past it within this share of the distance at which
/// it is near.
pub(super) const AT_SHARE: f32 = 0.3;

/// A path confirms a shorter one if it takes at most this many more steps: trajectories begin and
/// end up to a goal radius off.
const CONFIRMED_SLACK_STEPS: u16 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WalkedPath {
    /// Index of the other candidate.
    pub to: u32,
    /// Fewest steps from near one to near the other.
    pub fewest: u16,
    /// Fewest steps from the one itself to near the other, and from near it to the other itself;
    /// [`UNOBSERVED`] if there was none.
    pub exact: [u16; 2],
    /// Number of trajectories that have shown it, up to [`DOUBT_PASSES`].
    pub passes: u8,
}

impl WalkedPath {
    /// Returns the path that one trajectory has shown; `exact` is whether it began and ended at the
    /// candidates themselves.
    pub fn new(to: u32, steps: u16, exact: [bool; 2]) -> Self {
        let exact = exact.map(|exact| if exact { steps } else { UNOBSERVED });
        Self { to, fewest: steps, exact, passes: 1 }
    }

    /// Returns the fewest steps, or [`UNOBSERVED`] if the path is in doubt.
    pub fn steps(&self) -> u16 {
        let exact = self.exact[0].max(self.exact[1]);
        let confirmed = exact <= self.fewest.saturating_add(CONFIRMED_SLACK_STEPS);
        if confirmed || self.passes < DOUBT_PASSES { self.fewest } else { exact }
    }

    fn and(&self, other: &Self) -> Self {
        Self {
            to: self.to,
            fewest: self.fewest.min(other.fewest),
            exact: [0, 1].map(|end: usize| self.exact[end].min(other.exact[end])),
            passes: self.passes.saturating_add(other.passes).min(DOUBT_PASSES),
        }
    }
}

/// What is known of the paths from one candidate to others. Sparse, as recorded paths are short.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct KnownPaths {
    /// The paths, sorted by the other candidate.
    pub observed: Vec<WalkedPath>,
    /// Outcomes of walks to another candidate, by its id.
    pub practice: BTreeMap<u32, WalkRecord>,
}

impl KnownPaths {
    pub fn observe(this: &mut Arc<Self>, path: WalkedPath) {
        match this.observed.binary_search_by_key(&path.to, |path| path.to) {
            Ok(at) => {
                let known = this.observed[at].and(&path);
                // Frozen copies share what does not change.
                if known != this.observed[at] {
                    Arc::make_mut(this).observed[at] = known;
                }
            }
            Err(at) => Arc::make_mut(this).observed.insert(at, path),
        }
    }

    pub fn fit(&self, from: usize, count: usize) -> bool {
        self.observed.is_sorted_by(|a, b| a.to < b.to)
            && self.observed.iter().all(|path| path.to as usize != from)
            && self.observed.last().is_none_or(|last| (last.to as usize) < count)
    }

    pub fn to(&self, to: u32) -> Option<&WalkedPath> {
        let at = self.observed.binary_search_by_key(&to, |path| path.to).ok()?;
        Some(&self.observed[at])
    }

    /// Returns the other candidates and the fewest steps to each, without paths in doubt, in
    /// ascending order.
    pub fn certain(&self) -> impl Iterator<Item = (u32, u16)> {
        let all = self.observed.iter().map(|path| (path.to, path.steps()));
        all.filter(|(_, steps)| *steps != UNOBSERVED)
    }
}

/// Number of bins by length, one step each; longer hops share the last.
const LENGTHS: usize = 32;

/// Decay of earlier outcomes with each new one, as the actor keeps learning.
pub(crate) const HOP_FORGETTING: f32 = 0.99;

/// Most failures per arrival at which hops count as arriving: .00 to .01 in a city, .15 to .21 in
/// corridors one cell wide while D is off there.
const MOST_FAILURES: f32 = 0.05;

/// Outcomes of hops by D at their start. Hops into walls that the networks have not learned yet and
/// hops that are too long for the actor fail alike: plans should prefer shorter ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HopOutcomes {
    /// Discounted numbers of hops that arrived in time and of hops that did not, by whole steps of
    /// D.
    counts: [[f32; 2]; LENGTHS],
}

impl Default for HopOutcomes {
    fn default() -> Self {
        Self { counts: [[0.0; 2]; LENGTHS] }
    }
}

impl HopOutcomes {
    pub fn record(&mut self, distance: f32, arrived: bool) {
        let counts = &mut self.counts[bin(distance)];
        *counts = counts.map(|count| HOP_FORGETTING * count);
        counts[usize::from(!arrived)] += 1.0;
    }

    /// Returns the expected number of failures before a hop of this length arrives; 0 before any is
    /// known.
    pub fn failures(&self, distance: f32) -> f32 {
        let [arrived, failed] = self.counts[bin(distance)];
        failed / (arrived + 1.0)
    }

    /// Returns the failures per arrival of hops of up to `distance` steps, pooled over their
    /// lengths.
    pub fn failures_within(&self, distance: f32) -> f32 {
        let [arrived, failed] = self.total_within(distance);
        failed / (arrived + 1.0)
    }

    fn total_within(&self, distance: f32) -> [f32; 2] {
        let counts = self.counts[..=bin(distance)].iter();
        counts.fold([0.0; 2], |[a, f], [arrived, failed]| [a + arrived, f + failed])
    }

    /// Whether nearly all hops of up to `distance` steps arrive, as far as is known.
    pub fn arrive(&self, distance: f32) -> bool {
        let [arrived, failed] = self.total_within(distance);
        failed + 1.0 <= MOST_FAILURES * (arrived + 1.0)
    }

    pub fn counts(&self) -> &[[f32; 2]] {
        &self.counts
    }

    pub(super) fn is_plausible(&self) -> bool {
        let most = 1.0 / (1.0 - HOP_FORGETTING) + 1.0;
        self.counts.as_flattened().iter().all(|count| (0.0..=most).contains(count))
    }
}

fn bin(distance: f32) -> usize {
    (distance as usize).min(LENGTHS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the steps of a path after these trajectories, each with its steps and whether it was
    /// at the ends themselves.
    fn after(trajectories: &[(u16, [bool; 2])]) -> u16 {
        let mut paths = Arc::new(KnownPaths::default());
        for (steps, exact) in trajectories {
            KnownPaths::observe(&mut paths, WalkedPath::new(3, *steps, *exact));
        }
        paths.to(3).map_or(0, WalkedPath::steps)
    }

    #[test]
    fn a_path_that_often_ends_beside_a_candidate_but_never_there_is_in_doubt() {
        let beside = (1, [true, false]);
        let few = vec![beside; usize::from(DOUBT_PASSES) - 1];
        assert_eq!(after(&few), 1);
        let many = vec![beside; usize::from(DOUBT_PASSES)];
        assert_eq!(after(&many), UNOBSERVED);
        let way_round = [&many[..], &[(9, [false, true])]].concat();
        assert_eq!(after(&way_round), 9, "the way round the wall is known");
        let reached = [&many[..], &[(1 + CONFIRMED_SLACK_STEPS, [false, true])]].concat();
        assert_eq!(after(&reached), 1, "about as short: it does lead there");
    }
    #[test]
    fn failures_are_expected_where_hops_of_the_same_length_have_failed_lately() {
        let mut hops = HopOutcomes::default();
        assert_eq!(hops.failures(7.0), 0.0);
        for _ in 0..300 {
            hops.record(2.5, true);
            hops.record(7.9, true);
            hops.record(7.1, false);
            hops.record(1e9, false);
        }
        assert_eq!(hops.failures(2.0), 0.0);
        assert!((hops.failures(7.5) - 1.0).abs() < 0.05, "{}", hops.failures(7.5));
        assert_eq!(hops.failures(8.5), 0.0, "another length");
        assert!((hops.failures_within(7.0) - 0.33).abs() < 0.05, "{}", hops.failures_within(7.0));
        assert!(hops.arrive(6.9) && !hops.arrive(7.0));
        assert!(!HopOutcomes::default().arrive(7.0), "nobody has walked yet");
        assert_eq!(hops.failures_within(6.9), 0.0);
        assert!(hops.failures(500.0) > 50.0 && hops.is_plausible());
        (0..500).for_each(|_| hops.record(7.0, true));
        assert!(hops.failures(7.0) < 0.01, "the actor has learned: {}", hops.failures(7.0));
    }
}
