//! Where an edit has changed a world.

/// Most boxes of a region: each transition and candidate is compared with all of them.
const MAX_BOXES: usize = 16;

/// A part of the space of goals, as a few boxes along its axes that may contain more than what has
/// changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    boxes: Vec<Cuboid>,
}

#[derive(Clone, Debug, PartialEq)]
struct Cuboid {
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Cuboid {
    /// Returns the distance of `at` from the box; 0 within it.
    fn distance(&self, at: impl Iterator<Item = f32>) -> f32 {
        let gaps = at.zip(self.low.iter().zip(&self.high));
        let squares = gaps.map(|(at, (low, high))| (low - at).max(at - high).max(0.0).powi(2));
        squares.sum::<f32>().sqrt()
    }

    fn include(&mut self, low: &[f32], high: &[f32]) {
        self.low.iter_mut().zip(low).for_each(|(own, other)| *own = own.min(*other));
        self.high.iter_mut().zip(high).for_each(|(own, other)| *own = own.max(*other));
    }
}

impl Region {
    pub fn nothing() -> Self {
        Self { boxes: Vec::new() }
    }

    /// Returns the whole space, of `goal_dim` dimensions.
    pub fn everything(goal_dim: usize) -> Self {
        let whole =
            Cuboid { low: vec![f32::NEG_INFINITY; goal_dim], high: vec![f32::INFINITY; goal_dim] };
        Self { boxes: vec![whole] }
    }

    /// Adds the places between the corners `low` and `high`, both `(goal_dim)`. Boxes closer than
    /// `gap` become one, and so does the nearest one when there are too many.
    pub fn add(&mut self, low: &[f32], high: &[f32], gap: f32) {
        let centre = || low.iter().zip(high).map(|(low, high)| 0.5 * (low + high));
        let distance = |own: &Cuboid| own.distance(centre());
        let distances = self.boxes.iter().map(distance).enumerate();
        let nearest = distances.min_by(|(_, a), (_, b)| a.total_cmp(b));
        match nearest.filter(|(_, far)| *far < gap || self.boxes.len() >= MAX_BOXES) {
            Some((i, _)) => self.boxes[i].include(low, high),
            None => self.boxes.push(Cuboid { low: low.to_vec(), high: high.to_vec() }),
        }
    }

    /// Returns the straight-line distance of the goal `at` `(goal_dim)` from the region: 0 within
    /// it, infinite if it is empty.
    pub fn distance(&self, at: impl Iterator<Item = f32> + Clone) -> f32 {
        let distances = self.boxes.iter().map(move |own| own.distance(at.clone()));
        distances.fold(f32::INFINITY, f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_from_the_nearest_box() {
        let mut region = Region::nothing();
        assert_eq!(region.distance([1.0, 1.0].into_iter()), f32::INFINITY);
        region.add(&[2.0, 2.0], &[3.0, 3.0], 1.5);
        region.add(&[3.0, 2.0], &[4.0, 3.0], 1.5);
        region.add(&[20.0, 2.0], &[21.0, 3.0], 1.5);
        assert_eq!(region.boxes.len(), 2, "neighbours become one box");
        let distance = |x: f32, y: f32| region.distance([x, y].into_iter());
        assert_eq!([distance(3.9, 2.1), distance(7.0, 7.0), distance(19.0, 2.5)], [0.0, 5.0, 1.0]);
        assert_eq!(Region::everything(2).distance([9e9, -9e9].into_iter()), 0.0);
        // There are never more boxes than can be compared quickly.
        let mut region = Region::nothing();
        for i in 0..1000u16 {
            let [x, y] = [i % 37 * 9, i % 83 * 9].map(f32::from);
            region.add(&[x, y], &[x + 1.0, y + 1.0], 2.0);
            assert_eq!(region.distance([x + 0.5, y + 0.5].into_iter()), 0.0);
        }
        assert!(region.boxes.len() <= MAX_BOXES);
    }
}
