//! Lists to pick from and questions to answer.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Position, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Wrap};

use super::{BOLD, DIM, REVERSED, middle};
use crate::tui::dialog::{Picker, Prompt};

/// Size of a list at most, and of a question.
const LIST: (u16, u16) = (96, 24);
const QUESTION: (u16, u16) = (72, 7);

/// Draws a list; the place of its rows, and the number of the first that is shown.
pub fn draw_picker(frame: &mut Frame, area: Rect, picker: &Picker) -> (Rect, usize) {
    let (items, selected) = picker.shown();
    let items: Vec<_> = items.collect();
    let (width, height) = (LIST.0.min(area.width.saturating_sub(2)), LIST.1.min(area.height.saturating_sub(2)));
    let place = middle(area, width, height.min(picker.len() as u16 + 3));
    let block = Block::bordered().title(format!(" {} ", picker.title)).title_bottom(" Enter: take   Esc: close ");
    let inner = block.inner(place);
    frame.render_widget(Clear, place);
    frame.render_widget(block, place);
    let [line, rows] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(inner);
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
    let width = usize::from(rows.width);
    let widest = items.iter().map(|item| item.label.chars().count()).max().unwrap_or(0).min(width * 2 / 3);
    let lines = items.iter().enumerate().skip(first).take(height).map(|(i, item)| {
        let crate::tui::dialog::Item { label, detail, .. } = item;
        let label = format!(" {label:<widest$}  ");
        let rest = width.saturating_sub(label.chars().count());
        let text = Line::from(vec![Span::raw(label), Span::styled(format!("{detail:<rest$}"), DIM)]);
        let style = if i == selected { REVERSED } else { Style::new() };
        text.style(style)
    });
    let mut lines: Vec<Line> = lines.collect();
    if lines.is_empty() {
        lines.push(Line::styled(" nothing fits", DIM));
    }
    frame.render_widget(Paragraph::new(lines), rows);
    (rows, first)
}

/// Draws a question.
pub fn draw_prompt(frame: &mut Frame, area: Rect, prompt: &Prompt) {
    let place = middle(area, QUESTION.0.min(area.width.saturating_sub(2)), QUESTION.1);
    let block = Block::bordered().title(format!(" {} ", prompt.title)).title_bottom(" Enter: take   Esc: close ");
    let inner = block.inner(place);
    frame.render_widget(Clear, place);
    frame.render_widget(block, place);
    let [line, _, below] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Min(0)]).areas(inner);
    let (typed, cursor) = prompt.typed();
    // The end of what does not fit is where one types.
    let room = usize::from(line.width).saturating_sub(3);
    let hidden = cursor.saturating_sub(room);
    let seen: String = typed.chars().skip(hidden).take(room).collect();
    frame.render_widget(Paragraph::new(Line::from(vec![Span::styled("> ", BOLD), Span::raw(seen)])), line);
    set_cursor(frame, line, 2 + cursor - hidden);
    let (text, style) = match &prompt.error {
        Some(error) => (error.as_str(), BOLD),
        None => (prompt.hint.as_str(), DIM),
    };
    frame.render_widget(Paragraph::new(text).style(style).wrap(Wrap { trim: true }), below);
}

fn set_cursor(frame: &mut Frame, line: Rect, column: usize) {
    if !line.is_empty() {
        frame.set_cursor_position(Position::new(line.x + (column as u16).min(line.width - 1), line.y));
    }
}
