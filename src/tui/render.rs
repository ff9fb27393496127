//! Draws the application's state. Every pane is a function of the state, without I/O.
//!
//! ```text
//! +----------------------------------------------------------+
//! | map, method, preset, seed, phase, unsaved updates        |  header
//! +---------------------------------------+------------------+
//! | a hint, or how @ walks                | pane names       |
//! | map or arm                            | pane             |
//! |                                       | (more panes if   |
//! | meaning of colours, or facts of a cell|  there is room)  |  info
//! +---------------------------------------+                  |
//! | keys, or a notice                                        |  footer
//! +----------------------------------------------------------+
//! ```

pub(super) mod bars;
mod caption;
pub(super) mod curves;
pub(super) mod dialog;
pub(super) mod side;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::widgets::Paragraph;

use super::layout::ScreenLayout;
use super::pane_text::{first_lines, wrapped};
use super::scene::{Cache, Drawing, Scene};
use super::screen::Screen;
use super::theme::Theme;
use gdg::text::is_active;

/// Columns of the panel, of each column of panes in a wide panel, and minimum of the map.
const SIDE_WIDTH: u16 = 30;
const WIDE_SIDE_WIDTH: u16 = 40;
const MIN_MAP_WIDTH: u16 = 40;

/// Minimum rows for the panel below the map, and how much larger this must make the map.
const MIN_PANEL_ROWS: u16 = 16;
const LEAST_GAIN_BELOW: f32 = 1.25;

/// Screen widths from which the panel is wide, and from which it has two columns of panes.
const WIDE_SCREEN: u16 = 110;
const VERY_WIDE_SCREEN: u16 = 160;

pub struct ScreenPainter<'a, 'b> {
    frame: &'a mut Frame<'b>,
    screen: &'a Screen,
    scene: &'a Scene,
    layout: ScreenLayout,
}

/// Leaves out characters that act on a terminal, as names may contain some, and gives text without a
/// colour of its own the colours of the theme's page, if it has one.
pub fn finish_frame(frame: &mut Frame, theme: &Theme) {
    for cell in &mut frame.buffer_mut().content {
        // They have no width, and share a cell with another one.
        if cell.symbol().chars().nth(1).is_some() {
            let shown: String = cell.symbol().chars().filter(|c| !is_active(*c)).collect();
            cell.set_symbol(&shown);
        }
    }
    let Some((ink, ground)) = theme.page else { return };
    let [ink, ground] = [ink, ground].map(|rgb| theme.colour(rgb));
    for cell in &mut frame.buffer_mut().content {
        if cell.fg == Color::Reset {
            cell.fg = ink;
        }
        if cell.bg == Color::Reset {
            cell.bg = ground;
        }
    }
}

pub fn draw(frame: &mut Frame, screen: &Screen, scene: &Scene, cache: &mut Cache) -> ScreenLayout {
    let whole = frame.area();
    let mut page = ScreenPainter { frame, screen, scene, layout: ScreenLayout::new(whole) };
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)])
            .areas(whole);
    bars::draw_header(&mut page, head);
    let panel = PanelPosition::place(body, scene.proportions());
    page.layout.lacks_panel = panel == PanelPosition::Nowhere;
    if screen.maximised {
        side::draw(&mut page, body);
    } else {
        let [mut map_pane, mut side] = match panel {
            PanelPosition::Beside(columns) => {
                Layout::horizontal([Constraint::Min(0), Constraint::Length(columns)]).areas(body)
            }
            PanelPosition::Below(rows) => {
                Layout::vertical([Constraint::Min(0), Constraint::Length(rows)]).areas(body)
            }
            PanelPosition::Nowhere => [body, Rect::default()],
        };
        let beside = if side.is_empty() { &mut map_pane } else { &mut side };
        let [rest, caption] = caption::split(*beside, screen);
        *beside = rest;
        let [hint, map_pane] =
            Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(map_pane);
        page.layout.map_pane = map_pane;
        let [map, info] =
            Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(map_pane);
        let ScreenPainter { frame, layout, .. } = &mut page;
        scene.draw([map, info], Drawing { frame, screen, layout, cache });
        bars::draw_hint(&mut page, hint);
        caption::draw(&mut page, caption);
        if !side.is_empty() {
            side::draw(&mut page, side);
        }
    }
    bars::draw_footer(&mut page, foot);
    page.layout
}

