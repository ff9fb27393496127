//! Where the film of a run shows D: on a lattice of points in the space that the grip reaches, at
//! rest.

use super::{ArmScene, STATE};
use crate::env::Probes;

/// Points along each axis.
const ALONG: usize = 11;

/// The points of a film, a lattice along all axes.
#[derive(Clone, Copy, Debug)]
pub struct ProbeLattice {
    low: [f32; 3],
    high: [f32; 3],
    /// Distance between neighbouring points along each axis, in metres.
    apart: [f32; 3],
}

impl ProbeLattice {
    /// Returns the lattice over the grip positions of `scene`.
    pub fn new(scene: &ArmScene) -> Self {
        let [low, high] = scene.positions();
        Self { low, high, apart: std::array::from_fn(|i| (high[i] - low[i]) / (ALONG - 1) as f32) }
    }

    /// Returns the number of points.
    pub fn places(&self) -> usize {
        ALONG.pow(3)
    }

    /// Returns a point.
    pub fn point(&self, place: usize) -> [f32; 3] {
        let at = [place % ALONG, place / ALONG % ALONG, place / ALONG.pow(2)];
        // Rounding must not leave the space.
        std::array::from_fn(|i| (self.low[i] + at[i] as f32 * self.apart[i]).min(self.high[i]))
    }

    /// Returns the points around `at` and their weights, which sum up to 1; `None` outside the
    /// lattice.
    pub fn around(&self, at: [f32; 3]) -> Option<[(usize, f32); 8]> {
        let along: [f32; 3] = std::array::from_fn(|i| (at[i] - self.low[i]) / self.apart[i]);
        if !along.iter().all(|along| (0.0..=(ALONG - 1) as f32).contains(along)) {
            return None;
        }
        let first = along.map(|along| (along as usize).min(ALONG - 2));
        Some(std::array::from_fn(|corner| {
            let (mut place, mut weight) = (0, 1.0);
            for i in (0..3).rev() {
                let (up, share) = (corner >> i & 1, along[i] - first[i] as f32);
                place = place * ALONG + first[i] + up;
                weight *= if up == 1 { share } else { 1.0 - share };
            }
            (place, weight)
        }))
    }
}

/// Returns the probes of a film, with the centre of the goal region as the goal.
pub fn points() -> Probes {
    let lattice = ProbeLattice::new(&ArmScene);
    let [low, high] = ArmScene.goals();
    let middle: [f32; 3] = std::array::from_fn(|i| f32::midpoint(low[i], high[i]));
    let of_place: Vec<usize> =
        (0..lattice.places()).filter(|place| ArmScene.has_room(lattice.point(*place))).collect();
    let mut states = vec![0.0; of_place.len() * STATE];
    for (state, place) in states.chunks_exact_mut(STATE).zip(&of_place) {
        state[..3].copy_from_slice(&lattice.point(*place));
    }
    Probes {
        places: lattice.places(),
        place_of: of_place.into_iter().map(|place| place as u32).collect(),
        states,
        goal: ArmScene.nearest_goal(middle).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::MAX_PROBES;

    #[test]
    fn points_lie_where_the_grip_may_be() {
        let probes = points();
        assert!(probes.places <= MAX_PROBES);
        assert!(probes.place_of.len() < probes.places, "none is below the table");
        assert_eq!(probes.states.len(), probes.place_of.len() * STATE);
    }

    #[test]
    fn between_points_a_linear_function_is_exact() {
        let lattice = ProbeLattice::new(&ArmScene);
        let value = |[x, y, z]: [f32; 3]| 1.0 + 2.0 * x - 3.0 * y + 0.5 * z;
        let [low, high] = ArmScene.positions();
        for share in [[0.0, 0.0, 0.0], [0.31, 0.77, 0.5], [0.99, 0.02, 0.6]] {
            let at: [f32; 3] = std::array::from_fn(|i| low[i] + share[i] * (high[i] - low[i]));
            let around = lattice.around(at).expect("inside");
            let found: f32 =
                around.iter().map(|(place, weight)| weight * value(lattice.point(*place))).sum();
            assert!((found - value(at)).abs() < 1e-4, "{at:?}: {found}");
        }
        assert!(lattice.around([low[0] - 0.01, low[1], low[2]]).is_none());
        assert!(lattice.around([f32::NAN; 3]).is_none());
    }
}
