//! The search for a single bridge point, as published (Algorithm 2).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::learn::{Nets, Scratch};

/// What one search did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOutcome {
    /// Candidates tried.
    pub tried: usize,
    /// The bridge point found, as an index of the candidates, and its gain D(s,g) - D(s,b) - D(b,g) in steps.
    pub found: Option<(usize, f32)>,
}

/// Draws candidates b at random until D(s,g) > D(s,b) + D(b,g) or `budget` have been tried.
///
/// `states` are the candidates `(candidates, state_dim)`, `points` the same as goals `(candidates, goal_dim)`.
pub fn search(
    (state, goal): (&[f32], &[f32]),
    (states, points): (&[f32], &[f32]),
    budget: usize,
    nets: &Nets,
    rng: &mut ChaCha8Rng,
    scratch: &mut Scratch,
) -> SearchOutcome {
    let (s, g) = (state.len(), goal.len());
    let candidates = states.len() / s;
    if candidates == 0 {
        return SearchOutcome { tried: 0, found: None };
    }
    let drawn: Vec<usize> = (0..budget).map(|_| rng.random_range(0..candidates)).collect();
    // All at once through the networks, then judged in the order drawn: the result is that of trying one by one.
    let mut from: Vec<f32> = state.repeat(budget);
    from.extend(drawn.iter().flat_map(|i| &states[i * s..(i + 1) * s]));
    let mut to: Vec<f32> = drawn.iter().flat_map(|i| &points[i * g..(i + 1) * g]).copied().collect();
    to.extend(goal.repeat(budget));
    let mut distances = vec![0.0; 2 * budget];
    nets.distances(&from, &to, &mut distances, scratch);
    let direct = nets.distance(state, goal, scratch);
    let gains = distances[..budget].iter().zip(&distances[budget..]).map(|(to_b, from_b)| direct - to_b - from_b);
    match gains.enumerate().find(|(_, gain)| *gain > 0.0) {
        Some((i, gain)) => SearchOutcome { tried: i + 1, found: Some((drawn[i], gain)) },
        None => SearchOutcome { tried: budget, found: None },
    }
}
