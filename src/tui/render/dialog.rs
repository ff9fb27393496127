//! Lists to pick from and questions to answer.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Position, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Wrap};

use super::{BOLD, DIM, REVERSED, middle};
use crate::tui::dialog::{Item, Picker, Prompt};
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};

/// Maximum sizes of a list and of a question.
const MAX_LIST_SIZE: (u16, u16) = (96, 24);
const MAX_PROMPT_SIZE: (u16, u16) = (72, 7);

/// Columns beside an item's label.
const LABEL_MARGIN: usize = 3;

/// Rows below a list for the full selected item: a line and two rows of text.
const ROWS_BELOW: u16 = 3;

/// Draws a list. If any item is too long for its row, the selected item is shown in full below the list.
pub fn draw_picker(frame: &mut Frame, area: Rect, picker: &Picker, layout: &mut ScreenLayout) {
    let (items, selected) = picker.shown();
    let items: Vec<_> = items.collect();
    let (width, height) =
        (MAX_LIST_SIZE.0.min(area.width.saturating_sub(2)), MAX_LIST_SIZE.1.min(area.height.saturating_sub(2)));
    let columns = usize::from(width).saturating_sub(2);
    let widest = picker.items().map(|item| item.label.chars().count()).max().unwrap_or(0).min(columns * 2 / 3);
    let room_beside = |item: &Item| columns.saturating_sub(item.label.chars().count().max(widest) + LABEL_MARGIN);
    let fits = |item: &Item| item.detail.chars().count() <= room_beside(item);
    let below = if picker.items().all(fits) { 0 } else { ROWS_BELOW };
    let dialog_area = middle(area, width, height.min(picker.items().count() as u16 + 3 + below));
    let inner = draw_box(frame, dialog_area, &picker.title, layout);
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
    layout.rows = (rows, first);
}

/// Draws a question.
pub fn draw_prompt(frame: &mut Frame, area: Rect, prompt: &Prompt, layout: &mut ScreenLayout) {
    let dialog_area = middle(area, MAX_PROMPT_SIZE.0.min(area.width.saturating_sub(2)), MAX_PROMPT_SIZE.1);
    let inner = draw_box(frame, dialog_area, &prompt.title, layout);
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
fn draw_box(frame: &mut Frame, dialog_area: Rect, title: &str, layout: &mut ScreenLayout) -> Rect {
    let block = Block::bordered().title(format!(" {title} "));
    let inner = block.inner(dialog_area);
    frame.render_widget(Clear, dialog_area);
    frame.render_widget(block, dialog_area);
    let mut bar = ClickableLine::default();
    bar.push(Span::raw(" Enter: accept "), Click::Answer);
    bar.push(Span::raw("  Esc: close "), Click::Close);
    let width = (bar.width() as u16).min(inner.width);
    bar.draw(frame, Rect { y: dialog_area.bottom().saturating_sub(1), width, height: 1, ..inner }, layout);
    layout.dialog = dialog_area;
    inner
}

fn set_cursor(frame: &mut Frame, line: Rect, column: usize) {
    if !line.is_empty() {
        frame.set_cursor_position(Position::new(line.x + (column as u16).min(line.width - 1), line.y));
    }
}
