//! Compares gradients with finite differences of the reference, over all learners and several shapes,
//! odd sizes and batch size 1; and lookahead and imagined steps with its networks.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::env::{Contact, Spec};
use crate::learn::data::batch::Batch;
use crate::learn::network_learner::{
    GDG, LearnerVariant, NetworkLearner, VARIANTS, is_too_far_off,
};
use crate::learn::networks::policy::{Imagine, Nets};
use crate::learn::reference::{Net, Reference, wide};
use crate::learn::update::trained_networks::Training;
use crate::learn::{LearnSettings, Learner, LossScale, Policy, Profile, Scratch};
use crate::settings::Preset;
use crate::store::Store;

/// Returns a spec whose state has a position among other numbers, as for an arm; `axes` of its
/// numbers are the achieved goal.
fn spec(state: usize, axes: usize, positions: bool) -> Spec {
    Spec {
        state_centre: (0..state).map(|i| i as f32 * 0.5).collect(),
        state_half_range: (0..state).map(|i| 3.0 + i as f32).collect(),
        change_scale: (0..state).map(|i| 0.4 + 0.2 * i as f32).collect(),
        achieved: (0..axes).map(|i| (i + 1) % state).collect(),
        action_dim: axes,
        goal_radius: 0.8,
        position_scale: positions.then_some(1.0),
        contacts: if axes < state { vec![CONTACT] } else { Vec::new() },
        time_limit: None,
    }
}

/// Of a part of the goal and another number.
const CONTACT: Contact = Contact { goal: 1, other: 0, slope: -0.8, offset: 0.3, width: 1.5 };

/// Makes a batch of all kinds of rows.
fn batch(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Batch {
    let state = |rng: &mut ChaCha8Rng| -> Vec<f32> {
        let numbers = spec.state_centre.iter().zip(&spec.state_half_range);
        numbers.map(|(c, h)| c + h * rng.random_range(-0.95..0.95)).collect()
    };
    let mut batch = Batch::default();
    for i in 0..rows {
        batch.states.extend(state(rng));
        let goal = state(rng);
        batch.goals.extend(spec.achieved(&goal));
        batch.bootstrap_states.extend(state(rng));
        batch.steps.push(i as f32 % 7.0 * 9.0);
        batch.bootstrap.push((i % 2) as f32);
        batch.bound.push(if i % 5 == 1 { 30.0 } else { f32::INFINITY });
        batch.lower.push(if i % 7 == 2 { 12.0 } else { 0.0 });
        batch.from.extend(state(rng));
        batch.actions.extend((0..spec.action_dim).map(|_| rng.random_range(-1.0..1.0f32)));
        batch.next.extend(state(rng));
        batch.actor_weights.push(if i % 5 == 3 { 0.0 } else { 1.0 });
        // Some targets are beyond the possible range.
        batch.rewards.push(if i % 5 == 4 { 3.0 } else { -0.5 * (i % 3) as f32 });
        batch.noise.extend((0..spec.action_dim).map(|_| rng.random_range(-0.5..0.5f32)));
    }
    // A waypoint leads the actor of every third pair: the goal of the pair before it.
    batch.actor_goals.clone_from(&batch.goals);
    let g = spec.goal_dim();
    for row in (1..rows).step_by(3) {
        batch.actor_goals.copy_within((row - 1) * g..row * g, row * g);
    }
    batch
}

/// Blocks of numbers of which a gradient is compared.
const BLOCKS: usize = 6;

/// Length of a finite difference.
const STEP: f64 = 1e-6;

/// Compares the two parts of a gradient with finite differences of `loss` around `at`, along random
/// directions within blocks of the numbers, and along single ones. Those whose gradient is NaN have
/// not been computed.
pub fn assert_gradient(
    label: &str,
    at: &Net,
    gradient: &[Vec<f32>; 2],
    loss: impl Fn(&Net) -> f64,
) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for (part, gradient) in gradient.iter().enumerate() {
        assert_eq!(gradient.len(), at.0[part].len(), "{label}");
        let computed: Vec<usize> = (0..gradient.len()).filter(|i| !gradient[*i].is_nan()).collect();
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        if !computed.is_empty() {
            let size = computed.len().div_ceil(BLOCKS);
            blocks.extend(computed.chunks(size).map(<[usize]>::to_vec));
            let single = || computed[rng.random_range(0..computed.len())];
            blocks.extend(std::iter::repeat_with(single).take(BLOCKS).map(|i| vec![i]));
            let largest =
                computed.iter().max_by(|a, b| gradient[**a].abs().total_cmp(&gradient[**b].abs()));
            blocks.extend(largest.map(|i| vec![*i]));
        }
        for block in blocks {
            let directions: Vec<f64> = block.iter().map(|_| rng.random_range(-1.0..1.0)).collect();
            let length = directions.iter().map(|d| d * d).sum::<f64>().sqrt();
            let along = || block.iter().zip(&directions).map(|(i, d)| (*i, d / length));
            let moved = |step: f64| {
                let mut net = at.clone();
                along().for_each(|(i, d)| net.0[part][i] += step * d);
                loss(&net)
            };
            let expected = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            let found: f64 = along().map(|(i, d)| f64::from(gradient[i]) * d).sum();
            let squares: f64 = block.iter().map(|i| f64::from(gradient[*i]).powi(2)).sum();
            let most = 1e-3 * (squares / block.len() as f64).sqrt() + 1e-6;
            let off = (found - expected).abs();
            assert!(
                off < most,
                "{label}, part {part}, {} of {}: {found} instead of {expected}",
                block.len(),
                gradient.len()
            );
        }
    }
}

