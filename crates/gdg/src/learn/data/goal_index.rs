//! An index of goals by position, to search for those near a point.
//!
//! Goals are kept in a grid of buckets over the first two components, so that a search visits only
//! the buckets around the point. It finds exactly what a scan of all goals would, ties included:
//! runs must not depend on the index. (Libraries of spatial trees need the number of dimensions at
//! compile time and leave the order of ties open.)

use std::collections::BinaryHeap;

use crate::env::Spec;

/// Maximum number of components used for buckets.
const AXES: usize = 2;

/// Buckets along each axis of an empty grid, and the most there can be.
const BUCKETS: std::ops::RangeInclusive<usize> = 8..=1024;

/// The grid is refined when there are more places than this share of its buckets.
const MAX_PLACES_PER_BUCKET: f32 = 0.25;

/// Extra reach of searches as a share of a bucket's side; exceeds all rounding errors.
const ROUNDING_SLACK: f32 = 0.01;

/// End of a bucket's list.
const NONE: u32 = u32::MAX;

/// Goals, called places here, each with an index from 0 in the order in which they were added.
#[derive(Clone, Debug)]
pub struct GoalIndex {
    goal_dim: usize,
    /// `(places, goal_dim)`.
    goals: Vec<f32>,
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
    pub fn new(spec: &Spec) -> Self {
        let ranges = spec.achieved.iter().take(AXES).map(|i| {
            let half = spec.state_half_range[*i];
            (spec.state_centre[*i] - half, 2.0 * half)
        });
        let mut places = Self {
            goal_dim: spec.goal_dim(),
            goals: Vec::new(),
            ranges: ranges.collect(),
            side: *BUCKETS.start(),
            latest: Vec::new(),
            before: Vec::new(),
        };
        places.refill();
        places
    }

    /// Returns the number of places.
    pub fn len(&self) -> usize {
        self.before.len()
    }

    /// Returns whether there are no places.
    pub fn is_empty(&self) -> bool {
        self.before.is_empty()
    }

    /// Returns all places, `(places, goal_dim)`.
    pub fn goals(&self) -> &[f32] {
        &self.goals
    }

    /// Returns place `i`, `(goal_dim)`.
    pub fn goal(&self, i: usize) -> &[f32] {
        &self.goals[i * self.goal_dim..(i + 1) * self.goal_dim]
    }

    /// Adds a place, `(goal_dim)`.
    pub fn push(&mut self, goal: &[f32]) {
        self.goals.extend(goal);
        self.link(self.len());
        let full = self.len() as f32 > MAX_PLACES_PER_BUCKET * self.latest.len() as f32;
        if full && self.side < *BUCKETS.end() {
            self.side *= 2;
            self.refill();
        }
    }

    /// Returns the place nearest to `at` and its straight-line distance; of several, the first.
    /// `None` without places.
    pub fn nearest(&self, at: &[f32]) -> Option<(usize, f32)> {
        let mut best: Option<(f32, usize)> = None;
        self.search(at, f32::INFINITY, |i| {
            let found = (self.squared(at, i), i);
            // Squares are compared, as different ones can have the same root.
            if best.is_none_or(|best| found < best) {
                best = Some(found);
            }
            best.map_or(f32::INFINITY, |(squared, _)| squared.sqrt())
        });
        best.map(|(squared, i)| (i, squared.sqrt()))
    }

    /// Returns the `count` places nearest to `at` by straight-line distance, nearest first and in
    /// the order of their indices where equally far.
    pub fn nearest_few(&self, at: &[f32], count: usize) -> Vec<usize> {
        // Non-negative floats are in the same order as their bits.
        let mut nearest: BinaryHeap<(u32, usize)> = BinaryHeap::new();
        self.search(at, f32::INFINITY, |i| {
            nearest.push((self.squared(at, i).sqrt().to_bits(), i));
            if nearest.len() > count {
                nearest.pop();
            }
            let farthest = nearest.peek().filter(|_| nearest.len() >= count);
            farthest.map_or(f32::INFINITY, |(distance, _)| f32::from_bits(*distance))
        });
        nearest.into_sorted_vec().into_iter().map(|(_, i)| i).collect()
    }

    /// Whether `test` holds for any place within `radius` of `at`, given its index and
    /// straight-line distance. The order of the tests is undefined.
    pub fn any_within(
        &self,
        at: &[f32],
        radius: f32,
        mut test: impl FnMut(usize, f32) -> bool,
    ) -> bool {
        let mut found = false;
        self.search(at, radius, |i| {
            let distance = self.squared(at, i).sqrt();
            found = found || (distance <= radius && test(i, distance));
            if found { f32::NEG_INFINITY } else { radius }
        });
        found
    }

    /// Passes all places within `radius` of `at` to `visit`, with their straight-line distance, in
    /// no particular order.
    pub fn for_each_within(&self, at: &[f32], radius: f32, mut visit: impl FnMut(usize, f32)) {
        self.search(at, radius, |i| {
            let distance = self.squared(at, i).sqrt();
            if distance <= radius {
                visit(i, distance);
            }
            radius
        });
    }

