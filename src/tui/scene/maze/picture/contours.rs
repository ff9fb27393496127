//! Smooth contour lines, with labels along them.

use super::ground::Scale;
use crate::tui::scene::maze::MazeState;
use crate::tui::screen::Screen;
use crate::tui::sheet::{Ink, Sheet, text_width};
use crate::tui::theme::{Rgb, blend, ink};
use gdg::draw::{ContourPath, Ground, contour_paths};

/// Width of a line, and height of a label, as shares of a character's height.
const WIDTH: f32 = 0.07;
const LABEL_HEIGHT: f32 = 0.75;

/// How far lines and labels differ from the ground: shares of black or white.
const LINE_SHARE: f32 = 0.5;
const LABEL_SHARE: f32 = 0.9;

/// A gap exceeds its label by this share of the label's height, and a labelled line its gap by this
/// factor.
const MARGIN: f32 = 0.4;
const LEAST_LENGTH: f32 = 1.8;

/// Minimum straightness of a line at a label: the distance between its ends over its length.
const LEAST_STRAIGHTNESS: f32 = 0.97;

/// Minimum distance between two labels, and between two of the same level, as multiples of a
/// character's height.
const LABEL_SPACING: f32 = 2.5;
const SAME_LEVEL_SPACING: f32 = 14.0;

/// Sampling step along a line for label positions, in pixels.
const STEP: f32 = 6.0;

/// Values of ground beside a wall are continued into it if they differ by at most this many
/// intervals: otherwise they belong to different sides of it.
const MAX_JUMP: f32 = 1.5;

/// A field and where it is known.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// Rows of values over the whole sheet; NaN where there are none.
    pub field: &'a [f32],
    /// The values of a row.
    pub columns: usize,
    /// The kind of ground of each value.
    pub grounds: &'a [Ground],
}

/// Draws the lines of a field at the multiples of `interval`.
pub fn draw(
    sheet: &mut Sheet,
    scale: &Scale,
    Known { field, columns, grounds }: Known,
    interval: f32,
    maze: &MazeState,
    screen: &Screen,
) {
    let (unit, farthest) = (scale.unit(), maze.farthest(screen));
    let theme = screen.theme.in_full_colour();
    let goal = scale.pixel(maze.goal.centre());
    let rows = (field.len() / columns).max(1);
    let (across, down) = (scale.size.0 as f32 / columns as f32, scale.size.1 as f32 / rows as f32);
    let is_known = |at: [f32; 2]| {
        let [x, y] = [(at[0] / across).max(0.0) as usize, (at[1] / down).max(0.0) as usize];
        x < columns && y < rows && field[y * columns + x].is_finite()
    };
    let continued = continue_into_walls(field, columns, grounds, interval);
    let mut lines = contour_paths(&continued, columns, interval);
    lines.iter_mut().for_each(|line| {
        line.points.iter_mut().for_each(|at| *at = [at[0] * across, at[1] * down]);
    });
    lines.sort_by_key(|line| std::cmp::Reverse(line.points.len()));
    let mut labels: Vec<Label> = Vec::new();
    for line in &lines {
        let colour = |share| shaded(theme.distance_colour(line.level / farthest), share);
        let own = Label::place(line, unit, goal, &is_known, &labels);
        let pieces = match &own {
            Some(label) => label.pieces(&line.points),
            None => vec![line.points.clone()],
        };
        for points in pieces {
            sheet.line(&points, true, (WIDTH * unit).max(1.0), Ink(colour(LINE_SHARE), 1.0));
        }
        if let Some(label) = own {
            let (height, ink) = (LABEL_HEIGHT * unit, Ink(colour(LABEL_SHARE), 1.0));
            sheet.text(&label.text, label.middle, height, label.angle, false, ink);
            labels.push(label);
        }
    }
}

/// Returns a colour that stands out on `ground`.
fn shaded(ground: Rgb, share: f32) -> Rgb {
    let to = if crate::tui::theme::lightness(ground) > 0.4 { (0, 0, 0) } else { ink(ground) };
    blend(ground, to, share)
}

