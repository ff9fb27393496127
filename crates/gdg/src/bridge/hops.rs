//! How often hops between candidates arrive in time, by their length.

use serde::{Deserialize, Serialize};

/// Number of bins by length, one step each; longer hops share the last.
const LENGTHS: usize = 32;

/// Decay of earlier outcomes with each new one, as the actor keeps learning.
pub(crate) const HOP_FORGETTING: f32 = 0.99;

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
        let [arrived, failed] = self.counts[..=bin(distance)]
            .iter()
            .fold([0.0; 2], |[a, f], [arrived, failed]| [a + arrived, f + failed]);
        failed / (arrived + 1.0)
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

    impl HopOutcomes {
        pub fn spoil(&mut self) {
            self.counts[3][1] = 1e9;
        }
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
        assert_eq!(hops.failures_within(6.9), 0.0);
        assert!(hops.failures(500.0) > 50.0 && hops.is_plausible());
        (0..500).for_each(|_| hops.record(7.0, true));
        assert!(hops.failures(7.0) < 0.01, "the actor has learned: {}", hops.failures(7.0));
    }
}
