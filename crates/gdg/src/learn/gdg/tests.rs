//! Compares gradients with candle's autograd, over several shapes, odd sizes and batch size 1, and
//! lookahead and imagined steps with candle's networks.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use crate::env::Spec;
use crate::learn::networks::policy::Imagine;
use crate::learn::update::autograd::{batch, spec};
use crate::learn::{
    Batch, FullGradient, Gdg, LearnSettings, Learner, LossScale, Network, Policy, Profile, Scratch,
};
use crate::settings::Preset;
use crate::store::Store;
use candle_core::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Returns numbers as a tensor `(rows, width)`.
fn tensor(numbers: &[f32], width: usize) -> Tensor {
    Tensor::from_slice(numbers, (numbers.len() / width, width), &Device::Cpu).unwrap()
}

/// Returns the largest difference, and the largest number expected as its scale.
fn compare(fused: &[f32], autograd: &Tensor) -> (f32, f32) {
    let autograd = autograd.flatten_all().unwrap().to_vec1::<f32>().unwrap();
    assert_eq!(fused.len(), autograd.len());
    let difference = fused.iter().zip(&autograd).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    (difference, autograd.iter().map(|g| g.abs()).fold(0.0, f32::max))
}

/// Makes a batch of a number of rows.
type MakeBatch = fn(&Spec, usize, &mut ChaCha8Rng) -> Batch;

fn check(spec: &Spec, settings: &LearnSettings) {
    check_on(batch, 20, spec, settings);
}

/// Compares gradients on a batch after a number of updates on such batches.
fn check_on(make_batch: MakeBatch, updates_before: usize, spec: &Spec, settings: &LearnSettings) {
    for relearns in [false, true] {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let learner = Gdg::new(spec, settings, 2, &mut rng).unwrap();
        let mut batch = make_batch(spec, settings.batch_size, &mut rng);
        (batch.greedy_targets, batch.relearns) = (settings.greedy_targets, relearns);
        if relearns {
            // Far above the other targets.
            batch.lower.iter_mut().step_by(5).for_each(|lower| *lower = 100.0);
        }
        // Averages start equal to what they average: some updates move them apart.
        for _ in 0..updates_before {
            let mut other = make_batch(spec, settings.batch_size, &mut rng);
            other.greedy_targets = settings.greedy_targets;
            learner.update_on(&other, None, &mut Profile::default()).unwrap();
        }
        compare_gradients(&learner, &batch, spec, settings);
    }
}

fn compare_gradients(learner: &Gdg, batch: &Batch, spec: &Spec, settings: &LearnSettings) {
    let (s, g) = (spec.state_dim(), spec.goal_dim());
    let (states, goals) = (tensor(&batch.states, s), tensor(&batch.goals, g));
    let towards = tensor(&batch.actor_goals, g);
    let weights = tensor(&batch.actor_weights, 1).squeeze(1).unwrap();
    let reference = learner.reference().unwrap();
    let targets = learner.target_reference().unwrap().targets(batch, &Device::Cpu).unwrap();
    let current = reference.targets(batch, &Device::Cpu).unwrap().to_vec1::<f32>().unwrap();
    let (apart, _) = compare(&current, &targets);
    // A batch of one has a pair whose goal was reached.
    assert!(apart > 0.01 || settings.batch_size == 1, "targets at averages differ by {apart}");
    let critic = reference.critic_loss(0, &states, &goals, &targets).unwrap();
    let (from, next) = (tensor(&batch.from, s), tensor(&batch.next, s));
    let model =
        reference.model_loss(&from, &tensor(&batch.actions, spec.action_dim), &next).unwrap();
    let ways = [&goals, &towards, &weights];
    let (actor, excess) = reference.actor_loss(&states, ways, batch.relearns).unwrap();
    let losses = [&critic, &model, &actor].map(|loss| loss.to_scalar::<f32>().unwrap());
    let with_excess = settings.actor_bound > 0.0 || batch.relearns;
    let actor = if with_excess { (actor + excess).unwrap() } else { actor };
    let expected: Vec<(Tensor, Option<Tensor>)> = {
        let networks: [&Network; 3] = [learner.critic(0), learner.model(), learner.actor()];
        let gradient = |(n, loss): (&&Network, &Tensor)| {
            let g = loss.backward().unwrap();
            let table = n.table().map(|t| g.get(t).unwrap().narrow(1, 0, 1).unwrap());
            (g.get(n.dense()).unwrap().clone(), table)
        };
        networks.iter().zip([&critic, &model, &actor]).map(gradient).collect()
    };
    let (found_losses, found) = learner.gradients(batch).unwrap();
    let found_losses = [found_losses.critic, found_losses.model, found_losses.actor];
    for (i, name) in ["critic", "model", "actor"].iter().enumerate() {
        let off = (losses[i] - found_losses[i]).abs();
        // The reference covers the first critic only: the mean loss of two differs from its.
        let is_comparable = settings.critics == 1 || i > 0;
        assert!(!is_comparable || off <= 2e-4 * losses[i].abs() + 1e-5, "{name}: {losses:?}");
        let FullGradient { dense, table } = &found[i];
        let table = expected[i].1.as_ref().map(|expected| (table, expected, 5e-4));
        for (found, expected, most) in table.into_iter().chain([(dense, &expected[i].0, 2e-4)]) {
            let (off, largest) = compare(found, expected);
            assert!(largest > 0.0 && off < most * largest + 1e-6, "{name}: {off} of {largest}");
        }
    }
}

