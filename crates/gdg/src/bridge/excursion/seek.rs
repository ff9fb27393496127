//! Excursions to where the achieved goal has moved, in worlds in which it seldom does: an object that
//! has to be touched first.
//!
//! States in which it has moved are remembered. An agent returns to what is most like one of them, by
//! actions of which the dynamics model imagines that they lead there, and does again what was done
//! there: return first, then explore (Ecoffet et al. 2021). What the agent moves at once, such as a
//! hand, the model learns long before it knows what a touch does.

use std::collections::VecDeque;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::env::{MAX_MAGNITUDE, Spec};
use crate::learn::{Policy, Scratch};

/// Steps of such an excursion without a move.
pub const SEEK_STEPS: u32 = 50;

/// Actions imagined, for how many steps, after how many each time one is compared with what is
/// remembered, and for how many the chosen one is held.
const TRIED: usize = 24;
const AHEAD_STEPS: usize = 20;
const COMPARED_EVERY: usize = 2;
const HELD_STEPS: u32 = 2;

/// Remembered moves nearest to a state, of which an agent repeats the farthest.
const NEAR_MOVES: usize = 5;

/// Share of actions at random, and of those that were taken where the goal moved, once an agent is
/// there.
const RANDOM_SHARE: f32 = 0.2;
const AGAIN_SHARE: f32 = 0.7;

/// Most moves remembered: the latest ones.
const MOST_MOVES: usize = 1024;

/// Steps that have moved the achieved goal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalMoves(VecDeque<GoalMove>);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct GoalMove {
    /// `(state_dim)`.
    state: Vec<f32>,
    action: Vec<f32>,
    /// How far the achieved goal has moved.
    far: f32,
}

impl GoalMoves {
    pub fn push(&mut self, spec: &Spec, [state, next]: [&[f32]; 2], action: &[f32]) {
        if self.0.len() == MOST_MOVES {
            self.0.pop_front();
        }
        let goal: Vec<f32> = spec.achieved(next).collect();
        let far = spec.goal_distance(state, &goal);
        self.0.push_back(GoalMove { state: state.to_vec(), action: action.to_vec(), far });
    }

    pub fn fit(&self, spec: &Spec) -> bool {
        let fits = |numbers: &[f32], length: usize| {
            numbers.len() == length && numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE)
        };
        self.0.len() <= MOST_MOVES
            && self.0.iter().all(|own| {
                fits(&own.state, spec.state_dim())
                    && fits(&own.action, spec.action_dim)
                    && (0.0..=MAX_MAGNITUDE).contains(&own.far)
            })
    }
}

/// What is remembered, to be compared with many states: scaled, component by component,
/// `(state_dim, moves)`.
struct Remembered<'a> {
    spec: &'a Spec,
    moves: &'a GoalMoves,
    columns: Vec<f32>,
    squares: Vec<f32>,
}

impl<'a> Remembered<'a> {
    /// Returns `None` if nothing is remembered.
    fn of(spec: &'a Spec, moves: &'a GoalMoves) -> Option<Self> {
        let count = moves.0.len();
        let column = |i| moves.0.iter().map(move |own| spec.scaled(i, own.state[i]));
        let columns = (0..spec.state_dim()).flat_map(column).collect();
        (count > 0).then(|| Self { spec, moves, columns, squares: vec![0.0; count] })
    }

    /// Returns the squares of the distances from `state` to all that is remembered.
    fn squares(&mut self, state: &[f32]) -> &[f32] {
        self.squares.fill(0.0);
        for (i, own) in self.columns.chunks_exact(self.squares.len()).enumerate() {
            let u = self.spec.scaled(i, state[i]);
            self.squares.iter_mut().zip(own).for_each(|(sum, v)| *sum += (v - u) * (v - u));
        }
        &self.squares
    }

    /// Returns the square of the distance from `state` to the nearest remembered one.
    fn nearest(&mut self, state: &[f32]) -> f32 {
        self.squares(state).iter().copied().fold(f32::INFINITY, f32::min)
    }

    /// Returns the action that has moved the achieved goal farthest near `state`, and the square of the
    /// distance to the nearest remembered state.
    fn best_near(&mut self, state: &[f32]) -> Option<(&'a [f32], f32)> {
        let moves = self.moves;
        let mut near: Vec<(f32, &GoalMove)> =
            self.squares(state).iter().copied().zip(&moves.0).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (nearest, _) = near.first()?;
        let best = near.iter().take(NEAR_MOVES).max_by(|a, b| a.1.far.total_cmp(&b.1.far))?;
        Some((&best.1.action, *nearest))
    }
}

/// An excursion of one agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seek {
    /// Steps left unless the achieved goal moves.
    pub left: u32,
    /// The action held, `(action_dim)`, and for how many steps.
    action: Vec<f32>,
    held: u32,
}

impl Seek {
    pub fn new(action_dim: usize) -> Self {
        Self { left: SEEK_STEPS, action: vec![0.0; action_dim], held: 0 }
    }

    pub fn fits(&self, spec: &Spec) -> bool {
        self.left <= SEEK_STEPS
            && self.held <= HELD_STEPS
            && self.action.len() == spec.action_dim
            && self.action.iter().all(|v| v.abs() <= 1.0)
    }

