//! Contour lines on a canvas, and the labels in their gaps.

use std::collections::HashSet;

use ratatui::layout::Position;

use super::canvas::{Canvas, Label};
use super::theme::Theme;
use gdg::draw::{contour_interval, contour_paths};

/// Minimum average distance between lines, in pixels of the field: as characters, and in pictures.
const SPACING: f32 = 6.0;
const PICTURE_SPACING: f32 = 3.0;

/// Relative deviation from that distance before the interval changes, so that it does not flip.
const TOLERANCE: f32 = 0.15;

/// Width of a line in a picture, as a share of a character's height.
const WIDTH: f32 = 0.07;

/// Minimum distance of two labels, and of two of the same level, in characters' heights.
const LABEL_SPACING: f32 = 2.5;
const SAME_LEVEL_SPACING: f32 = 12.0;

/// A label covers at most this share of its line.
const MAX_COVERED_SHARE: f32 = 0.6;

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
/// multiples of `interval`, with gaps for the labels that it returns: as near to `near`, in pixels,
/// as there is room, where they move least as the field changes.
pub fn draw(
    canvas: &mut Canvas,
    (field, columns): (&[f32], usize),
    interval: f32,
    near: [f32; 2],
    theme: &Theme,
) -> Vec<Label> {
    let rows = (field.len() / columns).max(1);
    let pixel = [
        canvas.raster.pixels.0 as f32 / columns as f32,
        canvas.raster.pixels.1 as f32 / rows as f32,
    ];
    let paths = contour_paths(field, columns, interval);
    // The number of the line at each value, counted from 1; 0 if there is none.
    let mut line_at = vec![0; field.len()];
    let mut lines: Vec<(f32, Vec<[f32; 2]>)> = Vec::new();
    for (n, path) in paths.iter().enumerate() {
        let passed = path.pixels(columns);
        passed.iter().for_each(|i| line_at[*i] = n + 1);
        let points = if canvas.is_fine {
            smooth(path.points.iter().map(|at| [at[0] * pixel[0], at[1] * pixel[1]]).collect())
        } else {
            passed
                .iter()
                .map(|i| [(i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5])
                .collect()
        };
        lines.push((path.level, points));
    }
    let mut longest_first: Vec<usize> = (0..lines.len()).collect();
    longest_first.sort_by_key(|n| std::cmp::Reverse(paths[*n].points.len()));
    let mut labels: Vec<Label> = Vec::new();
    for n in longest_first {
        let (level, points) = &lines[n];
        let is_free = |i: usize| field[i].is_finite() && [0, n + 1].contains(&line_at[i]);
        let text = format!("{level:.0}");
        let places = places(canvas, text.len(), points, near);
        labels.extend(places.into_iter().map(|at| Label { at, text: text.clone() }).find(
            |label| {
                let [left, top, right, bottom] = bounds(canvas, label);
                let covered =
                    points.iter().filter(|at| is_within(**at, [left, top, right, bottom]));
                let [xs, ys] = [(left, right, pixel[0], columns), (top, bottom, pixel[1], rows)]
                    .map(|(from, to, size, all)| {
                        (from / size) as usize..((to / size).ceil() as usize).min(all)
                    });
                labels.iter().all(|other| are_apart(label, other))
                    && ys.clone().all(|y| xs.clone().all(|x| is_free(y * columns + x)))
                    && covered.count() as f32 <= MAX_COVERED_SHARE * points.len() as f32
            },
        ));
    }
    // All but the gaps.
    let gaps: Vec<[f32; 4]> = labels.iter().map(|label| bounds(canvas, label)).collect();
    let in_gap = |at: &[f32; 2]| gaps.iter().any(|gap| is_within(*at, *gap));
    let pieces: Vec<&[[f32; 2]]> = lines
        .iter()
        .flat_map(|(_, points)| points.chunk_by(|a, b| in_gap(a) == in_gap(b)))
        .filter(|piece| !in_gap(&piece[0]))
        .collect();
    canvas.contours(&pieces, WIDTH, theme);
    labels
}

/// Returns the left, upper, right and lower edges of a label, in pixels.
fn bounds(canvas: &Canvas, label: &Label) -> [f32; 4] {
    let ([x, y], (across, down)) = (canvas.label_middle(label), canvas.character);
    let [right, below] = [0.5 * (label.text.len() * across) as f32, 0.5 * down as f32];
    [x - right, y - below, x + right, y + below]
}

fn is_within([x, y]: [f32; 2], [left, top, right, bottom]: [f32; 4]) -> bool {
    x >= left && x < right && y >= top && y < bottom
}

fn are_apart(label: &Label, other: &Label) -> bool {
    let least = if label.text == other.text { SAME_LEVEL_SPACING } else { LABEL_SPACING };
    let middle = |label: &Label| f32::from(label.at.x) + 0.5 * label.text.len() as f32;
    let down = f32::from(label.at.y.abs_diff(other.at.y));
    // In characters' heights, which are twice their widths.
    (0.5 * (middle(label) - middle(other))).hypot(down) >= least
}

/// Returns the places for a label of `count` characters on a line, those nearest to `near` first.
fn places(canvas: &Canvas, count: usize, points: &[[f32; 2]], near: [f32; 2]) -> Vec<Position> {
    let ((width, height), frame) = (canvas.character, canvas.frame.area);
    let off = |at: &[f32; 2]| (at[0] - near[0]).hypot(at[1] - near[1]);
    let mut points = points.to_vec();
    points.sort_by(|a, b| off(a).total_cmp(&off(b)));
    let place = |at: &[f32; 2]| {
        let [column, row] = [at[0] as usize / width, at[1] as usize / height];
        let left = column.checked_sub(count / 2)?;
        let fits = left + count <= usize::from(frame.width) && row < usize::from(frame.height);
        fits.then(|| Position::new(frame.x + left as u16, frame.y + row as u16))
    };
    let mut known = HashSet::new();
    points.iter().filter_map(place).filter(|at| known.insert(*at)).collect()
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
