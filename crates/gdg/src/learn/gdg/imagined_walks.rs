//! Walks of the actor that the dynamics model imagines: they find the places at which it gets stuck.
//!
//! Next to a gap in a wall, an actor that is drawn into the gap from one side and out of it from the
//! other comes to rest and, without memory, stays there for ever. Its walks end at such places;
//! agents that explore, with noise and plans, are rarely there. So the walks from some pairs of each
//! batch are imagined, and where one comes to rest away from its goal, the pair begins there (states
//! of the actor's own walks, as in DAgger, Ross et al. 2011, from a model, as in Dyna, Sutton 1990).

use super::graph_paths::LEAST_LED_STEPS;
use crate::env::Spec;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::networks::policy::{Imagine, Scratch};

/// Length of an imagined walk, in steps.
pub(crate) const WALK_STEPS: usize = 30;

/// A walk rests if a step changes every component by at most this share of its change scale ...
pub(crate) const REST_CHANGE: f32 = 0.1;

/// ... at least this far from its goal, in steps.
pub(crate) const LEAST_LEFT_STEPS: f32 = 5.0;

/// Imagines the walks, and keeps the buffers.
#[derive(Default)]
pub struct ImaginedWalks {
    /// Where each walk is, or has ended, `(walks, state_dim)`.
    states: Vec<f32>,
    distances: Vec<f32>,
    /// States, goals and next states of the walks that go on.
    from: Vec<f32>,
    goals: Vec<f32>,
    next: Vec<f32>,
}

impl ImaginedWalks {
    /// Imagines walks from the last pairs of `batch`, and moves the pairs whose walks come to rest.
    pub fn apply(
        &mut self,
        spec: &Spec,
        policy: &dyn Imagine,
        sampler: &BatchSampler,
        batch: &mut Batch,
        scratch: &mut Scratch,
    ) {
        let (s, g, count) = (spec.state_dim(), spec.goal_dim(), sampler.walk_rows(batch));
        let Self { states, distances, from, goals, next } = self;
        if count == 0 {
            return;
        }
        let first = batch.len() - count;
        let all_goals = &batch.goals[first * g..];
        states.clear();
        states.extend(&batch.states[first * s..]);
        distances.resize(count, 0.0);
        policy.distances(states, all_goals, distances, scratch);
        let is_far = |i: &usize| distances[*i] >= LEAST_LED_STEPS;
        let (mut going, mut resting): (Vec<usize>, _) =
            ((0..count).filter(is_far).collect(), Vec::new());
        for _ in 0..WALK_STEPS {
            if going.is_empty() {
                break;
            }
            [&mut *from, goals].into_iter().for_each(Vec::clear);
            for i in &going {
                from.extend(&states[i * s..(i + 1) * s]);
                goals.extend(&all_goals[i * g..(i + 1) * g]);
            }
            policy.step(from, goals, next, scratch);
            let mut steps = from.chunks_exact(s).zip(next.chunks_exact(s));
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
        policy.distances(states, all_goals, distances, scratch);
        for i in resting.into_iter().filter(|i| distances[*i] >= LEAST_LEFT_STEPS) {
            sampler.begin_at(batch, first + i, &states[i * s..(i + 1) * s]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::networks::policy::tests::Line;
    use crate::learn::settings::LearnSettings;

    #[test]
    fn pairs_begin_where_the_actors_walks_come_to_rest_away_from_their_goals() {
        let spec = positions(&[(50.0, 50.0)]);
        let settings = LearnSettings {
            imagined_walks: 5.0 / 6.0,
            distillation: 0.0,
            ..LearnSettings::default()
        };
        let sampler = BatchSampler::new(&spec, &settings);
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
        let policy = Line { wall: 0.0, next: |s, g| (s + (g - s).clamp(-1.0, 1.0)).min(50.0) };
        let mut scratch = Scratch::default();
        ImaginedWalks::default().apply(&spec, &policy, &sampler, &mut batch, &mut scratch);
        assert_eq!(batch.states, [30.0, 50.0, 30.0, 5.0, 30.0, 48.0]);
        assert_eq!(batch.goals, goals);
        assert_eq!(batch.bootstrap_states, [33.0, 50.0, 33.0, 33.0, 33.0, 33.0]);
        assert_eq!((batch.steps[1], batch.bootstrap[1]), (0.0, 1.0), "lookahead decides");
        assert_eq!((batch.bound[1], batch.lower[1]), (f32::INFINITY, 0.0));
        assert_eq!((batch.bound[2], batch.steps[2]), (7.0, 3.0));
    }
}
