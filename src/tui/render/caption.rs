//! The caption of the guided tour: a box below the panes, or below the map where there are none, so
//! that it covers nothing of what it explains.

use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::Line;
use ratatui::widgets::{Block, Padding, Paragraph};

use super::ScreenPainter;
use super::bars::key;
use crate::tui::action::Action;
use crate::tui::characters::{put, put_letter};
use crate::tui::layout::ClickableLine;
use crate::tui::pane_text::wrapped;
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, ColourDepth, REVERSED};

/// What border and padding take, and the least columns of text.
const MARGIN_COLUMNS: u16 = 4;
const MARGIN_ROWS: u16 = 2;
const MIN_TEXT_WIDTH: u16 = 20;

/// Returns the rows of `area` without and with the caption, if there is one.
pub fn split(area: Rect, screen: &Screen) -> [Rect; 2] {
    let columns = area.width.saturating_sub(MARGIN_COLUMNS).max(MIN_TEXT_WIDTH);
    let rows = screen.tour.as_ref().map_or(0, |tour| {
        wrapped(&tour.caption.text, usize::from(columns)).len() as u16 + MARGIN_ROWS
    });
    Layout::vertical([Constraint::Min(0), Constraint::Length(rows)]).areas(area)
}

/// Draws the caption in `area`, and its signs on the map.
pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, layout, .. } = page;
    let (Some(tour), Some(map_frame)) = (&screen.tour, &layout.map) else { return };
    let (theme, buffer) = (&screen.theme, frame.buffer_mut());
    for (at, sign) in &tour.caption.marks {
        match map_frame.character_of(*at) {
            Some(at) if sign.is_alphabetic() => put_letter(buffer, at, *sign, theme.cursor, theme),
            Some(at) => put(buffer, at, *sign, None, theme),
            None => {}
        }
    }
    let title = Line::styled(format!(" {} ", tour.title), BOLD.patch(REVERSED));
    let border = match theme.depth {
        ColourDepth::Mono => BOLD,
        _ => BOLD.fg(theme.colour(theme.cursor)),
    };
    let block = Block::bordered().border_style(border).title(title).padding(Padding::horizontal(1));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let lines: Vec<Line> =
        wrapped(&tour.caption.text, usize::from(inner.width)).into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(lines), inner);
    let mut keys = ClickableLine::default();
    let next = if tour.is_last { "done" } else { "next" };
    for (action, label) in [(Action::NextTourStep, next), (Action::EndTour, "end")] {
        key(&mut keys, &screen.keymap, action, &format!(" {label} "), Style::new());
    }
    let width = (keys.width() as u16).min(area.width.saturating_sub(2));
    let bar = Rect { x: area.right() - 1 - width, y: area.bottom() - 1, width, height: 1 };
    keys.draw(frame, bar, layout);
}
