//! Colours, contours and pictures, for all front ends.

mod contour;
mod picture;
mod raster;

use colorous::Gradient;

pub use contour::{ContourPath, contour_interval, contour_paths};
pub use picture::{Picture, TextPixel, has_letter, paint_text, text_size};
pub use raster::{Raster, RasterPixel, trace};

/// Red, green, blue.
pub type Rgb = (u8, u8, u8);

/// The colour of walls in pictures.
pub const WALL: Rgb = (58, 58, 66);

/// Returns the colour of a distance, given as a share of the farthest shown: near is light, far is
/// dark.
pub fn distance_colour(gradient: Gradient, share: f32) -> Rgb {
    // The darkest end is left out, as walls and the background use it.
    sample(gradient, 0.95 - 0.85 * share.clamp(0.0, 1.0))
}

/// Returns the colour at a share (from 0 to 1) of a gradient.
pub fn sample(gradient: Gradient, at: f32) -> Rgb {
    let colour = gradient.eval_continuous(f64::from(at));
    (colour.r, colour.g, colour.b)
}

/// Returns how light a colour looks, from 0 to 1 (ITU-R BT.601 luma).
pub fn lightness((r, g, b): Rgb) -> f32 {
    (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)) / 255.0
}

/// Returns the contrast of two colours, from 1 (none) to 21: the ratio of WCAG 2.
pub fn contrast(a: Rgb, b: Rgb) -> f32 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Returns the relative luminance of a colour, from 0 to 1 (WCAG 2).
fn luminance((r, g, b): Rgb) -> f32 {
    let [r, g, b] = [r, g, b].map(|channel| {
        let own = f32::from(channel) / 255.0;
        if own <= 0.04045 { own / 12.92 } else { ((own + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Returns a colour as SVG writes it, `#rrggbb`.
pub fn hex((r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Returns the colour `share` of the way from one to another.
pub fn blend(from: Rgb, to: Rgb, share: f32) -> Rgb {
    let mix = |from: u8, to: u8| {
        (f32::from(from) + share * (f32::from(to) - f32::from(from))).round() as u8
    };
    (mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// Returns the colour of a contour line on `ground`: darker on light ground, lighter on dark
/// ground.
pub fn contour(ground: Rgb) -> Rgb {
    let to = if lightness(ground) > 0.4 { (0, 0, 0) } else { (255, 255, 255) };
    blend(ground, to, 0.45)
}

/// Returns `count` + 1 evenly spaced positions from one end to the other; `count` is at least 1.
pub fn positions_along([from, to]: [[f32; 2]; 2], count: usize) -> impl Iterator<Item = [f32; 2]> {
    (0..=count).map(move |n| {
        let share = n as f32 / count as f32;
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    })
}
