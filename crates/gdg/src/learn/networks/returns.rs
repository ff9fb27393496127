//! Rewards, the range of their discounted sum and what that sum means in steps; and distances in a
//! straight line.

use crate::env::Spec;

/// Returns the length of a typical step: the mean change scale of the state components that form
/// the achieved goal.
pub fn typical_step(spec: &Spec) -> f32 {
    let steps = spec.achieved.iter().map(|i| spec.change_scale[*i]).filter(|scale| *scale > 0.0);
    let (sum, count) = steps.fold((0.0, 0.0), |(sum, count), scale| (sum + scale, count + 1.0));
    if count > 0.0 { sum / count } else { 1.0 }
}

/// Returns the given distance of the paper's section 4.1, D(s, g) = |s - g|, from the achieved goal
/// to the goal in typical steps of length `step`, and writes its gradient with respect to `state`:
/// 1 / step towards the state, and 0 at the goal, where D has none.
pub fn straight_gradient(
    spec: &Spec,
    step: f32,
    state: &[f32],
    goal: &[f32],
    d_state: &mut [f32],
) -> f32 {
    d_state.fill(0.0);
    let length = spec.goal_distance(state, goal);
    if length > 0.0 {
        for (i, goal) in spec.achieved.iter().zip(goal) {
            d_state[*i] += (state[*i] - goal) / (length * step);
        }
    }
    length / step
}

/// What a step earns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reward {
    /// -1, until the goal is reached.
    Sparse,
    /// Minus the straight-line distance that remains, in lengths of a typical step.
    Distance,
}

/// Discounted sums of rewards: Q(s, a, g), which is never above 0.
#[derive(Clone, Debug)]
pub struct Returns {
    reward: Reward,
    /// gamma, at least 0 and below 1.
    pub discount: f32,
    /// Least possible sum.
    pub lowest: f32,
    step_length: f32,
}

/// Smallest 1 + Q (1 - gamma) that is not rounded to 0: D does not grow beyond it.
const MIN_REMAINING: f32 = 1e-6;

/// Newton steps to convert the sum of distances: enough for f32 over the whole range.
const NEWTON_STEPS: usize = 24;

impl Returns {
    pub fn new(reward: Reward, discount: f32, spec: &Spec) -> Self {
        let step_length = typical_step(spec);
        let sides = spec.achieved.iter().map(|i| 2.0 * spec.state_half_range[*i]);
        let largest_cost = match reward {
            Reward::Sparse => 1.0,
            Reward::Distance => sides.map(|side| side * side).sum::<f32>().sqrt() / step_length,
        };
        Self { reward, discount, lowest: -largest_cost / (1.0 - discount), step_length }
    }

    /// Returns the reward of a step that ends in `next`. The one that reaches the goal costs as
    /// much as any other; what follows costs nothing, as the episode is over.
    pub fn reward(&self, spec: &Spec, next: &[f32], goal: &[f32]) -> f32 {
        match self.reward {
            Reward::Sparse => -1.0,
            Reward::Distance => -spec.goal_distance(next, goal) / self.step_length,
        }
    }

    /// Returns the target of Q: r + gamma Q', or r at the goal, within the possible range
    /// (Andrychowicz et al. 2017, appendix A).
    pub fn target(&self, reward: f32, at_goal: bool, ahead: f32) -> f32 {
        let rest = if at_goal { 0.0 } else { self.discount * ahead };
        (reward + rest).clamp(self.lowest, 0.0)
    }

    /// Converts Q to the steps to the goal, D: finite and at least 0.
    ///
    /// With sparse rewards, -Q = 1 + gamma + ... + gamma^(D-1) = (1 - gamma^D) / (1 - gamma). With
    /// distances, D is the length of a straight walk of full steps that earns Q, -Q = sum over t <
    /// D of gamma^t (D - 1 - t): the number of steps where nothing is in the way. A way round an
    /// obstacle earns as little as a straight way of another length, so this D only ranks goals.
    pub fn steps(&self, q: f32) -> f32 {
        match self.reward {
            Reward::Sparse => {
                let remaining = (1.0 + q * (1.0 - self.discount)).clamp(MIN_REMAINING, 1.0);
                (remaining.ln() / self.discount.ln()).max(0.0)
            }
            Reward::Distance => straight_steps(-q.clamp(self.lowest, 0.0), self.discount),
        }
    }
}

