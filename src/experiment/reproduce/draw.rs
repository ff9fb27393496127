//! Draws a figure: charts, maps, or maps below charts.

use super::curves::Panel;
use super::panel::MapPanel;
use crate::figure::{
    Anchor, Chart, Curve, MILLIMETRE, Mark, Page, Point, Range, Sheet, circle, fitted,
};

/// A figure to draw: charts side by side, rows of maps, or rows of maps below charts.
pub struct Drawing<'a> {
    /// Its title.
    pub title: &'a str,
    /// Charts.
    pub panels: &'a [Panel],
    /// Maps.
    pub maps: &'a [Vec<MapPanel>],
}

/// Widths of a page, and of a figure of one chart.
const PAGE: f32 = 174.0 * MILLIMETRE;
const CHART: f32 = 130.0 * MILLIMETRE;

/// Between maps, and size of the letters around them.
const MARGIN: f32 = 6.0;
const LETTERS: f32 = 7.0;

impl Drawing<'_> {
    /// Draws the figure.
    pub fn draw(&self) -> Sheet {
        let charts: Vec<Chart> = self.panels.iter().map(chart).collect();
        let columns = charts.len().max(1);
        let width = if self.maps.is_empty() && columns == 1 { CHART } else { PAGE };
        let page = Page { title: self.title, has_heading: true, charts: &charts, width, columns };
        let mut sheet = page.draw();
        self.draw_maps(&mut sheet);
        sheet
    }

    /// Adds the maps, row by row, below what is on the sheet.
    fn draw_maps(&self, sheet: &mut Sheet) {
        let columns = self.maps.iter().map(Vec::len).max().unwrap_or(0) as f32;
        let sizes = || self.maps.iter().flatten().map(|panel| panel.picture.size());
        let pixels = sizes().map(|size| size.0).max().unwrap_or(1) as f32;
        let room = (sheet.size[0] - MARGIN) / columns.max(1.0) - MARGIN;
        let scale = (room / pixels).min(0.6);
        for row in self.maps {
            let rows = row.iter().map(|panel| panel.picture.size().1).max().unwrap_or(0);
            let top = sheet.size[1] + 1.5 * LETTERS;
            for (i, panel) in row.iter().enumerate() {
                let left = MARGIN + i as f32 * (room + MARGIN);
                draw_map(sheet, panel, [left, top], scale, room);
            }
            sheet.size[1] = top + scale * rows as f32 + 2.0 * LETTERS;
        }
    }
}

fn chart(panel: &Panel) -> Chart {
    let points = || panel.curves.iter().flat_map(|curve| &curve.points);
    let last = points().map(|point| point.x as f64).fold(1.0, f64::max);
    let curves = panel.curves.iter().enumerate().map(|(marker, curve)| {
        let point = |point: &super::curves::Point| {
            let (low, high) = point.range();
            Point { x: point.x as f64, mean: point.mean(), low, high }
        };
        Curve {
            name: curve.entry.title.to_owned(),
            colour: curve.entry.colour,
            marker,
            points: curve.points.iter().map(point).collect(),
        }
    });
    Chart {
        title: String::new(),
        labels: panel.labels.map(str::to_owned),
        x: [0.0, last],
        y: match panel.top {
            Some(high) => Range { high, ..Range::SHARE },
            None => Range::from_zero(points().map(|point| point.range().1)),
        },
        curves: curves.collect(),
    }
}

