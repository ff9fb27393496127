//! Gradients against candle's autograd.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{D, Device, Tensor};
use rand::{RngExt, SeedableRng};

use super::*;
use crate::learn::networks::network::Network;
use crate::learn::update::autograd::{assert_close, random_state, spec, variables_of};
use crate::learn::update::losses::EXCESS_WEIGHT;
use crate::learn::update::profile::Profile;
use crate::learn::update::reference::{Parameters, mlp, pair_rows};
use crate::settings::Preset;

/// Updates before gradients are compared: target networks start equal to the networks.
const UPDATES_BEFORE: usize = 20;

fn transitions(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Transitions {
    let mut batch = Transitions::default();
    for i in 0..rows {
        batch.states.extend(random_state(spec, rng));
        batch.next.extend(random_state(spec, rng));
        let goal = random_state(spec, rng);
        batch.goals.extend(spec.achieved(&goal));
        batch.actions.extend((0..spec.action_dim).map(|_| rng.random_range(-1.0..1.0f32)));
        // Some targets are beyond the possible range.
        batch.rewards.push(if i % 5 == 4 { 3.0 } else { -0.5 * (i % 3) as f32 });
        batch.at_goal.push(i % 4 == 1);
        batch.noise.extend((0..spec.action_dim).map(|_| rng.random_range(-0.5..0.5f32)));
    }
    batch
}

/// Returns a network's parameters or their averages.
fn parameters_of(learner: &Ddpg, network: &Network, averaged: bool) -> Parameters {
    let encoder = &learner.training.objective().encoder;
    Parameters::copied(network, encoder, averaged).unwrap()
}

/// The learner's losses in candle's operations.
struct Oracle<'a> {
    shapes: &'a Shapes,
    states: Tensor,
    next: Tensor,
    goals: Tensor,
    actions: Tensor,
    batch: &'a Transitions,
}

impl<'a> Oracle<'a> {
    fn new(shapes: &'a Shapes, batch: &'a Transitions) -> Self {
        let spec = shapes.encoder.spec();
        let tensor = |numbers: &[f32], width: usize| {
            Tensor::from_slice(numbers, (batch.len(), width), &Device::Cpu)
        };
        Self {
            shapes,
            states: tensor(&batch.states, spec.state_dim()).unwrap(),
            next: tensor(&batch.next, spec.state_dim()).unwrap(),
            goals: tensor(&batch.goals, spec.goal_dim()).unwrap(),
            actions: tensor(&batch.actions, spec.action_dim).unwrap(),
            batch,
        }
    }

    fn values(&self, critic: &Parameters, states: &Tensor, actions: &Tensor) -> Tensor {
        let rows = pair_rows(&self.shapes.encoder, critic, states, &self.goals).unwrap();
        let rows = Tensor::cat(&[&rows, actions], 1).unwrap();
        mlp(&self.shapes.critic, &critic.dense, &rows).unwrap().squeeze(1).unwrap()
    }

    /// The actor's outputs before tanh.
    fn outputs(&self, actor: &Parameters, states: &Tensor) -> Tensor {
        let rows = pair_rows(&self.shapes.encoder, actor, states, &self.goals).unwrap();
        mlp(&self.shapes.actor, &actor.dense, &rows).unwrap()
    }

    fn targets(&self, critics: &[Parameters], actor: &Parameters) -> Tensor {
        let noise =
            Tensor::from_slice(&self.batch.noise, self.actions.shape(), &Device::Cpu).unwrap();
        let actions = (self.outputs(actor, &self.next).tanh().unwrap() + noise)
            .unwrap()
            .clamp(-1.0, 1.0)
            .unwrap();
        let values = critics.iter().map(|critic| self.values(critic, &self.next, &actions));
        let least = values.reduce(|a, b| a.minimum(&b).unwrap()).unwrap();
        let column = |numbers: Vec<f32>| Tensor::new(numbers, &Device::Cpu).unwrap();
        let rest = column(self.batch.at_goal.iter().map(|end| f32::from(u8::from(!end))).collect());
        let returns = &self.shapes.returns;
        let ahead = ((least * rest).unwrap() * f64::from(returns.discount)).unwrap();
        let targets = (&column(self.batch.rewards.clone()) + &ahead).unwrap();
        targets.clamp(returns.lowest, 0.0).unwrap().detach()
    }

    fn critic_loss(&self, critic: &Parameters, targets: &Tensor) -> Tensor {
        let error = (self.values(critic, &self.states, &self.actions) - targets).unwrap();
        error.sqr().unwrap().mean_all().unwrap()
    }

    /// Mean -Q, and all that the actor minimises.
    fn actor_loss(&self, critic: &Parameters, actor: &Parameters) -> (Tensor, Tensor) {
        let outputs = self.outputs(actor, &self.states);
        let cost = self
            .values(critic, &self.states, &outputs.tanh().unwrap())
            .mean_all()
            .unwrap()
            .neg()
            .unwrap();
        let mut all = (&cost
            + (outputs.sqr().unwrap().mean_all().unwrap() * f64::from(self.shapes.actor_l2)))
        .unwrap();
        if self.shapes.actor_bound.is_finite() {
            let excess = (outputs.abs().unwrap() - f64::from(self.shapes.actor_bound))
                .unwrap()
                .relu()
                .unwrap();
            let excess = excess.sqr().unwrap().sum(D::Minus1).unwrap().mean_all().unwrap();
            all = (all + (excess * f64::from(EXCESS_WEIGHT)).unwrap()).unwrap();
        }
        (cost, all)
    }
}

