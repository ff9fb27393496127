//! Draws a figure: charts or maps, as SVG and as PNG.

mod png;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use miette::{IntoDiagnostic, Report, miette};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters_backend::DrawingErrorKind;

use super::curves::{Curve, Panel};
use super::panel::MapPanel;
use gdg::draw::Rgb;

/// A figure to draw: charts side by side, rows of maps, or rows of maps below charts.
pub struct Drawing<'a> {
    /// Its title.
    pub title: &'a str,
    /// Charts.
    pub panels: &'a [Panel],
    /// Maps.
    pub maps: &'a [Vec<MapPanel>],
}

/// Sizes in pixels: of a chart, of the legend beside the charts, of margins and of lines of text.
const CHART: (u32, u32) = (680, 440);
const LEGEND: u32 = 240;
const MARGIN: u32 = 14;
const LINE: u32 = 22;

/// Size of the letters.
const LETTERS: u32 = 15;

/// Markers on a curve, about: more would hide it.
const MARKERS: usize = 20;

/// How much of the colour a band of seeds has.
const BAND: f64 = 0.16;

type DrawError<B> = DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>;

/// Returns the figure as an SVG document.
///
/// # Errors
/// It cannot be drawn.
pub fn svg(drawing: &Drawing) -> Result<String, Report> {
    let (width, height) = drawing.size();
    let mut document = String::new();
    {
        let root = SVGBackend::with_string(&mut document, (width, height)).into_drawing_area();
        paint(&root, drawing).map_err(|error| miette!("the figure cannot be drawn: {error}"))?;
    }
    // Ground and pictures go below everything else: the backend writes no pictures.
    let mut below = format!("<rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n");
    for (panel, (x, y)) in drawing.placed() {
        let (columns, rows) = panel.picture.size();
        let data = STANDARD.encode(panel.picture.to_png().into_diagnostic()?);
        below += &format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{columns}\" height=\"{rows}\" href=\"data:image/png;base64,{data}\"/>\n"
        );
    }
    let head = document.find('>').map_or(0, |end| end + 1);
    document.insert_str(head, &format!("\n{below}"));
    Ok(document)
}

/// Returns the figure as a PNG file.
///
/// # Errors
/// It cannot be drawn or encoded.
pub fn png(drawing: &Drawing) -> Result<Vec<u8>, Report> {
    let pictures = drawing.placed().map(|(panel, at)| (&panel.picture, at));
    let drawn =
        png::draw(drawing.size(), pictures, |canvas| paint(&canvas.into_drawing_area(), drawing));
    let picture = drawn.ok_or_else(|| miette!("the figure is too large"))?;
    let picture = picture.map_err(|error| miette!("the figure cannot be drawn: {error}"))?;
    picture.to_png().into_diagnostic()
}

impl Drawing<'_> {
    /// Returns width and height in pixels.
    fn size(&self) -> (u32, u32) {
        let charts = (self.panels.len().max(1) as u32 * CHART.0 + LEGEND + 2 * MARGIN, CHART.1);
        let (width, height) = self.panel_size();
        let columns = self.maps.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let rows = self.maps.len() as u32;
        let maps = (columns * (width + MARGIN) + MARGIN, rows * (height + 2 * LINE + MARGIN));
        let (width, height) = match (self.maps.is_empty(), self.panels.is_empty()) {
            (true, _) => charts,
            (false, true) => maps,
            (false, false) => (charts.0.max(maps.0), charts.1 + maps.1),
        };
        (width, height + LINE + 2 * MARGIN)
    }

    /// Returns the size of the largest map.
    fn panel_size(&self) -> (u32, u32) {
        let sizes = || self.maps.iter().flatten().map(|panel| panel.picture.size());
        (
            sizes().map(|s| s.0).max().unwrap_or(0) as u32,
            sizes().map(|s| s.1).max().unwrap_or(0) as u32,
        )
    }

    /// Returns every map with the place of its upper left corner.
    fn placed(&self) -> impl Iterator<Item = (&MapPanel, (i32, i32))> {
        let (width, height) = self.panel_size();
        let above = if self.panels.is_empty() { 0 } else { CHART.1 };
        let rows = self.maps.iter().enumerate();
        rows.flat_map(move |(row, panels)| {
            panels.iter().enumerate().map(move |(column, panel)| {
                let x = MARGIN + column as u32 * (width + MARGIN);
                let y =
                    above + 2 * MARGIN + LINE + LINE + row as u32 * (height + 2 * LINE + MARGIN);
                (panel, (x as i32, y as i32))
            })
        })
    }
}

