//! The search for a single bridge point, as published (Algorithm 2).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::learn::{Policy, Scratch};

/// Outcome of one search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchOutcome {
    /// The state s searched from, `(state_dim)`.
    pub state: Vec<f32>,
    /// The goal g searched for, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Candidates tried and rejected, in order, `(rejected, goal_dim)`.
    pub rejected: Vec<f32>,
    /// The bridge point found.
    pub found: Option<BridgePoint>,
    /// Maximum number of candidates to try.
    pub budget: usize,
}

/// A bridge point b with D(s,b) + D(b,g) < D(s,g).
#[derive(Clone, Debug, PartialEq)]
pub struct BridgePoint {
    /// The candidate, `(goal_dim)`.
    pub point: Vec<f32>,
    /// D(s,g) - D(s,b) - D(b,g) in steps.
    pub gain: f32,
}

impl SearchOutcome {
    /// Returns the number of candidates tried.
    pub fn tried(&self) -> usize {
        self.rejected.len() / self.goal.len().max(1) + usize::from(self.found.is_some())
    }
}

/// The points that a search draws from.
#[derive(Clone, Copy, Debug)]
pub struct SearchSpace<'a> {
    /// The points as states, `(points, state_dim)`.
    pub states: &'a [f32],
    /// The same points as goals, `(points, goal_dim)`.
    pub goals: &'a [f32],
}

/// Draws points b from `space` until D(s,g) > D(s,b) + D(b,g) or `budget` have been tried.
pub fn search(
    state: &[f32],
    goal: &[f32],
    space: SearchSpace,
    budget: usize,
    policy: &dyn Policy,
    rng: &mut ChaCha8Rng,
    scratch: &mut Scratch,
) -> SearchOutcome {
    let (s, g) = (state.len(), goal.len());
    let mut outcome = SearchOutcome {
        state: state.to_vec(),
        goal: goal.to_vec(),
        budget,
        ..SearchOutcome::default()
    };
    let candidates = space.states.len() / s;
    if candidates == 0 {
        return outcome;
    }
    let drawn: Vec<usize> = (0..budget).map(|_| rng.random_range(0..candidates)).collect();
    // One batch for all candidates, judged in the order drawn: the same result as one by one, but
    // faster.
    let mut from: Vec<f32> = state.repeat(budget);
    from.extend(drawn.iter().flat_map(|i| &space.states[i * s..(i + 1) * s]));
    let mut to: Vec<f32> =
        drawn.iter().flat_map(|i| &space.goals[i * g..(i + 1) * g]).copied().collect();
    let tried = to.clone();
    to.extend(goal.repeat(budget));
    let mut distances = vec![0.0; 2 * budget];
    policy.distances(&from, &to, &mut distances, scratch);
    let direct = policy.distance(state, goal, scratch);
    let mut gains = distances[..budget]
        .iter()
        .zip(&distances[budget..])
        .map(|(to_b, from_b)| direct - to_b - from_b);
    let found = gains.by_ref().enumerate().find(|(_, gain)| *gain > 0.0);
    outcome.found =
        found.map(|(i, gain)| BridgePoint { point: tried[i * g..(i + 1) * g].to_vec(), gain });
    outcome.rejected = tried[..found.map_or(budget, |(i, _)| i) * g].to_vec();
    outcome
}
