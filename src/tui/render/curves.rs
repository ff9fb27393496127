//! Curves over updates: success and coverage, errors of D, losses.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{Page, chart};
use crate::experiment::plot::Axis;
use crate::tui::layout::ChartArea;
use crate::tui::screen::Screen;
use crate::tui::style::{BOLD, DIM};
use crate::tui::text::short;
use crate::tui::theme::{ColourDepth, Theme, blend};
use gdg::env::DistanceUnit;
use gdg::text::display_width;
use gdg::train::{DistanceScore, Evaluation};

/// Minimum height of a chart, and minimum width for two side by side.
const MIN_CHART_HEIGHT: u16 = 7;
const MIN_TWO_CHART_WIDTH: u16 = 64;

/// Columns between two charts, so that a curve does not run into a number.
const CHART_GAP: u16 = 2;

/// The symbol for the line at a change of the method, or at an edit of the map.
pub const MARK: char = '\u{2506}';

/// What an edit of the map is called, and the share of the window up to which the next one
/// continues it.
pub const EDITED: &str = "map edited";
const EDIT_SHARE: f64 = 0.02;

/// Colours of lines.
const COLOURS: usize = 6;

/// Share of all updates that is shown at once when scrolled back.
const PAGE_SHARE: f64 = 0.25;

/// A line of a chart, in unconnected parts.
struct Series {
    name: String,
    parts: Vec<Vec<(f64, f64)>>,
}

impl Series {
    fn joined(name: &str, points: impl Iterator<Item = (f64, f64)>) -> Self {
        Self { name: name.to_owned(), parts: vec![points.collect()] }
    }
}

/// A chart's data.
struct Plot {
    title: &'static str,
    series: Vec<Series>,
    /// The highest possible value, if there is one.
    max: Option<f64>,
    /// Whether it is drawn on a logarithmic scale.
    log: bool,
    /// Whether the values are shares, to be labelled in percent.
    percent: bool,
}

impl Plot {
    fn rate(title: &'static str, series: Vec<Series>) -> Self {
        Self { title, series, max: Some(1.0), log: false, percent: false }
    }

    fn loss(title: &'static str, series: Series) -> Self {
        Self { title, series: vec![series], max: None, log: true, percent: false }
    }
}

pub fn draw(page: &mut Page, area: Rect) {
    let Page { frame, screen, scene, layout } = page;
    let mut plots = plots(screen, scene.has_true_distances());
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
            layout.charts.extend(draw_plot(frame, *area, screen, &plot));
        }
    }
}

fn plots(screen: &Screen, has_true_distances: bool) -> Vec<Plot> {
    let snapshot = &screen.snapshot;
    // One part for each method. A former method that does not learn would only leave a dot.
    let stretches = snapshot.methods.stretches();
    let of = |name: &str, value: &dyn Fn(&Evaluation) -> Option<f64>| {
        let mut parts = vec![Vec::new(); stretches.len().max(1)];
        for (at, e) in snapshot.evaluations.iter() {
            let i = snapshot.methods.index(*at);
            if i + 1 >= stretches.len() || stretches[i].learns {
                parts[i].extend(value(e).map(|value| (along(screen, *at), value)));
            }
        }
        Series { name: name.to_owned(), parts }
    };
    let loss = |i: usize| {
        let points =
            snapshot.curve.iter().map(|p| (along(screen, p.updates), f64::from(p.losses[i])));
        Series::joined(["D", "f", "mu"][i], points)
    };
    let distances = screen.snapshot.evaluations.first().map_or(&[][..], |(_, e)| by_distance(e));
    let each = distances
        .iter()
        .enumerate()
        .map(|(i, d)| of(&group_name(d, i, distances.len()), &|e| by_distance(e).get(i)?.success));
    let by_unit = match distances.iter().find_map(DistanceScore::distance) {
        Some((_, DistanceUnit::Centimetres)) => "success by cm",
        Some((_, DistanceUnit::Steps)) => "success by steps",
        None => "success by task",
    };
    let coverage =
        screen.snapshot.coverage().into_iter().map(|(at, share)| (along(screen, at), share));
    let success = vec![
        of("planned", &|e| e.planned.as_ref()?.success),
        of("greedy", &|e| e.greedy.success),
        Series::joined("coverage", coverage),
    ];
    let errors = vec![
        of("D", &|e| Some(e.distance_error?.mape)),
        of("via graph", &|e| Some(e.distance_error?.graph?.mape)),
    ];
    let errors = Plot { title: "error of D", series: errors, max: None, log: true, percent: true };
    let of_critic = Plot::loss("loss of D", loss(0));
    let [second, third] =
        if has_true_distances { [errors, of_critic] } else { [of_critic, errors] };
    vec![
        Plot::rate("success", success),
        second,
        third,
        Plot::rate(by_unit, each.collect()),
        Plot::loss("loss of f", loss(1)),
        Plot::loss("loss of mu, steps", loss(2)),
    ]
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
    &e.planned.as_ref().unwrap_or(&e.greedy).by_distance
}

