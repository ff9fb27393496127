//! What paths through the bridge graph add to a batch: bounds on the targets of far pairs, and
//! waypoints for the actor.
//!
//! Distillation covers pairs of candidates, and other pairs need not follow: on large maps, their
//! far distances stay a third too long, and where the slope of D towards a far goal is lost in its
//! error, the actor gets stuck at a wall. For each pair (s, g) of a batch whose distance along the
//! graph is known, with a the candidate nearest to s, b the one nearest to g among those to which
//! distances are known, and d the graph's distance,
//!
//! - the target is at most D'(s, a) + d(a, b) + D'(b, g);
//! - the actor descends D to a waypoint on the path from a to b instead of D to g, if the path
//!   begins near s and ends near g;
//! - otherwise, if g is far, the actor does not learn from the pair: one step changes D to a far
//!   goal by less than its error, and near a wall its slope leads straight into it.
//!
//! D' gives the true distances to a and from b, even where a straight line crosses a wall.

use crate::env::Spec;
use crate::learn::data::batch::Batch;
use crate::learn::data::known::{DistancesByGoal, KnownDistances};
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::settings::LearnSettings;

/// Least distance along the graph of the pairs that are bounded, in steps: D of near pairs is
/// better than the graph's.
pub(crate) const LEAST_BOUND_STEPS: f32 = 20.0;

/// Least length of a path that leads the actor, and least D'(s, g) of a pair that it does not learn
/// because its path cannot lead it, in steps.
pub(crate) const LEAST_LED_STEPS: f32 = 10.0;

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
    /// Starts of the distances asked of D': s of each path, then b; s of the pairs not led.
    states: Vec<f32>,
    /// Their ends: a of each path, then g; g of the pairs not led.
    goals: Vec<f32>,
    distances: Vec<f32>,
    /// Rows of the pairs whose path begins or ends too far away to lead the actor.
    unled: Vec<usize>,
    scratch: Scratch,
}

/// A path through the graph for one pair of the batch.
struct Path {
    row: usize,
    /// d(a, b).
    steps: f32,
    /// A place on the path.
    waypoint: u32,
}

impl GraphPaths {
    /// Creates it, if `settings` use paths through the graph.
    pub fn new(settings: &LearnSettings) -> Option<Self> {
        let (bounds, waypoints) = (settings.graph_bounds, settings.actor_waypoints);
        let none = || Self {
            bounds,
            waypoints,
            paths: Vec::new(),
            states: Vec::new(),
            goals: Vec::new(),
            distances: Vec::new(),
            unled: Vec::new(),
            scratch: Scratch::default(),
        };
        (bounds || waypoints).then(none)
    }

    /// Bounds the targets of the pairs of `batch` from row `first` on whose distance along the graph
    /// is known, and leads their actor, or leaves them out of its training; `policy` gives D'.
    pub fn apply(
        &mut self,
        spec: &Spec,
        policy: &dyn Policy,
        known: &KnownDistances,
        batch: &mut Batch,
        first: usize,
    ) {
        self.collect(spec, known, batch, first);
        let (count, s, g) = (self.paths.len(), spec.state_dim(), spec.goal_dim());
        self.distances.resize(2 * count, 0.0);
        policy.distances(&self.states, &self.goals, &mut self.distances, &mut self.scratch);
        self.unled.clear();
        let (before, after) = self.distances.split_at(count);
        for (Path { row, steps, waypoint }, (before, after)) in
            self.paths.iter().zip(before.iter().zip(after))
        {
            if self.bounds && *steps >= LEAST_BOUND_STEPS {
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
                let waypoint = known.goals.goal(*waypoint as usize);
                batch.actor_goals[row * g..(row + 1) * g].copy_from_slice(waypoint);
            } else {
                self.unled.push(*row);
            }
        }
        [&mut self.states, &mut self.goals].into_iter().for_each(Vec::clear);
        for row in &self.unled {
            self.states.extend(&batch.states[row * s..(row + 1) * s]);
            self.goals.extend(&batch.goals[row * g..(row + 1) * g]);
        }
        self.distances.resize(self.unled.len(), 0.0);
        policy.distances(&self.states, &self.goals, &mut self.distances, &mut self.scratch);
        for (row, distance) in self.unled.iter().zip(&self.distances) {
            if *distance > LEAST_LED_STEPS {
                batch.actor_weights[*row] = 0.0;
            }
        }
    }