fn colour((r, g, b): Rgb) -> RGBColor {
    RGBColor(r, g, b)
}

fn letters(bold: bool) -> TextStyle<'static> {
    let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
    FontDesc::new(FontFamily::SansSerif, f64::from(LETTERS), style).color(&BLACK)
}

/// Draws everything but pictures.
fn paint<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    drawing: &Drawing,
) -> Result<(), DrawError<B>> {
    let margin = MARGIN as i32;
    root.draw(&Text::new(drawing.title, (margin, margin), letters(true)))?;
    if !drawing.panels.is_empty() {
        let (_, below) = root.split_vertically(MARGIN + LINE);
        let (below, _) = below.split_vertically(CHART.1 + MARGIN);
        let (charts, legend) = below.split_horizontally(drawing.panels.len() as u32 * CHART.0);
        for (area, panel) in
            charts.split_evenly((1, drawing.panels.len().max(1))).iter().zip(drawing.panels)
        {
            chart(area, panel)?;
        }
        if let Some(panel) = drawing.panels.first() {
            paint_legend(&legend, &panel.curves)?;
        }
    }
    for (panel, at) in drawing.placed() {
        paint_map(root, panel, at)?;
    }
    root.present()
}

/// Formats a number on an axis: 40k, 0.2.
pub fn tick(value: f64) -> String {
    match value.abs() {
        size if size >= 1e6 => format!("{}M", value / 1e6),
        size if size >= 1e4 => format!("{}k", value / 1e3),
        _ => format!("{}", (value * 1000.0).round() / 1000.0),
    }
}

fn chart<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    panel: &Panel,
) -> Result<(), DrawError<B>> {
    let points = || panel.curves.iter().flat_map(|curve| &curve.points);
    let last = points().map(|point| point.x as f64).fold(1.0, f64::max);
    let highest =
        panel.top.unwrap_or_else(|| points().map(|point| point.range().1).fold(1.0, f64::max));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..1.03 * last, 0.0..1.03 * highest)?;
    chart
        .configure_mesh()
        .x_desc(panel.labels[0])
        .y_desc(panel.labels[1])
        .x_labels(8)
        .y_labels(7)
        .label_style(letters(false))
        .axis_desc_style(letters(false))
        .x_label_formatter(&|value| tick(*value))
        .y_label_formatter(&|value| tick(*value))
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for curve in &panel.curves {
        let (up, down) = (curve.points.iter(), curve.points.iter().rev());
        let band =
            up.map(|p| (p.x as f64, p.range().1)).chain(down.map(|p| (p.x as f64, p.range().0)));
        chart.draw_series([Polygon::new(
            band.collect::<Vec<_>>(),
            colour(curve.entry.colour).mix(BAND),
        )])?;
    }
    for (i, curve) in panel.curves.iter().enumerate() {
        let own = colour(curve.entry.colour);
        let means: Vec<(f64, f64)> = curve.points.iter().map(|p| (p.x as f64, p.mean())).collect();
        chart.draw_series(LineSeries::new(means.clone(), own.stroke_width(2)))?;
        let symbol = |at: &(f64, f64)| EmptyElement::at(*at) + Symbol { number: i, colour: own };
        chart
            .draw_series(means.iter().step_by(means.len().div_ceil(MARKERS).max(1)).map(symbol))?;
    }
    Ok(())
}

/// A method's marker: shapes distinguish methods without colour, too.
struct Symbol {
    number: usize,
    colour: RGBColor,
}

impl<'a> plotters::element::PointCollection<'a, (i32, i32)> for &'a Symbol {
    type Point = (i32, i32);
    type IntoIter = [(i32, i32); 1];

    fn point_iter(self) -> Self::IntoIter {
        [(0, 0)]
    }
}

impl<B: DrawingBackend> plotters::element::Drawable<B> for Symbol {
    fn draw<I: Iterator<Item = (i32, i32)>>(
        &self,
        mut at: I,
        backend: &mut B,
        _: (u32, u32),
    ) -> Result<(), DrawingErrorKind<B::ErrorType>> {
        let Some((x, y)) = at.next() else { return Ok(()) };
        let style = ShapeStyle::from(&self.colour);
        match self.number % 5 {
            0 => backend.draw_circle((x, y), 4, &style, true),
            1 => backend.draw_rect((x - 4, y - 4), (x + 4, y + 4), &style, true),
            2 => backend.fill_polygon([(x, y - 5), (x + 5, y + 4), (x - 5, y + 4)], &style),
            3 => backend.fill_polygon([(x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y)], &style),
            _ => backend.fill_polygon([(x, y + 5), (x + 5, y - 4), (x - 5, y - 4)], &style),
        }
    }
}

