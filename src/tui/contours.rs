//! Contour lines on a canvas.

use super::canvas::Canvas;
use super::theme::Theme;
use gdg::draw::{ContourPath, contour_interval, contour_paths};

/// Minimum average distance between lines, in pixels of the field: as characters, and in pictures.
const SPACING: f32 = 6.0;
const PICTURE_SPACING: f32 = 3.0;

/// Relative deviation from that distance before the interval changes, so that it does not flip.
const TOLERANCE: f32 = 0.15;

/// Width of a line in a picture, as a share of a character's height.
const WIDTH: f32 = 0.07;

/// The distance of neighbouring points of a line in a picture, in pixels.
const STEP: f32 = 3.0;

/// Returns the common interval of the lines of `fields`; `before` if that is nearly right.
pub fn interval(fields: &[(&[f32], usize)], is_fine: bool, before: Option<f32>) -> Option<f32> {
    let apart = if is_fine { PICTURE_SPACING } else { SPACING };
    let with = |spacing: f32| {
        fields
            .iter()
            .map(|(field, columns)| contour_interval(field, *columns, spacing))
            .reduce(f32::max)
    };
    let spacings = [apart, (1.0 - TOLERANCE) * apart, (1.0 + TOLERANCE) * apart];
    let same = before.is_some() && spacings.into_iter().any(|spacing| with(spacing) == before);
    if same { before } else { with(apart) }
}

/// Draws the lines of `field`, which has rows of `columns` values all over the canvas, at the
/// multiples of `interval`.
pub fn draw(canvas: &mut Canvas, (field, columns): (&[f32], usize), interval: f32, theme: &Theme) {
    let rows = (field.len() / columns).max(1);
    let (across, down) = canvas.raster.pixels;
    let pixel = [across as f32 / columns as f32, down as f32 / rows as f32];
    let middle = |i: usize| [(i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5];
    let is_fine = canvas.is_fine;
    let points = |path: ContourPath| {
        if is_fine {
            smooth(path.points.iter().map(|at| [at[0] * pixel[0], at[1] * pixel[1]]).collect())
        } else {
            path.pixels(columns).into_iter().map(middle).collect()
        }
    };
    let lines: Vec<Vec<[f32; 2]>> =
        contour_paths(field, columns, interval).into_iter().map(points).collect();
    canvas.contours(&lines, WIDTH, theme);
}

/// Returns a line without its corners, as points that are [`STEP`] apart.
fn smooth(mut points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    let between = |a: [f32; 2], b: [f32; 2], share: f32| {
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    };
    // Chaikin's algorithm cuts corners.
    for _ in 0..2 {
        let (Some(first), Some(last)) = (points.first(), points.last()) else { return points };
        let cut = points
            .windows(2)
            .flat_map(|ends| [0.25, 0.75].map(|share| between(ends[0], ends[1], share)));
        points = [*first].into_iter().chain(cut).chain([*last]).collect();
    }
    let mut even: Vec<[f32; 2]> = points.first().copied().into_iter().collect();
    let mut left = STEP;
    for ends in points.windows(2) {
        let length = (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]);
        let mut at = left;
        while at <= length {
            even.push(between(ends[0], ends[1], at / length));
            at += STEP;
        }
        left = at - length;
    }
    even.extend(points.last());
    even
}
