//! What paths through the bridge graph add to a batch: bounds on the targets of far pairs, and
//! waypoints for the actor.
//!
//! Distillation covers pairs of candidates, and other pairs need not follow: on large maps, their
//! far distances stay a third too long, and where the slope of D towards a far goal is lost in its
//! error, the actor gets stuck at a wall. For each pair (s, g) of a batch whose distance along the
//! graph is known, with b the candidate nearest to g among those to which distances are known, d the
//! graph's distance, x = f(s, mu'(s, g)) where the actor leads, and a, of the [`FIRST_PLACES`]
//! candidates around s, the one with the smallest D'(x, a) + d(a, b), those near x first,
//!
//! - the target is at most 1 + D'(x, a) + d(a, b) + D'(b, g);
//! - the actor descends D to a waypoint on the path from a to b instead of D to g, if the path
//!   begins near s and ends near g;
//! - otherwise, if g is far, the actor does not learn from the pair: one step changes D to a far
//!   goal by less than its error, and near a wall its slope leads straight into it.
//!
//! D', unlike a straight line, sees walls on the way to a and from b. Between paths of about the same
//! length, x decides for the one that the actor already takes. Otherwise the choice would change with
//! every graph, and the actor would learn the mean of both and stop between them.

use std::ops::Range;

use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::data::hard_pairs::LEAST_LED_STEPS;
use crate::learn::data::known::{DistancesByGoal, KnownDistances};
use crate::learn::networks::policy::{DistanceQueries, Imagine, Scratch};

/// Least distance along the graph of the pairs that are bounded, in steps: D of near pairs is
/// better than the graph's. Actors are led from [`LEAST_LED_STEPS`] on.
const LEAST_BOUND_STEPS: f32 = 20.0;

/// Candidates around s of which one is chosen as the beginning of the path.
const FIRST_PLACES: usize = 2;

/// The actor is led only along paths that begin at most this far from s, by D'.
const MAX_STEPS_BEFORE: f32 = 5.0;

/// Such a path ends at most this far from g, or at most [`MAX_SHARE_AFTER`] of its length.
const MAX_STEPS_AFTER: f32 = 3.0;

/// The distance of a path's end from g, as a share of its length, at most.
const MAX_SHARE_AFTER: f32 = 0.3;

/// A path through the graph for one pair of the batch.
struct GraphPath {
    row: usize,
    /// b, as its number among the goals.
    end: usize,
    /// The candidates at which it may begin, as a range of a list.
    starts: Range<usize>,
    /// a.
    start: usize,
    /// D'(x, a).
    before: f32,
}

/// Bounds the targets of the pairs of `batch` from row `first` on whose distance along the graph is
/// known, and leads their actor, or leaves them out of its training; `policy` gives D' and where the
/// actor leads.
pub fn follow_graph(
    sampler: &BatchSampler,
    policy: &dyn Imagine,
    known: &KnownDistances,
    batch: &mut Batch,
    first: usize,
    scratch: &mut Scratch,
) {
    let (bounds, leads) = (sampler.settings.graph_bounds, sampler.leads(known));
    if !(bounds || leads) {
        return;
    }
    let (s, g) = (sampler.spec.state_dim(), sampler.spec.goal_dim());
    let paths = find_paths(sampler, policy, known, batch, first, scratch);
    let DistancesByGoal { places: ends_at, steps, waypoints, .. } = known.by_goal;
    let mut queries = DistanceQueries::default();
    for GraphPath { row, end, .. } in &paths {
        let b = ends_at[*end] as usize;
        let goal = &batch.goals[row * g..(row + 1) * g];
        queries.push(&known.states[b * s..(b + 1) * s], goal);
    }
    let after = queries.ask(policy, scratch);
    for (GraphPath { row, end, start, before, .. }, after) in paths.into_iter().zip(after) {
        let path = end * known.goals.len() + start;
        let (steps, waypoint) = (steps[path], waypoints[path]);
        if bounds && steps >= LEAST_BOUND_STEPS {
            let bound = &mut batch.bound[row];
            *bound = bound.min(1.0 + before + steps + after);
            batch.lower[row] = batch.lower[row].min(*bound);
        }
        let is_near =
            before <= MAX_STEPS_BEFORE && *after <= MAX_STEPS_AFTER.max(MAX_SHARE_AFTER * steps);
        if leads && is_near {
            let waypoint = known.goals.goal(waypoint as usize);
            batch.actor_goals[row * g..(row + 1) * g].copy_from_slice(waypoint);
        } else if leads {
            batch.actor_weights[row] = 0.0;
        }
    }
}