/// The part of a plot's data that a chart shows.
struct Window<'a> {
    plot: &'a Plot,
    /// The updates shown.
    x: [f64; 2],
    /// Whether values are on a logarithmic scale.
    log: bool,
    /// The series that each part belongs to, and its points as they are drawn.
    parts: Vec<(usize, Vec<(f64, f64)>)>,
}

impl<'a> Window<'a> {
    fn new(plot: &'a Plot, screen: &Screen) -> Self {
        let (x, log) = (window(screen), plot.log);
        let value = |y: f64| if log { y.max(1e-9).log10() } else { y };
        let shown = |part: &Vec<(f64, f64)>| -> Vec<(f64, f64)> {
            part.iter().filter(|p| is_within(p.0, x)).map(|p| (p.0, value(p.1))).collect()
        };
        let parts = (plot.series.iter().enumerate())
            .flat_map(|(i, series)| series.parts.iter().map(move |part| (i, shown(part))))
            .collect();
        Self { plot, x, log, parts }
    }

    fn values(&self) -> impl Iterator<Item = f64> {
        self.parts.iter().flat_map(|(_, points)| points).map(|point| point.1)
    }

    fn y(&self) -> [f64; 2] {
        let low = if self.log { self.values().fold(f64::INFINITY, f64::min) } else { 0.0 };
        [low, self.plot.max.unwrap_or_else(|| self.values().fold(low + 1e-6, f64::max))]
    }

    fn label(&self, y: f64) -> String {
        match if self.log { 10f64.powf(y) } else { y } {
            y if self.plot.percent => format!("{:.0} %", 100.0 * y),
            y if y >= 100.0 => format!("{y:.0}"),
            y if y >= 1.0 || y == 0.0 => format!("{y:.1}"),
            y => format!("{y:.2}"),
        }
    }

    /// Returns the title, with the names of the series if there are several, and of the methods.
    fn heading(&self, marks: &[(f64, String)], screen: &Screen, width: u16) -> Vec<Line<'static>> {
        let Self { plot, .. } = self;
        let title = format!(" {}{}", plot.title, if self.log { " (log)" } else { "" });
        let is_shown =
            |s: &Series| plot.series.len() > 1 && s.parts.iter().any(|part| !part.is_empty());
        let named = plot.series.iter().enumerate().filter(|(_, s)| is_shown(s));
        let theme = &screen.theme;
        let names = named.map(|(i, s)| {
            let name = format!("  {} {}", symbol(marker(theme, i)), s.name);
            Span::styled(name, colour(theme, i))
        });
        let mut lines = chart::heading(&Span::styled(title, BOLD), names, width);
        if plot.max.is_some() && !marks.is_empty() {
            lines.push(Line::styled(mark_names(marks, usize::from(width)), DIM));
        }
        lines
    }

    fn why_empty(&self, screen: &Screen) -> &'static str {
        match screen.snapshot.evaluations.is_empty() {
            _ if self.plot.log && self.plot.series.len() == 1 => " no data yet",
            true => " not evaluated yet",
            false => " not known here",
        }
    }
}

fn is_within(at: f64, [from, to]: [f64; 2]) -> bool {
    (from..=to).contains(&at)
}

/// Draws a chart; returns where its lines are, unless there are none.
fn draw_plot(frame: &mut Frame, area: Rect, screen: &Screen, plot: &Plot) -> Option<ChartArea> {
    let window = Window::new(plot, screen);
    let marks = marks(screen, window.x);
    let heading = window.heading(&marks, screen, area.width);
    let [head, body] =
        Layout::vertical([Constraint::Length(heading.len() as u16), Constraint::Min(0)])
            .areas(area);
    frame.render_widget(Paragraph::new(heading), head);
    if window.values().next().is_none() {
        let text = Line::styled(window.why_empty(screen), DIM);
        frame.render_widget(Paragraph::new(text), body);
        return None;
    }
    let [low, high] = window.y();
    let upright = |at: f64| [(at, low), (at, high)];
    let uprights: Vec<[(f64, f64); 2]> = marks.iter().map(|(at, _)| upright(*at)).collect();
    let past = screen.past.as_ref().map(|frame| along(screen, frame.updates));
    let past = past.filter(|at| is_within(*at, window.x)).map(upright);
    let line = |style, points| chart::Line { style, marker: Marker::Braille, points };
    let curve = |i: usize, points| {
        let theme = &screen.theme;
        chart::Line { style: colour(theme, i), marker: marker(theme, i), points }
    };
    // The first ones last, on top.
    let changes = uprights.iter().map(|upright| line(DIM, &upright[..]));
    let curves = window.parts.iter().rev().map(|(i, points)| curve(*i, &points[..]));
    let cursor = BOLD.fg(screen.theme.colour(screen.theme.cursor));
    let lines = changes.chain(curves).chain(past.iter().map(|points| line(cursor, &points[..])));
    let axes = chart::Axes {
        x: window.x,
        over: axis(screen),
        y: [low, high],
        y_labels: [low, high].map(|y| window.label(y)),
    };
    let area = chart::draw(frame, body, axes, lines);
    Some(ChartArea { area, bounds: window.x })
}

