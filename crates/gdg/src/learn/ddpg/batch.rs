//! Transitions drawn from the replay, with goals relabelled in hindsight.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::returns::Returns;
use crate::env::Spec;
use crate::learn::data::batch::{BatchSampler, later};
use crate::learn::data::replay::Replay;
use crate::learn::settings::LearnSettings;

/// Training data of one update.
#[derive(Clone, Debug, Default)]
pub struct Transitions {
    /// `(batch, state_dim)`.
    pub states: Vec<f32>,
    /// `(batch, action_dim)`.
    pub actions: Vec<f32>,
    /// `(batch, state_dim)`.
    pub next: Vec<f32>,
    /// `(batch, goal_dim)`.
    pub goals: Vec<f32>,
    /// `(batch)`.
    pub rewards: Vec<f32>,
    /// Whether the next state reaches the goal, which ends the task, `(batch)`. The end of an
    /// episode does not.
    pub at_goal: Vec<bool>,
    /// Noise on the actions of targets, `(batch, action_dim)`.
    pub noise: Vec<f32>,
}

/// The noise on the actions of targets is clipped at this many standard deviations (Fujimoto et al.
/// 2018, section 5.3).
pub const MAX_NOISE_DEVIATIONS: f32 = 2.5;

impl Transitions {
    /// Returns the number of transitions.
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    fn clear(&mut self) {
        for numbers in [
            &mut self.states,
            &mut self.actions,
            &mut self.next,
            &mut self.goals,
            &mut self.rewards,
        ] {
            numbers.clear();
        }
        self.at_goal.clear();
        self.noise.clear();
    }
}

/// Draws transitions according to the settings.
#[derive(Clone, Debug)]
pub struct Sampler {
    spec: Spec,
    returns: Returns,
    batch_size: usize,
    /// Standard deviation of the noise on the actions of targets.
    target_noise: f32,
    goals: BatchSampler,
}

impl Sampler {
    /// Creates a sampler for an environment of `spec` that relabels goals if `hindsight`.
    pub fn new(spec: &Spec, settings: &LearnSettings, returns: Returns, hindsight: bool) -> Self {
        let pursued = LearnSettings { goal_hindsight: 0.0, goal_random: 0.0, ..settings.clone() };
        let goals = BatchSampler::new(spec, if hindsight { settings } else { &pursued });
        let LearnSettings { batch_size, target_noise, .. } = *settings;
        Self { spec: spec.clone(), returns, batch_size, target_noise, goals }
    }