fn settings(batch: usize, hidden: usize, layers: usize) -> LearnSettings {
    LearnSettings { batch_size: batch, hidden, layers, critics: 1, ..LearnSettings::default() }
}

#[test]
fn gradients_match_autograd_whatever_the_settings() {
    let default = LearnSettings::default;
    let small = || settings(40, 32, 2);
    let mut all = vec![
        default(),
        LearnSettings { greedy_targets: false, expectile: 0.9, ..default() },
        LearnSettings::of(Preset::Paper),
        LearnSettings { actor_bound: 0.05, ..small() },
    ];
    // However two critics are combined, with every loss, and of odd sizes.
    all.extend([0.0, 0.3, 1.0].map(|pessimism| LearnSettings { pessimism, ..default() }));
    all.extend(
        [LossScale::Squared, LossScale::Sqrt, LossScale::Log]
            .map(|loss| LearnSettings { loss, ..small() }),
    );
    all.extend(
        [(1, 16, 1), (3, 7, 2), (37, 33, 3), (65, 128, 2)]
            .map(|(batch, hidden, layers)| settings(batch, hidden, layers)),
    );
    all.iter().for_each(|settings| check(&spec(2, 2, true), settings));
}

#[test]
fn gradients_of_states_larger_than_goals_and_with_a_constant_component_match_autograd() {
    check(&spec(10, 3, false), &settings(33, 24, 2));
    check(&spec(5, 3, true), &settings(20, 24, 2));
    check(&spec(4, 1, true), &settings(20, 24, 2));
    let mut constant = spec(4, 2, true);
    (constant.state_half_range[3], constant.change_scale[3]) = (0.0, 0.0);
    check(&constant, &settings(40, 32, 2));
}

