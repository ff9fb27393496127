//! Curves of several runs in one chart.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::Paragraph;

use super::list::{Entry, stem};
use super::{Curves, sign, style};
use crate::experiment::plot::Measure;
use crate::tui::action::{Action, ListAction};
use crate::tui::layout::{Click, ScreenLayout};
use crate::tui::render::chart::{self, Curve};
use crate::tui::render::curves;
use crate::tui::style::{BOLD, DIM};
use crate::tui::theme::Theme;

/// Returns the curve of a run.
fn curve(
    mark: Option<usize>,
    entry: &Entry,
    Curves { measure, axis }: Curves,
    theme: &Theme,
) -> Curve {
    let at = |at| Some((axis.of(at)?, measure.of(&at.evaluation)?));
    Curve {
        name: format!("{} {}", sign(mark), stem(&entry.run.source)),
        style: style(mark, theme),
        marker: mark.map_or(Marker::Braille, |mark| curves::marker(theme, mark)),
        points: entry.run.evaluations.iter().filter_map(at).collect(),
    }
}

/// Draws the curves of runs, with the numbers of their letters; a click on the title changes the
/// axis.
pub fn draw(
    frame: &mut Frame,
    area: Rect,
    runs: &[(Option<usize>, &Entry)],
    shown: Curves,
    theme: &Theme,
    layout: &mut ScreenLayout,
) {
    let all: Vec<Curve> =
        runs.iter().map(|(mark, entry)| curve(*mark, entry, shown, theme)).collect();
    let names = all.iter().map(|curve| Span::styled(format!("  {}", curve.name), curve.style));
    let title = format!(" {} over {}", shown.measure.label(), shown.axis.label());
    let heading = chart::heading(&Span::styled(title, BOLD), names, area.width);
    let [head, body] =
        Layout::vertical([Constraint::Length(heading.len() as u16), Constraint::Min(0)])
            .areas(area);
    layout.add(Rect { height: 1, ..head }, Click::Act(Action::List(ListAction::Axis)));
    frame.render_widget(Paragraph::new(heading), head);
    let points = || all.iter().flat_map(|curve| &curve.points);
    if points().next().is_none() {
        let text = if runs.iter().all(|(_, entry)| entry.run.evaluations.is_empty()) {
            " not evaluated yet"
        } else {
            " not known of these runs"
        };
        frame.render_widget(Paragraph::new(text).style(DIM), body);
        return;
    }
    let last = points().map(|point| point.0).fold(1.0, f64::max);
    let is_share = shown.measure != Measure::Error;
    let high = if is_share { 1.0 } else { points().map(|point| point.1).fold(0.01, f64::max) };
    let y_labels = [0.0, high]
        .map(|y| if is_share { format!("{y:.1}") } else { format!("{:.0} %", 100.0 * y) });
    let axes = chart::Axes { x: [0.0, last], over: shown.axis, y: [0.0, high], y_labels };
    // The first ones last, on top.
    chart::draw(frame, body, axes, all.iter().rev().map(Curve::line));
}
