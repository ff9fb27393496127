//! Gradients against candle's autograd, and the same results on any number of threads.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{D, Device, Tensor};
use rand::SeedableRng;

use super::objective::{ACTOR, MODEL};
use super::*;
use crate::learn::Learner;
use crate::learn::networks::export::NamedTensor;
use crate::learn::update::autograd::{assert_close, batch, spec, variables_of};
use crate::learn::update::losses::EXCESS_WEIGHT;
use crate::learn::update::profile::Profile;
use crate::learn::update::reference::{Reference, mlp, pair_rows};
use crate::learn::update::straight::typical_step;
use crate::settings::Preset;

fn update_on(learner: &GdgDistance, batch: &Batch) {
    learner.training.batch().write().clone_from(batch);
    learner.training.update(None, &mut Profile::default()).unwrap();
}

fn check(spec: &Spec, settings: &LearnSettings) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let learner = GdgDistance::new(spec, settings, 2, &mut rng).unwrap();
    for _ in 0..20 {
        update_on(&learner, &batch(spec, settings.batch_size, &mut rng));
    }
    let batch = batch(spec, settings.batch_size, &mut rng);
    let losses = learner.training.compute_gradients(&batch).unwrap();

    let tensor = |numbers: &[f32], width: usize| {
        Tensor::from_slice(numbers, (batch.len(), width), &Device::Cpu).unwrap()
    };
    let (states, goals) =
        (tensor(&batch.states, spec.state_dim()), tensor(&batch.goals, spec.goal_dim()));
    let (from, next) =
        (tensor(&batch.from, spec.state_dim()), tensor(&batch.next, spec.state_dim()));
    let shapes = &learner.training.objective().shapes;
    let variables = |k: usize| variables_of(learner.training.network(k), &shapes.encoder);
    let ((model, model_vars), (actor, actor_vars)) = (variables(MODEL), variables(ACTOR));
    let reference = Reference::with_parameters(shapes, vec![model, actor.clone()]).unwrap();
    let model_loss =
        reference.model_loss(&from, &tensor(&batch.actions, spec.action_dim), &next).unwrap();
    assert_close("model", learner.training.full_gradient(MODEL), &model_loss, &model_vars);

    let indices: Vec<u32> = spec.achieved.iter().map(|i| *i as u32).collect();
    let after =
        reference.predictions(&states, &reference.actions(&states, &goals).unwrap()).unwrap();
    let left = (after.index_select(&Tensor::new(indices, &Device::Cpu).unwrap(), 1).unwrap()
        - &goals)
        .unwrap();
    let steps = left.sqr().unwrap().sum(D::Minus1).unwrap().sqrt().unwrap().mean_all().unwrap();
    let steps = (steps / f64::from(typical_step(spec))).unwrap();
    let rows = pair_rows(&shapes.encoder, &actor, &states, &goals).unwrap();
    let outputs = mlp(&shapes.actor, &actor.dense, &rows).unwrap().abs().unwrap();
    let excess = (outputs - f64::from(shapes.actor_bound)).unwrap().relu().unwrap().sqr().unwrap();
    let excess =
        (excess.sum(D::Minus1).unwrap().mean_all().unwrap() * f64::from(EXCESS_WEIGHT)).unwrap();
    let whole =
        if shapes.actor_bound.is_finite() { (&steps + excess).unwrap() } else { steps.clone() };
    assert_close("actor", learner.training.full_gradient(ACTOR), &whole, &actor_vars);

    let expected = [&model_loss, &steps].map(|loss| loss.to_scalar::<f32>().unwrap());
    let close = |a: f32, b: f32| (a - b).abs() < 2e-4 * b.abs() + 1e-5;
    assert!(
        close(losses.model, expected[0]) && close(losses.actor, expected[1]),
        "{losses:?} instead of {expected:?}"
    );
}

fn settings(batch: usize, hidden: usize, layers: usize) -> LearnSettings {
    LearnSettings { batch_size: batch, hidden, layers, ..LearnSettings::default() }
}

#[test]
fn gradients_match_autograd_whatever_the_settings() {
    check(&spec(2, 2, true), &LearnSettings::default());
    check(&spec(2, 2, true), &LearnSettings::of(Preset::Paper));
    check(&spec(10, 3, false), &settings(33, 24, 2));
    check(&spec(5, 3, true), &settings(70, 24, 2));
    check(&spec(4, 2, true), &LearnSettings { actor_bound: 0.05, ..settings(40, 32, 2) });
    for (batch, hidden, layers) in [(1, 16, 1), (3, 7, 2), (37, 33, 3), (129, 40, 2)] {
        check(&spec(4, 2, true), &settings(batch, hidden, layers));
    }
}

#[test]
fn the_exported_actor_is_the_averaged_one() {
    let spec = spec(4, 2, false);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let learner = GdgDistance::new(&spec, &settings(40, 16, 2), 1, &mut rng).unwrap();
    for _ in 0..10 {
        update_on(&learner, &batch(&spec, 40, &mut rng));
    }
    let biases = |averaged: bool| {
        let export = learner.export_actor(averaged).unwrap().unwrap();
        let NamedTensor { name, values, .. } = export.tensors.last().unwrap().clone();
        assert_eq!(name, "output.bias");
        values
    };
    let shape = learner.training.objective().shapes.actor;
    assert_eq!(biases(true), learner.training.actor().copy(true).unwrap().0[shape.output_bias()]);
    assert_ne!(biases(true), biases(false));
}
