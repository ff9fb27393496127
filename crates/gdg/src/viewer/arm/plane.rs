//! D on planes through the goal.

use super::ArmWorker;
use crate::draw::Raster;
use crate::viewer::Field;

/// Candidates considered at each pixel for D along the bridge graph.
const LINK_CANDIDATES_PER_PIXEL: usize = 6;

/// A plane through the goal, at right angles to the line of sight, and the pixels that show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The part shown: to the right and downwards, in metres.
    pub raster: Raster,
    /// The direction to the right, of length 1.
    pub across: [f32; 3],
    /// The direction upwards, of length 1 and at right angles to `across`.
    pub up: [f32; 3],
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Plane {
    /// Returns where the line of sight to a point on the screen, to the right and downwards in
    /// metres, meets the plane through `goal`.
    pub fn point(&self, [right, down]: [f32; 2], goal: [f32; 3]) -> [f32; 3] {
        let Self { across, up, .. } = *self;
        let (by_x, by_y) = (right - dot(goal, across), -down - dot(goal, up));
        std::array::from_fn(|i| goal[i] + by_x * across[i] + by_y * up[i])
    }

    /// Returns the point that pixel `i` shows of the plane through `goal`.
    pub(super) fn pixel(&self, i: usize, goal: [f32; 3]) -> [f32; 3] {
        self.point(self.raster.middle_of(i), goal)
    }
}

impl ArmWorker {
    /// Computes the value at every pixel of a plane through `goal` that shows where a grip may be;
    /// the others are NaN.
    pub(super) fn field(&mut self, plane: &Plane, goal: [f32; 3]) -> Vec<f32> {
        let count = plane.raster.len();
        let mut field = vec![f32::NAN; count];
        let shown: Vec<(usize, [f32; 3])> = (0..count)
            .map(|i| (i, plane.pixel(i, goal)))
            .filter(|(_, at)| self.scene.has_room(*at))
            .collect();
        if self.shown.kind == Field::Plain || shown.is_empty() {
            return field;
        }
        let Some(arm) = self.reacher.world() else { return field };
        let spec = arm.spec();
        let mut states = vec![0.0; shown.len() * spec.state_dim()];
        for (state, (_, at)) in states.chunks_exact_mut(spec.state_dim()).zip(&shown) {
            // At rest: everything but the position is 0.
            spec.achieved.iter().zip(at).for_each(|(i, number)| state[*i] = *number);
        }
        for ((i, _), value) in shown.iter().zip(self.distances(&states, &shown, goal)) {
            field[*i] = value;
        }
        field
    }

    /// Returns the values at `states`, which lie at the positions in `shown`.
    fn distances(
        &mut self,
        states: &[f32],
        shown: &[(usize, [f32; 3])],
        goal: [f32; 3],
    ) -> Vec<f32> {
        let policy = &*self.shown.networks.policy;
        let mut distances = vec![0.0; shown.len()];
        match (self.shown.kind, self.reacher.pilot.graph()) {
            (Field::Composed, Some(graph)) => {
                let route = graph.route(&goal, policy, &mut self.scratch);
                return graph.composed_distances(
                    states,
                    &route,
                    LINK_CANDIDATES_PER_PIXEL,
                    policy,
                    &mut self.scratch,
                );
            }
            (Field::FromStart, _) => {
                let starts = self.reacher.reach.start_state.repeat(shown.len());
                let goals: Vec<f32> = shown.iter().flat_map(|(_, at)| *at).collect();
                policy.distances(&starts, &goals, &mut distances, &mut self.scratch);
            }
            _ => policy.distances(
                states,
                &goal.repeat(shown.len()),
                &mut distances,
                &mut self.scratch,
            ),
        }
        distances
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_the_plane_keep_the_third_coordinate_of_the_goal() {
        let raster = Raster { window: [0.0; 4], pixels: (1, 1) };
        let side = Plane { raster, across: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
        let front = Plane { across: [0.0, 1.0, 0.0], ..side };
        let goal = [1.3, 0.7, 0.5];
        for (plane, expected) in [(side, [1.2, 0.7, 0.6]), (front, [1.3, 1.2, 0.6])] {
            let at = plane.point([1.2, -0.6], goal);
            assert!((0..3).all(|i| (at[i] - expected[i]).abs() < 1e-6), "{at:?}");
        }
    }
}