fn updated(
    variant: LearnerVariant,
    spec: &Spec,
    settings: &LearnSettings,
    mut next_batch: impl FnMut(usize) -> Batch,
    updates: usize,
) -> NetworkLearner {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let learner = NetworkLearner::new(variant, spec, settings, 2, &mut rng).expect("networks");
    for _ in 0..updates {
        let batch = next_batch(settings.batch_size);
        learner.update_on(&batch, None, &mut Profile::default()).expect("an update");
    }
    learner
}

/// Makes a batch of a number of rows.
type MakeBatch = fn(&Spec, usize, &mut ChaCha8Rng) -> Batch;

/// Compares gradients, losses and targets on a batch after a number of updates on such batches:
/// averages start equal to what they average.
fn check_on(
    make_batch: MakeBatch,
    updates: usize,
    variant: LearnerVariant,
    spec: &Spec,
    settings: &LearnSettings,
) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut next_batch = |rows| {
        let greedy_targets = settings.greedy_targets;
        Batch { greedy_targets, ..make_batch(spec, rows, &mut rng) }
    };
    let learner = updated(variant, spec, settings, &mut next_batch, updates);
    let mut batch = next_batch(settings.batch_size);
    for relearns in [false, true] {
        batch.relearns = relearns;
        if relearns {
            // Far above the other targets.
            batch.lower.iter_mut().step_by(5).for_each(|lower| *lower = 100.0);
        }
        compare(&format!("{variant:?}, {settings:?}"), learner.training(), &batch);
    }
}

