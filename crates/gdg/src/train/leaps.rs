//! Steps that lead far at once, as through a teleport.
//!
//! D is a smallest number of steps, and a path counts as one once somebody has walked it: where
//! chance decides where a step leads, both would count on luck. So a leap counts only if leaps from
//! the same place have led to the same one, nearly always; otherwise the trajectory ends before it.
//! Actions are not compared: a recorded action may have been chosen when it was known where it leads.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::env::{MAX_MAGNITUDE, Spec};

/// A leap leads farther than this many typical steps.
const LEAP_STEPS: f32 = 8.0;

/// Most leaps remembered: the latest ones.
const MOST_LEAPS: usize = 1024;

/// A leap counts once this many leaps from the same place are known.
const SURE_COUNT: usize = 16;

/// Least share of the leaps from a place that must have led to the same one.
const SURE_SHARE: f32 = 0.9;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Leaps(VecDeque<Leap>);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Leap {
    from: Vec<f32>,
    to: Vec<f32>,
}

impl Leaps {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn fit(&self, spec: &Spec) -> bool {
        let fits = |at: &Vec<f32>| {
            at.len() == spec.goal_dim() && at.iter().all(|v| v.abs() <= MAX_MAGNITUDE)
        };
        self.0.len() <= MOST_LEAPS
            && self.0.iter().flat_map(|leap| [&leap.from, &leap.to]).all(fits)
    }

    pub fn note(&mut self, spec: &Spec, state: &[f32], next: &[f32]) {
        if !is_leap(spec, state, next) {
            return;
        }
        if self.0.len() == MOST_LEAPS {
            self.0.pop_front();
        }
        let [from, to] = [state, next].map(|state| spec.achieved(state).collect());
        self.0.push_back(Leap { from, to });
    }

    /// Returns whether the step from `state` to `next` counts: any but a leap that chance may have
    /// decided.
    pub fn is_sure(&self, spec: &Spec, state: &[f32], next: &[f32]) -> bool {
        if !is_leap(spec, state, next) {
            return true;
        }
        let (mut all, mut same) = (0, 0);
        for leap in self.0.iter().filter(|leap| spec.reached(state, &leap.from)) {
            all += 1;
            same += usize::from(spec.goal_distance(next, &leap.to) < 2.0 * spec.goal_radius);
        }
        all >= SURE_COUNT && same as f32 >= SURE_SHARE * all as f32
    }
}

fn is_leap(spec: &Spec, state: &[f32], next: &[f32]) -> bool {
    let far = LEAP_STEPS * spec.largest_change();
    spec.position_scale.is_some()
        && spec.achieved(state).zip(spec.achieved(next)).any(|(a, b)| (a - b).abs() > far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leap_counts_once_others_have_led_to_the_same_place() {
        let spec = crate::env::tests::positions(&[(0.0, 100.0); 2]);
        // Leaps from (0, 0) to (50, 0), `elsewhere` of them to (0, 50).
        let leaps = |count: usize, elsewhere: usize| {
            let mut leaps = Leaps::default();
            for i in 0..count {
                let to = if i < elsewhere { [0.0, 50.0] } else { [50.0, 0.0] };
                leaps.note(&spec, &[0.0, 0.0], &to);
            }
            leaps
        };
        let near = [0.5, 0.0];
        for (case, leaps, from, to, counts) in [
            ("seen", leaps(20, 2), near, [50.5, 0.5], true),
            ("by chance", leaps(20, 3), near, [50.5, 0.5], false),
            ("from another place", leaps(20, 0), [1.5, 0.0], [50.5, 0.5], false),
            ("not seen often enough", leaps(SURE_COUNT - 1, 0), near, [50.5, 0.5], false),
            ("an ordinary step", leaps(0, 0), near, [LEAP_STEPS, 0.0], true),
        ] {
            assert_eq!(leaps.is_sure(&spec, &from, &to), counts, "{case}");
        }
        // Nor is anything a leap where goals are no places.
        let spec = Spec { position_scale: None, ..spec };
        assert!(Leaps::default().is_sure(&spec, &[0.0, 0.0], &[90.0, 0.0]));
    }
}