    /// Passes places to `visit`, those around `at` first, until no other can be within the radius
    /// that `visit` returned last (at first, `radius`).
    fn search(&self, at: &[f32], mut radius: f32, mut visit: impl FnMut(usize) -> f32) {
        let centre = self.bucket(at);
        for ring in 0..self.side {
            if self.gap(at, centre, ring) > radius {
                return;
            }
            let [columns, rows] =
                centre.map(|at| at.saturating_sub(ring)..=(at + ring).min(self.side - 1));
            for y in rows {
                // Between its first and last row, a ring has two columns.
                let inner = if y.abs_diff(centre[1]) == ring { 1 } else { 2 * ring };
                for x in (centre[0] as isize - ring as isize..=(centre[0] + ring) as isize)
                    .step_by(inner)
                {
                    if !columns.contains(&(x as usize)) {
                        continue;
                    }
                    let mut place = self.latest[y * self.side + x as usize];
                    while place != NONE {
                        radius = visit(place as usize);
                        place = self.before[place as usize];
                    }
                }
            }
        }
    }

    /// Returns a lower bound on the distance from `at`, which is in bucket `centre`, to places
    /// `ring` or more buckets away.
    fn gap(&self, at: &[f32], centre: [usize; AXES], ring: usize) -> f32 {
        if ring == 0 {
            return 0.0;
        }
        let of_axis = |((at, bucket), (low, length)): ((&f32, usize), &(f32, f32))| {
            let width = length / self.side as f32;
            let above =
                (bucket + ring < self.side).then(|| low + (bucket + ring) as f32 * width - at);
            let below = (bucket >= ring).then(|| at - (low + (bucket + 1 - ring) as f32 * width));
            above
                .into_iter()
                .chain(below)
                .map(move |gap| gap - ROUNDING_SLACK * width)
                .fold(f32::INFINITY, f32::min)
        };
        at.iter().zip(centre).zip(&self.ranges).map(of_axis).fold(f32::INFINITY, f32::min)
    }

    /// Returns the squared distance between `at` and place `i`.
    fn squared(&self, at: &[f32], i: usize) -> f32 {
        at.iter().zip(self.goal(i)).map(|(a, p)| (a - p) * (a - p)).sum()
    }

    /// Returns the bucket of a point along each axis.
    fn bucket(&self, at: &[f32]) -> [usize; AXES] {
        let mut bucket = [0; AXES];
        for ((bucket, at), (low, length)) in bucket.iter_mut().zip(at).zip(&self.ranges) {
            *bucket = (((at - low) / length * self.side as f32) as usize).min(self.side - 1);
        }
        bucket
    }

    /// Adds place `i`, the first without a bucket, to its bucket.
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
            let mut places = GoalIndex::new(&positions(&ranges));
            points.iter().for_each(|point| places.push(&goal(point)));
            prop_assert_eq!(places.len(), points.len());
            for query in &queries {
                let at = goal(query);
                let all = scan(&places, &at);
                prop_assert_eq!(places.nearest(&at), all.first().map(|(i, squared)| (*i, squared.sqrt())));
                let mut few: Vec<(usize, f32)> = all.iter().map(|(i, squared)| (*i, squared.sqrt())).collect();
                few.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                let few: Vec<usize> = few.into_iter().take(count).map(|(i, _)| i).collect();
                prop_assert_eq!(places.nearest_few(&at, count), few);
                let radius = radius * ranges[0].1;
                let mut within = Vec::new();
                let any = places.any_within(&at, radius, |i, distance| {
                    within.push((i, distance));
                    false
                });
                prop_assert!(!any);
                let mut visited = Vec::new();
                places.for_each_within(&at, radius, |i, distance| visited.push((i, distance)));
                prop_assert_eq!(&visited, &within);
                within.sort_by_key(|(i, _)| *i);
                let mut expected: Vec<(usize, f32)> = all.iter().map(|(i, squared)| (*i, squared.sqrt())).collect();
                expected.retain(|(_, distance)| *distance <= radius);
                expected.sort_by_key(|(i, _)| *i);
                prop_assert_eq!(within, expected);
            }
        }
    }

    #[test]
    fn many_places_refine_the_grid_and_searches_visit_few_of_them() {
        let mut places = GoalIndex::new(&positions(&[(500.0, 500.0), (500.0, 500.0)]));
        for i in 0..10_000 {
            places.push(&[(i % 100) as f32 * 10.0 + 5.0, (i / 100) as f32 * 10.0 + 5.0]);
        }
        assert_eq!(places.side, 256);
        let mut visited = 0;
        places.search(&[333.0, 666.0], 12.0, |_| {
            visited += 1;
            12.0
        });
        assert!((4..60).contains(&visited), "{visited} of {}", places.len());
        assert_eq!(places.nearest(&[334.0, 667.0]).map(|(i, _)| i), Some(6633));
    }
}
