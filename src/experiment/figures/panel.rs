//! Draws a figure: charts side by side, and rows of maps with lines and dots on them.

use super::curves::Panel;
use crate::figure::{Anchor, Chart, Curve, MILLIMETRE, Mark, Page, Range, Sheet, circle, fitted};
pub use gdg::draw::WALL;
use gdg::draw::{Picture, Rgb};

/// Pixels along the longer side of a map's panel, about.
pub const PANEL_PIXELS: usize = 330;

pub const FLOOR: Rgb = (244, 244, 240);
pub const PLAN: Rgb = (255, 70, 50);
pub const PATH: Rgb = (0, 114, 178);
pub const START: Rgb = (86, 180, 233);
pub const GOAL: Rgb = (230, 159, 0);

/// Widths of a page, and of a figure of one chart.
const PAGE: f32 = 174.0 * MILLIMETRE;
const CHART: f32 = 130.0 * MILLIMETRE;

/// Between maps, and size of the letters around them.
const MARGIN: f32 = 6.0;
const LETTERS: f32 = 7.0;

/// One map with what is drawn on it. Positions are in pixels of the picture.
#[derive(Clone, Debug)]
pub struct MapPanel {
    pub title: String,
    /// Numbers, below the map.
    pub caption: String,
    /// The ground: the map's cells.
    pub picture: Picture,
    /// The first ones below.
    pub lines: Vec<PolyLine>,
    /// Above the lines.
    pub dots: Vec<Dot>,
    /// The map as characters, for the terminal.
    pub text: String,
}

#[derive(Clone, Debug)]
pub struct PolyLine {
    pub stops: Vec<[f32; 2]>,
    pub colour: Rgb,
    pub width: u32,
}

/// A dot with a dark edge.
#[derive(Clone, Copy, Debug)]
pub struct Dot {
    pub at: [f32; 2],
    pub colour: Rgb,
    /// Without the edge.
    pub radius: u32,
}

impl Dot {
    /// Returns a dot that stands out from lines.
    pub fn new(at: [f32; 2], colour: Rgb) -> Self {
        Self { at, colour, radius: 5 }
    }
}

impl MapPanel {
    pub fn new(title: String, caption: String, picture: Picture) -> Self {
        Self { title, caption, picture, lines: Vec::new(), dots: Vec::new(), text: String::new() }
    }

    /// Draws it with its title above and its caption below, each in one line of `room`.
    fn draw(&self, sheet: &mut Sheet, at: [f32; 2], scale: f32, room: f32) {
        let ink = (40, 40, 40);
        let [left, top] = at;
        let (columns, rows) = self.picture.size();
        let size = [scale * columns as f32, scale * rows as f32];
        let (right, bottom) = (left + size[0], top + size[1]);
        let picture = self.picture.clone();
        sheet.marks.push(Mark::Picture { at, size, picture });
        let edge = vec![[left, top], [right, top], [right, bottom], [left, bottom], at];
        sheet.line(edge, 0.4, (128, 128, 128));
        let texts = [(&self.title, top - 0.4 * LETTERS), (&self.caption, bottom + 1.2 * LETTERS)];
        for (text, y) in texts {
            sheet.text([left, y], text, fitted(text, LETTERS, room), Anchor::Start, ink);
        }
        let place = |[x, y]: [f32; 2]| [left + scale * x, top + scale * y];
        for line in &self.lines {
            let stops = line.stops.iter().map(|stop| place(*stop)).collect();
            sheet.line(stops, scale * line.width as f32, line.colour);
        }
        for dot in &self.dots {
            let circle = |radius| circle(place(dot.at), scale * radius);
            sheet.area(circle(dot.radius as f32 + 1.0), (0, 0, 0));
            sheet.area(circle(dot.radius as f32), dot.colour);
        }
    }
}

/// Draws charts side by side, and below them the maps, row by row.
pub fn draw(title: &str, panels: &[Panel], maps: &[Vec<MapPanel>]) -> Sheet {
    let charts: Vec<Chart> = panels.iter().map(chart).collect();
    let columns = charts.len().max(1);
    let width = if maps.is_empty() && columns == 1 { CHART } else { PAGE };
    let mut sheet = Page { title, has_heading: true, charts: &charts, width, columns }.draw();
    let columns = maps.iter().map(Vec::len).max().unwrap_or(0) as f32;
    let widths = maps.iter().flatten().map(|panel| panel.picture.size().0);
    let room = (sheet.size[0] - MARGIN) / columns.max(1.0) - MARGIN;
    let scale = (room / widths.max().unwrap_or(1) as f32).min(0.6);
    for row in maps {
        let rows = row.iter().map(|panel| panel.picture.size().1).max().unwrap_or(0);
        let top = sheet.size[1] + 1.5 * LETTERS;
        for (i, panel) in row.iter().enumerate() {
            let left = MARGIN + i as f32 * (room + MARGIN);
            panel.draw(&mut sheet, [left, top], scale, room);
        }
        sheet.size[1] = top + scale * rows as f32 + 2.0 * LETTERS;
    }
    sheet
}

fn chart(panel: &Panel) -> Chart {
    let curves = panel.curves.iter().enumerate().map(|(marker, curve)| {
        let (name, colour) = (curve.entry.title.to_owned(), curve.entry.colour);
        Curve { name, colour, marker, points: curve.means() }
    });
    let curves: Vec<Curve> = curves.collect();
    let points = || curves.iter().flat_map(|curve| &curve.points);
    Chart {
        title: String::new(),
        labels: panel.labels.map(str::to_owned),
        x: [0.0, points().map(|point| point.x).fold(1.0, f64::max)],
        y: match panel.top {
            Some(high) => Range { high, ..Range::SHARE },
            None => Range::from_zero(points().map(|point| point.high)),
        },
        curves,
    }
}
