//! For tests: compares hand-written gradients with candle's autograd.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{Tensor, Var};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::batch::Batch;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::network::Network;
use crate::learn::update::gradient::FullGradient;
use crate::learn::update::reference::Parameters;

/// Returns a spec whose state has a position among other numbers, as for an arm; `axes` of its
/// numbers are the achieved goal.
pub fn spec(state: usize, axes: usize, positions: bool) -> Spec {
    Spec {
        state_centre: (0..state).map(|i| i as f32 * 0.5).collect(),
        state_half_range: (0..state).map(|i| 3.0 + i as f32).collect(),
        change_scale: (0..state).map(|i| 0.4 + 0.2 * i as f32).collect(),
        achieved: (0..axes).map(|i| (i + 1) % state).collect(),
        action_dim: axes,
        goal_radius: 0.8,
        position_scale: positions.then_some(1.0),
    }
}

/// Draws a state.
pub fn random_state(spec: &Spec, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let numbers = spec.state_centre.iter().zip(&spec.state_half_range);
    numbers.map(|(c, h)| c + h * rng.random_range(-0.95..0.95)).collect()
}

/// Makes a batch of all kinds of rows.
pub fn batch(spec: &Spec, rows: usize, rng: &mut ChaCha8Rng) -> Batch {
    let state = |rng: &mut ChaCha8Rng| random_state(spec, rng);
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
    }
    // A waypoint leads the actor of every third pair: the goal of the pair before it.
    batch.actor_goals.clone_from(&batch.goals);
    for row in (1..rows).step_by(3) {
        let (before, own) =
            batch.actor_goals[(row - 1) * spec.goal_dim()..].split_at_mut(spec.goal_dim());
        own[..spec.goal_dim()].copy_from_slice(before);
    }
    batch
}

/// Returns a network's parameters as tensors that share the returned variables.
pub fn variables_of(network: &Network, encoder: &Encoder) -> (Parameters, Vec<Var>) {
    let Parameters { dense, table } = Parameters::copied(network, encoder, false).unwrap();
    let vars: Vec<Var> =
        std::iter::once(&dense).chain(&table).map(|t| Var::from_tensor(t).unwrap()).collect();
    let table = table.map(|_| vars[1].as_tensor().clone());
    (Parameters { dense: vars[0].as_tensor().clone(), table }, vars)
}

/// Compares a network's gradient with that of `loss` with respect to its variables.
pub fn assert_close(name: &str, gradient: FullGradient, loss: &Tensor, vars: &[Var]) {
    let FullGradient { dense, table } = gradient;
    let gradients = loss.backward().unwrap();
    let found: Vec<Vec<f32>> =
        std::iter::once(dense).chain((!table.is_empty()).then_some(table)).collect();
    assert_eq!(found.len(), vars.len());
    for (found, var) in found.iter().zip(vars) {
        let expected = gradients.get(var).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap();
        assert_eq!(found.len(), expected.len());
        let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let largest = expected.iter().map(|g| g.abs()).fold(0.0, f32::max);
        assert!(largest > 0.0 && off < 5e-4 * largest + 1e-6, "{name}: off by {off} of {largest}");
    }
}
