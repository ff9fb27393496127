//! D of a film's frame on planes, from the points in space that were filmed.

use super::Plane;
use crate::env::ArmScene;
use crate::env::fetch_reach::ProbeLattice;
use crate::train::FilmFrame;

/// Returns the goal of a frame.
pub fn film_goal(frame: &FilmFrame) -> [f32; 3] {
    std::array::from_fn(|i| frame.goal.get(i).copied().unwrap_or_default())
}

/// Returns the value at every pixel of a plane through the frame's goal; NaN where the grip cannot
/// be.
pub fn film_field(scene: &ArmScene, frame: &FilmFrame, plane: &Plane) -> Vec<f32> {
    let (lattice, goal) = (ProbeLattice::new(scene), film_goal(frame));
    let value = |i: usize| {
        let at = plane.pixel(i, goal);
        let around = lattice.around(at).filter(|_| scene.has_room(at))?;
        // Beside the table and the wall, only some of the points have a value.
        let known = around.into_iter().map(|(place, weight)| (frame.distance(place), weight));
        let (sum, weights) = known
            .filter(|(distance, _)| distance.is_finite())
            .fold((0.0, 0.0), |(sum, weights), (distance, weight)| {
                (sum + weight * distance, weights + weight)
            });
        (weights > 0.0).then(|| sum / weights)
    };
    (0..plane.raster.pixels.0 * plane.raster.pixels.1)
        .map(|i| value(i).unwrap_or(f32::NAN))
        .collect()
}
