//! Colours, contours and pictures, for all front ends.

mod animation;
mod colour;
mod contour;
mod letters;
mod picture;
mod raster;
mod segment;

pub use animation::Animation;
pub use colour::{Rgb, WALL, blend, contour, contrast, distance_colour, hex, lightness, sample};
pub use contour::{ContourLine, ContourPath, contour_interval, contour_lines, contour_paths};
pub use letters::{TextPixel, has_letter, paint_text, text_size};
pub use picture::Picture;
pub use raster::{Ground, Raster};
pub use segment::positions_along;
