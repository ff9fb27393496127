//! Contacts: what is close together where the achieved goal begins to move, such as a hand and the
//! object that it pushes.

use serde::{Deserialize, Serialize};

use crate::env::{MAX_MAGNITUDE, Spec};

/// Contacts are looked for in at least this many steps that begin to move the achieved goal.
const LEAST_BEGINNINGS: usize = 20;

/// Components go together if one accounts for at least this share of the other's variance there.
const LEAST_SHARE: f64 = 0.7;

/// Where the achieved goal begins to move, its component `goal` is about `slope * other + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// A component of the achieved goal.
    pub goal: usize,
    /// Another component of the state.
    pub other: usize,
    /// Units of the goal's component for one of the other.
    pub slope: f32,
    /// The goal's component where the other is 0.
    pub offset: f32,
    /// The root mean square of the difference.
    pub width: f32,
}

impl Contact {
    /// Returns how far apart the two are in `state`, in widths.
    pub fn apart(&self, state: &[f32]) -> f32 {
        (state[self.goal] - self.slope * state[self.other] - self.offset) / self.width
    }

    /// Whether it is one of states of `spec`.
    pub fn fits(&self, spec: &Spec) -> bool {
        let numbers = [self.slope, self.offset, 1.0 / self.width];
        self.goal.max(self.other) < spec.state_dim()
            && self.width > 0.0
            && numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE)
    }
}

/// Returns the contacts in `walks`, `(steps, state_dim)` each: for each component of the goal the one
/// that goes with it most closely. There is none where the goal is the whole state or is always moving.
pub fn find(spec: &Spec, walks: &[&[f32]]) -> Vec<Contact> {
    let beginnings: Vec<&[f32]> = walks.iter().flat_map(|walk| beginnings(spec, walk)).collect();
    if beginnings.len() < LEAST_BEGINNINGS {
        return Vec::new();
    }
    let others = || (0..spec.state_dim()).filter(|j| !spec.achieved.contains(j));
    let closest = |goal: usize| {
        let related = others().filter_map(|other| relate(spec, &beginnings, goal, other));
        related.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, contact)| contact)
    };
    spec.achieved.iter().filter_map(|goal| closest(*goal)).collect()
}

/// Returns the states of `walk` in which the achieved goal begins to move.
fn beginnings<'a>(spec: &Spec, walk: &'a [f32]) -> Vec<&'a [f32]> {
    let states: Vec<&[f32]> = walk.chunks_exact(spec.state_dim()).collect();
    let moves: Vec<bool> = states.windows(2).map(|pair| spec.goal_moves(pair[0], pair[1])).collect();
    let begins = |k: &usize| moves[*k] && (*k == 0 || !moves[k - 1]);
    (0..moves.len()).filter(begins).map(|k| states[k]).collect()
}

/// Returns the share of the variance of component `goal` that `other` accounts for, and their
/// contact, if the share is large.
fn relate(spec: &Spec, states: &[&[f32]], goal: usize, other: usize) -> Option<(f64, Contact)> {
    let mean = |of: &dyn Fn(&[f32]) -> f64| {
        states.iter().map(|state| of(state)).sum::<f64>() / states.len() as f64
    };
    let [y, x] = [goal, other].map(|i| move |state: &[f32]| f64::from(state[i]));
    let (my, mx) = (mean(&y), mean(&x));
    let [vy, vx] = [mean(&|s| (y(s) - my).powi(2)), mean(&|s| (x(s) - mx).powi(2))];
    let both = mean(&|s| (y(s) - my) * (x(s) - mx));
    let share = both * both / (vx * vy);
    let varies = vy > f64::from(spec.goal_radius).powi(2);
    if !varies || share.is_nan() || share < LEAST_SHARE {
        return None;
    }
    // Either may be off, so neither is regressed on the other.
    let slope = both.signum() * (vy / vx).sqrt();
    let offset = my - slope * mx;
    let width = mean(&|s| (y(s) - slope * x(s) - offset).powi(2)).sqrt();
    let [slope, offset, width] = [slope, offset, width].map(|v| v as f32);
    let contact = Contact { goal, other, slope, offset, width };
    contact.fits(spec).then_some((share, contact))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::env::tests::positions;

    /// A finger on a line, a disc that it pushes, and a number without meaning, each in its own order
    /// and unit; `rests` is how many steps pass between two touches.
    fn walk(order: [usize; 3], units: [f32; 3], rests: usize) -> Vec<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut rows = Vec::new();
        for step in 0..4_000 {
            let disc = (step / (rests + 1)) as f32 * 7.0 % 10.0;
            let away = if step % (rests + 1) == rests { 0.4 } else { rng.random_range(-9.0..9.0) };
            let numbers = [disc + away, disc, rng.random_range(-9.0..9.0)];
            rows.extend(order.map(|i| units[i] * numbers[i]));
        }
        rows
    }

    #[test]
    fn what_is_at_an_object_when_it_begins_to_move_is_found_in_any_order_and_unit() {
        for (order, units) in [([0, 1, 2], [1.0; 3]), ([2, 1, 0], [-3.0, 1.0, 0.1])] {
            let spec =
                Spec { achieved: vec![1], ..positions(&[(0.0, 10.0), (0.0, 10.0), (0.0, 10.0)]) };
            let found = find(&spec, &[&walk(order, units, 9)]);
            let [contact] = found[..] else { panic!("{found:?}") };
            assert_eq!((contact.goal, order[contact.other]), (1, 0));
            assert!((contact.slope - 1.0 / units[0]).abs() < 0.01, "{contact:?}");
            assert!(contact.fits(&spec) && !Contact { other: 3, ..contact }.fits(&spec));
            // Where it moves all the time, nothing begins.
            assert_eq!(find(&spec, &[&walk(order, units, 0)]), []);
        }
    }
}
