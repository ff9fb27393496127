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
//! - the target is at most D'(s, a) + d(a, b) + D'(b, g);
//! - the actor descends D to a waypoint on the path from a to b instead of D to g, if the path
//!   begins near s and ends near g;
//! - otherwise, if g is far, the actor does not learn from the pair: one step changes D to a far
//!   goal by less than its error, and near a wall its slope leads straight into it.
//!
//! D', unlike a straight line, sees walls on the way to a and from b. Between paths of about the same
//! length, x decides for the one that the actor already takes. Otherwise the choice would change with
//! every graph, and the actor would learn the mean of both and stop between them.

use std::ops::Range;

use crate::env::Spec;
use crate::learn::data::batch::Batch;
use crate::learn::data::known::{DistancesByGoal, KnownDistances};
use crate::learn::networks::policy::{DistanceQueries, Imagine, Scratch};
use crate::learn::settings::LearnSettings;

/// Least distance along the graph of the pairs that are bounded, in steps: D of near pairs is
/// better than the graph's.
pub(crate) const LEAST_BOUND_STEPS: f32 = 20.0;

/// Least distance of the pairs whose actor is led, in steps: along the graph, and by D' for those
/// without a path.
pub(crate) const LEAST_LED_STEPS: f32 = 10.0;

/// Candidates around s of which one is chosen as the beginning of the path.
pub(crate) const FIRST_PLACES: usize = 4;

/// The actor is led along paths that begin at most this far from s, by D', ...
pub(crate) const MAX_STEPS_BEFORE: f32 = 5.0;

/// ... and end at most this far from g, ...
pub(crate) const MAX_STEPS_AFTER: f32 = 3.0;

/// ... or at most this share of their length.
pub(crate) const MAX_SHARE_AFTER: f32 = 0.3;

/// Finds bounds and waypoints, and keeps the buffers.
pub struct GraphPaths {
    bounds: bool,
    waypoints: bool,
    paths: Vec<Path>,
    /// Candidates around s of each path, of all paths.
    starts: Vec<usize>,
    /// Pairs of which D', or where the actor leads, is asked.
    queries: DistanceQueries,
    /// x of each path, `(paths, state_dim)`.
    next: Vec<f32>,
    /// Rows of the pairs whose path begins or ends too far away to lead the actor.
    unled: Vec<usize>,
}

/// A path through the graph for one pair of the batch.
struct Path {
    row: usize,
    /// b, as its number among the goals.
    end: usize,
    /// The places at which it may begin, of [`GraphPaths::starts`].
    starts: Range<usize>,
    /// a.
    start: usize,
}

impl GraphPaths {
    /// Creates it, if `settings` use paths through the graph.
    pub fn new(settings: &LearnSettings) -> Option<Self> {
        let (bounds, waypoints) = (settings.graph_bounds, settings.actor_waypoints);
        let none = || Self {
            bounds,
            waypoints,
            paths: Vec::new(),
            starts: Vec::new(),
            queries: DistanceQueries::default(),
            next: Vec::new(),
            unled: Vec::new(),
        };
        (bounds || waypoints).then(none)
    }

    /// Bounds the targets of the pairs of `batch` from row `first` on whose distance along the graph
    /// is known, and leads their actor, or leaves them out of its training; `policy` gives D' and
    /// where the actor leads.
    pub fn apply(
        &mut self,
        spec: &Spec,
        policy: &dyn Imagine,
        known: &KnownDistances,
        batch: &mut Batch,
        first: usize,
        scratch: &mut Scratch,
    ) {
        self.collect(spec, known, batch, first);
        self.choose_starts(spec, policy, known, batch, scratch);
        let (s, g, places) = (spec.state_dim(), spec.goal_dim(), known.goals.len());
        let DistancesByGoal { places: ends_at, steps, waypoints, .. } = known.by_goal;
        self.queries.clear();
        for Path { row, start, .. } in &self.paths {
            self.queries.push(&batch.states[row * s..(row + 1) * s], known.goals.goal(*start));
        }
        for Path { row, end, .. } in &self.paths {
            let b = ends_at[*end] as usize;
            let goal = &batch.goals[row * g..(row + 1) * g];
            self.queries.push(&known.states[b * s..(b + 1) * s], goal);
        }
        self.unled.clear();
        let (before, after) = self.queries.ask(policy, scratch).split_at(self.paths.len());
        for (Path { row, end, start, .. }, (before, after)) in
            self.paths.iter().zip(before.iter().zip(after))
        {
            let path = end * places + start;
            let (steps, waypoint) = (steps[path], waypoints[path]);
            if self.bounds && steps >= LEAST_BOUND_STEPS {
                let bound = &mut batch.bound[*row];
                *bound = bound.min(before + steps + after);
                batch.lower[*row] = batch.lower[*row].min(*bound);
            }
            if !self.waypoints {
                continue;
            }
            let near = *before <= MAX_STEPS_BEFORE
                && *after <= MAX_STEPS_AFTER.max(MAX_SHARE_AFTER * steps);
            if near {
                let waypoint = known.goals.goal(waypoint as usize);
                batch.actor_goals[row * g..(row + 1) * g].copy_from_slice(waypoint);
            } else {
                self.unled.push(*row);
            }
        }
        self.queries.clear();
        for row in &self.unled {
            let goal = &batch.goals[row * g..(row + 1) * g];
            self.queries.push(&batch.states[row * s..(row + 1) * s], goal);
        }
        for (row, distance) in self.unled.iter().zip(self.queries.ask(policy, scratch)) {
            if *distance > LEAST_LED_STEPS {
                batch.actor_weights[*row] = 0.0;
            }
        }
    }

