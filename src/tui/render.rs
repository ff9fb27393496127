//! Draws the application's state. Every pane is a function of the state, without I/O.
//!
//! ```text
//! +----------------------------------------------------------+
//! | map, method, preset, seed, phase, unsaved updates        |  header
//! +---------------------------------------+------------------+
//! |                                       | pane names       |
//! | map or arm                            | pane             |
//! |                                       | (more panes if   |
//! | meaning of colours, or facts of a cell|  there is room)  |  info
//! +---------------------------------------+                  |
//! | keys, or a notice                                        |  footer
//! +----------------------------------------------------------+
//! ```

pub(super) mod chart;
pub(super) mod curves;
mod dialog;
pub(super) mod footer;
mod header;
pub(super) mod help;
mod hint;
mod log;
pub(super) mod scale;
mod side;
pub(super) mod text;
mod training;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};

use super::dialog::Dialog;
use super::layout::ScreenLayout;
use super::scene;
pub use super::scene::Cache;
use super::screen::Screen;
#[cfg(test)]
pub use side::lines as pane_lines;

/// The smallest screen on which everything fits.
#[cfg(test)]
pub(super) const MIN_SCREEN: (u16, u16) = (80, 24);

/// Widths in columns: the panel beside the map, each column of panes in a wide panel, and the minimum for the map.
const SIDE_WIDTH: u16 = 30;
const WIDE_SIDE_WIDTH: u16 = 40;
const MIN_MAP_WIDTH: u16 = 40;

/// Screen widths from which the panel is wide, and from which it has two columns of panes.
const WIDE_SCREEN: u16 = 110;
const VERY_WIDE_SCREEN: u16 = 160;

pub(super) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
pub(super) const DIM: Style = Style::new().add_modifier(Modifier::DIM);
pub(super) const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);

/// Draws everything and returns where it is; `cache` keeps what the next frame can reuse.
pub fn draw(frame: &mut Frame, screen: &Screen, cache: &mut Cache) -> ScreenLayout {
    let mut layout = draw_panes(frame, screen, cache);
    if let Some(top) = screen.dialogs.last() {
        // Panes below a dialog do not react to clicks.
        layout.forget_clicks();
        match top {
            Dialog::Help(first) => layout.help_line = Some(help::draw(frame, frame.area(), screen, *first)),
            Dialog::Pick(picker) => dialog::draw_picker(frame, frame.area(), picker, &mut layout),
            Dialog::Ask(prompt) => dialog::draw_prompt(frame, frame.area(), prompt, &mut layout),
        }
    }
    layout
}

/// Draws everything except dialogs.
pub fn draw_panes(frame: &mut Frame, screen: &Screen, cache: &mut Cache) -> ScreenLayout {
    let mut layout = ScreenLayout::new(frame.area());
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)]).areas(frame.area());
    header::draw(frame, head, screen, &mut layout);
    let side = match body.width {
        w if w >= VERY_WIDE_SCREEN => 2 * WIDE_SIDE_WIDTH,
        w if w >= WIDE_SCREEN => WIDE_SIDE_WIDTH,
        w if w >= SIDE_WIDTH + MIN_MAP_WIDTH => SIDE_WIDTH,
        _ => 0,
    };
    if screen.maximised {
        side::draw_maximised(frame, body, screen, &mut layout);
    } else {
        let [left, right] = Layout::horizontal([Constraint::Min(0), Constraint::Length(side)]).areas(body);
        layout.map_pane = left;
        let [map, info] = Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(left);
        scene::draw(frame, [map, info], screen, &mut layout, cache);
        hint::draw(frame, map, screen, &mut layout);
        if side > 0 {
            side::draw(frame, right, screen, &mut layout);
        }
    }
    footer::draw(frame, foot, screen, &mut layout);
    layout
}

/// Returns the middle of `area`, at most `width` by `height`.
fn middle(area: Rect, width: u16, height: u16) -> Rect {
    area.centered(Constraint::Length(width.min(area.width)), Constraint::Length(height.min(area.height)))
}
