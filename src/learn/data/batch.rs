//! Training batches drawn from the replay: pairs, their goals, and bounds on their distances.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::replay::{Moment, Replay};
use crate::learn::settings::LearnSettings;

/// Minimum n-step horizon of targets while relearning distances that have grown: each update raises them by at most
/// this much.
pub(crate) const RELEARN_N_STEP: usize = 20;

/// Lower bound on a distance that the bridge graph knows, as a multiple of the graph's distance ...
pub(crate) const GRAPH_LOWER_FACTOR: f32 = 0.6;

/// ... less this many steps: while few paths are known, those through the graph make long detours between near places.
pub(crate) const GRAPH_LOWER_SLACK_STEPS: f32 = 6.0;

/// Training data of one update.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// States s of the pairs, `(batch, state_dim)`.
    pub states: Vec<f32>,
    /// Goals g of the pairs, `(batch, goal_dim)`.
    pub goals: Vec<f32>,
    /// The states from which targets bootstrap, `(batch, state_dim)`.
    pub bootstrap_states: Vec<f32>,
    /// Steps from s to the state ahead, or to the goal, `(batch)`.
    pub steps: Vec<f32>,
    /// 1 where the target adds D'(ahead, g), 0 where the goal was reached, `(batch)`.
    pub bootstrap: Vec<f32>,
    /// Upper bound of the target, `(batch)`; infinite if unknown.
    pub bound: Vec<f32>,
    /// Lower bound of the target, no higher than the upper one, `(batch)`; 0 if unknown.
    pub lower: Vec<f32>,
    /// Whether targets are capped at the actor's one-step lookahead (see [`LearnSettings::greedy_targets`]).
    pub greedy_targets: bool,
    /// States of the dynamics model's transitions, `(batch, state_dim)`.
    pub from: Vec<f32>,
    /// Actions of these transitions, `(batch, action_dim)`.
    pub actions: Vec<f32>,
    /// Next states of these transitions, `(batch, state_dim)`.
    pub next: Vec<f32>,
}

impl Batch {
    /// Returns the number of pairs.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Returns whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Replaces pair `i` with one that is `steps` apart along the bridge graph (distillation).
    ///
    /// A path through the graph exists, so its length is an upper bound. A part of it is a lower bound, which raises D
    /// where it is far too short. In between, the actor's one-step lookahead decides: if D followed the graph, it would
    /// inherit the graph's detours, and so would the next graph, whose edges are as long as D says.
    pub fn set_graph_distance(&mut self, i: usize, state: &[f32], goal: &[f32], steps: f32) {
        self.states[i * state.len()..(i + 1) * state.len()].copy_from_slice(state);
        self.bootstrap_states[i * state.len()..(i + 1) * state.len()].copy_from_slice(state);
        self.goals[i * goal.len()..(i + 1) * goal.len()].copy_from_slice(goal);
        self.steps[i] = 0.0;
        self.bootstrap[i] = 1.0;
        self.bound[i] = steps;
        self.lower[i] = (GRAPH_LOWER_FACTOR * steps - GRAPH_LOWER_SLACK_STEPS).max(0.0);
    }

    fn clear(&mut self) {
        for numbers in
            [&mut self.states, &mut self.goals, &mut self.bootstrap_states, &mut self.from, &mut self.actions]
        {
            numbers.clear();
        }
        for numbers in [&mut self.next, &mut self.steps, &mut self.bootstrap, &mut self.bound, &mut self.lower] {
            numbers.clear();
        }
    }
}

/// Draws batches according to the settings.
#[derive(Clone, Debug)]
pub struct BatchSampler {
    spec: Spec,
    settings: LearnSettings,
}

impl BatchSampler {
    /// Creates a sampler for an environment of `spec`.
    pub fn new(spec: &Spec, settings: &LearnSettings) -> Self {
        Self { spec: spec.clone(), settings: settings.clone() }
    }

    /// Refills `batch`. While relearning distances that have `grown`, targets follow the behaviour alone, over many
    /// steps.
    pub fn sample(&self, replay: &Replay, grown: bool, rng: &mut ChaCha8Rng, batch: &mut Batch) {
        batch.clear();
        batch.greedy_targets = self.settings.greedy_targets && !grown;
        let n_step = if grown { RELEARN_N_STEP.max(self.settings.n_step) } else { self.settings.n_step };
        for _ in 0..self.settings.batch_size {
            let (moment, left) = replay.sample(rng);
            let bound = self.push_goal(replay, moment, left, rng, &mut batch.goals);
            let state = replay.state(moment);
            let goal = &batch.goals[batch.goals.len() - self.spec.goal_dim()..];
            let (steps, reached) = self.look_ahead(replay, moment, n_step.min(left), goal);
            batch.states.extend(state);
            batch.bootstrap_states.extend(replay.state(later(moment, steps)));
            batch.steps.push(steps as f32);
            batch.bootstrap.push(if reached { 0.0 } else { 1.0 });
            batch.bound.push(if self.settings.hindsight_bound { bound } else { f32::INFINITY });
            batch.lower.push(0.0);
            batch.from.extend(state);
            batch.actions.extend(replay.action(moment));
            batch.next.extend(replay.state(later(moment, 1)));
        }
    }

    /// Chooses a goal for `moment`; returns the number of steps in which it was reached, infinite if unknown.
    fn push_goal(
        &self,
        replay: &Replay,
        moment: Moment,
        left: usize,
        rng: &mut ChaCha8Rng,
        goals: &mut Vec<f32>,
    ) -> f32 {
        let kind: f32 = rng.random();
        if kind < self.settings.goal_hindsight {
            let ahead = self.hindsight_steps(left, rng);
            goals.extend(self.spec.achieved(replay.state(later(moment, ahead))));
            return ahead as f32;
        }
        if kind < self.settings.goal_hindsight + self.settings.goal_random {
            goals.extend(self.spec.achieved(replay.state(replay.sample_any(rng))));
        } else {
            goals.extend(replay.goal(moment));
        }
        f32::INFINITY
    }

    /// Draws how many steps ahead a hindsight goal lies, from 1 to `left`.
    fn hindsight_steps(&self, left: usize, rng: &mut ChaCha8Rng) -> usize {
        let geometric = rng.random::<f32>() < self.settings.goal_geometric;
        let mean = self.settings.goal_geometric_mean_steps;
        if geometric && mean > 1.0 {
            let u: f32 = 1.0 - rng.random::<f32>();
            return (1 + (u.ln() / (1.0 - 1.0 / mean).ln()) as usize).min(left);
        }
        if geometric { 1 } else { rng.random_range(1..=left) }
    }

    /// Returns the number of steps from `moment` to the state ahead, at most `last`, and whether the goal is reached
    /// there: the n-step return is truncated at the goal and at the end of the episode. d = 0 if the state is already
    /// at the goal (Algorithm 1).
    fn look_ahead(&self, replay: &Replay, moment: Moment, last: usize, goal: &[f32]) -> (usize, bool) {
        let reached = (0..=last).find(|k| self.spec.reached(replay.state(later(moment, *k)), goal));
        reached.map_or((last, false), |steps| (steps, true))
    }
}

fn later(moment: Moment, steps: usize) -> Moment {
    Moment { slot: moment.slot + steps as u64, ..moment }
}
