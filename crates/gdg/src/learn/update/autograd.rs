//! For tests: compares hand-written gradients with candle's autograd.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use candle_core::{Tensor, Var};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
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