fn paint_legend<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    curves: &[Curve],
) -> Result<(), DrawError<B>> {
    for (i, curve) in curves.iter().enumerate() {
        let (y, own) = ((2 * MARGIN + i as u32 * LINE) as i32, colour(curve.entry.colour));
        area.draw(&PathElement::new([(0, y), (30, y)], own.stroke_width(2)))?;
        area.draw(&(EmptyElement::at((15, y)) + Symbol { number: i, colour: own }))?;
        let beside = letters(false).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(curve.entry.title, (38, y), beside))?;
    }
    Ok(())
}

/// Draws a map's lines, dots, title and caption.
fn paint_map<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    panel: &MapPanel,
    (left, top): (i32, i32),
) -> Result<(), DrawError<B>> {
    let place = |at: &[f32; 2]| (left + at[0].round() as i32, top + at[1].round() as i32);
    let below = top + panel.picture.size().1 as i32;
    root.draw(&Text::new(panel.title.as_str(), (left, top - LINE as i32 + 3), letters(false)))?;
    root.draw(&Text::new(panel.caption.as_str(), (left, below + 3), letters(false)))?;
    let (columns, rows) = panel.picture.size();
    let corner = (left + columns as i32, top + rows as i32);
    root.draw(&Rectangle::new([(left - 1, top - 1), corner], BLACK.mix(0.5)))?;
    for line in &panel.lines {
        let stops: Vec<(i32, i32)> = line.stops.iter().map(place).collect();
        if stops.len() > 1 {
            root.draw(&PathElement::new(stops, colour(line.colour).stroke_width(line.width)))?;
        }
    }
    for ring in &panel.rings {
        root.draw(&Circle::new(place(&ring.at), ring.radius, colour(ring.colour).stroke_width(2)))?;
    }
    for dot in &panel.dots {
        root.draw(&Circle::new(place(&dot.at), dot.radius + 1, BLACK.filled()))?;
        root.draw(&Circle::new(place(&dot.at), dot.radius, colour(dot.colour).filled()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::reproduce::curves::Point;
    use crate::experiment::reproduce::methods::{DEFAULT, Entry, GDG_BRIDGE};

    static ENTRIES: [Entry; 2] = [DEFAULT, GDG_BRIDGE];

    fn panel() -> Panel {
        let points = |mean: f64| {
            let at = |x: u64| Point { x: 100 * x, values: vec![(1, mean - 0.1), (2, mean + 0.1)] };
            (1..=3).map(at).collect::<Vec<Point>>()
        };
        let curve = |i: usize| Curve { entry: &ENTRIES[i], points: points(0.3 + 0.2 * i as f64) };
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
        let drawing = Drawing { title: "A title", panels: &panels, maps: &[] };
        let text = svg(&drawing).expect("a drawing");
        for part in [
            "A title",
            "updates",
            "success rate",
            ENTRIES[0].title,
            ENTRIES[1].title,
            "#D55E00",
            "#0072B2",
        ] {
            assert!(text.contains(part), "{part}");
        }
        let file = png(&drawing).expect("a picture");
        let mut reader =
            ::png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let frame = reader.next_frame(&mut pixels).expect("pixels");
        assert_eq!((frame.width, frame.height), drawing.size());
        let count =
            |(r, g, b): Rgb| pixels.chunks_exact(3).filter(|pixel| **pixel == [r, g, b]).count();
        assert!(count((255, 255, 255)) > 100_000 && count((0, 0, 0)) > 100, "letters on white");
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
        let size = |panels, maps| Drawing { title: "", panels, maps }.size();
        let (charts, both) = (size(&panels, &[]), size(&panels, &maps));
        assert_eq!((both.0, both.1), (charts.0, charts.1 + 20 + 2 * LINE + MARGIN));
        let drawing = Drawing { title: "A title", panels: &panels, maps: &maps };
        let (_, (_, top)) = drawing.placed().next().expect("a map");
        assert!(top as u32 > MARGIN + LINE + CHART.1 && top as u32 + 20 < both.1, "{top}");
        let text = svg(&drawing).expect("a drawing");
        assert!(["success rate", "A map", "<image "].iter().all(|part| text.contains(part)));
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([0.2, 40.0, 40_000.0, 2e6].map(tick), ["0.2", "40", "40k", "2M"]);
    }
}