    /// Goes on with the action if it has moved the achieved goal.
    pub fn note(&mut self, goal_has_moved: bool) {
        self.left = self.left.saturating_sub(1);
        if goal_has_moved {
            (self.left, self.held) = (SEEK_STEPS, self.held.max(1));
        }
    }

    /// Returns the action in `state`.
    pub fn act(
        &mut self,
        spec: &Spec,
        moves: &GoalMoves,
        state: &[f32],
        policy: &dyn Policy,
        rng: &mut ChaCha8Rng,
        scratch: &mut Scratch,
    ) -> &[f32] {
        if self.held == 0 {
            let mut tried: Vec<f32> =
                (0..TRIED * spec.action_dim).map(|_| rng.random_range(-1.0..=1.0)).collect();
            // Full steps: what is hit gently hardly moves.
            for action in tried.chunks_exact_mut(spec.action_dim) {
                let longest = action.iter().fold(f32::MIN_POSITIVE, |most, v| most.max(v.abs()));
                action.iter_mut().for_each(|v| *v /= longest);
            }
            let is_random = rng.random::<f32>() < RANDOM_SHARE;
            let again = rng.random::<f32>() < AGAIN_SHARE;
            let mut remembered = Remembered::of(spec, moves).filter(|_| !is_random);
            let best = remembered.as_mut().and_then(|own| Some((own.best_near(state)?, own)));
            self.action = match best {
                None => tried[..spec.action_dim].to_vec(),
                Some(((best, here), remembered)) => {
                    let (action, ahead) = imagined(remembered, state, &tried, policy, scratch);
                    if here <= ahead && again { best.to_vec() } else { action.to_vec() }
                }
            };
            self.held = HELD_STEPS;
        }
        self.held -= 1;
        &self.action
    }
}

/// Returns that of the `tried` actions which the model expects to lead nearest to a remembered state
/// if it is held, and the square of the distance.
fn imagined<'a>(
    remembered: &mut Remembered,
    state: &[f32],
    tried: &'a [f32],
    policy: &dyn Policy,
    scratch: &mut Scratch,
) -> (&'a [f32], f32) {
    let mut states = state.repeat(TRIED);
    let mut next = states.clone();
    let mut least = vec![f32::INFINITY; TRIED];
    for step in 1..=AHEAD_STEPS {
        policy.imagine(&states, tried, &mut next, scratch);
        std::mem::swap(&mut states, &mut next);
        if step.is_multiple_of(COMPARED_EVERY) {
            for (least, state) in least.iter_mut().zip(states.chunks_exact(state.len())) {
                *least = least.min(remembered.nearest(state));
            }
        }
    }
    let all = tried.chunks_exact(tried.len() / TRIED).zip(least);
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((tried, f32::INFINITY))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::tests::positions;

    /// A finger in the plane that moves by its action; the model knows that much of it.
    struct Finger;

    impl Policy for Finger {
        fn distances(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}

        fn actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}

        fn imagine(&self, states: &[f32], actions: &[f32], next: &mut [f32], _: &mut Scratch) {
            next.copy_from_slice(states);
            for (state, action) in next.chunks_exact_mut(3).zip(actions.chunks_exact(2)) {
                state[0] = (state[0] + action[0]).clamp(-20.0, 20.0);
                state[1] = (state[1] + action[1]).clamp(-20.0, 20.0);
            }
        }
    }

    #[test]
    fn an_agent_returns_to_where_the_goal_has_moved_and_does_there_what_moved_it() {
        let spec = Spec {
            achieved: vec![2],
            action_dim: 2,
            ..positions(&[(0.0, 20.0), (0.0, 20.0), (0.0, 20.0)])
        };
        let (mut rng, mut scratch) = (ChaCha8Rng::seed_from_u64(1), Scratch::default());
        // What moves the goal is a step to the right of (10, -10), within two units of it.
        let touches = |state: &[f32], action: &[f32]| {
            (state[0] - 10.0).hypot(state[1] + 10.0) < 2.0 && action[0] > 0.5
        };
        let mut arrived = |moves: &GoalMoves| {
            let trials = (0..40).filter(|_| {
                let (mut seek, mut state) = (Seek::new(2), vec![-10.0, 10.0, 0.0]);
                (0..SEEK_STEPS).any(|_| {
                    let action =
                        seek.act(&spec, moves, &state, &Finger, &mut rng, &mut scratch).to_vec();
                    seek.note(false);
                    let (before, mut next) = (state.clone(), state.clone());
                    Finger.imagine(&before, &action, &mut next, &mut scratch);
                    state = next;
                    touches(&before, &action)
                })
            });
            trials.count()
        };
        let by_chance = arrived(&GoalMoves::default());
        let mut moves = GoalMoves::default();
        moves.push(&spec, [&[10.0, -10.0, 0.0], &[11.0, -10.0, 1.0]], &[1.0, 0.0]);
        let remembered = arrived(&moves);
        assert!(by_chance < 4 && remembered > 12, "{by_chance} {remembered}");
    }
}
