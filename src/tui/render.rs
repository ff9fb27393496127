//! From the application's state to a frame. Every pane is a function of the state, without I/O.

mod help;
mod map;
mod side;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::action::BINDINGS;
pub use map::Base;

use super::app::App;
use crate::train::Phase;

/// Columns of the panel beside the map, and the least that must remain for the map.
const SIDE: u16 = 30;
const LEAST_MAP: u16 = 40;

/// Draws everything.
pub fn draw(frame: &mut Frame, app: &mut App) {
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)]).areas(frame.area());
    header(frame, head, app);
    let side = if body.width >= SIDE + LEAST_MAP { SIDE } else { 0 };
    let [left, right] = Layout::horizontal([Constraint::Min(0), Constraint::Length(side)]).areas(body);
    map::draw(frame, left, app);
    if side > 0 {
        side::draw(frame, right, app);
    }
    footer(frame, foot, app);
    if app.show_help {
        help::draw(frame, frame.area(), app);
    }
}

fn header(frame: &mut Frame, area: Rect, app: &App) {
    let run = app.run();
    let phase = match &app.snapshot.phase {
        Phase::Running => "training".to_owned(),
        Phase::Paused => "paused".to_owned(),
        Phase::Done => "done".to_owned(),
        Phase::Failed(error) => format!("stopped: {error}"),
    };
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let line = Line::from(vec![
        Span::styled(" gdg-tui ", bold.add_modifier(Modifier::REVERSED)),
        Span::styled(format!(" {} ", app.map().name()), bold),
        Span::raw(format!("{} {} seed {}  ", run.method.name(), run.preset.name(), run.seed)),
        Span::styled(phase, bold),
        Span::raw(format!("  {}", app.layer.name())),
    ]);
    frame.render_widget(Paragraph::new(line), area);
}

/// A notice, or the keys.
fn footer(frame: &mut Frame, area: Rect, app: &App) {
    let line = match app.notice() {
        Some(notice) => Line::styled(format!(" {notice}"), Style::new().add_modifier(Modifier::BOLD)),
        None => keys(app),
    };
    frame.render_widget(Paragraph::new(line), area);
}

fn keys(app: &App) -> Line<'static> {
    if app.editor.is_open() {
        let bold = Style::new().add_modifier(Modifier::BOLD);
        return Line::from(vec![
            Span::styled(" EDIT ", bold.add_modifier(Modifier::REVERSED)),
            Span::raw(" drag: walls   right drag: floor   arrows, "),
            Span::styled("x", bold),
            Span::raw(": one cell   "),
            Span::styled("u", bold),
            Span::raw(" undo   "),
            Span::styled("e", bold),
            Span::raw(" done"),
        ]);
    }
    let mut spans = Vec::new();
    for binding in BINDINGS.iter().filter(|b| !b.short.is_empty()) {
        let paused = app.snapshot.phase == Phase::Paused;
        let short = if paused && binding.short == "pause" { "go on" } else { binding.short };
        spans.push(Span::styled(format!(" {}", binding.shown), Style::new().add_modifier(Modifier::BOLD)));
        spans.push(Span::raw(format!(" {short} ")));
    }
    Line::from(spans)
}
