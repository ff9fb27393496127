//! D between the places at which a film shows it.

use crate::train::FilmFrame;

/// Returns the mean of D in `frame` over places, each with a weight; NaN if it is not known at any
/// place with a positive weight.
pub fn mean_distance(frame: &FilmFrame, places: impl IntoIterator<Item = (usize, f32)>) -> f32 {
    let weighted = places.into_iter().filter(|(_, weight)| *weight > 0.0);
    let (sum, weights) = weighted
        .map(|(place, weight)| (frame.distance(place), weight))
        .filter(|(distance, _)| distance.is_finite())
        .fold((0.0, 0.0), |(sum, weights), (distance, weight)| {
            (sum + weight * distance, weights + weight)
        });
    if weights > 0.0 { sum / weights } else { f32::NAN }
}
