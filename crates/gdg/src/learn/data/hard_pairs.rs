//! Pairs that critics and actor find hard: where D falls short of the bridge graph, and where the
//! actor gets stuck.

use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::data::known::{KnownDistances, KnownPair};
use crate::learn::networks::policy::{DistanceQueries, Imagine, Policy, Scratch};

/// Near pairs of which the one is chosen whose D falls furthest short.
const TRIED_PAIRS: usize = 4;

/// Shortfalls count relative to the distance and this many steps more.
const SHORTFALL_SLACK_STEPS: f32 = 3.0;

/// Chooses `count` near pairs whose D falls short of the bridge graph, each from [`TRIED_PAIRS`]
/// drawn; none if there are no near pairs. `policy` gives D.
///
/// Walks of the actor alone end at walls, where they press against the wall with nothing left of
/// their motion along it: D to a place beyond is too short on this side, as networks interpolate
/// across a thin wall, and has a dip there. Among pairs drawn at random, such pairs are rare. So of
/// several near pairs whose distance along the graph is known, the one whose D falls furthest short
/// of it is learned (hard example mining, Shrivastava et al. 2016).
pub fn short_pairs(
    spec: &Spec,
    policy: &dyn Policy,
    known: &KnownDistances,
    count: usize,
    rng: &mut ChaCha8Rng,
    scratch: &mut Scratch,
) -> Vec<KnownPair> {
    let s = spec.state_dim();
    let tried = if known.by_goal.near == 0 { 0 } else { count * TRIED_PAIRS };
    let tried: Vec<KnownPair> = (0..tried).map(|_| known.by_goal.near_pair(rng)).collect();
    let mut queries = DistanceQueries::default();
    for KnownPair { from, to, .. } in &tried {
        let from = *from as usize;
        queries.push(&known.states[from * s..(from + 1) * s], known.goals.goal(*to as usize));
    }
    let distances = queries.ask(policy, scratch);
    let shortfall =
        |(pair, d): (&KnownPair, &f32)| (pair.steps - d) / (pair.steps + SHORTFALL_SLACK_STEPS);
    let furthest = tried.chunks(TRIED_PAIRS).zip(distances.chunks(TRIED_PAIRS)).filter_map(
        |(pairs, distances)| {
            let pairs = pairs.iter().zip(distances);
            pairs.max_by(|a, b| shortfall(*a).total_cmp(&shortfall(*b))).map(|(pair, _)| *pair)
        },
    );
    furthest.collect()
}

/// Least distance of the pairs whose actor is led or imagined, in steps.
pub const LEAST_LED_STEPS: f32 = 10.0;

/// Length of an imagined walk, in steps.
const WALK_STEPS: usize = 30;

/// A walk rests if a step changes every component by at most this share of its change scale.
const REST_CHANGE: f32 = 0.1;

/// A walk that rests counts only this far from its goal or farther, in steps.
const LEAST_LEFT_STEPS: f32 = 5.0;