fn update_on(learner: &Ddpg, batch: &Transitions) {
    learner.training.batch().write().clone_from(batch);
    learner.training.update(None, &mut Profile::default()).unwrap();
}

fn check(variant: Variant, spec: &Spec, settings: &LearnSettings) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let learner = Ddpg::new(variant, spec, settings, 2, &mut rng).unwrap();
    for _ in 0..UPDATES_BEFORE {
        update_on(&learner, &transitions(spec, settings.batch_size, &mut rng));
    }
    let batch = transitions(spec, settings.batch_size, &mut rng);
    let training = &learner.training;
    let shapes = training.objective();
    let oracle = Oracle::new(shapes, &batch);
    let at = |averaged: bool| {
        let mut all: Vec<_> =
            training.networks().map(|n| parameters_of(&learner, n, averaged)).collect();
        let actor = all.pop().unwrap();
        oracle.targets(&all, &actor)
    };
    let targets = at(true);
    let [expected, current] =
        [&targets, &at(false)].map(|targets| targets.to_vec1::<f32>().unwrap());
    let apart = expected.iter().zip(&current).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(
        apart > 0.003 || batch.len() == 1,
        "targets at averages and at current weights differ by {apart} only"
    );
    let losses = training.compute_gradients(&batch).unwrap();
    let found: Vec<f32> =
        training.parts().iter().flat_map(|part| part.lock().buffers.targets.clone()).collect();
    for (found, expected) in found.iter().zip(&expected) {
        assert!(
            (found - expected).abs() < 1e-4 * expected.abs() + 1e-5,
            "target {found} instead of {expected}"
        );
    }
    assert!(batch.len() < 5 || found.contains(&0.0), "a target is clipped");
    let mut critic_losses = Vec::new();
    for k in 0..settings.critics {
        let (own, vars) = variables_of(training.network(k), &shapes.encoder);
        let loss = oracle.critic_loss(&own, &targets);
        critic_losses.push(loss.to_scalar::<f32>().unwrap());
        assert_close("critic", training.full_gradient(k), &loss, &vars);
    }
    let (own, vars) = variables_of(training.actor(), &shapes.encoder);
    let (cost, loss) =
        oracle.actor_loss(&parameters_of(&learner, training.network(0), false), &own);
    assert_close("actor", training.full_gradient(settings.critics), &loss, &vars);
    let expected = (
        critic_losses.iter().sum::<f32>() / critic_losses.len() as f32,
        cost.to_scalar::<f32>().unwrap(),
    );
    let close = |a: f32, b: f32| (a - b).abs() < 2e-4 * b.abs() + 1e-5;
    assert!(
        close(losses.critic, expected.0) && close(losses.actor, expected.1),
        "{losses:?} instead of {expected:?}"
    );
}

fn settings(batch: usize, hidden: usize, layers: usize, critics: usize) -> LearnSettings {
    LearnSettings { batch_size: batch, hidden, layers, critics, ..LearnSettings::of(Preset::Tuned) }
}

/// Inputs as the goal-distance learner has them by default.
fn with_our_inputs(settings: &LearnSettings) -> LearnSettings {
    let LearnSettings { fourier_octaves, relative_scales, grid_cells, .. } =
        LearnSettings::default();
    LearnSettings { fourier_octaves, relative_scales, grid_cells, ..settings.clone() }
}

#[test]
fn gradients_match_autograd_whatever_the_settings() {
    for preset in [LearnSettings::of(Preset::Tuned), LearnSettings::of(Preset::Sb3)] {
        for variant in [SPARSE, HINDSIGHT, DISTANCE] {
            check(variant, &spec(2, 2, true), &LearnSettings { batch_size: 96, ..preset.clone() });
        }
    }
    for critics in [1, 2] {
        check(HINDSIGHT, &spec(2, 2, true), &with_our_inputs(&settings(70, 48, 2, critics)));
        check(DISTANCE, &spec(5, 3, true), &with_our_inputs(&settings(40, 24, 2, critics)));
    }
    for (batch, hidden, layers) in [(1, 16, 1), (3, 7, 2), (37, 33, 3), (129, 40, 2)] {
        check(SPARSE, &spec(2, 2, true), &settings(batch, hidden, layers, 2));
    }
    check(SPARSE, &spec(10, 6, false), &settings(33, 24, 2, 1));
    let bounded = LearnSettings { actor_bound: 0.05, actor_l2: 0.0, ..settings(40, 32, 2, 1) };
    check(SPARSE, &spec(2, 2, true), &bounded);
    check(SPARSE, &spec(2, 2, true), &LearnSettings { actor_bound: 0.0, actor_l2: 0.7, ..bounded });
}
