//! Contour lines on a canvas, and the labels in their gaps.

use ratatui::layout::Rect;

use super::canvas::{Canvas, Ground, Label, text_width};
use super::theme::Theme;
use gdg::draw::{contour_interval, contour_paths};

/// Minimum average distance between lines, in pixels of the field: as characters, and in pictures.
const SPACING: f32 = 6.0;
const PICTURE_SPACING: f32 = 3.0;

/// Relative deviation from that distance before the interval changes, so that it does not flip back
/// and forth as the field changes.
const TOLERANCE: f32 = 0.15;

/// Width of a line, and height of a label in a picture, as shares of a character's height.
const WIDTH: f32 = 0.07;
const LABEL_HEIGHT: f32 = 0.75;

/// A gap in a picture exceeds its label by this share of the label's height.
const MARGIN: f32 = 0.4;

/// Minimum distance of two labels, and of two of the same level, in characters' heights.
const LABEL_SPACING: f32 = 2.5;
const SAME_LEVEL_SPACING: f32 = 12.0;

/// A label covers at most this share of its line.
const MAX_COVERED_SHARE: f32 = 0.6;

/// Minimum straightness of a line at a label in a picture: the distance between its ends over its
/// length there.
const LEAST_STRAIGHTNESS: f32 = 0.97;

/// The distance of neighbouring points of a line in a picture, in pixels.
const STEP: f32 = 3.0;

/// Values beside a wall are continued into it if they differ by at most this many intervals:
/// otherwise they belong to different sides of it.
const MAX_JUMP: f32 = 1.5;

/// Returns the common interval of the lines of `fields`, each with the length of its rows; `before`
/// if that is nearly right.
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
    let paths = if canvas.is_fine {
        contour_paths(
            &continued_into_walls(canvas, field, columns, pixel, interval),
            columns,
            interval,
        )
    } else {
        contour_paths(field, columns, interval)
    };
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
        let is_free = |at: [f32; 2]| {
            let [x, y] = [at[0] / pixel[0], at[1] / pixel[1]];
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows;
            inside && {
                let i = y as usize * columns + x as usize;
                field[i].is_finite() && [0, n + 1].contains(&line_at[i])
            }
        };
        let apart = pixel[0].min(pixel[1]);
        let label = place(canvas, &format!("{level:.0}"), points, near, |label| {
            let covered = points.iter().filter(|at| label.contains(**at)).count();
            covered as f32 <= MAX_COVERED_SHARE * points.len() as f32
                && labels.iter().all(|other| are_apart(label, other, canvas))
                && label.points(apart).all(is_free)
        });
        labels.extend(label);
    }
    // All but the gaps.
    let in_gap = |at: &[f32; 2]| labels.iter().any(|label| label.contains(*at));
    let pieces: Vec<&[[f32; 2]]> = lines
        .iter()
        .flat_map(|(_, points)| points.chunk_by(|a, b| in_gap(a) == in_gap(b)))
        .filter(|piece| !in_gap(&piece[0]))
        .collect();
    canvas.contours(&pieces, WIDTH, theme);
    labels
}

fn are_apart(label: &Label, other: &Label, canvas: &Canvas) -> bool {
    let least = if label.text == other.text { SAME_LEVEL_SPACING } else { LABEL_SPACING };
    let [across, down] = [0, 1].map(|axis| (label.middle[axis] - other.middle[axis]).abs());
    // In characters' heights, which are twice their widths.
    let (width, height) = canvas.character;
    (across / (2 * width) as f32).hypot(down / height as f32) >= least
}

/// Finds a place for a label on a line through `points`: the one nearest to `near` that `has_room`.
fn place(
    canvas: &Canvas,
    text: &str,
    points: &[[f32; 2]],
    near: [f32; 2],
    has_room: impl Fn(&Label) -> bool,
) -> Option<Label> {
    let (width, height) = canvas.character;
    let off = |n: &usize| (points[*n][0] - near[0]).hypot(points[*n][1] - near[1]);
    let mut places: Vec<usize> = (0..points.len()).collect();
    places.sort_by(|a, b| off(a).total_cmp(&off(b)));
    let (text, mut tried) = (text.to_owned(), None);
    places.into_iter().find_map(|n| {
        let label = if canvas.is_fine {
            let high = LABEL_HEIGHT * height as f32;
            let size = [text_width(&text, high) + MARGIN * high, high];
            let half = (0.5 * size[0] / STEP).ceil() as usize;
            let ends = [*points.get(n.checked_sub(half)?)?, *points.get(n + half)?];
            let [x, y] = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
            let long = x.hypot(y);
            let is_straight = long >= LEAST_STRAIGHTNESS * STEP * (2 * half) as f32;
            let middle = [0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1])];
            let along = [x / long, y / long];
            let text = text.clone();
            (is_straight && off(&n) >= size[0]).then(|| Label {
                text,
                middle,
                size,
                along,
                area: Rect::default(),
            })?
        } else {
            let [column, row] = [points[n][0] as usize / width, points[n][1] as usize / height];
            let count = text.len();
            let frame = canvas.frame.area;
            let left = column.checked_sub(count / 2)?;
            if left + count > usize::from(frame.width)
                || tried.replace((left, row)) == Some((left, row))
            {
                return None;
            }
            let area = Rect::new(frame.x + left as u16, frame.y + row as u16, count as u16, 1);
            let size = [(count * width) as f32, height as f32];
            let middle =
                [(left * width) as f32 + 0.5 * size[0], (row as f32 + 0.5) * height as f32];
            Label { text: text.clone(), middle, size, along: [1.0, 0.0], area }
        };
        has_room(&label).then_some(label)
    })
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

/// Continues the field by one value into walls, so that lines reach them.
fn continued_into_walls(
    canvas: &Canvas,
    field: &[f32],
    columns: usize,
    pixel: [f32; 2],
    interval: f32,
) -> Vec<f32> {
    let mut continued = field.to_vec();
    for (i, value) in continued.iter_mut().enumerate().filter(|(_, value)| !value.is_finite()) {
        let (x, y) = (i % columns, i / columns);
        let middle = [(x as f32 + 0.5) * pixel[0], (y as f32 + 0.5) * pixel[1]];
        let shown = middle[1] as usize * canvas.columns() + middle[0] as usize;
        if canvas.grounds.get(shown) == Some(&Ground::Floor) {
            continue;
        }
        let around = (y.saturating_sub(1)..=y + 1)
            .flat_map(|y| (x.saturating_sub(1)..=x + 1).map(move |x| (x, y)));
        let known =
            around.filter(|(x, _)| *x < columns).filter_map(|(x, y)| field.get(y * columns + x));
        let (mut least, mut most, mut sum, mut count) =
            (f32::INFINITY, f32::NEG_INFINITY, 0.0, 0.0);
        for own in known.filter(|own| own.is_finite()) {
            (least, most, sum, count) = (least.min(*own), most.max(*own), sum + own, count + 1.0);
        }
        if count > 0.0 && most - least <= MAX_JUMP * interval {
            *value = sum / count;
        }
    }
    continued
}
