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
mod footer;
mod header;
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

use super::app::App;
use super::dialog::Dialog;
pub use map::Cache;
#[cfg(test)]
pub use side::lines as pane_lines;

/// The smallest screen on which everything has room.
#[cfg(test)]
pub(super) const LEAST_SCREEN: (u16, u16) = (80, 24);

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
    app.places.forget_clicks();
    header::draw(frame, head, app);
    let side = match body.width {
        w if w >= VERY_WIDE => 2 * WIDE_SIDE,
        w if w >= WIDE => WIDE_SIDE,
        w if w >= SIDE + LEAST_MAP => SIDE,
        _ => 0,
    };
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
    footer::draw(frame, foot, app);
    let mut dialogs = std::mem::take(&mut app.dialogs);
    if let Some(top) = dialogs.last_mut() {
        // What lies below it does not answer.
        app.places.forget_clicks();
        match top {
            Dialog::Help(first) => help::draw(frame, frame.area(), app, first),
            Dialog::Pick(picker) => dialog::draw_picker(frame, frame.area(), picker, &mut app.places),
            Dialog::Ask(prompt) => dialog::draw_prompt(frame, frame.area(), prompt, &mut app.places),
        }
    }
    app.dialogs = dialogs;
}

/// The middle of `area`, at most so large.
fn middle(area: Rect, width: u16, height: u16) -> Rect {
    area.centered(Constraint::Length(width.min(area.width)), Constraint::Length(height.min(area.height)))
}