/// Continues the field by one value into walls, so that lines reach them.
fn continue_into_walls(
    field: &[f32],
    columns: usize,
    grounds: &[Ground],
    interval: f32,
) -> Vec<f32> {
    let mut continued = field.to_vec();
    for (i, value) in continued.iter_mut().enumerate() {
        if !matches!(grounds[i], Ground::Wall | Ground::Crossed(_) | Ground::Outside) {
            continue;
        }
        let (x, y) = (i % columns, i / columns);
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

/// A number in the gap of a line.
struct Label {
    text: String,
    middle: [f32; 2],
    /// Clockwise, in rad; never upside down.
    angle: f32,
    /// Where the gap begins and ends.
    ends: [[f32; 2]; 2],
    /// The number of points before the gap, and up to its end.
    counts: [usize; 2],
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns the corners of a text of that width and height, and the middles of its longer sides;
/// `along` is its direction.
fn outline(middle: [f32; 2], along: [f32; 2], [width, height]: [f32; 2]) -> [[f32; 2]; 6] {
    let at = |[by, aside]: [f32; 2]| {
        let [by, aside] = [by * width / 2.0, aside * height / 2.0];
        [middle[0] + by * along[0] - aside * along[1], middle[1] + by * along[1] + aside * along[0]]
    };
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, -1.0], [0.0, 1.0]].map(at)
}

impl Label {
    /// Returns the parts of its line before and after the gap.
    fn pieces(&self, points: &[[f32; 2]]) -> Vec<Vec<[f32; 2]>> {
        let ([from, to], [before, after]) = (self.ends, self.counts);
        let first = points[..before].iter().copied().chain([from]).collect();
        vec![first, [to].into_iter().chain(points[after..].iter().copied()).collect()]
    }

    /// Places a label where its line is straight, on ground that is known, away from others, and as
    /// near to `near` as possible: there, lines move least as the field changes.
    fn place(
        line: &ContourPath,
        unit: f32,
        near: [f32; 2],
        is_known: &impl Fn([f32; 2]) -> bool,
        others: &[Self],
    ) -> Option<Self> {
        let text = format!("{:.0}", line.level);
        let height = LABEL_HEIGHT * unit;
        let gap = text_width(&text, height) + MARGIN * height;
        // The length of the line up to each point.
        let mut lengths = vec![0.0];
        lengths.extend(line.points.windows(2).scan(0.0, |length, ends| {
            *length += distance(ends[0], ends[1]);
            Some(*length)
        }));
        let length = lengths[lengths.len() - 1];
        if length < LEAST_LENGTH * gap {
            return None;
        }
        let at = |along: f32| {
            let after =
                lengths.partition_point(|length| *length < along).clamp(1, lengths.len() - 1);
            let (from, to) = (line.points[after - 1], line.points[after]);
            let share =
                (along - lengths[after - 1]) / (lengths[after] - lengths[after - 1]).max(1e-6);
            [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
        };
        let count = ((length - gap) / STEP) as usize;
        let mut places: Vec<f32> = (0..=count).map(|n| n as f32 * STEP).collect();
        let off = |from: &f32| distance(at(from + gap / 2.0), near);
        places.sort_by(|a, b| off(a).total_cmp(&off(b)));
        let found = places.into_iter().find_map(|from| {
            let ends = [at(from), at(from + gap)];
            let middle = [0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1])];
            let apart = distance(ends[0], ends[1]);
            let along = [(ends[1][0] - ends[0][0]) / apart, (ends[1][1] - ends[0][1]) / apart];
            let has_room = apart >= LEAST_STRAIGHTNESS * gap
                && others.iter().all(|other| {
                    let least = if other.text == text { SAME_LEVEL_SPACING } else { LABEL_SPACING };
                    distance(middle, other.middle) >= least * unit
                })
                && distance(middle, near) >= gap
                && outline(middle, along, [gap, height]).into_iter().all(is_known);
            has_room.then_some((from, ends, middle, along))
        });
        let (from, ends, middle, [x, y]) = found?;
        let angle = if x < 0.0 { (-y).atan2(-x) } else { y.atan2(x) };
        let counts = [from, from + gap].map(|end| lengths.partition_point(|length| *length < end));
        Some(Self { text, middle, angle, ends, counts })
    }
}
