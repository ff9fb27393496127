//! Charts as characters, for the terminal.

use std::io::IsTerminal;

use anstyle::RgbColor;
use anstyle_lossy::rgb_to_xterm;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

use super::curves::{Curve, Panel};
use gdg::draw::Rgb;
use gdg::text::terminal_obeys_escapes;

/// Columns and rows of a chart.
const SIZE: (u16, u16) = (100, 22);

/// Columns of the names of methods, with the last value of each.
const LEGEND: u16 = 37;

/// Draws charts one below the other, in colours if standard output is a terminal that has some.
pub fn charts(panels: &[Panel]) -> String {
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