    /// Collects the paths for the pairs of `batch` from row `first` on, with all places at which
    /// each may begin.
    fn collect(&mut self, spec: &Spec, known: &KnownDistances, batch: &Batch, first: usize) {
        self.paths.clear();
        self.starts.clear();
        let (s, g, places) = (spec.state_dim(), spec.goal_dim(), known.goals.len());
        let DistancesByGoal { goals, steps, .. } = known.by_goal;
        let least = if self.waypoints { LEAST_LED_STEPS } else { LEAST_BOUND_STEPS };
        for row in (first..batch.len()).filter(|row| batch.bootstrap[*row] > 0.0) {
            let state = &batch.states[row * s..(row + 1) * s];
            let at: Vec<f32> = spec.achieved(state).collect();
            let Some((end, _)) = goals.nearest(&batch.goals[row * g..(row + 1) * g]) else {
                return;
            };
            let steps = |a: &usize| steps[end * places + a];
            let around = known.goals.nearest_few(&at, FIRST_PLACES);
            let Some(start) = around.first().copied() else { return };
            if steps(&start).is_finite() && steps(&start) >= least {
                let from = self.starts.len();
                self.starts.extend(around.iter().filter(|a| steps(a).is_finite()));
                self.paths.push(Path { row, end, starts: from..self.starts.len(), start });
            }
        }
    }

    /// Chooses the place at which each path begins.
    fn choose_starts(
        &mut self,
        spec: &Spec,
        policy: &dyn Imagine,
        known: &KnownDistances,
        batch: &Batch,
        scratch: &mut Scratch,
    ) {
        let (s, g, places) = (spec.state_dim(), spec.goal_dim(), known.goals.len());
        let Self { paths, starts, queries, next, .. } = self;
        queries.clear();
        for row in paths.iter().map(|path| path.row) {
            let goal = &batch.goals[row * g..(row + 1) * g];
            queries.push(&batch.states[row * s..(row + 1) * s], goal);
        }
        policy.step(&queries.states, &queries.goals, next, scratch);
        queries.clear();
        for (path, next) in paths.iter().zip(next.chunks_exact(s)) {
            starts[path.starts.clone()]
                .iter()
                .for_each(|a| queries.push(next, known.goals.goal(*a)));
        }
        let before = queries.ask(policy, scratch);
        for Path { end, starts: own, start, .. } in paths {
            // Far ones come last: D' of the way to them has no overhead of hops, and would win.
            let cost = |k: usize| {
                let steps = before[k] + known.by_goal.steps[*end * places + starts[k]];
                (before[k] > MAX_STEPS_BEFORE, steps)
            };
            let best = own.clone().min_by(|a, b| {
                let (a, b) = (cost(*a), cost(*b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            });
            *start = best.map_or(*start, |k| starts[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::data::known::tests::{by_goal, index};
    use crate::learn::networks::policy::tests::Line;

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
        let mut paths = GraphPaths::new(settings).expect("paths are wanted");
        let policy = Line { wall: 300.0, next };
        paths.apply(&spec, &policy, &known, &mut batch, 1, &mut Scratch::default());
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
        let through = 2.0 + 82.0 + 3.0;
        assert_eq!(batch.bound, [1e9, through, 1e9, 1e9, 60.0, 1e9]);
        assert_eq!(batch.lower[1], through, "no higher than the upper bound");
        assert_eq!((&batch.actor_goals, &batch.actor_weights), (&vec![87.0; 6], &vec![1.0; 6]));
        // The paths of the third and fifth row begin too far away for the actor.
        let batch = apply(&LearnSettings { graph_bounds: false, ..default() });
        assert_eq!(batch.actor_goals, [87.0, 48.0, 87.0, 87.0, 87.0, 87.0]);
        assert_eq!(batch.actor_weights, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        assert_eq!(batch.bound, [1e9, 1e9, 1e9, 1e9, 60.0, 1e9]);
        let neither = LearnSettings { graph_bounds: false, actor_waypoints: false, ..default() };
        assert!(GraphPaths::new(&neither).is_none());
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