    /// Collects the paths for the pairs of `batch` from row `first` on.
    fn collect(&mut self, spec: &Spec, known: &KnownDistances, batch: &Batch, first: usize) {
        [&mut self.states, &mut self.goals].into_iter().for_each(Vec::clear);
        self.paths.clear();
        let (s, g, places) = (spec.state_dim(), spec.goal_dim(), known.goals.len());
        let DistancesByGoal { places: ends_at, goals, steps, waypoints, .. } = known.by_goal;
        let least = if self.waypoints { LEAST_LED_STEPS } else { LEAST_BOUND_STEPS };
        let mut ends = (Vec::new(), Vec::new());
        for row in (first..batch.len()).filter(|row| batch.bootstrap[*row] > 0.0) {
            let (state, goal) =
                (&batch.states[row * s..(row + 1) * s], &batch.goals[row * g..(row + 1) * g]);
            let at: Vec<f32> = spec.achieved(state).collect();
            let (Some((a, _)), Some((b, _))) = (known.goals.nearest(&at), goals.nearest(goal))
            else {
                return;
            };
            let (steps, waypoint) = (steps[b * places + a], waypoints[b * places + a]);
            if steps.is_finite() && steps >= least {
                let b = ends_at[b] as usize;
                self.paths.push(Path { row, steps, waypoint });
                self.states.extend(state);
                self.goals.extend(known.goals.goal(a));
                ends.0.extend(&known.states[b * s..(b + 1) * s]);
                ends.1.extend(goal);
            }
        }
        self.states.append(&mut ends.0);
        self.goals.append(&mut ends.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::data::goal_index::GoalIndex;

    /// D is the straight line, but with a wall at 50.
    struct Line;

    impl Policy for Line {
        fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
            let behind_wall =
                |s: &f32, g: &f32| if (*s < 50.0) == (*g < 50.0) { 0.0 } else { 300.0 };
            let pairs = states.iter().zip(goals);
            out.iter_mut()
                .zip(pairs)
                .for_each(|(d, (s, g))| *d = (s - g).abs() + behind_wall(s, g));
        }

        fn actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}
    }

    /// Places at 10, 48 and 90 with distances to the last one, and pairs whose goal is 87.
    fn check(settings: &LearnSettings, expected: impl Fn(&Batch)) {
        let spec = positions(&[(50.0, 50.0)]);
        let states = [10.0, 48.0, 90.0];
        let mut goals = GoalIndex::new(&spec);
        states.iter().for_each(|place| goals.push(&[*place]));
        let mut last = GoalIndex::new(&spec);
        last.push(&[90.0]);
        let by_goal = DistancesByGoal {
            places: vec![2],
            goals: last,
            steps: vec![82.0, 44.0, 0.0],
            waypoints: vec![1, 2, 2],
            checked: 0,
            nearest_checked: vec![],
            pairs: vec![0, 1],
            near: 0,
            hop_steps: 0.0,
        };
        let known =
            KnownDistances { states: &states, goals: &goals, by_goal: &by_goal, changed: None };
        let from = [12.0, 12.0, 51.0, 88.0, 16.0, 12.0];
        let mut batch = Batch {
            states: from.to_vec(),
            goals: vec![87.0; 6],
            actor_goals: vec![87.0; 6],
            actor_weights: vec![1.0; 6],
            bound: vec![1e9, 1e9, 1e9, 1e9, 60.0, 1e9],
            lower: vec![0.0, 100.0, 0.0, 0.0, 0.0, 0.0],
            bootstrap: vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.0],
            steps: vec![0.0; 6],
            ..Batch::default()
        };
        let mut paths = GraphPaths::new(settings).expect("paths are wanted");
        paths.apply(&spec, &Line, &known, &mut batch, 1);
        expected(&batch);
    }

    #[test]
    fn far_pairs_are_bounded_by_the_path_through_the_graph() {
        let settings = LearnSettings { actor_waypoints: false, ..LearnSettings::default() };
        check(&settings, |batch| {
            let through = 2.0 + 82.0 + 3.0;
            // The nearest candidate of the third row is behind the wall; the fourth is near its
            // goal.
            assert_eq!(batch.bound, [1e9, through, 3.0 + 300.0 + 44.0 + 3.0, 1e9, 60.0, 1e9]);
            assert_eq!(batch.lower[1], through, "no higher than the upper bound");
            assert_eq!((&batch.actor_goals, &batch.actor_weights), (&vec![87.0; 6], &vec![1.0; 6]));
        });
    }

    #[test]
    fn the_actor_learns_from_far_pairs_where_a_path_begins_near_the_state_and_ends_near_the_goal() {
        let settings = LearnSettings { graph_bounds: false, ..LearnSettings::default() };
        check(&settings, |batch| {
            // The paths of the third and fifth row begin too far away. The goal of the fourth row is
            // near, and that of the last one was reached.
            assert_eq!(batch.actor_goals, [87.0, 48.0, 87.0, 87.0, 87.0, 87.0]);
            assert_eq!(batch.actor_weights, [1.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
            assert_eq!(batch.bound, [1e9, 1e9, 1e9, 1e9, 60.0, 1e9]);
        });
    }

    #[test]
    fn nothing_is_collected_where_neither_is_wanted() {
        let settings = LearnSettings {
            graph_bounds: false,
            actor_waypoints: false,
            ..LearnSettings::default()
        };
        assert!(GraphPaths::new(&settings).is_none());
    }
}
