//! Charts as characters, for the terminal.

use std::io::IsTerminal;

use anstyle::RgbColor;
use anstyle_lossy::rgb_to_xterm;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, LegendPosition, Widget};

use super::curves::Panel;
use crate::view::Rgb;

/// Columns and rows of a chart.
const SIZE: (u16, u16) = (100, 22);

/// Draws charts one below the other, in colours if standard output is a terminal.
pub fn charts(panels: &[Panel]) -> String {
    let coloured = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    panels.iter().map(|panel| chart(panel, coloured)).collect()
}

fn chart(panel: &Panel, coloured: bool) -> String {
    let points: Vec<Vec<(f64, f64)>> =
        panel.curves.iter().map(|curve| curve.points.iter().map(|p| (p.x as f64, p.mean())).collect()).collect();
    let all = || points.iter().flatten();
    let last = all().map(|p| p.0).fold(1.0, f64::max);
    let highest = panel.top.unwrap_or_else(|| all().map(|p| p.1).fold(1.0, f64::max));
    let data = panel.curves.iter().zip(&points).zip('a'..);
    let data = data.map(|((curve, points), letter)| {
        // Without colours, letters tell the methods apart.
        let name = if coloured { curve.entry.title.to_owned() } else { format!("{letter} {}", curve.entry.title) };
        Dataset::default()
            .name(name)
            .marker(if coloured { Marker::Braille } else { Marker::Custom(letter) })
            .graph_type(GraphType::Line)
            .style(Style::new().fg(of(curve.entry.colour)))
            .data(points)
    });
    let axis = |title, top: f64| {
        let labels = [0.0, 0.5, 1.0].map(|share| Line::from(super::draw::tick(share * top)));
        Axis::default().title(title).bounds([0.0, 1.02 * top]).labels(labels)
    };
    let chart = Chart::new(data.collect())
        .x_axis(axis(panel.labels[0], last))
        .y_axis(axis(panel.labels[1], highest))
        .legend_position(Some(LegendPosition::Right))
        .hidden_legend_constraints((Constraint::Percentage(50), Constraint::Percentage(60)));
    let mut screen = Buffer::empty(Rect::new(0, 0, SIZE.0, SIZE.1));
    chart.render(screen.area, &mut screen);
    text(&screen, coloured)
}

/// Returns the nearest of the 256 colours, which every terminal with colours has.
fn of((r, g, b): Rgb) -> Color {
    Color::Indexed(rgb_to_xterm(RgbColor(r, g, b)).0)
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
    use crate::experiment::reproduce::curves::{Curve, Point};
    use crate::experiment::reproduce::methods::ENTRIES;

    #[test]
    fn a_chart_shows_axes_legend_and_a_line_per_method() {
        let points =
            |value| vec![Point { x: 0, values: vec![(1, value)] }, Point { x: 40_000, values: vec![(1, value)] }];
        let curve = |i: usize, value| Curve { entry: &ENTRIES[i], points: points(value) };
        let curves = vec![curve(0, 0.9), curve(1, 0.1)];
        let panel = Panel { measure: "success", labels: ["updates", "success rate"], top: Some(1.0), curves };
        let plain = chart(&panel, false);
        for part in ["updates", "success rate", "a default (ours)", "40k", "aaaaaaaa", "bbbbbbbb"] {
            assert!(plain.contains(part), "{part}: {plain}");
        }
        assert!(!plain.contains('\x1b') && chart(&panel, true).contains("\x1b[38;5;"));
    }
}