/// Returns pairs that begin with their own steps: small actions are blocked, and the last step of
/// each part jumps.
fn blocked(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Batch {
    let mut batch = batch(spec, rows, rng);
    batch.from.clone_from(&batch.states);
    batch.next.clone_from(&batch.states);
    let steps = batch
        .next
        .chunks_exact_mut(spec.state_dim())
        .zip(batch.actions.chunks_exact(spec.action_dim));
    for (row, (next, action)) in steps.enumerate() {
        let jump = if row % 32 == 31 { 3.0 } else { 0.0 };
        for ((next, action), scale) in next.iter_mut().zip(action).zip(&spec.change_scale) {
            *next += scale * (jump + if action.abs() > 0.5 { 2.0 * action } else { 0.0 });
        }
        (batch.bootstrap[row], batch.bound[row], batch.lower[row]) = (1.0, f32::INFINITY, 0.0);
    }
    batch
}

#[test]
fn gradients_of_a_blocked_actor_and_of_a_mispredicting_model_match_autograd() {
    let spec = spec(2, 2, true);
    let default = LearnSettings { actor_bound: 0.1, ..LearnSettings::default() };
    let updates_before = 100;
    check_on(blocked, updates_before, &spec, &default);
    // Both make a difference to such a batch.
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let trained = Gdg::new(&spec, &default, 1, &mut rng).unwrap();
    let mut next_batch =
        || Batch { greedy_targets: true, ..blocked(&spec, default.batch_size, &mut rng) };
    for _ in 0..updates_before {
        trained.update_on(&next_batch(), None, &mut Profile::default()).unwrap();
    }
    let (batch, mut store) = (next_batch(), Store::default());
    trained.save(&mut store).unwrap();
    let gradients = |settings: &LearnSettings| {
        let mut learner = Gdg::new(&spec, settings, 1, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
        learner.load(&store).unwrap();
        let (_, found) = learner.gradients(&batch).unwrap();
        [0, 2].map(|network| found[network].dense.clone())
    };
    let [critic, actor] = gradients(&default);
    let [unchecked, _] = gradients(&LearnSettings { model_check: false, ..default.clone() });
    let [_, still_blocked] = gradients(&LearnSettings { unblock_actor: false, ..default.clone() });
    assert!(critic != unchecked, "the model mispredicts a step");
    assert!(actor != still_blocked, "lookahead finds a way out");
}

#[test]
fn lower_bounds_raise_targets_little_by_little_while_distances_are_relearned() {
    let (spec, mut rng) = (spec(2, 2, true), ChaCha8Rng::seed_from_u64(9));
    let settings = LearnSettings { batch_size: 1, ..LearnSettings::default() };
    let learner = Gdg::new(&spec, &settings, 1, &mut rng).unwrap();
    // The goal is reached after 10 steps.
    let row = |lower, relearns| {
        let mut batch = batch(&spec, 1, &mut ChaCha8Rng::seed_from_u64(9));
        (batch.steps[0], batch.lower[0], batch.relearns) = (10.0, lower, relearns);
        batch
    };
    let critic_loss = |lower, relearns| {
        let (losses, _) = learner.gradients(&row(lower, relearns)).unwrap();
        losses.critic
    };
    let raised = critic_loss(24.0, false);
    assert!(critic_loss(100.0, true) == raised && critic_loss(24.0, true) == raised);
    assert!(critic_loss(100.0, false) != raised && critic_loss(0.0, true) != raised);
}

#[test]
fn lookahead_finds_the_best_tried_action_according_to_model_and_critics() {
    for spec in [spec(2, 2, true), spec(5, 3, false)] {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let learner =
            Gdg::new(&spec, &LearnSettings { critics: 2, ..settings(32, 24, 2) }, 1, &mut rng)
                .unwrap();
        for _ in 0..200 {
            let mut moves = batch(&spec, 32, &mut rng);
            // Actions move the first components by ten times what is usual.
            moves.next.clone_from(&moves.from);
            for (next, action) in moves
                .next
                .chunks_exact_mut(spec.state_dim())
                .zip(moves.actions.chunks_exact(spec.action_dim))
            {
                next.iter_mut().zip(action).for_each(|(next, action)| *next += 4.0 * action);
            }
            learner.update_on(&moves, None, &mut Profile::default()).unwrap();
        }
        let pairs = batch(&spec, 40, &mut rng);
        let mut own = vec![0.0; 40 * spec.action_dim];
        let mut best = Vec::new();
        learner
            .with_nets(false, |nets| {
                nets.actions(&pairs.states, &pairs.goals, &mut own, &mut Scratch::default());
                best.clone_from(&own);
                let mut scratch = Scratch::default();
                nets.improve_actions(&pairs.states, &pairs.goals, &mut best, &mut scratch);
            })
            .unwrap();
        let reference = learner.reference().unwrap();
        let (states, goals) =
            (tensor(&pairs.states, spec.state_dim()), tensor(&pairs.goals, spec.goal_dim()));
        let after = |actions: &[f32]| -> Vec<f32> {
            let next = reference.predictions(&states, &tensor(actions, spec.action_dim)).unwrap();
            let [first, second] = [0, 1].map(|k| reference.distances(k, &next, &goals).unwrap());
            first.maximum(&second).unwrap().to_vec1().unwrap()
        };
        let (after_own, after_best) = (after(&own), after(&best));
        let corner = after(&vec![1.0; own.len()]);
        let mut changed = 0;
        for i in 0..40 {
            let [own, best, corner] = [&after_own, &after_best, &corner].map(|after| after[i]);
            // Better by more than what counts as noise.
            assert!(
                best <= own + 1e-3 && best <= corner + 0.1 + 1e-3,
                "{i}: {own} {best} {corner}"
            );
            changed += usize::from(best < own - 0.05);
        }
        assert!(changed > 5, "the actor leaves room for improvement: {changed} of 40");
    }
}

#[test]
fn an_imagined_step_is_the_models_after_the_actors_action() {
    for spec in [spec(2, 2, true), spec(5, 3, false)] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let learner = Gdg::new(&spec, &settings(32, 24, 2), 1, &mut rng).unwrap();
        let pairs = batch(&spec, 37, &mut rng);
        let mut actions = vec![0.0; 37 * spec.action_dim];
        // As after a longer walk.
        let mut next = vec![f32::NAN; 2 * pairs.states.len()];
        learner
            .with_nets(false, |nets| {
                let mut scratch = Scratch::default();
                nets.actions(&pairs.states, &pairs.goals, &mut actions, &mut scratch);
                nets.step(&pairs.states, &pairs.goals, &mut next, &mut scratch);
            })
            .unwrap();
        let reference = learner.reference().unwrap();
        let states = tensor(&pairs.states, spec.state_dim());
        let expected = reference.predictions(&states, &tensor(&actions, spec.action_dim)).unwrap();
        assert_eq!(next.len(), pairs.states.len());
        let ((apart, _), (moved, _)) = (compare(&next, &expected), compare(&next, &states));
        assert!(apart < 1e-4 && moved > 1e-3, "apart {apart}, moved {moved}");
    }
}
