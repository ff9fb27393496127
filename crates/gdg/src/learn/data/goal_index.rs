//! An index of goals by position, to search for those near a point.
//!
//! Goals are kept in a grid of buckets over the first two components, so that a search visits only
//! the buckets around the point. It finds exactly what a scan of all goals would, ties included:
//! runs must not depend on the index. (Libraries of spatial trees need the number of dimensions at
//! compile time and leave the order of ties open.)

use serde::{Deserialize, Serialize};

use crate::env::Spec;

/// Maximum number of components used for buckets.
const AXES: usize = 2;

/// Buckets along each axis of an empty grid, and the most there can be.
const BUCKETS: std::ops::RangeInclusive<usize> = 8..=1024;

/// The grid is refined when there are more places than this share of its buckets.
const MAX_PLACES_PER_BUCKET: f32 = 0.25;

/// Extra reach of searches as a share of a bucket's side; exceeds all rounding errors.
const ROUNDING_SLACK: f32 = 0.01;

/// Distance between places that differ in anything but the goal, in goal radii: farther than any two
/// goals.
const FAR_RADII: f32 = 1e4;

/// End of a bucket's list.
const NONE: u32 = u32::MAX;

/// A component of the state, in cells of a width.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    pub component: usize,
    /// Width of a cell, in the component's unit.
    pub width: f32,
    /// Lower end of a cell.
    pub low: f32,
    /// Typical change per step that moves it.
    pub step: f32,
}

impl Axis {
    /// Whether what a checkpoint has kept fits the world.
    pub fn fits(&self, spec: &Spec) -> bool {
        let is_sound = |v: f32| v > 0.0 && v.is_finite();
        self.component < spec.state_dim()
            && is_sound(self.width)
            && is_sound(self.step)
            && self.low.is_finite()
    }

    pub fn cell(&self, state: &[f32]) -> i32 {
        ((state[self.component] - self.low) / self.width).floor() as i32
    }
}

/// Goals, called places here, each with an index from 0 in the order in which they were added. Where
/// more than the goal tells states apart, such as a key, a search for a state finds those that agree
/// in it first, and a search for a goal those of any kind.
#[derive(Clone, Debug, Default)]
pub struct GoalIndex {
    goal_dim: usize,
    /// `(places, goal_dim)`.
    goals: Vec<f32>,
    /// The goal's components of the state, and what else tells states apart.
    achieved: Vec<usize>,
    others: Vec<Axis>,
    /// Distance between cells of the latter.
    far: f32,
    /// Goals and the latter, `(places, goal_dim + others)`; empty if there are none.
    places: Vec<f32>,
    /// Lower end and length of the range of each axis; places outside it belong to the buckets at
    /// its edge.
    ranges: Vec<(f32, f32)>,
    /// Buckets along each axis.
    side: usize,
    /// The latest place in each bucket, and the one before each place in the same bucket.
    latest: Vec<u32>,
    before: Vec<u32>,
}

impl GoalIndex {
    /// Creates an empty set of places of a world with `spec`.
    pub(crate) fn new(spec: &Spec, others: &[Axis]) -> Self {
        let ranges = spec.achieved.iter().take(AXES).map(|i| {
            let half = spec.state_half_range[*i];
            (spec.state_centre[*i] - half, 2.0 * half)
        });
        let mut places = Self {
            goal_dim: spec.goal_dim(),
            goals: Vec::new(),
            achieved: spec.achieved.clone(),
            others: others.to_vec(),
            far: FAR_RADII * spec.goal_radius,
            places: Vec::new(),
            ranges: ranges.collect(),
            side: *BUCKETS.start(),
            latest: Vec::new(),
            before: Vec::new(),
        };
        places.refill();
        places
    }

    pub(crate) fn len(&self) -> usize {
        self.before.len()
    }

    pub(crate) fn goals(&self) -> &[f32] {
        &self.goals
    }

    /// Returns place `i`, `(goal_dim)`.
    pub(crate) fn goal(&self, i: usize) -> &[f32] {
        &self.goals[i * self.goal_dim..(i + 1) * self.goal_dim]
    }

