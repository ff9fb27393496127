//! Pairs whose D falls short of the bridge graph: hard examples for critics and actor.
//!
//! Walks of the actor alone end at walls, where they press against the wall with nothing left of
//! their motion along it: D to a place beyond is too short on this side, as networks interpolate
//! across a thin wall, and has a dip there. Among pairs drawn at random, such pairs are rare. So of
//! several near pairs whose distance along the graph is known, the one whose D falls furthest short
//! of it is learned (hard example mining, Shrivastava et al. 2016).

use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::known::{KnownDistances, KnownPair};
use crate::learn::networks::policy::{DistanceQueries, Policy, Scratch};

/// Near pairs of which the one is chosen whose D falls furthest short.
pub(crate) const TRIED_PAIRS: usize = 4;

/// Shortfalls count relative to the distance and this many steps more.
pub(crate) const SHORTFALL_SLACK_STEPS: f32 = 3.0;

/// Chooses the pairs, and keeps the buffers.
#[derive(Default)]
pub struct ShortPairs {
    tried: Vec<KnownPair>,
    queries: DistanceQueries,
    chosen: Vec<KnownPair>,
}

impl ShortPairs {
    /// Draws [`TRIED_PAIRS`] near pairs for each of `count` to be chosen; none if there are no near
    /// pairs.
    pub fn draw(
        &mut self,
        spec: &Spec,
        known: &KnownDistances,
        count: usize,
        rng: &mut ChaCha8Rng,
    ) {
        let s = spec.state_dim();
        self.tried.clear();
        self.queries.clear();
        if known.by_goal.near == 0 {
            return;
        }
        for _ in 0..count * TRIED_PAIRS {
            let pair = known.by_goal.near_pair(rng);
            let (from, to) = (pair.from as usize, pair.to as usize);
            self.queries.push(&known.states[from * s..(from + 1) * s], known.goals.goal(to));
            self.tried.push(pair);
        }
    }

    /// Returns the pairs chosen of those drawn; `policy` gives D.
    pub fn choose(&mut self, policy: &dyn Policy, scratch: &mut Scratch) -> &[KnownPair] {
        let distances = self.queries.ask(policy, scratch);
        self.chosen.clear();
        let drawn = self.tried.chunks(TRIED_PAIRS).zip(distances.chunks(TRIED_PAIRS));
        for (pairs, distances) in drawn {
            let shortfall = |(pair, d): (&KnownPair, &f32)| {
                (pair.steps - d) / (pair.steps + SHORTFALL_SLACK_STEPS)
            };
            let furthest =
                pairs.iter().zip(distances).max_by(|a, b| shortfall(*a).total_cmp(&shortfall(*b)));
            self.chosen.extend(furthest.map(|(pair, _)| *pair));
        }
        &self.chosen
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::tests::positions;
    use crate::learn::data::known::DistancesByGoal;
    use crate::learn::data::known::tests::{by_goal, index};
    use crate::learn::networks::policy::tests::Line;

    #[test]
    fn the_pairs_chosen_are_those_whose_d_falls_furthest_short_of_the_graph() {
        let spec = positions(&[(50.0, 50.0)]);
        let states = [10.0, 12.0, 30.0];
        let none = f32::INFINITY;
        // A wall between the first two: 15 steps along the graph, 2 by D.
        let steps = [15.0, none, 19.0, 5.0, 18.0, none];
        let by_goal =
            DistancesByGoal { near: 4, ..by_goal(&states, &[1, 2], &steps, &[1, 1, 1, 2, 2, 2]) };
        let [behind_wall, longer] = [0, 3].map(|i| by_goal.pair(i));
        let (states, goals) = (&states[..], &index(&states));
        let known = KnownDistances { states, goals, by_goal: &by_goal, changed: None };
        let (mut pairs, mut rng) = (ShortPairs::default(), ChaCha8Rng::seed_from_u64(1));
        pairs.draw(&spec, &known, 100, &mut rng);
        let (policy, mut scratch) = (Line { wall: 0.0, next: |s, _| s }, Scratch::default());
        let chosen = pairs.choose(&policy, &mut scratch);
        assert_eq!(chosen.len(), 100);
        let behind_wall = chosen.iter().filter(|pair| **pair == behind_wall).count();
        // At random it would be a quarter; it is among four drawn with a probability of 0.68.
        assert!(behind_wall > 55, "{behind_wall} of 100");
        let longer = chosen.iter().filter(|pair| **pair == longer).count();
        assert!(longer < 5, "D is longer than the graph there: {longer}");
        let none_near = DistancesByGoal { near: 0, ..by_goal.clone() };
        let known = KnownDistances { by_goal: &none_near, ..known };
        pairs.draw(&spec, &known, 100, &mut rng);
        assert!(pairs.choose(&policy, &mut scratch).is_empty());
    }
}