/// Draws a map with its title above and its caption below, each in one line of `room`.
fn draw_map(sheet: &mut Sheet, panel: &MapPanel, at: [f32; 2], scale: f32, room: f32) {
    let ink = (40, 40, 40);
    let [left, top] = at;
    let (columns, rows) = panel.picture.size();
    let size = [scale * columns as f32, scale * rows as f32];
    let (right, bottom) = (left + size[0], top + size[1]);
    let picture = panel.picture.clone();
    sheet.marks.push(Mark::Picture { at, size, picture });
    let edge = vec![[left, top], [right, top], [right, bottom], [left, bottom], at];
    sheet.line(edge, 0.4, (128, 128, 128));
    for (text, y) in [(&panel.title, top - 0.4 * LETTERS), (&panel.caption, bottom + 1.2 * LETTERS)]
    {
        sheet.text([left, y], text, fitted(text, LETTERS, room), Anchor::Start, ink);
    }
    let place = |[x, y]: [f32; 2]| [left + scale * x, top + scale * y];
    for line in &panel.lines {
        let stops = line.stops.iter().map(|stop| place(*stop)).collect();
        sheet.line(stops, scale * line.width as f32, line.colour);
    }
    for ring in &panel.rings {
        let mut edge = circle(place(ring.at), scale * ring.radius as f32);
        edge.extend(edge.first().copied());
        sheet.line(edge, 2.0 * scale, ring.colour);
    }
    for dot in &panel.dots {
        let circle = |radius| circle(place(dot.at), scale * radius);
        sheet.area(circle(dot.radius as f32 + 1.0), (0, 0, 0));
        sheet.area(circle(dot.radius as f32), dot.colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::reproduce::curves::{self, Point};
    use crate::experiment::reproduce::methods::{DEFAULT, Entry, GDG_BRIDGE};
    use crate::figure::Format;
    use gdg::draw::Rgb;

    static ENTRIES: [Entry; 2] = [DEFAULT, GDG_BRIDGE];

    fn panel() -> Panel {
        let points = |mean: f64| {
            let at = |x: u64| Point { x: 100 * x, values: vec![(1, mean - 0.1), (2, mean + 0.1)] };
            (1..=3).map(at).collect::<Vec<Point>>()
        };
        let curve =
            |i: usize| curves::Curve { entry: &ENTRIES[i], points: points(0.3 + 0.2 * i as f64) };
        Panel {
            measure: "success",
            labels: ["updates", "success rate"],
            top: Some(1.0),
            curves: vec![curve(0), curve(1)],
        }
    }

    #[test]
    fn charts_name_their_axes_and_methods_and_show_their_colours() {
        let panels = [panel()];
        let sheet = Drawing { title: "A title", panels: &panels, maps: &[] }.draw();
        let text = String::from_utf8(Format::Svg.encode(&sheet).expect("a drawing")).expect("text");
        for part in [
            "A title",
            "updates",
            "success rate",
            ENTRIES[0].title,
            ENTRIES[1].title,
            "#d55e00",
            "#0072b2",
        ] {
            assert!(text.contains(part), "{part}");
        }
        let file = Format::Png.encode(&sheet).expect("a picture");
        let mut reader =
            ::png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let frame = reader.next_frame(&mut pixels).expect("pixels");
        assert_eq!(frame.width, (sheet.size[0] * 300.0 / 72.0).ceil() as u32);
        let count =
            |(r, g, b): Rgb| pixels.chunks_exact(3).filter(|pixel| **pixel == [r, g, b]).count();
        assert!(count((255, 255, 255)) > 100_000 && count((40, 40, 40)) > 100, "letters on white");
        assert!(ENTRIES.iter().all(|entry| count(entry.colour) > 300), "lines");
    }

    #[test]
    fn maps_are_drawn_below_charts() {
        let map = MapPanel {
            title: "A map".to_owned(),
            caption: String::new(),
            picture: gdg::draw::Picture::new((30, 20), (1, 2, 3)),
            lines: Vec::new(),
            rings: Vec::new(),
            dots: Vec::new(),
            text: String::new(),
        };
        let (panels, maps) = ([panel()], [vec![map]]);
        let draw = |panels, maps| Drawing { title: "A title", panels, maps }.draw();
        let (alone, both) = (draw(&[], &maps), draw(&panels, &maps));
        let place = |sheet: &Sheet| {
            let at = sheet.marks.iter().find_map(|mark| match mark {
                Mark::Picture { at, size, .. } => Some(at[1]..at[1] + size[1]),
                _ => None,
            });
            at.expect("a map")
        };
        assert!(place(&both).start > place(&alone).end && place(&both).end < both.size[1]);
        let text = String::from_utf8(Format::Svg.encode(&both).expect("a drawing")).expect("text");
        assert!(["success rate", "A map", "<image "].iter().all(|part| text.contains(part)));
    }
}
