//! Straight-line distances, in typical steps.

use crate::env::Spec;

/// Returns the length of a typical step: the mean change scale of the state components that form
/// the achieved goal.
pub fn typical_step(spec: &Spec) -> f32 {
    let steps = spec.achieved.iter().map(|i| spec.change_scale[*i]).filter(|scale| *scale > 0.0);
    let (sum, count) = steps.fold((0.0, 0.0), |(sum, count), scale| (sum + scale, count + 1.0));
    if count > 0.0 { sum / count } else { 1.0 }
}

/// The given distance of the paper's section 4.1, D(s, g) = |s - g|, from the achieved goal to the
/// goal in typical steps. It passes through walls.
#[derive(Clone, Debug)]
pub struct StraightLine {
    spec: Spec,
    step: f32,
}

impl StraightLine {
    /// Returns the distance in an environment of `spec`.
    pub fn new(spec: &Spec) -> Self {
        Self { spec: spec.clone(), step: typical_step(spec) }
    }

    /// Returns D(s, g).
    pub fn steps(&self, state: &[f32], goal: &[f32]) -> f32 {
        self.spec.goal_distance(state, goal) / self.step
    }

    /// Returns D(s, g) and writes its gradient with respect to `state`: 1 / step towards the state,
    /// and 0 at the goal, where D has none.
    pub fn gradient(&self, state: &[f32], goal: &[f32], d_state: &mut [f32]) -> f32 {
        d_state.fill(0.0);
        let length = self.spec.goal_distance(state, goal);
        if length > 0.0 {
            for (i, goal) in self.spec.achieved.iter().zip(goal) {
                d_state[*i] += (state[*i] - goal) / (length * self.step);
            }
        }
        length / self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> StraightLine {
        StraightLine::new(&Spec {
            state_centre: vec![0.0; 4],
            state_half_range: vec![9.0; 4],
            change_scale: vec![7.0, 1.0, 0.0, 3.0],
            achieved: vec![3, 1],
            action_dim: 2,
            goal_radius: 1.0,
            position_scale: Some(1.0),
        })
    }

    #[test]
    fn distances_are_in_mean_change_scales_of_the_achieved_goal() {
        let mut gradient = [9.0; 4];
        let distance = line().gradient(&[5.0, 4.0, 8.0, 3.0], &[0.0, 0.0], &mut gradient);
        assert_eq!((distance, line().steps(&[5.0, 4.0, 8.0, 3.0], &[0.0, 0.0])), (2.5, 2.5));
        assert_eq!(gradient, [0.0, 0.4, 0.0, 0.3]);
    }

    #[test]
    fn gradients_at_the_goal_and_next_to_it_are_finite() {
        for off in [0.0, f32::MIN_POSITIVE, 1e-30, 1e-20, 1e-6] {
            let mut gradient = [9.0; 4];
            let distance = line().gradient(&[1.0, off, 1.0, 2.0], &[2.0, 0.0], &mut gradient);
            let slope = gradient.iter().map(|d| d * d).sum::<f32>().sqrt();
            assert!(distance >= 0.0 && slope <= 0.5001, "{off}: {distance}, {gradient:?}");
        }
    }
}
