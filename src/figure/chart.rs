//! Charts of curves: means over seeds with their bands, all over the same range.

use super::sheet::{Anchor, Mark, Sheet, Text, circle, fitted, text_width};
use gdg::draw::Rgb;

/// Size of letters: of ticks and labels, of charts' titles, and of the page's.
const LETTERS: f32 = 7.0;
const TITLE: f32 = 7.5;
const HEADING: f32 = 9.0;

/// Widths of lines: of curves, of axes and ticks, and of the grid.
const CURVE: f32 = 1.2;
const AXIS: f32 = 0.6;
const GRID: f32 = 0.4;

const INK: Rgb = (40, 40, 40);
const GRID_INK: Rgb = (225, 225, 225);

/// Length of ticks, and distance from them to their labels.
const TICK: f32 = 2.5;
const GAP: f32 = 2.0;

/// Distance between ticks of the horizontal axis, at least.
const TICKS_APART: f32 = 24.0;

/// Between charts, and around the page.
const MARGIN: f32 = 5.0;

/// Height of a chart's lines, as a share of its width: of charts one below the other, and of
/// others.
const FLAT: f32 = 0.4;
const SHAPE: f32 = 0.62;

/// Length of the line in front of a name above the charts.
const SAMPLE: f32 = 14.0;

/// Points between two markers, on average, and radius of a marker.
const MARKERS: usize = 10;
const RADIUS: f32 = 1.7;

/// How much of its colour a band has.
const BAND: f32 = 0.18;

/// Colours that colour-blind people can tell apart (Okabe and Ito 2008), without yellow, which is
/// too light for lines on white.
pub const COLOURS: [Rgb; 7] = [
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (230, 159, 0),
    (0, 0, 0),
];

pub fn colour(i: usize) -> Rgb {
    COLOURS[i % COLOURS.len()]
}

#[derive(Clone, Debug)]
pub struct Chart {
    /// What it shows, above it; may be empty.
    pub title: String,
    pub labels: [String; 2],
    pub x: [f64; 2],
    /// The upper end of the vertical axis, which begins at 0.
    pub top: f64,
    pub curves: Vec<Curve>,
}

#[derive(Clone, Debug)]
pub struct Curve {
    pub name: String,
    pub colour: Rgb,
    /// The number of its marker: shapes tell curves apart without colours, too.
    pub marker: usize,
    pub points: Vec<Point>,
}

/// A point of a curve: the mean over seeds, and the band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    pub mean: f64,
    pub low: f64,
    pub high: f64,
}

#[derive(Clone, Debug)]
pub struct ChartPage<'a> {
    /// What they show, for the file's metadata.
    pub title: &'a str,
    /// Whether that is written above them.
    pub has_heading: bool,
    pub charts: &'a [Chart],
    pub width: f32,
    pub columns: usize,
}

impl Point {
    pub fn single(x: f64, value: f64) -> Self {
        Self { x, mean: value, low: value, high: value }
    }
}

/// Returns the upper end of an axis from 0 on which all values are.
pub fn round_top(values: impl Iterator<Item = f64>) -> f64 {
    let high = values.filter(|value| value.is_finite()).fold(0.0, f64::max);
    let step = round_ticks(0.0, if high > 0.0 { high } else { 1.0 }, 6);
    let step = if let [first, second, ..] = step[..] { second - first } else { 1.0 };
    (high / step).ceil().max(1.0) * step
}

#[derive(Clone, Copy)]
struct Area {
    left: f32,
    top: f32,
    right: f32,
    bottom: f32,
}

struct Placed<'a> {
    chart: &'a Chart,
    area: Area,
}