    /// Returns the place of `state`, to search for it or to add it.
    pub(crate) fn place_of(&self, state: &[f32]) -> Vec<f32> {
        let others = self.others.iter().map(|axis| axis.cell(state) as f32 * self.far);
        self.achieved.iter().map(|i| state[*i]).chain(others).collect()
    }

    /// Returns place `i` with what tells it apart beside the goal.
    pub(crate) fn place(&self, i: usize) -> &[f32] {
        let width = self.goal_dim + self.others.len();
        if self.others.is_empty() { self.goal(i) } else { &self.places[i * width..][..width] }
    }

    /// Whether places differ in more than the goal.
    pub(crate) fn differ_in_more(&self) -> bool {
        !self.others.is_empty()
    }

    /// Whether place `i` and another one differ in the goal alone.
    pub(crate) fn is_like(&self, i: usize, place: &[f32]) -> bool {
        self.place(i)[self.goal_dim..] == place[self.goal_dim..]
    }

    /// Whether places `i` and `j` differ in the goal alone.
    pub(crate) fn are_alike(&self, i: usize, j: usize) -> bool {
        self.is_like(i, self.place(j))
    }

    /// Adds a place, `(goal_dim + others)`.
    pub(crate) fn push(&mut self, place: &[f32]) {
        self.goals.extend(&place[..self.goal_dim]);
        if !self.others.is_empty() {
            self.places.extend(place);
        }
        self.link(self.len());
        let full = self.len() as f32 > MAX_PLACES_PER_BUCKET * self.latest.len() as f32;
        if full && self.side < *BUCKETS.end() {
            self.side *= 2;
            self.refill();
        }
    }

    /// Returns the place nearest to `at` and its straight-line distance; of several, the first.
    /// `None` without places.
    pub(crate) fn nearest(&self, at: &[f32]) -> Option<(usize, f32)> {
        let rings = self.rings(at);
        // Squares are compared, as different ones can have the same root.
        let (mut least, mut found) = (f32::INFINITY, usize::MAX);
        let mut ring = 0;
        while rings.may_be_within(ring, least.sqrt()) {
            rings.visit(ring, |i, squared| {
                if squared < least || (squared == least && i < found) {
                    (least, found) = (squared, i);
                }
            });
            ring += 1;
        }
        (found < self.len()).then(|| (found, least.sqrt()))
    }

    /// Returns the `count` places nearest to `at` by straight-line distance, nearest first and in
    /// the order of their indices where equally far.
    pub(crate) fn nearest_few(&self, at: &[f32], count: usize) -> Vec<usize> {
        let rings = self.rings(at);
        // Non-negative floats are in the same order as their bits.
        let mut near: Vec<(u32, u32)> = Vec::with_capacity(2 * count);
        let (mut ring, mut farthest) = (0, f32::INFINITY);
        while count > 0 && rings.may_be_within(ring, farthest) {
            rings.visit(ring, |i, squared| near.push((squared.sqrt().to_bits(), i as u32)));
            if near.len() >= count {
                farthest = f32::from_bits(near.select_nth_unstable(count - 1).1.0);
                near.truncate(count);
            }
            ring += 1;
        }
        near.sort_unstable();
        near.into_iter().map(|(_, i)| i as usize).collect()
    }

    /// Whether `test` holds for any place within `radius` of `at`, given its index and
    /// straight-line distance. The order of the tests is undefined.
    pub(crate) fn any_within(
        &self,
        at: &[f32],
        radius: f32,
        mut test: impl FnMut(usize, f32) -> bool,
    ) -> bool {
        let rings = self.rings(at);
        let (mut ring, mut found) = (0, false);
        while !found && rings.may_be_within(ring, radius) {
            rings.visit(ring, |i, squared| {
                let distance = squared.sqrt();
                found = found || (distance <= radius && test(i, distance));
            });
            ring += 1;
        }
        found
    }

