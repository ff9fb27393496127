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

/// A leap counts from this many leaps from the same place on ...
const SURE_COUNT: usize = 16;

/// ... of which at least this share has led to the same place.
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
        let fits = |numbers: &[f32], length: usize| {
            numbers.len() == length && numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE)
        };
        self.0.len() <= MOST_LEAPS
            && self
                .0
                .iter()
                .all(|leap| fits(&leap.from, spec.goal_dim()) && fits(&leap.to, spec.goal_dim()))
    }

    /// Remembers the step from `state` to `next` if it is a leap.
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

    fn spec() -> Spec {
        crate::env::tests::positions(&[(0.0, 100.0); 2])
    }

    /// Leaps from (0, 0) to (50, 0), `elsewhere` of 20 to (0, 50).
    fn leaps(spec: &Spec, elsewhere: usize) -> Leaps {
        let mut leaps = Leaps::default();
        for i in 0..20 {
            let to = if i < elsewhere { [0.0, 50.0] } else { [50.0, 0.0] };
            leaps.note(spec, &[0.0, 0.0], &to);
        }
        leaps
    }

    #[test]
    fn a_leap_counts_once_others_have_led_to_the_same_place() {
        let spec = spec();
        let to = [50.5, 0.5];
        assert!(leaps(&spec, 2).is_sure(&spec, &[0.5, 0.0], &to));
        for (case, elsewhere, from) in
            [("by chance", 3, [0.5, 0.0]), ("from another place", 0, [1.5, 0.0])]
        {
            assert!(!leaps(&spec, elsewhere).is_sure(&spec, &from, &to), "{case}");
        }
        let few = Leaps(leaps(&spec, 0).0.into_iter().take(SURE_COUNT - 1).collect());
        assert!(!few.is_sure(&spec, &[0.5, 0.0], &to), "not seen often enough");
    }

    #[test]
    fn ordinary_steps_always_count() {
        let spec = spec();
        let mut leaps = Leaps::default();
        leaps.note(&spec, &[0.0, 0.0], &[LEAP_STEPS, 0.0]);
        assert!(leaps.is_empty() && leaps.is_sure(&spec, &[0.0, 0.0], &[1.0, 1.0]));
        // Nor is anything a leap where goals are no places.
        let spec = Spec { position_scale: None, ..spec };
        assert!(leaps.is_sure(&spec, &[0.0, 0.0], &[90.0, 0.0]));
    }
}