impl ChartPage<'_> {
    pub fn draw(&self) -> Sheet {
        let columns = self.columns.clamp(1, self.charts.len().max(1));
        let column = (self.width - MARGIN * (columns as f32 + 1.0)) / columns as f32;
        let mut names: Vec<&Curve> = Vec::new();
        for curve in self.charts.iter().flat_map(|chart| &chart.curves) {
            if names.iter().all(|known| known.name != curve.name) {
                names.push(curve);
            }
        }
        let mut sheet =
            Sheet { size: [self.width, 0.0], title: self.title.to_owned(), marks: Vec::new() };
        let mut top = MARGIN;
        if self.has_heading {
            let size = fitted(self.title, HEADING, self.width - 2.0 * MARGIN);
            sheet.text([MARGIN, top + HEADING], self.title, size, Anchor::Start, INK);
            top += 2.0 * HEADING;
        }
        if !names.is_empty() {
            top = legend(&mut sheet, &names, top);
        }
        let ticks = self.charts.iter().flat_map(|chart| ticks(0.0, chart.top, 6));
        let ticks = ticks.map(|(_, text)| text_width(&text, LETTERS)).fold(0.0, f32::max);
        let left = LETTERS * 1.3 + GAP + ticks + GAP + TICK;
        let (below, labelled) = (TICK + GAP + LETTERS, LETTERS * 1.4);
        let shape = if columns == 1 && self.charts.len() > 1 { FLAT } else { SHAPE };
        for (row, charts) in self.charts.chunks(columns).enumerate() {
            let is_last = (row + 1) * columns >= self.charts.len();
            if charts.iter().any(|chart| !chart.title.is_empty()) {
                top += TITLE * 1.5;
            }
            let bottom = top + shape * (column - left).max(20.0);
            for (i, chart) in charts.iter().enumerate() {
                let start = MARGIN + i as f32 * (column + MARGIN);
                let (from, to) = (start + left, start + column - MARGIN);
                let placed = Placed { chart, area: Area { left: from, top, right: to, bottom } };
                let is_lowest = (row + 1) * columns + i >= self.charts.len();
                // A label is not repeated along a row.
                let is_new = i == 0 || chart.labels[1] != charts[i - 1].labels[1];
                placed.axes(&mut sheet, start, [is_lowest, is_new]);
                placed.curves(&mut sheet);
            }
            top = bottom + below + if is_last { labelled } else { MARGIN };
        }
        sheet.size[1] = top + MARGIN;
        sheet
    }
}

/// Draws the names of curves in lines from `top`; returns where they end.
fn legend(sheet: &mut Sheet, names: &[&Curve], top: f32) -> f32 {
    let (mut x, mut y) = (MARGIN, top + LETTERS);
    for curve in names {
        let length = SAMPLE + GAP + text_width(&curve.name, LETTERS);
        if x > MARGIN && x + length > sheet.size[0] - MARGIN {
            (x, y) = (MARGIN, y + 1.4 * LETTERS);
        }
        let middle = y - 0.35 * LETTERS;
        sheet.line(vec![[x, middle], [x + SAMPLE, middle]], CURVE, curve.colour);
        sheet.area(marker(curve.marker, [x + SAMPLE / 2.0, middle]), curve.colour);
        sheet.text([x + SAMPLE + GAP, y], &curve.name, LETTERS, Anchor::Start, INK);
        x += length + 2.0 * MARGIN;
    }
    y + MARGIN
}

fn marker(number: usize, [x, y]: [f32; 2]) -> Vec<[f32; 2]> {
    let r = 1.15 * RADIUS;
    match number % 5 {
        0 => circle([x, y], RADIUS),
        1 => vec![[x - r, y - r], [x + r, y - r], [x + r, y + r], [x - r, y + r]],
        2 => vec![[x, y - 1.3 * r], [x + 1.2 * r, y + r], [x - 1.2 * r, y + r]],
        3 => vec![[x, y - 1.5 * r], [x + 1.5 * r, y], [x, y + 1.5 * r], [x - 1.5 * r, y]],
        _ => vec![[x, y + 1.3 * r], [x - 1.2 * r, y - r], [x + 1.2 * r, y - r]],
    }
}

