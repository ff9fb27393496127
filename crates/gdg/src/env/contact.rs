//! Contacts: what is close together where the achieved goal begins to move, such as a hand and the
//! object that it pushes.

use serde::{Deserialize, Serialize};

use crate::env::{MAX_MAGNITUDE, Spec, share};

/// Contacts are looked for in at least this many steps that begin to move the achieved goal: the first
/// ones are of few episodes, in which it is at the same place.
const LEAST_BEGINNINGS: usize = 100;

/// A component goes with the beginnings of moves if its variance there, once a component of the goal is
/// accounted for, is at most this share of its variance everywhere.
const MOST_SHARE: f64 = 0.3;

/// Share of the beginnings ignored at either end of the range of a goal component: an object that has
/// fallen off the table begins to move elsewhere.
const TAIL: f64 = 0.05;

/// It goes along with a component of the goal that accounts for at least this share of its variance there;
/// otherwise it has one place.
const LEAST_RELATED: f64 = 0.7;

/// Where the achieved goal begins to move, component `other` of the state is about `slope * goal + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// A component that is not part of the achieved goal.
    pub other: usize,
    /// The component of the goal that it goes with most closely.
    pub goal: usize,
    /// Units of the one for one of the other; 0 where it is always at the same place.
    pub slope: f32,
    /// The one where the other is 0.
    pub offset: f32,
    /// The root mean square of the difference.
    pub width: f32,
}

impl Contact {
    /// Returns how far apart the two are in `state`, in widths.
    pub fn apart(&self, state: &[f32]) -> f32 {
        (state[self.other] - self.slope * state[self.goal] - self.offset) / self.width
    }

    /// Whether it is one of states of `spec`.
    pub fn fits(&self, spec: &Spec) -> bool {
        let numbers = [self.slope, self.offset, 1.0 / self.width];
        self.goal.max(self.other) < spec.state_dim()
            && self.width > 0.0
            && numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE)
    }
}

/// Refits the contacts to `walks`, `(steps, state_dim)` each. Known ones keep their places, so that
/// networks keep their weights, and new ones come last. Returns whether any has changed.
pub fn refine(spec: &mut Spec, walks: &[&[f32]]) -> bool {
    let before = spec.contacts.clone();
    for found in find(spec, walks) {
        match spec.contacts.iter_mut().find(|known| known.other == found.other) {
            Some(known) => *known = found,
            None => spec.contacts.push(found),
        }
    }
    spec.contacts != before
}

/// Returns the contacts in `walks`, `(steps, state_dim)` each. There is none where the goal is the whole
/// state or is always moving.
fn find(spec: &Spec, walks: &[&[f32]]) -> Vec<Contact> {
    let mut beginnings: Vec<&[f32]> =
        walks.iter().flat_map(|walk| beginnings(spec, walk)).collect();
    if beginnings.len() < LEAST_BEGINNINGS {
        return Vec::new();
    }
    for i in &spec.achieved {
        let [low, high] = share(beginnings.iter().map(|state| state[*i]).collect(), TAIL);
        beginnings.retain(|state| (low..=high).contains(&state[*i]));
    }
    let all: Vec<&[f32]> =
        walks.iter().flat_map(|walk| walk.chunks_exact(spec.state_dim())).collect();
    let others = (0..spec.state_dim()).filter(|i| !spec.achieved.contains(i));
    others.filter_map(|other| contact(spec, [&beginnings, &all], other)).collect()
}

/// Returns the states of `walk` in which the achieved goal begins to move.
fn beginnings<'a>(spec: &Spec, walk: &'a [f32]) -> Vec<&'a [f32]> {
    let states: Vec<&[f32]> = walk.chunks_exact(spec.state_dim()).collect();
    let moves: Vec<bool> =
        states.windows(2).map(|pair| spec.goal_moves(pair[0], pair[1])).collect();
    let begins = |k: &usize| moves[*k] && (*k == 0 || !moves[k - 1]);
    (0..moves.len()).filter(begins).map(|k| states[k]).collect()
}

/// Returns the mean product of components `i` and `j`, each less its mean, and these means.
fn covariance(states: &[&[f32]], [i, j]: [usize; 2]) -> (f64, [f64; 2]) {
    let count = states.len() as f64;
    let means = [i, j].map(|i| states.iter().map(|state| f64::from(state[i])).sum::<f64>() / count);
    let apart = |state: &[f32], i: usize, mean: f64| f64::from(state[i]) - mean;
    let products = states.iter().map(|s| apart(s, i, means[0]) * apart(s, j, means[1]));
    (products.sum::<f64>() / count, means)
}

/// Returns the contact of component `other`, if there is one: by the component of the goal that accounts
/// for most of its variance.
fn contact(spec: &Spec, [beginnings, all]: [&[&[f32]]; 2], other: usize) -> Option<Contact> {
    let usual = covariance(all, [other; 2]).0;
    let own = covariance(beginnings, [other; 2]).0;
    let by = |goal: &usize| {
        let (both, [mean, goal_mean]) = covariance(beginnings, [other, *goal]);
        let variance = covariance(beginnings, [*goal; 2]).0;
        let goes_along = both * both >= LEAST_RELATED * own * variance;
        let slope = if goes_along && variance > 0.0 { both / variance } else { 0.0 };
        let numbers = [slope, mean - slope * goal_mean, (own - slope * both).max(0.0).sqrt()];
        let [slope, offset, width] = numbers.map(|v| v as f32);
        Contact { other, goal: *goal, slope, offset, width }
    };
    let closest = spec.achieved.iter().map(by).min_by(|a, b| a.width.total_cmp(&b.width))?;
    let is_close = f64::from(closest.width).powi(2) <= MOST_SHARE * usual;
    (is_close && closest.fits(spec)).then_some(closest)
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
            let turn = step / (rests + 1);
            let disc = turn as f32 * 7.0 % 10.0;
            let is_at_it = step % (rests + 1) == rests;
            let away = if is_at_it { 0.4 } else { 9.0 } * rng.random_range(-1.0..1.0);
            // Now and then it has fallen, and begins to move again far below.
            let lies = if turn % 30 == 7 { -300.0 } else { disc };
            let numbers = [disc + away, lies, rng.random_range(-9.0..9.0)];
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
            assert!((contact.slope / units[0] - 1.0).abs() < 0.01, "{contact:?}");
            assert!(contact.fits(&spec) && !Contact { other: 3, ..contact }.fits(&spec));
            // Where it moves all the time, nothing begins.
            let (rests, now) = (walk(order, units, 0), walk(order, units, 7));
            assert_eq!(find(&spec, &[&rests]), []);
            // What is found later is better.
            let early = Contact { width: 2.0 * contact.width, ..contact };
            let mut known = Spec { contacts: vec![early], ..spec.clone() };
            assert!(!refine(&mut known, &[&rests]) && refine(&mut known, &[&now]));
            assert_eq!(known.contacts, find(&spec, &[&now]));
        }
    }
}