    /// Refills `batch`. Rewards, and whether the task is over, follow from the goal that was
    /// chosen.
    pub fn sample(&self, replay: &Replay, rng: &mut ChaCha8Rng, batch: &mut Transitions) {
        batch.clear();
        for _ in 0..self.batch_size {
            let (moment, left) = replay.sample(rng);
            self.goals.push_goal(replay, moment, left, rng, &mut batch.goals);
            let goal = &batch.goals[batch.goals.len() - self.spec.goal_dim()..];
            let next = replay.state(later(moment, 1));
            batch.rewards.push(self.returns.reward(&self.spec, next, goal));
            batch.at_goal.push(self.spec.reached(next, goal));
            batch.states.extend(replay.state(moment));
            batch.actions.extend(replay.action(moment));
            batch.next.extend(next);
            for _ in 0..self.spec.action_dim {
                // Without noise, draws nothing, so that batches are the same as before the setting
                // existed.
                let noise: f32 =
                    if self.target_noise > 0.0 { StandardNormal.sample(rng) } else { 0.0 };
                batch.noise.push(
                    self.target_noise * noise.clamp(-MAX_NOISE_DEVIATIONS, MAX_NOISE_DEVIATIONS),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::returns::Reward;
    use super::*;
    use crate::env::tests::positions;
    use crate::learn::ReplaySizes;

    /// Positions on a line, and a replay of two walks of ten steps along it towards 30, which time
    /// ends.
    fn line() -> (Spec, Replay) {
        let spec = Spec { goal_radius: 1.5, ..positions(&[(50.0, 50.0)]) };
        let mut replay = Replay::new(ReplaySizes::all(1), 1, 200);
        for start in [0.0, 20.0] {
            (0..10).for_each(|i| replay.push(0, &[start + i as f32], &[1.0], &[30.0]));
            replay.end_episode(0, &[start + 10.0]);
        }
        (spec, replay)
    }

    fn sample(goal_hindsight: f32, hindsight: bool, reward: Reward) -> Transitions {
        let (spec, replay) = line();
        let settings = LearnSettings {
            batch_size: 2_000,
            goal_hindsight,
            goal_geometric: 0.0,
            goal_random: 0.0,
            ..LearnSettings::default()
        };
        let sampler = Sampler::new(&spec, &settings, Returns::new(reward, 0.99, &spec), hindsight);
        let mut batch = Transitions::default();
        sampler.sample(&replay, &mut ChaCha8Rng::seed_from_u64(1), &mut batch);
        batch
    }

    #[test]
    fn relabelled_goals_lie_in_the_future_and_relabel_reward_and_end() {
        let batch = sample(0.8, true, Reward::Sparse);
        let (mut relabelled, mut ends) = (0, 0);
        for i in 0..batch.len() {
            let (state, next, goal) = (batch.states[i], batch.next[i], batch.goals[i]);
            assert_eq!(next, state + 1.0);
            let ahead = goal - state;
            let same_walk = (state < 15.0) == (goal < 15.0);
            let later = (1.0..=10.0).contains(&ahead) && same_walk;
            assert!(goal == 30.0 || later, "{state} to {goal}");
            assert_eq!(batch.at_goal[i], (next - goal).abs() < 1.5, "{state} to {goal}");
            assert_eq!(batch.rewards[i], -1.0);
            relabelled += usize::from(goal < 30.0);
            ends += usize::from(batch.at_goal[i] && goal < 30.0);
        }
        // Some of those relabelled get 30, where the second walk ends: H(10) / 10 of its moments.
        assert!((1_280..1_450).contains(&relabelled), "{relabelled}");
        assert!(ends > 300, "{ends}");
    }

    #[test]
    fn target_noise_has_its_deviation_and_is_clipped() {
        assert!(sample(0.8, true, Reward::Sparse).noise.iter().all(|noise| *noise == 0.0));
        let (spec, replay) = line();
        let settings =
            LearnSettings { batch_size: 4_000, target_noise: 0.2, ..LearnSettings::default() };
        let sampler =
            Sampler::new(&spec, &settings, Returns::new(Reward::Sparse, 0.99, &spec), true);
        let mut batch = Transitions::default();
        sampler.sample(&replay, &mut ChaCha8Rng::seed_from_u64(1), &mut batch);
        let square = batch.noise.iter().map(|noise| noise * noise).sum::<f32>() / 4_000.0;
        assert!((square.sqrt() - 0.195).abs() < 0.01, "{}", square.sqrt());
        let largest = batch.noise.iter().fold(0.0, |most: f32, noise| most.max(noise.abs()));
        assert!((0.48..=0.5).contains(&largest), "{largest}");
    }

    #[test]
    fn without_hindsight_goals_are_those_pursued_and_the_end_of_an_episode_is_not_the_end() {
        let batch = sample(0.8, false, Reward::Distance);
        for i in 0..batch.len() {
            assert_eq!(batch.goals[i], 30.0);
            assert_eq!(batch.rewards[i], -(30.0 - batch.next[i]).abs());
            // The first walk ends far from the goal: time was up.
            assert_eq!(batch.at_goal[i], batch.next[i] >= 29.0, "{}", batch.next[i]);
        }
        assert!(batch.next.contains(&10.0));
    }
}
