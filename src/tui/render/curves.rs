//! Curves over updates: success and coverage, errors of D, losses; and charts: lines over an axis, below
//! their names.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{self, Chart, Dataset, GraphType, LegendPosition, Paragraph};

use super::ScreenPainter;
use crate::experiment::plot::{Drawable, Measure, XAxis};
use crate::figure;
use crate::tui::layout::ChartArea;
use crate::tui::pane_text::{fitted_lines, short};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, ColourDepth, DIM, Rgb, Theme, blend, rgb_of};
use gdg::env::DistanceUnit;
use gdg::train::{DistanceScore, Evaluation};

/// Minimum height of a chart, and minimum width for two side by side.
const MIN_CHART_HEIGHT: u16 = 7;
const MIN_TWO_CHART_WIDTH: u16 = 64;

/// Columns between two charts, so that a curve does not run into a number.
const CHART_GAP: u16 = 2;

/// The symbol for the line at a change of the method, or at an edit of the map.
pub const MARK: char = '\u{2506}';

/// What an edit is called, and the share of the axis up to which the next one continues it.
pub const EDITED: &str = "map edited";
const EDIT_SHARE: f64 = 0.02;

/// The numbers of colours besides those of measures.
const VIA_GRAPH: usize = 4;
const MODEL: usize = 5;
const ACTOR: usize = 6;

/// How much lighter lines are on a dark page than in figures, and how far the curve of the farthest
/// tasks fades.
const LIGHTER: f32 = 0.25;
const FADE: f32 = 0.7;

pub struct Plot {
    pub title: &'static str,
    /// Those without a name continue the one before.
    pub curves: Vec<PaneCurve>,
    pub max: Option<f64>,
    /// Whether it is drawn on a logarithmic scale.
    log: bool,
}

pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let mut plots = plots(screen, &screen.theme, scene.has_true_distances());
    let columns = if area.width >= MIN_TWO_CHART_WIDTH { 2 } else { 1 };
    let rows =
        usize::from((area.height / MIN_CHART_HEIGHT).max(1)).min(plots.len().div_ceil(columns));
    plots.truncate(rows * columns);
    let rows = Layout::vertical(vec![Constraint::Fill(1); rows]).split(area);
    let mut plots = plots.into_iter();
    for row in rows.iter() {
        let areas =
            Layout::horizontal(vec![Constraint::Fill(1); columns]).spacing(CHART_GAP).split(*row);
        for (area, plot) in areas.iter().zip(&mut plots) {
            layout.charts.extend(draw_plot(frame, *area, screen, plot));
        }
    }
}

/// Returns the charts, whose curves have the same colours as in all others, by what they mean, and signs by
/// their order.
pub fn plots(screen: &Screen, theme: &Theme, has_true_distances: bool) -> Vec<Plot> {
    type Quantity<'a> = &'a dyn Fn(&Evaluation) -> Option<f64>;
    let snapshot = &screen.snapshot;
    let own = |of: Measure| of.colour(screen.run().method.plans());
    let curve = |name: &str, [ink, sign]: [usize; 2], points| {
        let (style, marker) = (colour(theme, [ink, sign]), marker(theme, sign));
        PaneCurve { name: name.to_owned(), style, marker, points }
    };
    // One part for each method. A former method that does not learn would only leave a dot.
    let stretches = snapshot.methods.stretches();
    let of = |name: &str, inks: [usize; 2], value: Quantity| -> Vec<PaneCurve> {
        let mut parts = vec![Vec::new(); stretches.len().max(1)];
        for (at, e) in snapshot.evaluations.iter() {
            let own = snapshot.methods.index(*at);
            if own + 1 >= stretches.len() || stretches[own].learns {
                parts[own].extend(value(e).map(|value| (along(screen, *at), value)));
            }
        }
        let named = std::iter::once(name).chain(std::iter::repeat(""));
        named.zip(parts).map(|(name, points)| curve(name, inks, points)).collect()
    };
    let loss = |title, i: usize, ink| {
        let points = snapshot.curve.iter();
        let points = points.map(|p| (along(screen, p.updates), f64::from(p.losses[i]))).collect();
        Plot { title, curves: vec![curve("", [ink, 0], points)], max: None, log: true }
    };
    let distances = snapshot.evaluations.first().map_or(&[][..], |(_, e)| by_distance(e));
    let each = distances.iter().enumerate().flat_map(|(i, d)| {
        let name = group_name(d, i, distances.len());
        let curves = of(&name, [own(Measure::Success), i], &|e| by_distance(e).get(i)?.success);
        let fade = FADE * i as f32 / distances.len() as f32;
        curves.into_iter().map(move |curve| curve.faded(theme, fade))
    });
    let by_unit = match distances.iter().find_map(DistanceScore::distance) {
        Some((_, DistanceUnit::Centimetres)) => "success by cm",
        Some((_, DistanceUnit::Steps)) => "success by steps",
        None => "success by task",
    };
    let coverage = snapshot.coverage().into_iter();
    let coverage = coverage.map(|(at, share)| (along(screen, at), share)).collect();
    let mut success =
        of("planned", [Measure::Success.colour(true), 0], &|e| e.planned.as_ref()?.success);
    success.extend(of("alone", [own(Measure::Alone), 1], &|e| e.alone.success));
    success.push(curve("explored", [own(Measure::Explored), 2], coverage));
    let mut errors = of("D", [own(Measure::Error), 0], &|e| Some(100.0 * e.error?.mape));
    let graph = |e: &Evaluation| Some(100.0 * e.error?.graph?.mape);
    errors.extend(of("via graph", [VIA_GRAPH, 1], &graph));
    let rate = |title, curves| Plot { title, curves, max: Some(1.0), log: false };
    let errors = Plot { title: "error of D, %", curves: errors, max: None, log: true };
    let of_critic = loss("loss of D", 0, own(Measure::Error));
    let is_known = has_true_distances || errors.curves.iter().any(|curve| !curve.points.is_empty());
    let errors = is_known.then_some(errors);
    // One group has the curve of all.
    let each = (distances.len() != 1).then(|| rate(by_unit, each.collect()));
    let losses = [loss("loss of f", 1, MODEL), loss("loss of mu, steps", 2, ACTOR)];
    let first = [rate("success", success)].into_iter().chain(errors);
    first.chain([of_critic]).chain(each).chain(losses).collect()
}