    /// Passes all places within `radius` of `at` to `visit`, with their straight-line distance, in
    /// no particular order.
    pub(crate) fn for_each_within(
        &self,
        at: &[f32],
        radius: f32,
        mut visit: impl FnMut(usize, f32),
    ) {
        let _ = self.any_within(at, radius, |i, distance| {
            visit(i, distance);
            false
        });
    }

    fn rings<'a>(&'a self, at: &'a [f32]) -> Rings<'a> {
        let centre = self.bucket(at);
        let mut gaps = [[f32::INFINITY; 2]; AXES];
        let mut widths = [0.0; AXES];
        for (axis, ((at, (low, length)), bucket)) in
            at.iter().zip(&self.ranges).zip(centre).enumerate()
        {
            let width = length / self.side as f32;
            let below = low + bucket as f32 * width;
            widths[axis] = width;
            gaps[axis] = [at - below, below + width - at].map(|gap| gap - ROUNDING_SLACK * width);
        }
        Rings { index: self, at, centre, gaps, widths }
    }

    fn squared(&self, at: &[f32], i: usize) -> f32 {
        match *at {
            // The usual case, without a loop; the sum is the same bit for bit.
            [x, y] if self.goal_dim == 2 => {
                let [dx, dy] = [x - self.goals[2 * i], y - self.goals[2 * i + 1]];
                dx * dx + dy * dy
            }
            _ => at.iter().zip(self.place(i)).map(|(a, p)| (a - p) * (a - p)).sum(),
        }
    }

    /// Returns the bucket of a point along each axis.
    fn bucket(&self, at: &[f32]) -> [usize; AXES] {
        let mut bucket = [0; AXES];
        for ((bucket, at), (low, length)) in bucket.iter_mut().zip(at).zip(&self.ranges) {
            *bucket = (((at - low) / length * self.side as f32) as usize).min(self.side - 1);
        }
        bucket
    }

    fn link(&mut self, i: usize) {
        let [x, y] = self.bucket(self.goal(i));
        self.before.push(std::mem::replace(&mut self.latest[y * self.side + x], i as u32));
    }

    /// Puts all places into the buckets of an empty grid.
    fn refill(&mut self) {
        let places = self.goals.len() / self.goal_dim.max(1);
        self.latest = vec![NONE; self.side * self.side];
        self.before.clear();
        (0..places).for_each(|i| self.link(i));
    }
}

/// The buckets around a point, in rings: the k-th are those k buckets away along one axis and at
/// most as many along the other.
struct Rings<'a> {
    index: &'a GoalIndex,
    at: &'a [f32],
    /// The bucket of the point.
    centre: [usize; AXES],
    /// Distance from the point to the lower and the upper end of its bucket, along each axis.
    gaps: [[f32; 2]; AXES],
    /// Size of a bucket along each axis.
    widths: [f32; AXES],
}

