//! Gradients against candle's autograd, and the same results on any number of threads.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{D, Device, Tensor, Var};
use rand::{RngExt, SeedableRng};

use super::*;
use crate::learn::kernels::kernel;
use crate::learn::networks::export::NamedTensor;
use crate::learn::update::losses::EXCESS_WEIGHT;
use crate::learn::update::reference::{Layers, Parameters, Reference, mlp, pair_rows};
use crate::learn::update::straight::typical_step;

fn spec(state: usize, axes: usize, positions: bool) -> Spec {
    Spec {
        state_centre: (0..state).map(|i| i as f32 * 0.5).collect(),
        state_half_range: (0..state).map(|i| 3.0 + i as f32).collect(),
        change_scale: (0..state).map(|i| 0.4 + 0.2 * i as f32).collect(),
        achieved: (0..axes).map(|i| (i + 1) % state).collect(),
        action_dim: axes,
        goal_radius: 0.8,
        goals_are_positions: positions,
    }
}

fn batch(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Batch {
    let state = |rng: &mut ChaCha8Rng| -> Vec<f32> {
        let numbers = spec.state_centre.iter().zip(&spec.state_half_range);
        numbers.map(|(c, h)| c + h * rng.random_range(-0.95..0.95)).collect()
    };
    let mut batch = Batch { steps: vec![0.0; rows], bootstrap: vec![0.0; rows], ..Batch::default() };
    (batch.bound, batch.lower) = (vec![0.0; rows], vec![0.0; rows]);
    for _ in 0..rows {
        batch.states.extend(state(rng));
        let goal = state(rng);
        batch.goals.extend(spec.achieved(&goal));
        batch.bootstrap_states.extend(state(rng));
        batch.from.extend(state(rng));
        batch.actions.extend((0..spec.action_dim).map(|_| rng.random_range(-1.0..1.0f32)));
        batch.next.extend(state(rng));
    }
    batch
}

/// Returns a network's parameters as variables, and these.
fn variables_of(learner: &GdgDistance, network: &Network) -> (Parameters, Vec<Var>) {
    let (dense, table) = network.copy(false).unwrap();
    let grid = learner.shared.objective.shapes.encoder.grid();
    let table = grid.map(|grid| Tensor::from_vec(table, (grid.corners(), grid.channels), &Device::Cpu).unwrap());
    let dense = Tensor::new(dense, &Device::Cpu).unwrap();
    let vars: Vec<Var> = std::iter::once(&dense).chain(&table).map(|t| Var::from_tensor(t).unwrap()).collect();
    let table = table.map(|_| vars[1].as_tensor().clone());
    (Parameters { dense: vars[0].as_tensor().clone(), table }, vars)
}

/// Compares a network's gradient on the latest batch with that of `loss`.
fn assert_close(
    (learner, network, touched): (&GdgDistance, &Network, &RwLock<TouchedCorners>),
    of: impl Fn(&mut Part) -> &mut Gradient,
    loss: &Tensor,
    vars: &[Var],
) {
    let (mut dense, mut encoded) = (Vec::new(), Vec::new());
    for part in &learner.shared.parts {
        let mut part = part.lock();
        let gradient = of(&mut part);
        dense.resize(gradient.dense.len(), 0.0);
        kernel::add_into(&mut dense, &gradient.dense);
        encoded.push(gradient.encoded.clone());
    }
    let table = network.halves().1.map(|table| touched.read().table_gradient(&encoded, table.channels()));
    let gradients = loss.backward().unwrap();
    assert_eq!(vars.len(), 1 + usize::from(table.is_some()));
    for (found, var) in std::iter::once(dense).chain(table).zip(vars) {
        let expected = gradients.get(var).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        assert_eq!(found.len(), expected.len());
        let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let largest = expected.iter().map(|g| g.abs()).fold(0.0, f32::max);
        assert!(largest > 0.0 && off < 5e-4 * largest + 1e-6, "off by {off} of {largest}");
    }
}

fn check(spec: &Spec, settings: &LearnSettings) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut learner = GdgDistance::new(spec, settings, 2, &mut rng).unwrap();
    for _ in 0..20 {
        learner.update_on(&batch(spec, settings.batch_size, &mut rng), &mut Profile::default()).unwrap();
    }
    let batch = batch(spec, settings.batch_size, &mut rng);
    // The gradients of an update, without its steps.
    learner.shared.batch.write().clone_from(&batch);
    let parts = learner.shared.parts.len();
    learner.run_parallel(Shared::TOUCH_TASKS + parts, Shared::touched_corners_or_gradients).unwrap();
    learner.run_parallel(parts, Shared::actor_gradient).unwrap();

    let tensor =
        |numbers: &[f32], width: usize| Tensor::from_slice(numbers, (batch.len(), width), &Device::Cpu).unwrap();
    let (states, goals) = (tensor(&batch.states, spec.state_dim()), tensor(&batch.goals, spec.goal_dim()));
    let (from, next) = (tensor(&batch.from, spec.state_dim()), tensor(&batch.next, spec.state_dim()));
    let shared = &*learner.shared;
    let shapes = &shared.objective.shapes;
    let (model, model_vars) = variables_of(&learner, &shared.model);
    let (actor, actor_vars) = variables_of(&learner, &shared.actor);
    let reference = Reference::with_parameters(shapes, vec![model, actor.clone()], Layers::Linear).unwrap();
    let model_loss = reference.model_loss(&from, &tensor(&batch.actions, spec.action_dim), &next).unwrap();
    assert_close((&learner, &shared.model, &shared.transitions), |part| &mut part.model, &model_loss, &model_vars);

    let indices: Vec<u32> = spec.achieved.iter().map(|i| *i as u32).collect();
    let after = reference.predictions(&states, &reference.actions(&states, &goals).unwrap()).unwrap();
    let left = (after.index_select(&Tensor::new(indices, &Device::Cpu).unwrap(), 1).unwrap() - &goals).unwrap();
    let steps = left.sqr().unwrap().sum(D::Minus1).unwrap().sqrt().unwrap().mean_all().unwrap();
    let steps = (steps / f64::from(typical_step(spec))).unwrap();
    let rows = pair_rows(&shapes.encoder, &actor, &states, &goals).unwrap();
    let outputs = mlp(&shapes.actor, &actor.dense, &rows).unwrap().abs().unwrap();
    let excess = (outputs - f64::from(shapes.actor_bound)).unwrap().relu().unwrap().sqr().unwrap();
    let excess = (excess.sum(D::Minus1).unwrap().mean_all().unwrap() * f64::from(EXCESS_WEIGHT)).unwrap();
    let whole = if shapes.actor_bound.is_finite() { (&steps + excess).unwrap() } else { steps.clone() };
    assert_close((&learner, &shared.actor, &shared.pairs), |part| &mut part.actor, &whole, &actor_vars);

    let found = learner.losses();
    let expected = [&model_loss, &steps].map(|loss| loss.to_scalar::<f32>().unwrap());
    let close = |a: f32, b: f32| (a - b).abs() < 2e-4 * b.abs() + 1e-5;
    assert!(close(found.model, expected[0]) && close(found.actor, expected[1]), "{found:?} instead of {expected:?}");
}