/// Converts a number of updates to a position on the horizontal axis: the learner's updates or, in
/// a run without a learner, the steps.
pub fn along(screen: &Screen, updates: u64) -> f64 {
    if has_learned(screen) {
        return screen.snapshot.learned(updates) as f64;
    }
    (updates * screen.run().settings.train.env_steps_per_update) as f64
}

/// Returns what [`along`] counts.
fn axis(screen: &Screen) -> Axis {
    if has_learned(screen) { Axis::Updates } else { Axis::Steps }
}

fn has_learned(screen: &Screen) -> bool {
    screen.snapshot.updates() > 0 || screen.snapshot.learns
}

/// Returns where the method changed within the window, and to which, and where the map was edited.
fn marks(screen: &Screen, window: [f64; 2]) -> Vec<(f64, String)> {
    let changes = screen.snapshot.methods.stretches().iter().skip(1);
    let changes = changes.map(|stretch| (along(screen, stretch.from), stretch.method.clone()));
    let edits = screen.snapshot.edits.iter().map(|at| along(screen, *at));
    let edits = apart(edits, window).into_iter().map(|at| (at, EDITED.to_owned()));
    let mut marks: Vec<(f64, String)> =
        changes.filter(|(at, _)| is_within(*at, window)).chain(edits).collect();
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    marks
}

/// Returns the edits within the window, without those that only continue another one: drawing a
/// wall is several.
pub fn apart(edits: impl Iterator<Item = f64>, window: [f64; 2]) -> Vec<f64> {
    let gap = EDIT_SHARE * (window[1] - window[0]);
    let mut apart: Vec<f64> = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for at in edits.filter(|at| is_within(*at, window)) {
        if at - before > gap {
            apart.push(at);
        }
        before = at;
    }
    apart
}

/// Names the latest of `marks` that fit into `width` columns, the last one in any case.
fn mark_names(marks: &[(f64, String)], width: usize) -> String {
    let mut names = String::new();
    for (at, method) in marks.iter().rev() {
        let name = format!(" {MARK} {} {method}", short(*at));
        let gap = if names.is_empty() { "" } else { " " };
        if !names.is_empty() && display_width(&names) + gap.len() + display_width(&name) > width {
            break;
        }
        names = name + gap + &names;
    }
    names
}

/// Returns the range of updates shown: all, or an earlier part when scrolled back.
fn window(screen: &Screen) -> [f64; 2] {
    let last = along(screen, screen.snapshot.counters.updates).max(1.0);
    let page = PAGE_SHARE * last;
    match screen.scrolled {
        0 => [0.0, last],
        n => {
            let to = (last - (n - 1) as f64 * page / 2.0).max(page);
            [to - page, to]
        }
    }
}

/// Returns the characters that line `i` is drawn with: they tell lines apart that have no colours,
/// or the same ones.
pub fn marker(theme: &Theme, i: usize) -> Marker {
    let number = if theme.depth == ColourDepth::Mono { i } else { i / COLOURS };
    match ['\u{2500}', '\u{2022}', '+', 'x', 'o', '*'][number % 6] {
        sign if number > 0 => Marker::Custom(sign),
        _ => Marker::Braille,
    }
}

pub fn symbol(marker: Marker) -> char {
    match marker {
        Marker::Custom(sign) => sign,
        _ => '\u{2500}',
    }
}

/// Returns the style of line `i`.
pub fn colour(theme: &Theme, i: usize) -> Style {
    if theme.depth == ColourDepth::Mono {
        return [Style::new(), Style::new().add_modifier(Modifier::BOLD), DIM][i % 3];
    }
    // Colours from the map's distance scale, the first two far apart.
    let at = [0.0, 0.6, 0.3, 0.45, 0.75, 0.15][i % COLOURS];
    let Color::Rgb(..) = theme.colour((0, 0, 0)) else {
        return Style::new().fg([
            Color::Yellow,
            Color::Cyan,
            Color::Green,
            Color::Blue,
            Color::Magenta,
            Color::Red,
        ][i % COLOURS]);
    };
    let rgb = theme.distance_colour(at);
    // On a light page, thin lines must be darker than areas.
    let rgb = if theme.page.is_some() { blend(rgb, (0, 0, 0), 0.45) } else { rgb };
    Style::new().fg(theme.colour(rgb))
}