impl Rings<'_> {
    /// Returns whether there are rings from `ring` on, and places in them may be within `radius`.
    fn may_be_within(&self, ring: usize, radius: f32) -> bool {
        if ring == 0 {
            return true;
        }
        let side = self.index.side;
        let ends = self.centre.iter().zip(&self.gaps).zip(&self.widths);
        // A lower bound on their distance, from the sides on which there are more buckets.
        let gap = ends.fold(f32::INFINITY, |gap, ((centre, [below, above]), width)| {
            let inner = (ring - 1) as f32 * width;
            let gap = if ring <= *centre { gap.min(below + inner) } else { gap };
            if centre + ring < side { gap.min(above + inner) } else { gap }
        });
        ring < side && gap <= radius
    }

    /// Passes the places in `ring` to `visit`, with their squared distance from the point.
    fn visit(&self, ring: usize, mut visit: impl FnMut(usize, f32)) {
        let (last, [x, y]) = (self.index.side - 1, self.centre);
        let mut visit_bucket = |x: usize, y: usize| {
            let mut place = self.index.latest[y * self.index.side + x];
            while place != NONE {
                visit(place as usize, self.index.squared(self.at, place as usize));
                place = self.index.before[place as usize];
            }
        };
        for row in y.saturating_sub(ring)..=(y + ring).min(last) {
            if row.abs_diff(y) == ring {
                (x.saturating_sub(ring)..=(x + ring).min(last)).for_each(|x| visit_bucket(x, row));
                continue;
            }
            // Between its first and last row, a ring has two columns.
            if x >= ring {
                visit_bucket(x - ring, row);
            }
            if x + ring <= last {
                visit_bucket(x + ring, row);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::env::tests::positions;

    /// Returns all places as a scan finds them, nearest first.
    fn scan(places: &GoalIndex, at: &[f32]) -> Vec<(usize, f32)> {
        let mut all: Vec<(usize, f32)> =
            (0..places.len()).map(|i| (i, places.squared(at, i))).collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        all
    }

    #[test]
    fn a_search_for_a_state_finds_its_kind_first_and_one_for_a_goal_any() {
        let spec =
            Spec { achieved: vec![0, 1], ..positions(&[(0.0, 50.0), (0.0, 50.0), (0.5, 0.5)]) };
        let key = Axis { component: 2, width: 0.125, low: 0.0, step: 0.125 };
        let mut places = GoalIndex::new(&spec, &[key]);
        for state in [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 1.0, 1.0], [40.0, 1.0, 1.0]] {
            places.push(&places.place_of(&state));
        }
        let few = |state: [f32; 3]| places.nearest_few(&places.place_of(&state), 3);
        assert_eq!([few([1.0, 0.0, 0.0]), few([1.0, 0.0, 1.0])], [[0, 1, 2], [2, 3, 0]]);
        assert_eq!(places.nearest_few(&[1.0, 0.0], 3), [0, 2, 1]);
        assert!(places.are_alike(0, 1) && !places.are_alike(0, 2));
        assert_eq!(places.goals()[4..6], [0.0, 1.0]);
    }

    proptest! {
        /// With ties, places outside the range, an axis without a range, and one, two or three
        /// components.
        #[test]
        fn a_search_finds_what_a_scan_finds(
            ranges in prop::collection::vec(
                prop_oneof![Just((500.0, 500.0)), Just((20.5, 20.0)), Just((0.0, 0.1)), Just((3.0, 0.0))],
                1..4,
            ),
            points in prop::collection::vec((prop::array::uniform3(-1.2f32..1.2), any::<bool>()), 0..600),
            queries in prop::collection::vec((prop::array::uniform3(-1.5f32..1.5), any::<bool>()), 8),
            count in 1usize..60,
            radius in 0.0f32..0.5,
        ) {
            let goal = |(shares, rounded): &([f32; 3], bool)| -> Vec<f32> {
                let of_axis = |((centre, half), share): (&(f32, f32), &f32)| {
                    let share = if *rounded { (share * 10.0).round() / 10.0 } else { *share };
                    centre + half * share
                };
                ranges.iter().zip(shares).map(of_axis).collect()
            };
            let mut places = GoalIndex::new(&positions(&ranges), &[]);
            points.iter().for_each(|point| places.push(&goal(point)));
            prop_assert_eq!(places.len(), points.len());
            for query in &queries {
                let at = goal(query);
                let all = scan(&places, &at);
                prop_assert_eq!(places.nearest(&at), all.first().map(|(i, squared)| (*i, squared.sqrt())));
                let mut few: Vec<(usize, f32)> = all.iter().map(|(i, squared)| (*i, squared.sqrt())).collect();
                few.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                let nearest: Vec<usize> = few.iter().take(count).map(|(i, _)| *i).collect();
                prop_assert_eq!(places.nearest_few(&at, count), nearest);
                let radius = radius * ranges[0].1;
                let (mut within, mut visited) = (Vec::new(), Vec::new());
                places.any_within(&at, radius, |i, distance| {
                    within.push((i, distance));
                    false
                });
                places.for_each_within(&at, radius, |i, distance| visited.push((i, distance)));
                prop_assert_eq!(&visited, &within);
                few.retain(|(_, distance)| *distance <= radius);
                few.sort_by_key(|(i, _)| *i);
                within.sort_by_key(|(i, _)| *i);
                prop_assert_eq!(within, few);
            }
        }
    }
}