fn compare(label: &str, training: &Training, batch: &Batch) {
    let (losses, gradients) = training.compute_gradients(batch);
    let near = |what: &str, found: f32, expected: f64| {
        let off = (f64::from(found) - expected).abs();
        assert!(off < 2e-4 * expected.abs() + 1e-5, "{label}: {what} {found}, not {expected}");
    };
    let [now, average] = [false, true].map(|averaged| Reference::of(training, averaged));
    let (count, has_model) = (now.critics.len(), training.shapes().returns.is_none());
    let mut critic_loss = 0.0;
    if count > 0 {
        let [current, targets] = [&now, &average].map(|networks| networks.targets(batch));
        let apart = current.iter().zip(&targets).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart > 0.003 || batch.len() == 1, "{label}: averages make no difference");
        let found = training.targets();
        found.iter().zip(&targets).for_each(|(found, target)| near("target", *found, *target));
        for (critic, gradient) in now.critics.iter().zip(&gradients) {
            let loss = |net: &Net| now.critic_loss(net, batch, &targets);
            critic_loss += loss(critic) / count as f64;
            assert_gradient(&format!("{label}: critic"), critic, gradient, loss);
        }
    }
    near("critics' loss", losses.critic, critic_loss);
    if has_model {
        let loss = |net: &Net| now.model_loss(net, batch);
        near("model's loss", losses.model, loss(&now.model));
        assert_gradient(&format!("{label}: model"), &now.model, &gradients[count], loss);
    }
    let pulls = now.pulls(batch);
    near("actor's loss", losses.actor, now.actor_loss(&now.actor, batch, &pulls)[0]);
    let loss = |net: &Net| now.actor_loss(net, batch, &pulls)[1];
    let own = gradients.last().expect("an actor");
    assert_gradient(&format!("{label}: actor"), &now.actor, own, loss);
}

fn settings(batch: usize, hidden: usize, layers: usize) -> LearnSettings {
    LearnSettings { batch_size: batch, hidden, layers, ..LearnSettings::default() }
}

