//! Lists to pick from and questions to answer.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Position, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Wrap};

use super::{BOLD, DIM, REVERSED, middle};
use crate::tui::dialog::{Item, Picker, Prompt};
use crate::tui::places::{Bar, Click, Places};

/// Maximum sizes of a list and of a question.
const LIST: (u16, u16) = (96, 24);
const QUESTION: (u16, u16) = (72, 7);

/// Columns beside an item's label.
const MARGINS: usize = 3;

/// Rows below a list for the full selected item: a line and two rows of text.
const ROWS_BELOW: u16 = 3;

/// Draws a list. If any item is too long for its row, the selected item is shown in full below the list.
pub fn draw_picker(frame: &mut Frame, area: Rect, picker: &Picker, places: &mut Places) {
    let (items, selected) = picker.shown();
    let items: Vec<_> = items.collect();
    let (width, height) = (LIST.0.min(area.width.saturating_sub(2)), LIST.1.min(area.height.saturating_sub(2)));
    let columns = usize::from(width).saturating_sub(2);
    let widest = picker.items().map(|item| item.label.chars().count()).max().unwrap_or(0).min(columns * 2 / 3);
    let room_beside = |item: &Item| columns.saturating_sub(item.label.chars().count().max(widest) + MARGINS);
    let fits = |item: &Item| item.detail.chars().count() <= room_beside(item);
    let below = if picker.items().all(fits) { 0 } else { ROWS_BELOW };
    let place = middle(area, width, height.min(picker.items().count() as u16 + 3 + below));
    let inner = draw_box(frame, place, &picker.title, places);
    let [line, rows, below] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(below)]).areas(inner);
    let (typed, cursor) = picker.typed();
    let hint = if typed.is_empty() { "type to search" } else { "" };
    frame.render_widget(
        Paragraph::new(Line::from(vec![
            Span::styled("> ", BOLD),
            Span::raw(typed.to_owned()),
            Span::styled(hint, DIM),
        ])),
        line,
    );
    set_cursor(frame, line, 2 + cursor);
    let height = usize::from(rows.height);
    let first = (selected + 1).saturating_sub(height);
    let lines = items.iter().enumerate().skip(first).take(height).map(|(i, item)| {
        let (label, rest) = (format!(" {:<widest$}  ", item.label), room_beside(item));
        let text = Line::from(vec![Span::raw(label), Span::styled(format!("{:<rest$}", item.detail), DIM)]);
        text.style(if i == selected { REVERSED } else { Style::new() })
    });
    let mut lines: Vec<Line> = lines.collect();
    if lines.is_empty() {
        lines.push(Line::styled(" no match", DIM));
    }
    frame.render_widget(Paragraph::new(lines), rows);
    if let (Some(item), false) = (items.get(selected), below.is_empty()) {
        let all = format!("{}: {}", item.label, item.detail);
        let block = Block::new().borders(Borders::TOP);
        frame.render_widget(Paragraph::new(all).wrap(Wrap { trim: true }).block(block), below);
    }
    places.rows = (rows, first);
}

/// Draws a question.
pub fn draw_prompt(frame: &mut Frame, area: Rect, prompt: &Prompt, places: &mut Places) {
    let place = middle(area, QUESTION.0.min(area.width.saturating_sub(2)), QUESTION.1);
    let inner = draw_box(frame, place, &prompt.title, places);
    let [line, _, below] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Min(0)]).areas(inner);
    let (typed, cursor) = prompt.typed();
    // A long answer is scrolled to keep the cursor visible.
    let room = usize::from(line.width).saturating_sub(3);
    let hidden = cursor.saturating_sub(room);
    let seen: String = typed.chars().skip(hidden).take(room).collect();
    let style = if prompt.is_untouched() { REVERSED } else { Style::new() };
    frame.render_widget(Paragraph::new(Line::from(vec![Span::styled("> ", BOLD), Span::styled(seen, style)])), line);
    set_cursor(frame, line, 2 + cursor - hidden);
    let (text, style) = match &prompt.error {
        Some(error) => (error.as_str(), BOLD),
        None => (prompt.hint.as_str(), DIM),
    };
    frame.render_widget(Paragraph::new(text).style(style).wrap(Wrap { trim: true }), below);
}

/// Draws the box around a dialog, with its buttons at the bottom; returns the area inside.
fn draw_box(frame: &mut Frame, place: Rect, title: &str, places: &mut Places) -> Rect {
    let block = Block::bordered().title(format!(" {title} "));
    let inner = block.inner(place);
    frame.render_widget(Clear, place);
    frame.render_widget(block, place);
    let mut bar = Bar::default();
    bar.push(Span::raw(" Enter: accept "), Click::Answer);
    bar.push(Span::raw("  Esc: close "), Click::Close);
    let width = (bar.width() as u16).min(inner.width);
    bar.draw(frame, Rect { y: place.bottom().saturating_sub(1), width, height: 1, ..inner }, places);
    places.dialog = place;
    inner
}

fn set_cursor(frame: &mut Frame, line: Rect, column: usize) {
    if !line.is_empty() {
        frame.set_cursor_position(Position::new(line.x + (column as u16).min(line.width - 1), line.y));
    }
}