/// Returns the paths for the pairs of `batch` from row `first` on, with the place at which each
/// begins.
fn find_paths(
    sampler: &BatchSampler,
    policy: &dyn Imagine,
    known: &KnownDistances,
    batch: &Batch,
    first: usize,
    scratch: &mut Scratch,
) -> Vec<GraphPath> {
    let (mut paths, mut starts): (Vec<GraphPath>, Vec<usize>) = (Vec::new(), Vec::new());
    let (s, g) = (sampler.spec.state_dim(), sampler.spec.goal_dim());
    let places = known.goals.len();
    let DistancesByGoal { goals, steps, .. } = known.by_goal;
    let least = if sampler.leads(known) { LEAST_LED_STEPS } else { LEAST_BOUND_STEPS };
    let mut pairs = DistanceQueries::default();
    for row in (first..batch.len()).filter(|row| batch.bootstrap[*row] > 0.0) {
        let state = &batch.states[row * s..(row + 1) * s];
        let goal = &batch.goals[row * g..(row + 1) * g];
        let at = known.goals.place_of(state);
        let mut around = known.goals.nearest_few(&at, FIRST_PLACES);
        around.retain(|i| known.goals.is_like(*i, &at));
        let (Some((end, _)), Some(start)) = (goals.nearest(goal), around.first().copied()) else {
            continue;
        };
        let steps = |a: &usize| steps[end * places + a];
        if steps(&start).is_finite() && steps(&start) >= least {
            let from = starts.len();
            starts.extend(around.iter().filter(|a| steps(a).is_finite()));
            paths.push(GraphPath { row, end, starts: from..starts.len(), start, before: 0.0 });
            pairs.push(state, goal);
        }
    }
    let mut next = Vec::new();
    policy.step(&pairs.states, &pairs.goals, &mut next, scratch);
    let mut queries = DistanceQueries::default();
    for (path, next) in paths.iter().zip(next.chunks_exact(s)) {
        starts[path.starts.clone()].iter().for_each(|a| queries.push(next, known.goals.goal(*a)));
    }
    let before = queries.ask(policy, scratch);
    for GraphPath { end, starts: own, start, before: steps_before, .. } in &mut paths {
        // Far ones come last: D' of the way to them has no overhead of hops, and would win.
        let cost = |k: usize| {
            let steps = before[k] + steps[*end * places + starts[k]];
            (before[k] > MAX_STEPS_BEFORE, steps)
        };
        let best = own.clone().min_by(|a, b| {
            let (a, b) = (cost(*a), cost(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        if let Some(k) = best {
            (*start, *steps_before) = (starts[k], before[k]);
        }
    }
    paths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::LearnSettings;
    use crate::learn::data::known::tests::{by_goal, index};
    use crate::learn::networks::policy::tests::LineWorld;

    /// Returns what becomes of a batch of pairs `from` these states to the same `goal` where distances
    /// of `places` are known.
    fn applied(
        settings: &LearnSettings,
        [places, from]: [&[f32]; 2],
        goal: f32,
        by_goal: &DistancesByGoal,
        next: fn(f32, f32) -> f32,
        change: impl Fn(&mut Batch),
    ) -> Batch {
        let (spec, goals, rows) = (positions(&[(50.0, 50.0)]), index(places), from.len());
        let known = KnownDistances { states: places, goals: &goals, by_goal, changed: None };
        let mut batch = Batch {
            states: from.to_vec(),
            goals: vec![goal; rows],
            actor_goals: vec![goal; rows],
            actor_weights: vec![1.0; rows],
            bound: vec![1e9; rows],
            lower: vec![0.0; rows],
            bootstrap: vec![1.0; rows],
            steps: vec![0.0; rows],
            ..Batch::default()
        };
        change(&mut batch);
        let policy = LineWorld { wall: 300.0, next };
        let sampler = BatchSampler { spec, settings: settings.clone(), returns: None };
        follow_graph(&sampler, &policy, &known, &mut batch, 1, &mut Scratch::default());
        batch
    }

    #[test]
    fn far_pairs_are_bounded_by_the_path_through_the_graph_along_which_the_actor_is_led() {
        let default = LearnSettings::default;
        let places = [10.0, 48.0, 90.0];
        let to_last = by_goal(&places, &[2], &[82.0, 44.0, 0.0], &[1, 2, 2]);
        // No candidate before the goal is on the third row's side of the wall; the fourth row is near
        // its goal, the fifth is bounded already, and the goal of the last was reached.
        let from = [12.0, 12.0, 51.0, 88.0, 16.0, 12.0];
        let apply = |settings: &LearnSettings| {
            applied(
                settings,
                [&places, &from],
                87.0,
                &to_last,
                |s, _| s,
                |batch| {
                    (batch.bound[4], batch.lower[1], batch.bootstrap[5]) = (60.0, 100.0, 0.0);
                },
            )
        };
        let batch = apply(&LearnSettings { actor_waypoints: false, ..default() });
        let through = 1.0 + 2.0 + 82.0 + 3.0;
        assert_eq!(batch.bound, [1e9, through, 1e9, 1e9, 60.0, 1e9]);
        assert_eq!(batch.lower[1], through, "no higher than the upper bound");
        assert_eq!((&batch.actor_goals, &batch.actor_weights), (&vec![87.0; 6], &vec![1.0; 6]));
        // The paths of the third and fifth row begin too far away for the actor.
        let batch = apply(&LearnSettings { graph_bounds: false, ..default() });
        assert_eq!(batch.actor_goals, [87.0, 48.0, 87.0, 87.0, 87.0, 87.0]);
        assert_eq!(batch.actor_weights, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        assert_eq!(batch.bound, [1e9, 1e9, 1e9, 1e9, 60.0, 1e9]);
    }

    #[test]
    fn of_paths_about_as_short_the_actor_is_led_along_the_one_to_which_it_tends() {
        // From 70 and from 74, there is a way of its own.
        let places = [70.0, 74.0, 10.0, 20.0];
        let steps = [30.5, 30.0, 0.0, f32::INFINITY];
        let to_third = by_goal(&places, &[2], &steps, &[3, 2, 2, 2]);
        let waypoint = |next| {
            let settings = LearnSettings::default();
            applied(&settings, [&places, &[72.0; 2]], 10.0, &to_third, next, |_| {}).actor_goals[1]
        };
        assert_eq!(waypoint(|s, _| s), 10.0, "the shorter one");
        assert_eq!(waypoint(|s, _| s - 1.0), 20.0, "half a step longer, and the actor leads there");
        assert_eq!(waypoint(|s, _| s + 1.0), 10.0);
    }
}