/// Imagines the actor's walks from the last pairs of `batch`, and moves the pairs whose walks come to
/// rest.
///
/// Next to a gap in a wall, an actor that is drawn into the gap from one side and out of it from the
/// other comes to rest and, without memory, stays there for ever. Its walks end at such places;
/// agents that explore, with noise and plans, are rarely there. So where a walk that the dynamics
/// model imagines comes to rest away from its goal, the pair begins there (states of the actor's own
/// walks, as in DAgger, Ross et al. 2011, from a model, as in Dyna, Sutton 1990).
pub fn imagine_walks(
    policy: &dyn Imagine,
    sampler: &BatchSampler,
    batch: &mut Batch,
    scratch: &mut Scratch,
) {
    let (spec, count) = (&sampler.spec, sampler.walk_rows(batch));
    let (s, g, first) = (spec.state_dim(), spec.goal_dim(), batch.len() - count);
    let all_goals = &batch.goals[first * g..];
    let mut states = batch.states[first * s..].to_vec();
    let mut distances = vec![0.0; count];
    policy.distances(&states, all_goals, &mut distances, scratch);
    let mut going: Vec<usize> = (0..count).filter(|i| distances[*i] >= LEAST_LED_STEPS).collect();
    let (mut resting, mut next) = (Vec::new(), Vec::new());
    for _ in 0..WALK_STEPS {
        if going.is_empty() {
            break;
        }
        let mut walks = DistanceQueries::default();
        for i in &going {
            walks.push(&states[i * s..(i + 1) * s], &all_goals[i * g..(i + 1) * g]);
        }
        policy.step(&walks.states, &walks.goals, &mut next, scratch);
        let mut steps = walks.states.chunks_exact(s).zip(next.chunks_exact(s));
        going.retain(|i| {
            let Some((before, after)) = steps.next() else { return false };
            states[i * s..(i + 1) * s].copy_from_slice(after);
            let mut changes = before.iter().zip(after).zip(&spec.change_scale);
            let rests = changes.all(|((a, b), scale)| (a - b).abs() <= REST_CHANGE * scale);
            if rests {
                resting.push(*i);
            }
            !rests && !spec.reached(after, &all_goals[i * g..(i + 1) * g])
        });
    }
    policy.distances(&states, all_goals, &mut distances, scratch);
    for i in resting.into_iter().filter(|i| distances[*i] >= LEAST_LEFT_STEPS) {
        sampler.begin_at(batch, first + i, &states[i * s..(i + 1) * s]);
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::tests::positions;
    use crate::learn::LearnSettings;
    use crate::learn::data::known::DistancesByGoal;
    use crate::learn::data::known::tests::{by_goal, index};
    use crate::learn::networks::policy::tests::LineWorld;

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
        let choose = |known: &KnownDistances| {
            let (policy, mut rng) =
                (LineWorld { wall: 0.0, next: |s, _| s }, ChaCha8Rng::seed_from_u64(1));
            short_pairs(&spec, &policy, known, 100, &mut rng, &mut Scratch::default())
        };
        let chosen = choose(&known);
        assert_eq!(chosen.len(), 100);
        let behind_wall = chosen.iter().filter(|pair| **pair == behind_wall).count();
        // At random it would be a quarter; it is among four drawn with a probability of 0.68.
        assert!(behind_wall > 55, "{behind_wall} of 100");
        let longer = chosen.iter().filter(|pair| **pair == longer).count();
        assert!(longer < 5, "D is longer than the graph there: {longer}");
        let none_near = DistancesByGoal { near: 0, ..by_goal.clone() };
        assert!(choose(&KnownDistances { by_goal: &none_near, ..known }).is_empty());
    }

    #[test]
    fn pairs_begin_where_the_actors_walks_come_to_rest_away_from_their_goals() {
        let settings = LearnSettings {
            imagined_walks: 5.0 / 6.0,
            distillation: 0.0,
            ..LearnSettings::default()
        };
        let spec = positions(&[(50.0, 50.0)]);
        let sampler = BatchSampler { spec, settings, returns: None };
        // Not imagined; stuck; stuck within a few steps of the goal; still on its way; arrived; near.
        let (states, goals) =
            ([30.0, 30.0, 30.0, 5.0, 30.0, 48.0], [90.0, 90.0, 54.0, 90.0, 42.0, 57.0]);
        let mut batch = Batch {
            states: states.to_vec(),
            goals: goals.to_vec(),
            bootstrap_states: vec![33.0; 6],
            steps: vec![3.0; 6],
            bootstrap: vec![0.0; 6],
            bound: vec![7.0; 6],
            lower: vec![6.0; 6],
            greedy_targets: true,
            ..Batch::default()
        };
        // A step at a time, but not beyond 50.
        let policy = LineWorld { wall: 0.0, next: |s, g| (s + (g - s).clamp(-1.0, 1.0)).min(50.0) };
        imagine_walks(&policy, &sampler, &mut batch, &mut Scratch::default());
        assert_eq!(batch.states, [30.0, 50.0, 30.0, 5.0, 30.0, 48.0]);
        assert_eq!(batch.goals, goals);
        assert_eq!(batch.bootstrap_states, [33.0, 50.0, 33.0, 33.0, 33.0, 33.0]);
        assert_eq!((batch.steps[1], batch.bootstrap[1]), (0.0, 1.0), "lookahead decides");
        assert_eq!((batch.bound[1], batch.lower[1]), (f32::INFINITY, 0.0));
        assert_eq!((batch.bound[2], batch.steps[2]), (7.0, 3.0));
    }
}
