//! Contour lines on a canvas, and the labels in their gaps.

use ratatui::layout::Rect;

use super::canvas::Canvas;
use super::raster::MapFrame;
use super::theme::{Rgb, Theme};
use gdg::draw::{ContourLine, contour_interval, contour_lines};

/// Minimum average distance between lines, in pixels.
pub const SPACING: f32 = 6.0;

/// Minimum characters between two labels, across and down, and between two of the same level.
const LABEL_SPACING: (u16, u16) = (4, 2);
const SAME_LEVEL_SPACING: (u16, u16) = (24, 8);

/// A label covers at most this share of its line.
const MAX_COVERED_SHARE: f32 = 0.7;

/// The value of a contour line, written in a gap of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The characters it covers, in one row.
    pub area: Rect,
    /// The text.
    pub text: String,
}

impl Label {
    /// Returns the pixels that it covers.
    pub fn pixels(&self, map_frame: &MapFrame) -> impl Iterator<Item = usize> + use<> {
        pixels_of(self.area, map_frame)
    }
}

/// Relative deviation from that distance before the interval changes, so that it does not flip back
/// and forth as the field changes.
const TOLERANCE: f32 = 0.15;

/// Returns the common contour interval of `fields`, each with the length of its rows, for lines
/// that are on average at least `apart` pixels apart; `before` if that is nearly right.
pub fn interval(fields: &[(&[f32], usize)], apart: f32, before: Option<f32>) -> Option<f32> {
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

/// Draws the lines of `field` at the multiples of `interval`, with gaps for the labels that it
/// returns: as near to the pixel at column and row `near` as there is room, where they move least
/// as the field changes.
pub fn draw(
    canvas: &mut Canvas,
    map_frame: &MapFrame,
    field: &[f32],
    interval: f32,
    near: (usize, usize),
    theme: &Theme,
) -> Vec<Label> {
    let lines = contour_lines(field, canvas.columns(), interval);
    let labels = place_labels(&lines, map_frame, field, near);
    let mut in_gap = vec![false; canvas.len()];
    labels.iter().flat_map(|label| label.pixels(map_frame)).for_each(|i| in_gap[i] = true);
    let drawn = lines.iter().flat_map(|line| &line.pixels).copied().filter(|i| !in_gap[*i]);
    // Chosen before any is drawn: beside a line is ground.
    let line = |i: usize| {
        let (columns, len) = (canvas.columns(), canvas.len());
        let beside = [i.wrapping_sub(1), i + 1, i.wrapping_sub(columns), i + columns];
        let beside = beside.into_iter().filter(|other| *other < len);
        let beside: Vec<Rgb> = beside.filter_map(|other| canvas.colour(other)).collect();
        (i, canvas.colour(i).map(|ground| theme.contour(ground, &beside)))
    };
    let drawn: Vec<(usize, Option<Rgb>)> = drawn.map(line).collect();
    drawn.into_iter().for_each(|(i, line)| canvas.set_thin(i, line));
    labels
}

/// Places labels where their characters show nothing but known values and their own line.
fn place_labels(
    lines: &[ContourLine],
    map_frame: &MapFrame,
    field: &[f32],
    (column, row): (usize, usize),
) -> Vec<Label> {
    let columns = map_frame.raster.pixels.0;
    // The number of the line at each pixel, counted from 1; 0 if there is none.
    let mut line_at = vec![0; field.len()];
    for (n, line) in lines.iter().enumerate() {
        line.pixels.iter().for_each(|i| line_at[*i] = n + 1);
    }
    let off = |i: usize| (i % columns).abs_diff(column).pow(2) + (i / columns).abs_diff(row).pow(2);
    let mut longest_first: Vec<usize> = (0..lines.len()).collect();
    longest_first.sort_by_key(|n| std::cmp::Reverse(lines[*n].pixels.len()));
    let mut labels: Vec<Label> = Vec::new();
    for n in longest_first {
        let line = &lines[n];
        let text = format!("{:.0}", line.level);
        let mut places = line.pixels.clone();
        places.sort_by_key(|i| off(*i));
        let mut areas =
            places.into_iter().filter_map(|i| area_around(i, text.len() as u16, map_frame));
        let most_covered = (MAX_COVERED_SHARE * line.pixels.len() as f32) as usize;
        let has_room = |area: &Rect| {
            let free = |i: usize| field[i].is_finite() && [0, n + 1].contains(&line_at[i]);
            let covered = pixels_of(*area, map_frame).filter(|i| line_at[*i] == n + 1).count();
            covered <= most_covered
                && labels.iter().all(|other| {
                    let spacing =
                        if other.text == text { SAME_LEVEL_SPACING } else { LABEL_SPACING };
                    !with_margins(*area, spacing).intersects(other.area)
                })
                && pixels_of(*area, map_frame).all(free)
        };
        if let Some(area) = areas.find(has_room) {
            labels.push(Label { area, text });
        }
    }
    labels
}

/// Returns the `width` characters around the one that shows pixel `i`, if all of them are in the
/// frame.
fn area_around(i: usize, width: u16, map_frame: &MapFrame) -> Option<Rect> {
    let columns = map_frame.raster.pixels.0;
    let (across, down) = map_frame.marker.pixels();
    let [column, row] = [i % columns / across, i / columns / down].map(|at| at as u16);
    let left = column.checked_sub(width / 2).filter(|left| left + width <= map_frame.area.width)?;
    Some(Rect::new(map_frame.area.x + left, map_frame.area.y + row, width, 1))
}

fn with_margins(area: Rect, (across, down): (u16, u16)) -> Rect {
    let (x, y) = (area.x.saturating_sub(across), area.y.saturating_sub(down));
    Rect::new(x, y, area.right() + across - x, area.bottom() + down - y)
}

/// Returns the pixels that the characters of `area` show.
fn pixels_of(area: Rect, map_frame: &MapFrame) -> impl Iterator<Item = usize> + use<> {
    let columns = map_frame.raster.pixels.0;
    let (across, down) = map_frame.marker.pixels();
    let [left, right] =
        [area.left(), area.right()].map(|x| usize::from(x - map_frame.area.x) * across);
    let [top, bottom] =
        [area.top(), area.bottom()].map(|y| usize::from(y - map_frame.area.y) * down);
    (top..bottom).flat_map(move |row| (left..right).map(move |column| row * columns + column))
}
