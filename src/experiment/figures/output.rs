//! A figure's files: data as CSV, drawings as SVG and PNG, and charts for the terminal.

use std::io::IsTerminal;

use anstyle::RgbColor;
use anstyle_lossy::rgb_to_xterm;
use miette::Report;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::{self, Axis, Dataset, GraphType, Widget};

use super::MethodRuns;
use super::catalogue::Figure;
use super::curves::{Panel, panels};
use super::maps::{MapPanel, draw, rows};
use crate::experiment::folder::Folder;
use crate::experiment::measure::Walked;
use crate::experiment::plot::{csv_of, table};
use crate::figure::{Chart, Format, tick};
use gdg::draw::Rgb;
use gdg::text::terminal_obeys_escapes;

pub struct Drawn {
    pub panels: Vec<Panel>,
    /// Maps, a row per method.
    pub maps: Vec<Vec<MapPanel>>,
    pub text: String,
}

impl Drawn {
    pub fn write(figure: &Figure, methods: &[MethodRuns], folder: &Folder) -> Result<Self, Report> {
        let name = figure.name;
        let (panels, maps) = (panels(figure, methods), rows(figure, methods));
        let csv = if let [Panel { labels, .. }, ..] = &panels[..] {
            let lines = panels.iter().flat_map(|panel| &panel.lines);
            table(lines, [labels[0], "value"], [0.0, f64::INFINITY])?
        } else {
            walks_csv(methods)?
        };
        folder.write(&format!("data/{name}.csv"), &csv)?;
        let charts: Vec<Chart> = panels.iter().map(Panel::chart).collect();
        let sheet = draw(figure.title, &charts, &maps);
        for format in [Format::Svg, Format::Png] {
            let file = format!("figures/{name}.{}", format.extension());
            folder.write(&file, &format.encode(&sheet)?)?;
        }
        let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        let coloured = wanted && std::io::stdout().is_terminal() && terminal_obeys_escapes();
        let text = charts.iter().map(|chart| text_of(chart, coloured));
        let text = format!("\n{name}: {}\n{}", figure.title, text.collect::<String>());
        Ok(Self { panels, maps, text })
    }
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

/// Columns and rows of a chart in characters.
const SIZE: (u16, u16) = (80, 20);

/// Returns a chart in characters, with the names of its curves and their last values below, and with
/// escape sequences for their colours if `coloured`.
fn text_of(chart: &Chart, coloured: bool) -> String {
    let Chart { labels, x, y, curves, .. } = chart;
    // The nearest of the 256 colours, which every terminal with colours has.
    let of = |(r, g, b): Rgb| rgb_to_xterm(RgbColor(r, g, b)).0;
    let painted = |text: &str, colour: u8| match text {
        text if coloured && text != " " => format!("\x1b[38;5;{colour}m{text}\x1b[39m"),
        text => text.to_owned(),
    };
    let points = curves.iter().map(|curve| curve.points.iter().map(|at| (at.x, at.mean)).collect());
    let points: Vec<Vec<(f64, f64)>> = points.collect();
    let data = curves.iter().zip(&points).map(|(curve, points)| {
        let line = Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line);
        line.style(Style::new().fg(Color::Indexed(of(curve.colour)))).data(points)
    });
    let axis = |top: f64| {
        Axis::default()
            .bounds([0.0, 1.02 * top])
            .labels([0.0, 0.5, 1.0].map(|share| tick(share * top)))
    };
    let mut screen = Buffer::empty(Rect::new(0, 0, SIZE.0, SIZE.1));
    widgets::Chart::new(data.collect())
        .x_axis(axis(x[1]))
        .y_axis(axis(y.high))
        .legend_position(None)
        .render(screen.area, &mut screen);
    let mut out = format!("\n{} over {}\n", labels[1], labels[0]);
    for row in screen.area.rows() {
        let cells = row.positions().map(|at| match screen[at].fg {
            Color::Indexed(colour) => painted(screen[at].symbol(), colour),
            _ => screen[at].symbol().to_owned(),
        });
        out = out + cells.collect::<String>().trim_end() + "\n";
    }
    for curve in curves {
        // Without colours, the last values tell the lines apart.
        let last = curve.points.last().map_or(String::new(), |at| format!("{:.2}", at.mean));
        let line = format!("  \u{2500}\u{2500} {:<27}{last}", curve.name);
        out = out + &painted(&line, of(curve.colour)) + "\n";
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Curve, Point, Range};

    #[test]
    fn a_chart_shows_axes_legend_and_a_line_per_method() {
        let curve = |name: &str, value| {
            let points = [0.0, 40_000.0].map(|x| Point::single(x, value)).to_vec();
            Curve { name: name.to_owned(), colour: (213, 94, 0), marker: 0, points }
        };
        let chart = Chart {
            title: String::new(),
            labels: ["updates", "success rate"].map(str::to_owned),
            x: [0.0, 40_000.0],
            y: Range::SHARE,
            curves: vec![curve("ours", 1.0), curve("GDG", 0.1)],
        };
        let plain = text_of(&chart, false);
        for part in [
            "success rate over updates\n",
            "\u{2500}\u{2500} GDG                        0.10\n",
            "40k",
            "\u{2812}\u{2812}\u{2812}",
        ] {
            assert!(plain.contains(part), "{part}: {plain}");
        }
        assert!(!plain.contains('\x1b') && text_of(&chart, true).contains("\x1b[38;5;"));
    }
}