/// Where the panel with the panes goes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum PanelPosition {
    Beside(u16),
    Below(u16),
    Nowhere,
}

impl PanelPosition {
    /// Places the panel beside the map, or below it if that leaves clearly more room.
    fn place(body: Rect, [width, height]: [f32; 2]) -> Self {
        let columns = match body.width {
            w if w >= VERY_WIDE_SCREEN => 2 * WIDE_SIDE_WIDTH,
            w if w >= WIDE_SCREEN => WIDE_SIDE_WIDTH,
            w if w >= SIDE_WIDTH + MIN_MAP_WIDTH => SIDE_WIDTH,
            _ => 0,
        };
        // Characters per cell; a character is twice as high as wide.
        let scale = |columns: u16, rows: u16| {
            (f32::from(columns) / width).min(2.0 * f32::from(rows) / height)
        };
        // The map and the line below it take what they need, the panel takes the rest.
        let needed =
            (height * f32::from(body.width) / width / 2.0).ceil().min(f32::from(u16::MAX)) as u16;
        let rows = body.height.saturating_sub(needed.saturating_add(1)).max(MIN_PANEL_ROWS);
        let least_gain = if columns > 0 { LEAST_GAIN_BELOW } else { 1.0 };
        let beside = scale(body.width - columns, body.height.saturating_sub(1));
        let below = scale(body.width, body.height.saturating_sub(rows + 1));
        let is_below =
            body.height > rows + 1 && body.width >= SIDE_WIDTH && below >= least_gain * beside;
        match (is_below, columns) {
            (true, _) => Self::Below(rows),
            (false, 0) => Self::Nowhere,
            (false, columns) => Self::Beside(columns),
        }
    }
}

/// Returns `width`, or all columns of `area` if only slivers would stay in view.
fn without_slivers(area: Rect, width: u16) -> u16 {
    if width.saturating_add(2) >= area.width { area.width } else { width }
}

/// Says that the screen is too small for `what`, which needs this many columns and rows.
pub fn too_small(frame: &mut Frame, what: &str, (columns, rows): (u16, u16)) {
    let area = frame.area();
    let (width, height) = (area.width, area.height);
    let text =
        format!("{what} needs {columns} x {rows} characters: this terminal has {width} x {height}");
    let lines = wrapped(&text, width.into());
    let lines = first_lines(lines, height.into(), width.into());
    let middle = area.centered_vertically(Constraint::Length(lines.len() as u16));
    frame.render_widget(Paragraph::new(lines.join("\n")).centered(), middle);
}

pub fn middle(area: Rect, width: u16, height: u16) -> Rect {
    let sizes = [width.min(area.width), height.min(area.height)];
    let [width, height] = sizes.map(Constraint::Length);
    area.centered(width, height)
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ratatui::buffer::Cell;

    use super::*;
    use crate::tui::theme::{ColourDepth, ThemeName};

    #[test]
    fn characters_that_act_on_a_terminal_are_left_out_of_a_frame() {
        let theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
        let mut terminal = Terminal::new(TestBackend::new(8, 1)).expect("a terminal");
        let drawn = terminal.draw(|frame| {
            frame.render_widget(Paragraph::new("a\u{202e}b\u{2066}e\u{301}"), frame.area());
            finish_frame(frame, &theme);
        });
        let cells = &drawn.expect("a frame").buffer.content;
        assert_eq!(cells.iter().map(Cell::symbol).collect::<String>(), "abe\u{301}     ");
    }
}