/// The title of a chart that draws one quantity of several runs.
pub fn title(of: Measure, over: XAxis) -> String {
    format!(" {} over {}", of.label().replace("success rate", "success"), over.label())
}

/// Returns the name of group `i` of `groups`: its distance, or its number.
pub fn group_name(group: &DistanceScore, i: usize, groups: usize) -> String {
    match group.distance() {
        Some((distance, _)) => format!("{distance:.0}"),
        None if groups > 1 => (i + 1).to_string(),
        None => "all".to_owned(),
    }
}

/// Returns the success at each distance, with planning if the method plans.
fn by_distance(e: &Evaluation) -> &[DistanceScore] {
    &e.planned.as_ref().unwrap_or(&e.alone).by_distance
}

/// Draws a chart of the window; returns where its lines are, unless there are none.
fn draw_plot(frame: &mut Frame, area: Rect, screen: &Screen, mut plot: Plot) -> Option<ChartArea> {
    let x = [0.0, along(screen, screen.snapshot.counters.updates).max(1.0)];
    let log = plot.log;
    if log {
        let points = plot.curves.iter_mut().flat_map(|curve| &mut curve.points);
        points.for_each(|point| point.1 = point.1.max(1e-9).log10());
    }
    let marks = marks(screen, x[1]);
    let names = plot.curves.iter().filter(|curve| !curve.name.is_empty());
    let names = names.filter(|curve| !curve.points.is_empty());
    let mut names: Vec<Span> = names.map(PaneCurve::label).collect();
    if plot.max.is_some() {
        let mut of_marks: Vec<&str> = marks.iter().map(|(_, name)| &**name).collect();
        of_marks.dedup();
        names.extend(of_marks.iter().map(|name| Span::styled(format!("  {MARK} {name}"), DIM)));
    }
    let title = format!(" {}{}", plot.title, if log { " (log)" } else { "" });
    let [_, body] = draw_heading(frame, area, title, names.into_iter());
    let values = || plot.curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
    if values().next().is_none() {
        let known = !screen.snapshot.evaluations.is_empty();
        let why = if known { " not known here" } else { " no data yet" };
        frame.render_widget(Line::styled(why, DIM), body);
        return None;
    }
    let low = if log { values().fold(f64::INFINITY, f64::min) } else { 0.0 };
    let high = plot.max.unwrap_or_else(|| values().fold(low + 1e-6, f64::max));
    let upright = |at: f64| [(at, low), (at, high)];
    let uprights: Vec<[(f64, f64); 2]> = marks.iter().map(|(at, _)| upright(*at)).collect();
    let past = screen.past.as_ref().map(|frame| along(screen, frame.updates));
    let past = past.map(upright);
    let line = |style, points| ChartLine { style, marker: Marker::Braille, points };
    // The first ones last, on top.
    let changes = uprights.iter().map(|upright| line(DIM, &upright[..]));
    let cursor = BOLD.fg(screen.theme.colour(screen.theme.cursor));
    let lines = changes
        .chain(plot.curves.iter().rev().map(PaneCurve::line))
        .chain(past.iter().map(|points| line(cursor, &points[..])));
    let label = |y: f64| match if log { 10f64.powf(y) } else { y } {
        y if y >= 100.0 => format!("{y:.0}"),
        y if y >= 1.0 || y == 0.0 => format!("{y:.1}"),
        y if y >= 0.0095 => format!("{y:.2}"),
        y => format!("{y:.3}"),
    };
    let y = [low, high];
    let axes = Axes { x, over: axis(screen), y, y_labels: y.map(label) };
    let area = draw_chart(frame, body, axes, lines);
    Some(ChartArea { area, bounds: x })
}