fn settings(batch: usize, hidden: usize, layers: usize) -> LearnSettings {
    LearnSettings { batch_size: batch, hidden, layers, ..LearnSettings::default() }
}

#[test]
fn gradients_match_autograd() {
    check(&spec(2, 2, true), &LearnSettings::default());
    check(&spec(2, 2, true), &LearnSettings::paper());
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
                learner = GdgDistance::new(&spec, &settings, 1, &mut ChaCha8Rng::seed_from_u64(99)).unwrap();
                learner.load(&saved).unwrap();
            }
            learner.update_on(&batch(&spec, 130, &mut rng), &mut Profile::default()).unwrap();
        }
        state(&learner)
    });
    assert!(states[0] == states[1] && states[0] == states[2]);
}

#[test]
fn the_exported_actor_is_the_averaged_one() {
    let spec = spec(4, 2, false);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut learner = GdgDistance::new(&spec, &settings(40, 16, 2), 1, &mut rng).unwrap();
    for _ in 0..10 {
        learner.update_on(&batch(&spec, 40, &mut rng), &mut Profile::default()).unwrap();
    }
    let biases = |averaged: bool| {
        let export = learner.export_actor(averaged).unwrap().unwrap();
        let NamedTensor { name, values, .. } = export.tensors.last().unwrap().clone();
        assert_eq!(name, "output.bias");
        values
    };
    let shape = learner.shared.objective.shapes.actor;
    assert_eq!(biases(true), learner.shared.actor.copy(true).unwrap().0[shape.output_bias()]);
    assert_ne!(biases(true), biases(false));
}

#[test]
fn distances_are_straight_lines_before_any_update() {
    let spec = spec(4, 2, true);
    let learner = GdgDistance::new(&spec, &settings(40, 16, 2), 1, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
    let (states, goals) = ([9.0, 1.0, 2.0, 9.0, 5.0, 0.5, 0.5, 5.0], [4.0, 6.0, 0.5, 0.5]);
    let mut out = [9.0; 2];
    learner.policy(true).unwrap().distances(&states, &goals, &mut out, &mut Scratch::default());
    // The achieved goal's components change by .6 and .8 a step.
    assert!((out[0] - 5.0 / 0.7).abs() < 1e-5 && out[1] == 0.0, "{out:?}");
}

#[test]
fn other_backends_are_refused_by_name() {
    let settings = LearnSettings { backend: Backend::Tape, ..LearnSettings::default() };
    let refused = (KIND.create)(&spec(2, 2, true), &settings, 1, &mut ChaCha8Rng::seed_from_u64(1));
    let message = refused.err().unwrap().to_string();
    assert!(message.contains("gdg-distance") && message.contains("backend=fused"), "{message}");
}
