//! Charts: lines over an axis, below their names.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{self, Chart, Dataset, GraphType, LegendPosition};

use crate::experiment::plot::Axis;
use crate::tui::pane_text::{fitted_lines, short};
use crate::tui::style::DIM;

/// Maximum lines for a chart's title and the names of its curves.
const MAX_NAME_LINES: usize = 2;

pub struct PaneCurve {
    pub name: String,
    pub style: Style,
    pub marker: Marker,
    pub points: Vec<(f64, f64)>,
}

impl PaneCurve {
    /// Returns its sign and its name, for a heading.
    pub fn label(&self) -> Span<'static> {
        let sign = if let Marker::Custom(sign) = self.marker { sign } else { '\u{2500}' };
        Span::styled(format!("  {sign} {}", self.name), self.style)
    }

    pub fn line(&self) -> ChartLine<'_> {
        let Self { style, marker, points, .. } = self;
        ChartLine { style: *style, marker: *marker, points }
    }
}

pub struct ChartLine<'a> {
    pub style: Style,
    pub marker: Marker,
    pub points: &'a [(f64, f64)],
}

/// Returns a chart's title, followed by the names of its curves, in two lines at most.
pub fn heading(
    title: &Span<'static>,
    names: impl Iterator<Item = Span<'static>>,
    width: u16,
) -> Vec<Line<'static>> {
    let mut lines = vec![Line::from(title.clone())];
    for name in names {
        let used = lines.last().map_or(0, Line::width);
        if used + name.width() > usize::from(width) && lines.len() < MAX_NAME_LINES {
            lines.push(Line::default());
        }
        lines.last_mut().into_iter().for_each(|line| line.push_span(name.clone()));
    }
    fitted_lines(lines, width)
}

pub struct Axes {
    /// The bounds across, and what they count.
    pub x: [f64; 2],
    pub over: Axis,
    /// The bounds upwards, and their labels.
    pub y: [f64; 2],
    pub y_labels: [String; 2],
}

/// Draws lines over axes; returns the area of the lines.
pub fn draw<'a>(
    frame: &mut Frame,
    area: Rect,
    Axes { x, over, y, y_labels }: Axes,
    lines: impl Iterator<Item = ChartLine<'a>>,
) -> Rect {
    let inner = lines_area(area, &x.map(short), &y_labels);
    let set = |line: ChartLine<'a>| {
        // A single fine dot would be hard to see.
        let is_dot = line.points.len() == 1 && line.marker == Marker::Braille;
        let marker = if is_dot { Marker::Dot } else { line.marker };
        let set = Dataset::default().marker(marker).graph_type(GraphType::Line);
        set.style(line.style).data(line.points)
    };
    let [from, to] = x.map(short);
    // Ratatui gives each of the labels the same width, after a blank, and cuts what is longer.
    let room = |labels: u16| usize::from(inner.width / labels);
    let fits = |unit: &&str| unit.len().max(to.len()) < room(3);
    let x_labels = match [over.label(), over.name()].into_iter().find(fits) {
        Some(unit) => vec![from, unit.to_owned(), to],
        None if to.len() <= room(2) => vec![from, to],
        None => vec![String::new(); 2],
    };
    let axis = widgets::Axis::default().style(DIM);
    let x_axis = axis.clone().bounds(x).labels(x_labels);
    let y_axis = axis.bounds(y).labels(y_labels);
    let chart = Chart::new(lines.map(set).collect()).x_axis(x_axis).y_axis(y_axis);
    frame.render_widget(chart.legend_position(None::<LegendPosition>), area);
    inner
}

/// Returns the area within a chart that ratatui leaves for lines: to the right of the labels, of
/// which the first one below may begin under the axis, and of the axis; above the other axis and
/// its labels.
fn lines_area(area: Rect, x_labels: &[String; 2], y_labels: &[String; 2]) -> Rect {
    let width = |label: &String| Line::raw(label.as_str()).width();
    let left = y_labels
        .iter()
        .map(width)
        .chain([width(&x_labels[0]).saturating_sub(1)])
        .max()
        .unwrap_or(0);
    let left = (left as u16).min(area.width / 3) + 1;
    Rect {
        x: area.x + left.min(area.width),
        width: area.width.saturating_sub(left),
        height: area.height.saturating_sub(2),
        ..area
    }
}
