//! A figure's files: data as CSV, drawings as SVG and PNG, and the same for the terminal.

use std::io::IsTerminal;

use anstyle::RgbColor;
use anstyle_lossy::rgb_to_xterm;
use miette::Report;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

use super::MethodRuns;
use super::catalogue::Figure;
use super::curves::{Curve, Panel, panels};
use super::maps::{MapPanel, draw, rows};
use crate::experiment::folder::Folder;
use crate::experiment::measure::Walked;
use crate::experiment::plot::csv_of;
use crate::figure::Format;
use gdg::draw::Rgb;
use gdg::text::terminal_obeys_escapes;

/// What a figure shows.
pub struct Drawn {
    /// Charts, if it shows curves.
    pub panels: Vec<Panel>,
    /// Maps, a row per method.
    pub maps: Vec<Vec<MapPanel>>,
}

impl Drawn {
    /// Draws a figure and writes its data and drawings into `folder`.
    pub fn write(figure: &Figure, methods: &[MethodRuns], folder: &Folder) -> Result<Self, Report> {
        let name = figure.name;
        let drawn = Self { panels: panels(figure, methods), maps: rows(figure, methods) };
        let Self { panels, maps } = &drawn;
        let csv = if panels.is_empty() { walks_csv(methods)? } else { curves_csv(panels)? };
        folder.write(&format!("data/{name}.csv"), &csv)?;
        let sheet = draw(figure.title, panels, maps);
        for format in [Format::Svg, Format::Png] {
            let file = format!("figures/{name}.{}", format.extension());
            folder.write(&file, &format.encode(&sheet)?)?;
        }
        Ok(drawn)
    }

    pub fn for_terminal(&self, figure: &Figure) -> String {
        let heading = format!("\n{}: {}\n", figure.name, figure.title);
        let charts = charts(&self.panels);
        let map = |panel: &MapPanel| {
            let MapPanel { title, caption, text, .. } = panel;
            if text.is_empty() { String::new() } else { format!("\n{title} ({caption})\n{text}") }
        };
        // The first row is our default; more would be pages of text.
        let maps: String = self.maps.first().into_iter().flatten().map(map).collect();
        heading + &charts + &maps
    }
}

/// Returns a line per value: measure, method, seed, place on the horizontal axis, value.
fn curves_csv(panels: &[Panel]) -> Result<Vec<u8>, Report> {
    let mut lines = Vec::new();
    for panel in panels {
        for curve in &panel.curves {
            for (seed, points) in &curve.seeds {
                let line = |(x, value): &(f64, f64)| {
                    (panel.measure, curve.entry.name, *seed, *x as u64, *value)
                };
                lines.extend(points.iter().map(line));
            }
        }
    }
    csv_of(&["measure", "method", "seed", panels[0].labels[0], "value"], lines)
}

fn walks_csv(methods: &[MethodRuns]) -> Result<Vec<u8>, Report> {
    let mut lines = Vec::new();
    for method in methods {
        let Some(result) = method.results.first() else { continue };
        let Some(measured) = &result.measured else { continue };
        let walks = measured.walks.iter().chain(measured.bridge.iter().map(|bridge| &bridge.walk));
        for Walked { distance, reached, path, .. } in walks {
            let line = |(step, [x, y]): (usize, &[f32; 2])| {
                (method.entry.name, result.seed, *distance, *reached, step, *x, *y)
            };
            lines.extend(path.iter().enumerate().map(line));
        }
    }
    csv_of(&["method", "seed", "distance", "reached", "step", "x", "y"], lines)
}

/// Columns and rows of a chart.
const SIZE: (u16, u16) = (100, 22);

/// Columns of the names of methods, with the last value of each.
const LEGEND: u16 = 37;

/// Draws charts one below the other, in colours if standard output is a terminal that has some.
fn charts(panels: &[Panel]) -> String {
    let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let coloured = wanted && std::io::stdout().is_terminal() && terminal_obeys_escapes();
    panels.iter().map(|panel| chart(panel, coloured)).collect()
}

