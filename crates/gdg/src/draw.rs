//! Colours, contours and pictures, for all front ends.

mod animation;
mod colour;
mod contour;
mod picture;
mod raster;

pub use animation::Animation;
pub use colour::{Rgb, blend, contour, distance_colour, lightness, sample};
pub use contour::{ContourLine, ContourPath, contour_interval, contour_lines, contour_paths};
pub use picture::{Picture, text_size};
pub use raster::{Ground, Raster};
