//! From the application's state to a frame. Every pane is a function of the state, without I/O.
//!
//! ```text
//! +----------------------------------------------------------+
//! | map, method, preset, seed, phase, what is not saved       |  header
//! +---------------------------------------+------------------+
//! |                                       | panes' names     |
//! | map                                   | pane             |
//! |                                       | (more panes,     |
//! | what colours mean, or the cell's facts|  where there is  |  info
//! +---------------------------------------+  room)           |
//! | keys, or a notice                                         |  footer
//! +----------------------------------------------------------+
//! ```

mod curves;
mod dialog;
mod help;
mod info;
mod legend;
mod log;
mod map;
mod minimap;
mod side;
mod text;
mod training;
mod walk;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::action::{Action, bindings};
use super::app::App;
use super::dialog::Dialog;
use super::editor::Tool;
pub use map::Cache;

/// Columns of the panel beside the map: of one column of panes, and of two; and the least that must remain for the map.
const SIDE: u16 = 30;
const WIDE_SIDE: u16 = 40;
const LEAST_MAP: u16 = 40;

/// Columns from which on the panel is wider, and from which on there are two of it.
const WIDE: u16 = 110;
const VERY_WIDE: u16 = 160;

pub(super) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
pub(super) const DIM: Style = Style::new().add_modifier(Modifier::DIM);
pub(super) const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);

/// Draws everything; `cache` keeps what need not be drawn anew the next time.
pub fn draw(frame: &mut Frame, app: &mut App, cache: &mut Cache) {
    app.places.screen = frame.area();
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)]).areas(frame.area());
    frame.render_widget(Paragraph::new(header(app, head.width)), head);
    let side = match body.width {
        w if w >= VERY_WIDE => 2 * WIDE_SIDE,
        w if w >= WIDE => WIDE_SIDE,
        w if w >= SIDE + LEAST_MAP => SIDE,
        _ => 0,
    };
    app.places.tabs.clear();
    if app.maximised {
        side::draw_maximised(frame, body, app);
    } else {
        let [left, right] = Layout::horizontal([Constraint::Min(0), Constraint::Length(side)]).areas(body);
        app.places.map_pane = left;
        let [map, info] = Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(left);
        map::draw(frame, map, app, cache);
        minimap::draw(frame, map, app);
        info::draw(frame, info, app);
        if side > 0 {
            side::draw(frame, right, app);
        }
    }
    frame.render_widget(Paragraph::new(footer(app, foot.width)), foot);
    let mut dialogs = std::mem::take(&mut app.dialogs);
    if let Some(top) = dialogs.last_mut() {
        match top {
            Dialog::Help(first) => help::draw(frame, frame.area(), app, first),
            Dialog::Pick(picker) => app.places.rows = dialog::draw_picker(frame, frame.area(), picker),
            Dialog::Ask(prompt) => dialog::draw_prompt(frame, frame.area(), prompt),
        }
    }
    app.dialogs = dialogs;
}

fn header(app: &App, width: u16) -> Line<'static> {
    let run = app.run();
    let unsaved = app.unsaved_updates();
    let saved = match &app.snapshot.saved {
        _ if unsaved > 0 => " * not saved".to_owned(),
        Some((_, path)) => path.file_name().map_or(String::new(), |f| format!(" {}", f.to_string_lossy())),
        None => String::new(),
    };
    let speed = app.snapshot.speed.map_or(String::new(), |speed| format!(" (at most {speed:.0}/s)"));
    let mut spans = vec![
        Span::styled(" gdg-tui ", BOLD.add_modifier(Modifier::REVERSED)),
        Span::styled(format!(" {} ", app.map().name()), BOLD),
        Span::raw(format!("{} {} seed {} ", run.method.name(), run.preset.name(), run.seed)),
        Span::styled(format!(" {}{speed}", app.phase()), BOLD),
        Span::styled(saved, DIM),
    ];
    let used: usize = spans.iter().map(Span::width).sum();
    let unsaved = format!("  {unsaved} updates since the last checkpoint");
    if app.snapshot.saved.is_some() && used + unsaved.len() < usize::from(width) {
        spans.push(Span::styled(unsaved, DIM));
    }
    Line::from(spans)
}

/// A notice, or the keys.
fn footer(app: &App, width: u16) -> Line<'static> {
    if let Some((notice, fades)) = app.log.notice() {
        return Line::styled(format!(" {notice}"), if fades { DIM } else { BOLD });
    }
    if app.editor.is_open() {
        return editor_keys(app, width);
    }
    let mut line = Line::default();
    for binding in bindings().filter(|b| !b.short.is_empty()) {
        let key = app.keymap.shown(binding).first().cloned().unwrap_or_default();
        let waits = binding.action == Action::TogglePause && !app.snapshot.phase.trains();
        let short = if waits { "go on" } else { binding.short };
        line.push_span(Span::styled(format!(" {key}"), BOLD));
        line.push_span(Span::raw(format!(" {short} ")));
    }
    line
}

fn editor_keys(app: &App, width: u16) -> Line<'static> {
    let mut line = Line::from(Span::styled(" EDIT ", BOLD.add_modifier(Modifier::REVERSED)));
    for (i, tool) in Tool::ALL.into_iter().enumerate() {
        line.push_span(Span::styled(format!(" {}", i + 1), BOLD));
        let style = if tool == app.editor.tool { REVERSED } else { Style::new() };
        line.push_span(Span::styled(tool.name(), style));
    }
    let hints = ["  x use", "  u undo", "  e done", "  drag: walls  right drag: floor"];
    for hint in hints {
        if line.width() + hint.len() <= usize::from(width) {
            line.push_span(Span::raw(hint));
        }
    }
    line
}

/// The middle of `area`, at most so large.
fn middle(area: Rect, width: u16, height: u16) -> Rect {
    area.centered(Constraint::Length(width.min(area.width)), Constraint::Length(height.min(area.height)))
}
