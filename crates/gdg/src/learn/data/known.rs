//! Distances known from a source other than transitions: from the bridge graph.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::learn::data::goal_index::GoalIndex;
use crate::store::planes;

/// How to relearn distances that may have changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Relearning {
    /// Approximate number of slots that each agent has filled in the replay buffer since the
    /// change.
    pub recent_slots: u64,
    /// Whether a bridge graph finds out which distances have changed (see
    /// [`KnownDistances::changed`]), as soon as there is one. Otherwise, all distances are in
    /// doubt.
    pub graph_finds_changed: bool,
}

/// Distances known from a source other than transitions.
#[derive(Clone, Copy)]
pub struct KnownDistances<'a> {
    /// `(places, state_dim)`.
    pub states: &'a [f32],
    /// The same places as goals.
    pub goals: &'a GoalIndex,
    /// Distances along shortest paths to some of them.
    pub by_goal: &'a DistancesByGoal,
    /// Distances that have changed, while they are relearned.
    pub changed: Option<&'a ChangedDistances>,
}

/// A pair of places whose distance is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPair {
    /// The place where the path starts.
    pub from: u32,
    /// The place where it ends.
    pub to: u32,
    pub steps: f32,
    /// The first place on it that is at least `WAYPOINT_STEPS` from the start, or its end.
    pub waypoint: u32,
}

/// Pairs are near up to this distance, in steps.
pub(crate) const NEAR_STEPS: f32 = 40.0;

/// Least distance of the waypoints that lead the actor, in steps: near enough that D is right, far
/// enough that the way there shows the direction.
pub(crate) const WAYPOINT_STEPS: f32 = 4.0;

/// Steps from all places to some of them.
#[derive(Clone, Debug)]
pub struct DistancesByGoal {
    pub places: Vec<u32>,
    /// The same places as goals.
    pub goals: GoalIndex,
    /// Steps from each place to each goal, `(goals, places)`, with the overhead of each hop, the
    /// first as well; infinite if there is no path.
    pub steps: Vec<f32>,
    /// For each of these, the first place on the path that is at least `WAYPOINT_STEPS` from its
    /// start, or its end.
    pub waypoints: Vec<u32>,
    /// Number of goals, the first ones, to which [`ChangedDistances`] are found.
    pub checked: usize,
    /// For each place, the one of these goals that is fewest steps away, as its number.
    pub nearest_checked: Vec<u32>,
    /// Indices in `steps` of the pairs of a goal and another place with a path to it; those less
    /// than `NEAR_STEPS` apart come first.
    pub pairs: Vec<u32>,
    /// Number of these near pairs.
    pub near: usize,
    /// The overhead of a first hop, which paths that start exactly at a place do not have.
    pub hop_steps: f32,
    /// Whether agents that walk along the graph arrive. Otherwise D is off between near places, and
    /// paths, whose parts are as long as D says, are far too long.
    pub walks_arrive: bool,
}

impl DistancesByGoal {
    /// Returns the pair at index `i` of [`Self::steps`].
    pub(crate) fn pair(&self, i: u32) -> KnownPair {
        let at = i as usize;
        let places = self.steps.len() / self.places.len();
        KnownPair {
            from: (at % places) as u32,
            to: self.places[at / places],
            steps: self.steps[at] - self.hop_steps,
            waypoint: self.waypoints[at],
        }
    }

    pub(crate) fn checked_places(&self) -> &[u32] {
        &self.places[..self.checked]
    }

    pub(crate) fn any_pair(&self, rng: &mut ChaCha8Rng) -> KnownPair {
        self.pair(self.pairs[rng.random_range(0..self.pairs.len())])
    }

    pub(crate) fn near_pair(&self, rng: &mut ChaCha8Rng) -> KnownPair {
        self.pair(self.pairs[rng.random_range(0..self.near)])
    }

    pub(crate) fn longest_steps(&self) -> f32 {
        self.pairs.iter().map(|i| self.pair(*i).steps).fold(0.0, f32::max)
    }
}

/// Bounds on distances of which D is far too short or too long.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChangedDistances {
    /// The places that are goals, the first of [`DistancesByGoal::places`].
    pub goals: Vec<u32>,
    /// Fewest steps from each place to each goal, `(goals, places)`; 0 where D is long enough.
    #[serde(with = "planes")]
    pub lower: Vec<f32>,
    /// Most steps from each place to each goal, `(goals, places)`; `f32::MAX` where D is short
    /// enough.
    #[serde(with = "planes")]
    pub upper: Vec<f32>,
}

#[cfg(test)]
pub(in crate::learn) mod tests {
    use super::*;
    use crate::env::tests::positions;

    /// Returns places on a line of a hundred steps as goals.
    pub fn index(places: &[f32]) -> GoalIndex {
        let mut index = GoalIndex::new(&positions(&[(50.0, 50.0)]), &[]);
        places.iter().for_each(|place| index.push(&[*place]));
        index
    }

    /// Returns known steps, of which none are near or checked, to some `goals` of these places.
    pub fn by_goal(
        places: &[f32],
        goals: &[u32],
        steps: &[f32],
        waypoints: &[u32],
    ) -> DistancesByGoal {
        let paths = (0..steps.len()).filter(|i| steps[*i] > 0.0 && steps[*i].is_finite());
        DistancesByGoal {
            places: goals.to_vec(),
            goals: index(&goals.iter().map(|goal| places[*goal as usize]).collect::<Vec<_>>()),
            steps: steps.to_vec(),
            waypoints: waypoints.to_vec(),
            checked: 0,
            nearest_checked: vec![],
            pairs: paths.map(|i| i as u32).collect(),
            near: 0,
            hop_steps: 0.0,
            walks_arrive: true,
        }
    }
}