#[test]
fn gradients_match_finite_differences_whatever_the_settings() {
    let default = LearnSettings::default;
    let small = || settings(40, 32, 2);
    let mut all: Vec<LearnSettings> = [Preset::Paper, Preset::Tuned, Preset::Sb3]
        .map(|preset| LearnSettings { batch_size: 96, hidden: 48, ..LearnSettings::of(preset) })
        .into();
    all.extend([
        default(),
        LearnSettings { greedy_targets: false, expectile: 0.9, ..small() },
        LearnSettings { actor_bound: 0.05, ..small() },
        LearnSettings { actor_bound: 0.0, actor_l2: 0.7, critics: 1, ..small() },
    ]);
    // However two critics are combined, with every loss, and of odd sizes.
    all.extend([0.0, 0.3].map(|pessimism| LearnSettings { pessimism, ..small() }));
    all.extend([LossScale::Squared, LossScale::Log].map(|loss| LearnSettings { loss, ..small() }));
    all.extend(
        [(1, 16, 1), (3, 7, 2), (37, 33, 3), (129, 40, 2)]
            .map(|(batch, hidden, layers)| settings(batch, hidden, layers)),
    );
    for variant in VARIANTS.into_iter().filter(|variant| !variant.is_random()) {
        for settings in &all {
            check_on(batch, 20, variant, &spec(2, 2, true), settings);
        }
        // States larger than goals, with a constant component, and goals without a grid.
        let mut constant = spec(4, 2, true);
        (constant.state_half_range[3], constant.change_scale[3]) = (0.0, 0.0);
        for spec in [spec(10, 3, false), spec(5, 3, true), spec(4, 1, true), constant] {
            check_on(batch, 20, variant, &spec, &settings(33, 24, 2));
        }
    }
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
fn gradients_of_a_blocked_actor_and_of_a_mispredicting_model_match_finite_differences() {
    let spec = spec(2, 2, true);
    let default = LearnSettings { actor_bound: 0.1, ..LearnSettings::default() };
    check_on(blocked, 100, GDG, &spec, &default);
    // Both make a difference to such a batch.
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut next_batch = |rows| Batch { greedy_targets: true, ..blocked(&spec, rows, &mut rng) };
    let trained = updated(GDG, &spec, &default, &mut next_batch, 100);
    let (batch, mut store) = (next_batch(default.batch_size), Store::default());
    trained.save(&mut store).expect("its state");
    let gradients = |settings: &LearnSettings| {
        let mut learner = updated(GDG, &spec, settings, |_| Batch::default(), 0);
        learner.load(&store).expect("the same networks");
        let (_, found) = learner.training().compute_gradients(&batch);
        [found[0].clone(), found[found.len() - 1].clone()]
    };
    let [critic, actor] = gradients(&default);
    let [unchecked, _] = gradients(&LearnSettings { model_check: false, ..default.clone() });
    let [_, still_blocked] = gradients(&LearnSettings { unblock_actor: false, ..default.clone() });
    assert!(critic != unchecked, "the model mispredicts a step");
    assert!(actor != still_blocked, "lookahead finds a way out");
}

#[test]
fn lookahead_finds_the_best_tried_action_and_an_imagined_step_is_the_models() {
    for spec in [spec(2, 2, true), spec(5, 3, false)] {
        let (s, g, a) = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let moves = |rows| {
            let mut moves = batch(&spec, rows, &mut rng);
            // Actions move the first components by ten times what is usual.
            moves.next.clone_from(&moves.from);
            let steps = moves.next.chunks_exact_mut(s).zip(moves.actions.chunks_exact(a));
            steps.for_each(|(next, action)| {
                next.iter_mut().zip(action).for_each(|(next, action)| *next += 4.0 * action);
            });
            moves
        };
        let learner = updated(GDG, &spec, &settings(32, 24, 2), moves, 200);
        let pairs = batch(&spec, 40, &mut ChaCha8Rng::seed_from_u64(4));
        let (mut own, mut best) = (vec![0.0; 40 * a], Vec::new());
        // As after a longer walk.
        let mut imagined = vec![f32::NAN; 2 * pairs.states.len()];
        let look = |nets: Nets| {
            let (Batch { states, goals, .. }, mut scratch) = (&pairs, Scratch::default());
            nets.actions(states, goals, &mut own, &mut scratch);
            best.clone_from(&own);
            nets.improve_actions(states, goals, &mut best, &mut scratch);
            nets.step(states, goals, &mut imagined, &mut scratch);
        };
        learner.training().with_nets(false, look).expect("weights");
        assert_eq!(imagined.len(), pairs.states.len());
        let reference = Reference::of(learner.training(), false);
        let mut changed = 0;
        for i in 0..40 {
            let [state, goal] =
                [wide(&pairs.states[i * s..][..s]), wide(&pairs.goals[i * g..][..g])];
            let after = |action: &[f32]| {
                let next = reference.prediction(&reference.model, &state, &wide(action));
                (reference.joint_distance(&next, &goal), next)
            };
            let ((shorter, _), (corner, _)) = (after(&best[i * a..][..a]), after(&vec![1.0; a]));
            let (longer, next) = after(&own[i * a..][..a]);
            // Better by more than what counts as noise, unless the actor's makes good progress.
            let is_good = reference.joint_distance(&state, &goal) - longer > 0.8;
            assert!(shorter <= longer + 1e-3 && (is_good || shorter <= corner + 0.101), "{i}");
            changed += usize::from(shorter < longer - 0.05);
            let apart = next.iter().zip(wide(&imagined[i * s..][..s])).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-4, "{i}: another step than the model's");
        }
        assert!(changed > 5, "the actor leaves room for improvement: {changed} of 40");
    }
}

#[test]
fn the_exported_actor_is_the_averaged_one() {
    let (spec, mut rng) = (spec(4, 2, false), ChaCha8Rng::seed_from_u64(3));
    let next_batch = |rows| batch(&spec, rows, &mut rng);
    let learner = updated(VARIANTS[1], &spec, &settings(40, 16, 2), next_batch, 10);
    let biases = |averaged: bool| {
        let export = learner.export_actor(averaged).expect("weights").expect("an actor");
        let last = export.tensors.last().expect("tensors").clone();
        assert_eq!(last.name, "output.bias");
        last.values
    };
    let shape = learner.training().shapes().actor;
    let (own, _) = learner.training().actor().copy(true).expect("weights");
    assert_eq!(biases(true), own[shape.output_bias()]);
    assert_ne!(biases(true), biases(false));
}

