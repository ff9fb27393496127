//! D of a film's frame on planes, from the points in space that were filmed.

use super::Plane;
use crate::env::ArmScene;
use crate::env::fetch_reach::ProbeLattice;
use crate::train::FilmFrame;
use crate::viewer::film::mean_distance;

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
        // Beside the table and the wall, only some of the points have a value.
        let around = lattice.around(at).filter(|_| scene.has_room(at));
        around.map_or(f32::NAN, |around| mean_distance(frame, around))
    };
    (0..plane.raster.len()).map(value).collect()
}
