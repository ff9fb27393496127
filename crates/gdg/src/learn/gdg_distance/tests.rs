//! Gradients against candle's autograd, and the same results on any number of threads.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{D, Device, Tensor};
use rand::{RngExt, SeedableRng};

use super::objective::{ACTOR, MODEL};
use super::*;
use crate::learn::Learner;
use crate::learn::networks::export::NamedTensor;
use crate::learn::networks::policy::Scratch;
use crate::learn::settings::Backend;
use crate::learn::update::autograd::{assert_close, random_state, spec, variables_of};
use crate::learn::update::losses::EXCESS_WEIGHT;
use crate::learn::update::profile::Profile;
use crate::learn::update::reference::{Layers, Reference, mlp, pair_rows};
use crate::learn::update::straight::typical_step;
use crate::settings::Preset;
use crate::store::Store;

fn batch(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Batch {
    let mut batch =
        Batch { steps: vec![0.0; rows], bootstrap: vec![0.0; rows], ..Batch::default() };
    (batch.bound, batch.lower) = (vec![0.0; rows], vec![0.0; rows]);
    for _ in 0..rows {
        batch.states.extend(random_state(spec, rng));
        let goal = random_state(spec, rng);
        batch.goals.extend(spec.achieved(&goal));
        batch.bootstrap_states.extend(random_state(spec, rng));
        batch.from.extend(random_state(spec, rng));
        batch.actions.extend((0..spec.action_dim).map(|_| rng.random_range(-1.0..1.0f32)));
        batch.next.extend(random_state(spec, rng));
    }
    batch.actor_goals.clone_from(&batch.goals);
    batch.actor_weights.resize(batch.len(), 1.0);
    batch
}

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
    let reference =
        Reference::with_parameters(shapes, vec![model, actor.clone()], Layers::Linear).unwrap();
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
fn gradients_match_autograd() {
    check(&spec(2, 2, true), &LearnSettings::default());
    check(&spec(2, 2, true), &LearnSettings::of(Preset::Paper));
    check(&spec(10, 3, false), &settings(33, 24, 2));
    check(&spec(5, 3, true), &settings(70, 24, 2));
}

#[test]
fn gradients_of_odd_sizes_batch_one_and_an_actor_beyond_its_bound_match_autograd() {
    for (batch, hidden, layers) in [(1, 16, 1), (3, 7, 2), (37, 33, 3), (129, 40, 2)] {
        check(&spec(4, 2, true), &settings(batch, hidden, layers));
    }
    check(&spec(4, 2, true), &LearnSettings { actor_bound: 0.05, ..settings(40, 32, 2) });
}

#[test]
fn updates_are_the_same_on_any_number_of_threads_and_after_a_restart() {
    let (spec, settings) = (spec(2, 2, true), settings(130, 32, 2));
    let state = |learner: &GdgDistance| {
        let mut store = Store::default();
        learner.save(&mut store).unwrap();
        store
    };
    let states = [1, 2, 3].map(|threads| {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut learner = GdgDistance::new(&spec, &settings, threads, &mut rng).unwrap();
        for update in 0..30 {
            if update == 11 && threads == 3 {
                let saved = state(&learner);
                learner = GdgDistance::new(&spec, &settings, 1, &mut ChaCha8Rng::seed_from_u64(99))
                    .unwrap();
                learner.load(&saved).unwrap();
            }
            update_on(&learner, &batch(&spec, 130, &mut rng));
        }
        state(&learner)
    });
    assert!(states[0] == states[1] && states[0] == states[2]);
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

#[test]
fn distances_are_straight_lines_before_any_update() {
    let spec = spec(4, 2, true);
    let learner =
        GdgDistance::new(&spec, &settings(40, 16, 2), 1, &mut ChaCha8Rng::seed_from_u64(3))
            .unwrap();
    let (states, goals) = ([9.0, 1.0, 2.0, 9.0, 5.0, 0.5, 0.5, 5.0], [4.0, 6.0, 0.5, 0.5]);
    let mut out = [9.0; 2];
    learner.policy(true).unwrap().distances(&states, &goals, &mut out, &mut Scratch::default());
    // The achieved goal's components change by .6 and .8 a step.
    assert!((out[0] - 5.0 / 0.7).abs() < 1e-5 && out[1] == 0.0, "{out:?}");
}

#[test]
fn other_backends_are_refused_by_name() {
    let settings = LearnSettings { backend: Backend::Tape, ..LearnSettings::default() };
    let refused =
        (KIND.create)(&spec(2, 2, true), &settings, 1.into(), &mut ChaCha8Rng::seed_from_u64(1));
    let message = refused.err().unwrap().to_string();
    assert!(message.contains("gdg-distance") && message.contains("backend=fused"), "{message}");
}