/// Converts updates to a position on the axis: the learner's updates or, without one, steps.
pub fn along(screen: &Screen, updates: u64) -> f64 {
    if has_learned(screen) {
        return screen.snapshot.learned(updates) as f64;
    }
    (updates * screen.run().settings.train.env_steps_per_update) as f64
}

pub fn axis(screen: &Screen) -> XAxis {
    if has_learned(screen) { XAxis::Updates } else { XAxis::Steps }
}

fn has_learned(screen: &Screen) -> bool {
    screen.snapshot.updates() > 0 || screen.snapshot.learns
}

/// Returns where the method changed, and to which, and where the map was edited.
fn marks(screen: &Screen, last: f64) -> Vec<(f64, String)> {
    let changes = screen.snapshot.methods.stretches().iter().skip(1);
    let changes = changes.map(|stretch| (along(screen, stretch.from), stretch.method.clone()));
    let edits = screen.snapshot.edits.iter().map(|at| along(screen, *at));
    let edits = apart(edits, last).into_iter().map(|at| (at, EDITED.to_owned()));
    let mut marks: Vec<(f64, String)> = changes.chain(edits).collect();
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    marks
}

/// Returns the edits up to the `last` place, without those that only continue another one.
pub fn apart(edits: impl Iterator<Item = f64>, last: f64) -> Vec<f64> {
    let mut apart: Vec<f64> = edits.collect();
    apart.dedup_by(|at, before| *at - *before <= EDIT_SHARE * last);
    apart
}

/// Returns the characters of line `i`, which tell lines of no colours or the same ones apart.
pub fn marker(theme: &Theme, i: usize) -> Marker {
    sign(if theme.depth == ColourDepth::Mono { i } else { i / figure::COLOURS.len() })
}

pub fn sign(number: usize) -> Marker {
    match ['\u{2500}', '\u{2022}', '+', 'x', 'o', '*'][number % 6] {
        sign if number > 0 => Marker::Custom(sign),
        _ => Marker::Braille,
    }
}

/// Returns the style of lines in a colour of figures; without colours, by their sign.
pub fn colour(theme: &Theme, [ink, sign]: [usize; 2]) -> Style {
    if theme.depth == ColourDepth::Mono {
        return [Style::new(), Style::new().add_modifier(Modifier::BOLD), DIM][sign % 3];
    }
    let rgb = match figure::colour(ink) {
        rgb if theme.page.is_some() => rgb,
        (0, 0, 0) => WHITE,
        rgb => blend(rgb, WHITE, LIGHTER),
    };
    Style::new().fg(theme.colour(rgb))
}

const WHITE: Rgb = (255, 255, 255);

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

    fn faded(self, theme: &Theme, share: f32) -> Self {
        let page = theme.page.map_or((0, 0, 0), |(_, page)| page);
        let faded = |rgb| theme.colour(blend(rgb, page, share));
        Self {
            style: Style { fg: self.style.fg.and_then(rgb_of).map(faded), ..self.style },
            ..self
        }
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

/// Draws a chart's title, followed by the names of its curves, in two lines at most; returns their
/// area and what is left below.
pub fn draw_heading(
    frame: &mut Frame,
    area: Rect,
    title: String,
    names: impl Iterator<Item = Span<'static>>,
) -> [Rect; 2] {
    let mut lines = vec![Line::from(Span::styled(title, BOLD))];
    for name in names {
        let used = lines.last().map_or(0, Line::width);
        if used + name.width() > usize::from(area.width) && lines.len() < MAX_NAME_LINES {
            lines.push(Line::default());
        }
        lines.last_mut().into_iter().for_each(|line| line.push_span(name.clone()));
    }
    let rows = [Constraint::Length(lines.len() as u16), Constraint::Min(0)];
    let areas: [Rect; 2] = Layout::vertical(rows).areas(area);
    frame.render_widget(Paragraph::new(fitted_lines(lines, area.width)), areas[0]);
    areas
}

pub struct Axes {
    /// The bounds across, and what they count.
    pub x: [f64; 2],
    pub over: XAxis,
    /// The bounds upwards, and their labels.
    pub y: [f64; 2],
    pub y_labels: [String; 2],
}

/// Draws lines over axes; returns the area of the lines.
pub fn draw_chart<'a>(
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
