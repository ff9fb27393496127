//! Upper bounds on the targets of far pairs: paths through the bridge graph.
//!
//! Distillation bounds pairs of candidates. Between them, D is not bound to follow: on big maps, far distances of other
//! pairs stay a third too long. Each far pair (s, g) of a batch is bounded by D'(s, a) + d(a, b) + D'(b, g), with a the
//! candidate nearest to s, b the one nearest to g whose distances are known, and d the graph's distance. D' says how far
//! it really is to them, also where straight lines cross a wall.

use crate::env::Spec;
use crate::learn::data::batch::Batch;
use crate::learn::learner::{DistancesByGoal, KnownDistances};
use crate::learn::networks::policy::{Policy, Scratch};

/// Least distance along the graph of the pairs that are bounded, in steps: D of near pairs is better than the graph's.
pub(crate) const LEAST_STEPS: f32 = 20.0;

/// Finds the bounds, and keeps the buffers.
#[derive(Default)]
pub struct GraphBounds {
    /// The rows of the batch that may be bounded, and the steps between their candidates.
    rows: Vec<(usize, f32)>,
    states: Vec<f32>,
    goals: Vec<f32>,
    distances: Vec<f32>,
    scratch: Scratch,
}

impl GraphBounds {
    /// Collects the pairs of `batch` from row `first` on that are far apart along the graph.
    pub fn collect(&mut self, spec: &Spec, known: &KnownDistances, batch: &Batch, first: usize) {
        [&mut self.states, &mut self.goals].into_iter().for_each(Vec::clear);
        self.rows.clear();
        let Some(by_goal) = known.by_goal else { return };
        let (s, g, places) = (spec.state_dim(), spec.goal_dim(), known.goals.len());
        let DistancesByGoal { places: ends_at, goals, steps } = by_goal;
        let mut ends = (Vec::new(), Vec::new());
        for row in (first..batch.len()).filter(|row| batch.bootstrap[*row] > 0.0) {
            let (state, goal) = (&batch.states[row * s..(row + 1) * s], &batch.goals[row * g..(row + 1) * g]);
            let at: Vec<f32> = spec.achieved(state).collect();
            let (Some((a, _)), Some((b, _))) = (known.goals.nearest(&at), goals.nearest(goal)) else { return };
            let steps = steps[b * places + a];
            if steps.is_finite() && steps >= LEAST_STEPS && steps < batch.bound[row] {
                let b = ends_at[b] as usize;
                self.rows.push((row, steps));
                self.states.extend(state);
                self.goals.extend(known.goals.goal(a));
                ends.0.extend(&known.states[b * s..(b + 1) * s]);
                ends.1.extend(goal);
            }
        }
        self.states.append(&mut ends.0);
        self.goals.append(&mut ends.1);
    }

    /// Bounds the targets of the pairs collected; `policy` gives D'.
    pub fn apply(&mut self, policy: &dyn Policy, batch: &mut Batch) {
        let count = self.rows.len();
        self.distances.resize(2 * count, 0.0);
        policy.distances(&self.states, &self.goals, &mut self.distances, &mut self.scratch);
        let (to_graph, from_graph) = self.distances.split_at(count);
        for ((row, between), (before, after)) in self.rows.iter().zip(to_graph.iter().zip(from_graph)) {
            let bound = &mut batch.bound[*row];
            *bound = bound.min(before + between + after);
            batch.lower[*row] = batch.lower[*row].min(*bound);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::data::goal_index::GoalIndex;

    /// D is the straight line, and far longer across the wall at 50.
    struct Line;

    impl Policy for Line {
        fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
            let across = |s: f32, g: f32| if (s < 50.0) == (g < 50.0) { 0.0 } else { 300.0 };
            out.iter_mut().zip(states.iter().zip(goals)).for_each(|(d, (s, g))| *d = (s - g).abs() + across(*s, *g));
        }

        fn actions(&self, _: &[f32], _: &[f32], out: &mut [f32], _: &mut Scratch) {
            out.fill(0.0);
        }

        fn improve_actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}
    }

    #[test]
    fn far_pairs_are_bounded_by_the_way_to_a_candidate_through_the_graph_and_on() {
        let spec = positions(&[(50.0, 50.0)]);
        let states = [10.0, 48.0, 90.0];
        let mut goals = GoalIndex::new(&spec);
        states.iter().for_each(|state| goals.push(&[*state]));
        // To the last place only.
        let mut last = GoalIndex::new(&spec);
        last.push(&[90.0]);
        let by_goal = DistancesByGoal { places: vec![2], goals: last, steps: vec![82.0, 44.0, 0.0] };
        let known =
            KnownDistances { states: &states, goals: &goals, pairs: &[], by_goal: Some(&by_goal), changed: None };
        let from = [12.0, 12.0, 51.0, 88.0, 12.0, 12.0];
        let mut batch = Batch {
            states: from.to_vec(),
            goals: vec![87.0; 6],
            bound: vec![1e9, 1e9, 1e9, 1e9, 60.0, 1e9],
            lower: vec![0.0, 100.0, 0.0, 0.0, 0.0, 0.0],
            bootstrap: vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.0],
            steps: vec![1.0; 6],
            ..Batch::default()
        };
        let mut bounds = GraphBounds::default();
        bounds.collect(&spec, &known, &batch, 1);
        bounds.apply(&Line, &mut batch);
        let through = 2.0 + 82.0 + 3.0;
        // The nearest candidate of the third row is behind the wall; the fourth is near its goal.
        assert_eq!(batch.bound, [1e9, through, 3.0 + 300.0 + 44.0 + 3.0, 1e9, 60.0, 1e9]);
        assert_eq!(batch.lower[1], through, "no higher than the upper bound");
        bounds.collect(&spec, &KnownDistances { by_goal: None, ..known }, &batch, 0);
        bounds.apply(&Line, &mut batch);
        assert_eq!(batch.bound[0], 1e9, "nothing is known");
    }
}