fn chart(panel: &Panel, coloured: bool) -> String {
    let means = panel.curves.iter().map(Curve::means);
    let points: Vec<Vec<(f64, f64)>> =
        means.map(|means| means.iter().map(|point| (point.x, point.mean)).collect()).collect();
    let all = || points.iter().flatten();
    let last = all().map(|p| p.0).fold(1.0, f64::max);
    let highest = panel.top.unwrap_or_else(|| all().map(|p| p.1).fold(1.0, f64::max));
    // The nearest of the 256 colours, which every terminal with colours has.
    let of = |(r, g, b): Rgb| Color::Indexed(rgb_to_xterm(RgbColor(r, g, b)).0);
    let data = panel.curves.iter().zip(&points).map(|(curve, points)| {
        let line = Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line);
        line.style(Style::new().fg(of(curve.entry.colour))).data(points)
    });
    let axis = |top: f64| {
        let labels = [0.0, 0.5, 1.0].map(|share| Line::from(crate::figure::tick(share * top)));
        Axis::default().bounds([0.0, 1.02 * top]).labels(labels)
    };
    // Names of axes and methods are around the chart, where no line crosses them.
    let mut screen = Buffer::empty(Rect::new(0, 0, SIZE.0, SIZE.1));
    let [above, middle, below] =
        Layout::vertical([Constraint::Length(1), Constraint::Fill(1), Constraint::Length(1)])
            .areas(screen.area);
    let [ground, legend] =
        Layout::horizontal([Constraint::Fill(1), Constraint::Length(LEGEND)]).areas(middle);
    Chart::new(data.collect()).x_axis(axis(last)).y_axis(axis(highest)).render(ground, &mut screen);
    Line::from(panel.labels[1]).render(above, &mut screen);
    let below = Rect { width: ground.width, ..below };
    Line::from(panel.labels[0]).right_aligned().render(below, &mut screen);
    // Without colours, the last values tell the lines apart.
    let digits = if panel.top.is_some() { 2 } else { 1 };
    for ((curve, points), row) in panel.curves.iter().zip(&points).zip(legend.rows()) {
        let last = points.last().map_or(String::new(), |(_, value)| format!("{value:.digits$}"));
        Line::from(format!("  ── {:<27}{last}", curve.entry.title))
            .style(of(curve.entry.colour))
            .render(row, &mut screen);
    }
    text(&screen, coloured)
}

/// Returns the characters, with escape sequences for their colours if `coloured`.
fn text(screen: &Buffer, coloured: bool) -> String {
    let mut out = String::from("\n");
    for y in 0..screen.area.height {
        let mut line = String::new();
        for x in 0..screen.area.width {
            let cell = &screen[(x, y)];
            match cell.fg {
                Color::Indexed(i) if coloured && cell.symbol() != " " => {
                    line += &format!("\x1b[38;5;{i}m{}\x1b[39m", cell.symbol());
                }
                _ => line += cell.symbol(),
            }
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::figures::catalogue::{DEFAULT, Entry, GDG_BRIDGE};

    static ENTRIES: [Entry; 2] = [DEFAULT, GDG_BRIDGE];

    #[test]
    fn a_chart_shows_axes_legend_and_a_line_per_method() {
        let curve = |i: usize, value| {
            let points = vec![(0.0, value), (40_000.0, value)];
            Curve { entry: &ENTRIES[i], seeds: [(1, points)].into() }
        };
        // The first curve lies at the top, where names of axis and methods must not be.
        let curves = vec![curve(0, 1.0), curve(1, 0.1)];
        let labels = ["updates", "success rate"];
        let panel = Panel { measure: "success", labels, top: Some(1.0), curves };
        let plain = chart(&panel, false);
        for part in [
            "updates",
            "── default (ours)             1.00",
            "── GDG, bridges               0.10",
            "40k",
            "⠒⠒⠒⠒",
        ] {
            assert!(plain.contains(part), "{part}: {plain}");
        }
        assert!(plain.lines().any(|line| line.trim() == "success rate"), "{plain}");
        assert!(!plain.contains('\x1b') && chart(&panel, true).contains("\x1b[38;5;"));
    }
}