#[test]
fn networks_say_the_same_in_other_scales() {
    let mut now = spec(5, 2, true);
    let before = Spec { contacts: Vec::new(), ..now.clone() };
    (now.state_centre[3], now.state_half_range[3], now.state_half_range[0]) = (4.0, 20.0, 9.0);
    now.change_scale[4] *= 8.0;
    for variant in &VARIANTS[..4] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let learner = updated(
            *variant,
            &before,
            &settings(16, 24, 2),
            |rows| batch(&before, rows, &mut rng),
            30,
        );
        let pairs = batch(&before, 40, &mut rng);
        let said = |learner: &dyn Learner, averaged| {
            let (mut scratch, mut d, mut next) = (Scratch::default(), vec![0.0; 40], Vec::new());
            let mut actions = pairs.actions.clone();
            learner
                .with_policy(averaged, &mut |policy: &dyn Policy| {
                    policy.distances(&pairs.states, &pairs.goals, &mut d, &mut scratch);
                    policy.actions(&pairs.states, &pairs.goals, &mut actions, &mut scratch);
                    next.clone_from(&pairs.states);
                    policy.imagine(&pairs.states, &pairs.actions, &mut next, &mut scratch);
                })
                .expect("a policy");
            [d.as_slice(), &actions, &next].concat()
        };
        for averaged in [false, true] {
            let apart = |converted| {
                let mut store = Store::default();
                let own = Spec { contacts: now.contacts.clone(), ..before.clone() };
                let scales = if converted { &now } else { &own };
                learner.save_in_scales_of(scales, &mut store).expect("saved");
                let mut other =
                    NetworkLearner::new(*variant, &now, &settings(16, 24, 2), 1, &mut rng.clone())
                        .expect("networks");
                other.load(&store).expect("loaded");
                let pairs = said(&learner, averaged).into_iter().zip(said(&other, averaged));
                pairs.map(|(a, b)| (a - b).abs() / (1.0 + a.abs())).fold(0.0, f32::max)
            };
            assert!(apart(true) < 1e-3 && apart(false) > 1e-2, "{variant:?}: {}", apart(true));
        }
    }
}

#[test]
fn nothing_looks_ahead_while_the_model_is_off_in_steps_of_distance() {
    let spec = spec(5, 2, false);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    // Chance decides where steps lead, or nothing moves.
    let mut error = |by_chance: bool| {
        let moves = |rows| {
            let mut moves = batch(&spec, rows, &mut rng);
            if !by_chance {
                moves.next.clone_from(&moves.from);
            }
            moves
        };
        let learner = updated(GDG, &spec, &settings(32, 24, 2), moves, 300);
        learner.training().losses().model_steps
    };
    let [chance, sure] = [error(true), error(false)];
    assert!(chance > 0.4 && sure < 0.1, "{chance} {sure}");
    let mut learner =
        updated(GDG, &spec, &settings(32, 24, 2), |rows| batch(&spec, rows, &mut rng), 50);
    let pairs = batch(&spec, 40, &mut rng);
    let changes = |learner: &NetworkLearner| {
        let policy = learner.policy(true).expect("a policy");
        let mut actions = pairs.actions.clone();
        policy.improve_actions(&pairs.states, &pairs.goals, &mut actions, &mut Scratch::default());
        let exported = learner.export_critics(true).expect("an export").expect("critics");
        assert_eq!(exported.outputs.tried_actions.is_empty(), actions == pairs.actions);
        actions != pairs.actions
    };
    assert!(changes(&learner));
    let mut store = Store::default();
    learner.save(&mut store).expect("saved");
    store.put_numbers("learner_model_error", vec![chance, 0.1, 1.0]);
    learner.load(&store).expect("loaded");
    assert!(!changes(&learner));
    // The share says when to look ahead again, and a D that has settled forgives more.
    for (was, error, updates, is_off) in [
        (false, [0.2, 0.05], 0, false),
        (true, [0.2, 0.05], 0, true),
        (false, [0.5, 0.05], 0, true),
        (true, [0.5, 0.05], 20_000, false),
        (true, [0.5, 0.08], 90_000, true),
    ] {
        assert_eq!(is_too_far_off(was, error, updates), is_off, "{error:?} after {updates}");
    }
}