impl Placed<'_> {
    fn at(&self, x: f64, y: f64) -> [f32; 2] {
        let (Area { left, top, right, bottom }, [from, to]) = (self.area, self.chart.x);
        let along = if to > from { ((x - from) / (to - from)) as f32 } else { 0.5 };
        let up = (y / self.chart.top).clamp(0.0, 1.0) as f32;
        [left + along * (right - left), bottom - up * (bottom - top)]
    }

    /// Draws title, axes and grid, and the labels of those axes that are to be `labelled`; the one
    /// of the vertical axis at `start`.
    fn axes(&self, sheet: &mut Sheet, start: f32, labelled: [bool; 2]) {
        let (Area { left, top, right, bottom }, chart) = (self.area, self.chart);
        sheet.text([left, top - 0.6 * TITLE], &chart.title, TITLE, Anchor::Start, INK);
        for (value, label) in ticks(0.0, chart.top, 6) {
            let [_, y] = self.at(chart.x[0], value);
            sheet.line(vec![[left, y], [right, y]], GRID, GRID_INK);
            sheet.line(vec![[left - TICK, y], [left, y]], AXIS, INK);
            let place = [left - TICK - GAP, y + 0.36 * LETTERS];
            sheet.text(place, &label, LETTERS, Anchor::End, INK);
        }
        let most = ((right - left) / TICKS_APART) as usize;
        for (value, label) in ticks(chart.x[0], chart.x[1], most) {
            let [x, _] = self.at(value, 0.0);
            sheet.line(vec![[x, bottom], [x, bottom + TICK]], AXIS, INK);
            let place = [x, bottom + TICK + GAP + 0.75 * LETTERS];
            sheet.text(place, &label, LETTERS, Anchor::Middle, INK);
        }
        sheet.line(vec![[left, top], [left, bottom], [right, bottom]], AXIS, INK);
        let [along, up] = &chart.labels;
        if labelled[0] {
            let place = [f32::midpoint(left, right), bottom + TICK + GAP + 2.2 * LETTERS];
            sheet.text(place, along, LETTERS, Anchor::Middle, INK);
        }
        if labelled[1] {
            let at = [start + 0.9 * LETTERS, f32::midpoint(top, bottom)];
            let (words, anchor) = (up.clone(), Anchor::Middle);
            let text = Text { at, words, size: LETTERS, colour: INK, anchor, turned: true };
            sheet.marks.push(Mark::Text(text));
        }
    }

    fn curves(&self, sheet: &mut Sheet) {
        for Curve { colour, points, .. } in self.chart.curves.iter().rev() {
            if points.iter().any(|point| point.low < point.high) {
                let up = points.iter().map(|point| self.at(point.x, point.high));
                let down = points.iter().rev().map(|point| self.at(point.x, point.low));
                let (points, colour) = (up.chain(down).collect(), *colour);
                sheet.marks.push(Mark::Area { points, colour, opacity: BAND });
            }
        }
        for curve in self.chart.curves.iter().rev() {
            let means: Vec<_> = curve.points.iter().map(|at| self.at(at.x, at.mean)).collect();
            let every = means.len().div_ceil(MARKERS).max(1);
            let markers = means.iter().skip(means.len().saturating_sub(1) % every).step_by(every);
            let markers: Vec<_> = markers.map(|at| marker(curve.marker, *at)).collect();
            sheet.line(means, CURVE, curve.colour);
            markers.into_iter().for_each(|corners| sheet.area(corners, curve.colour));
        }
    }
}

/// Returns the multiples of 1, 2 or 5 times a power of ten from `low` to `high`: as many as
/// possible, but at most `most`.
fn round_ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    if !(high > low && (high - low).is_finite()) {
        return vec![low];
    }
    let first = 10f64.powf((high - low).log10().floor() - 1.0);
    let steps = (0..4).flat_map(|power| [1.0, 2.0, 5.0].map(|by| by * 10f64.powi(power)));
    let multiples = |step: f64| {
        let (from, to) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        (from..=to).map(|i| i as f64 * step).collect::<Vec<_>>()
    };
    let all = steps.map(|step| multiples(first * step));
    all.into_iter().find(|ticks| ticks.len() <= most.max(2)).unwrap_or_else(|| vec![low, high])
}

/// Returns the [`round_ticks`] of an axis with their labels, all in the same unit: 40k, 0.2.
fn ticks(low: f64, high: f64, most: usize) -> impl Iterator<Item = (f64, String)> {
    let ticks = round_ticks(low, high, most);
    let largest = ticks.iter().fold(0.0, |most: f64, tick| most.max(tick.abs()));
    ticks.into_iter().map(move |tick| (tick, in_unit_of(tick, largest)))
}

fn in_unit_of(value: f64, largest: f64) -> String {
    let (unit, name) = match largest {
        largest if largest >= 1e6 => (1e6, "M"),
        largest if largest >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let short = (value / unit * 1e6).round() / 1e6;
    if short == 0.0 { "0".to_owned() } else { format!("{short}{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let labels =
            |low, high, most| ticks(low, high, most).map(|tick| tick.1).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 1.0, 6), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(labels(0.0, 58_731.0, 4), ["0", "20k", "40k"]);
        assert_eq!(labels(3.0, 1_100.0, 6), ["200", "400", "600", "800", "1000"]);
        assert_eq!(labels(0.0, 0.031, 4), ["0", "0.01", "0.02", "0.03"]);
        assert_eq!(round_ticks(5.0, 5.0, 4), [5.0]);
        assert_eq!(
            [0.2, 40.0, 40_000.0, 2e6].map(|value| in_unit_of(value, value)),
            ["0.2", "40", "40k", "2M"]
        );
        for high in [0.007, 1.0, 9.99, 123.0, 1e7] {
            let ticks = round_ticks(0.0, high, 5);
            assert!((2..=5).contains(&ticks.len()), "{high}: {ticks:?}");
        }
    }
}