/// Returns the n of at least 1 with n / (1 - gamma) - (1 - gamma^n) / (1 - gamma)^2 = `cost`, by
/// Newton's method from above: the sum is convex, so that every step stays above the solution.
fn straight_steps(cost: f32, discount: f32) -> f32 {
    let (cost, discount) = (f64::from(cost), f64::from(discount));
    if discount == 0.0 {
        // The logarithm below would be infinite.
        return (cost + 1.0) as f32;
    }
    let horizon = 1.0 / (1.0 - discount);
    let mut n = cost / horizon + horizon;
    for _ in 0..NEWTON_STEPS {
        let kept = discount.powf(n);
        let excess = n * horizon - (1.0 - kept) * horizon * horizon - cost;
        n -= excess / (horizon + kept * discount.ln() * horizon * horizon);
    }
    n.max(1.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;

    fn spec() -> Spec {
        Spec { change_scale: vec![2.0; 2], ..positions(&[(15.0, 15.0), (20.0, 20.0)]) }
    }

    #[test]
    fn steps_and_returns_of_a_straight_walk_are_inverse_and_any_value_gives_finite_steps() {
        for discount in [0.0, 0.9, 0.98, 0.99] {
            let [distance, sparse] = [Reward::Distance, Reward::Sparse]
                .map(|reward| Returns::new(reward, discount, &spec()));
            // The diagonal is 25 steps long. From the last step, with nothing left to go, to the first.
            for steps in 1..=25 {
                let near = |found: f32| (found - steps as f32).abs() < 0.02 * steps as f32;
                let q = (0..steps).fold(0.0, |q, left| distance.target(-(left as f32), false, q));
                assert!(near(distance.steps(q)), "{steps}: {}", distance.steps(q));
                let q = (0..steps).fold(0.0, |q, _| sparse.target(-1.0, false, q));
                assert!(discount == 0.0 || near(sparse.steps(q)), "{steps}: {}", sparse.steps(q));
            }
            for returns in [distance, sparse] {
                for q in [returns.lowest * 2.0, returns.lowest, -3.0, -0.0, 7.0, f32::MAX, f32::MIN]
                {
                    let steps = returns.steps(q);
                    assert!(steps.is_finite() && steps >= 0.0, "{returns:?} {q}: {steps}");
                }
            }
        }
    }

    #[test]
    fn targets_end_at_the_goal_and_stay_within_the_possible_range() {
        let sparse = Returns::new(Reward::Sparse, 0.98, &spec());
        assert!((sparse.lowest + 50.0).abs() < 1e-3);
        assert_eq!(sparse.target(-1.0, true, -30.0), -1.0);
        assert_eq!(sparse.target(-1.0, false, -30.0), -1.0 + 0.98 * -30.0);
        assert_eq!(sparse.target(-1.0, false, -1e6), sparse.lowest);
        assert_eq!(sparse.target(-1.0, false, 1e6), 0.0);
        // A diagonal of 50 in steps of 2.
        let distance = Returns::new(Reward::Distance, 0.98, &spec());
        assert!((distance.lowest + 25.0 * 50.0).abs() < 1e-2);
        assert_eq!(distance.reward(&spec(), &[3.0, 4.0], &[0.0, 0.0]), -2.5);
    }

    #[test]
    fn straight_distances_and_their_gradients_are_in_typical_steps_and_finite_at_the_goal() {
        let spec = Spec {
            change_scale: vec![7.0, 1.0, 0.0, 3.0],
            achieved: vec![3, 1],
            ..positions(&[(0.0, 9.0); 4])
        };
        let of = |state: [f32; 4], goal: [f32; 2]| {
            let mut d = [9.0; 4];
            (straight_gradient(&spec, typical_step(&spec), &state, &goal, &mut d), d)
        };
        assert_eq!(of([5.0, 4.0, 8.0, 3.0], [0.0; 2]), (2.5, [0.0, 0.4, 0.0, 0.3]));
        for off in [0.0, f32::MIN_POSITIVE, 1e-30, 1e-20, 1e-6] {
            let (distance, d) = of([1.0, off, 1.0, 2.0], [2.0, 0.0]);
            let slope = d.iter().map(|d| d * d).sum::<f32>().sqrt();
            assert!(distance >= 0.0 && slope <= 0.5001, "{off}: {distance}, {d:?}");
        }
    }
}
