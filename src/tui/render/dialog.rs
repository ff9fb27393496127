//! Dialogs above a run or a comparison: lists to pick from, and questions to answer.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Position, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph};
use unicode_truncate::UnicodeTruncateStr;

use super::bars::{draw_notice, push_key};
use super::{middle, without_slivers};
use crate::tui::dialog::{Choice, Dialog, Item, Picker, PickerRow, Prompt};
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::log::Notice;
use crate::tui::pane_text::{first_lines, wrapped};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, DIM, REVERSED};
use gdg::text::{display_width, fitted, padded};

/// Maximum sizes of a list, and the maximum width of a question.
pub const MAX_LIST_SIZE: (u16, u16) = (112, 40);
const MAX_PROMPT_WIDTH: u16 = 72;

/// Minimum width of a searchable list, and minimum rows above the selected item's full text.
const MIN_SEARCHED_WIDTH: usize = 40;
const MIN_ROWS: u16 = 5;

/// Columns before and after an item's label, and more before it in a question, for its key.
const LABEL_MARGIN: usize = 3;
const KEY_MARGIN: usize = 2;

/// Columns of a detail, such as a key, that a long label leaves.
const MAX_KEPT: usize = 12;

/// Draws the topmost dialog, if there is one, and records where it is. A notice is shown in the last line
/// of the screen, in place of keys.
pub fn draw_dialog(
    frame: &mut Frame,
    screen: &Screen,
    notice: Option<Notice>,
    layout: &mut ScreenLayout,
) {
    let Some(top) = screen.dialogs.last() else { return };
    // What is below a dialog does not react to clicks.
    layout.forget_clicks();
    match top {
        Dialog::Pick(picker) => draw_picker(frame, picker, layout),
        Dialog::Ask(prompt) => draw_prompt(frame, screen, prompt, layout),
    }
    let foot = Rect { y: frame.area().bottom(), ..frame.area() };
    notice.into_iter().for_each(|notice| draw_notice(frame, foot, &screen.theme, notice));
}

/// Draws a list. If any item is too long for its row, the selected item is shown in full below the
/// list. While something is typed, the box ends below the matches.
pub fn draw_picker(frame: &mut Frame, picker: &Picker, layout: &mut ScreenLayout) {
    let area = frame.area();
    let width = usize::from(without_slivers(area, list_width(picker, area.width) as u16));
    let columns = width.saturating_sub(2);
    let labels = label_width(picker, columns);
    let rows = picker.rows();
    let search_rows = u16::from(!picker.is_question());
    let height = MAX_LIST_SIZE.1.min(area.height.saturating_sub(2));
    let all_rows = u16::try_from(rows.len().max(1)).unwrap_or(u16::MAX);
    let room = height.saturating_sub(2 + search_rows);
    let text = lines_above(picker, columns, room.saturating_sub(MIN_ROWS.min(all_rows)));
    let above = text.len() as u16;
    let below = rows_below(picker, columns, labels).min(room.saturating_sub(above + MIN_ROWS));
    let wanted = all_rows.saturating_add(2 + search_rows + above + below);
    let dialog_area = place(area, width as u16, wanted);
    let accepts = picker.is_question() || picker.choice().is_some_and(|c| *c != Choice::Nothing);
    let inner = draw_box(frame, dialog_area, &picker.title, accepts, layout);
    let [top, line, list, below] = Layout::vertical([
        Constraint::Length(above),
        Constraint::Length(search_rows),
        Constraint::Min(0),
        Constraint::Length(below),
    ])
    .areas(inner);
    frame.render_widget(Paragraph::new(text), top);
    if !picker.is_question() {
        draw_search(frame, line, picker);
    }
    let room = usize::from(list.height);
    let selected = rows.iter().position(|row| matches!(row, PickerRow::Item(_, true))).unwrap_or(0);
    let first = (selected + 1).saturating_sub(room);
    // The title of the first group stays in view.
    let first = if first == 1 && room > 1 && selected + 1 < room { 0 } else { first };
    let mut lines: Vec<Line> =
        rows.iter().skip(first).take(room).map(|row| row_line(row, labels, columns)).collect();
    if lines.is_empty() {
        lines.push(Line::styled(format!(" nothing fits \"{}\"", picker.typed().0), DIM));
    }
    frame.render_widget(Paragraph::new(lines), list);
    if !below.is_empty() {
        let text =
            picker.item().map_or(Vec::new(), |item| text_below(picker, item, columns, labels));
        let text = first_lines(text, usize::from(below.height) - 1, columns);
        let text: Vec<Line> = text.into_iter().map(|row| Line::from(format!(" {row}"))).collect();
        frame.render_widget(Paragraph::new(text).block(Block::new().borders(Borders::TOP)), below);
    }
    layout.rows = (list, first);
}

/// Returns the place of a dialog: all begin in the same row.
fn place(area: Rect, width: u16, height: u16) -> Rect {
    let most = MAX_LIST_SIZE.1.min(area.height.saturating_sub(2));
    Rect { height: height.min(most), ..middle(area, width, most) }
}

/// Returns the text above a list in up to `most` lines, and an empty one; the log has all of it.
fn lines_above(picker: &Picker, columns: usize, most: u16) -> Vec<Line<'static>> {
    let room = usize::from(most).saturating_sub(1);
    let columns = columns.saturating_sub(2).max(1);
    let text = if picker.typed().0.is_empty() { &picker.text } else { "" };
    let lines = text.lines().flat_map(|line| wrapped(line, columns)).collect();
    let mut lines = first_lines(lines, room, columns);
    if !lines.is_empty() {
        lines.push(String::new());
    }
    lines.into_iter().map(|line| Line::from(format!(" {line}"))).collect()
}

/// Returns the columns that a list needs, its box included, up to `most`.
fn list_width(picker: &Picker, most: u16) -> usize {
    let detail = picker.items().map(|item| display_width(&item.detail)).max().unwrap_or(0);
    let label = picker.items().map(|item| display_width(&item.label)).max().unwrap_or(0);
    let text = picker.text.lines().map(|line| display_width(line) + 2).max().unwrap_or(0);
    let title = (display_width(&picker.title) + 2).max(text);
    let least = if picker.is_question() { title } else { title.max(MIN_SEARCHED_WIDTH) };
    let key = if picker.is_question() { KEY_MARGIN } else { 0 };
    (label + LABEL_MARGIN + key + detail + 1)
        .max(least)
        .saturating_add(2)
        .min(usize::from(most.min(MAX_LIST_SIZE.0)))
}

fn label_width(picker: &Picker, columns: usize) -> usize {
    picker.items().map(|item| display_width(&item.label)).max().unwrap_or(0).min(columns * 2 / 3)
}

/// Returns the columns of an item's label and of its detail: a long label leaves room for a key.
fn rooms(item: &Item, labels: usize, columns: usize) -> [usize; 2] {
    let key = if item.key.is_some() { KEY_MARGIN } else { 0 };
    let all = columns.saturating_sub(LABEL_MARGIN + key);
    let most = all.saturating_sub(display_width(&item.detail).min(MAX_KEPT)).max(labels);
    let label = display_width(&item.label).clamp(labels, most).min(all);
    [label, all - label]
}

/// Returns the rows for the full text of what is selected, and a line above it; none if it fits. A
/// question stays as high as its longest text needs.
fn rows_below(picker: &Picker, columns: usize, labels: usize) -> u16 {
    let all = picker.items().filter(|_| picker.is_question()).chain(picker.item());
    let rows = all.map(|item| text_below(picker, item, columns, labels).len()).max().unwrap_or(0);
    if rows == 0 { 0 } else { 1 + rows as u16 }
}

/// Returns everything about an item that does not fit its row, or of which in a question another one
/// does not, in rows of `columns` with a blank on either side.
fn text_below(picker: &Picker, item: &Item, columns: usize, labels: usize) -> Vec<String> {
    let fits = |item: &Item| {
        let [label, detail] = rooms(item, labels, columns);
        let is_whole = display_width(&item.label) <= label && display_width(&item.detail) <= detail;
        item.below.is_empty() && is_whole
    };
    if picker.items().filter(|_| picker.is_question()).chain([item]).all(fits) {
        return Vec::new();
    }
    let columns = columns.saturating_sub(2).max(1);
    if item.below.is_empty() && item.detail.is_empty() {
        return wrapped(&item.label, columns);
    }
    if item.below.is_empty() {
        return wrapped(&format!("{}: {}", item.label, item.detail), columns);
    }
    item.below.iter().flat_map(|line| wrapped(line, columns)).collect()
}

fn row_line(row: &PickerRow, labels: usize, columns: usize) -> Line<'static> {
    let PickerRow::Item(item, selected) = row else {
        let PickerRow::Title(title) = row else { return Line::default() };
        return Line::styled((*title).to_owned(), BOLD);
    };
    let sign = match (item.key, item.marked) {
        (Some(key), _) => format!(" {key} "),
        (None, true) => "*".to_owned(),
        (None, false) => " ".to_owned(),
    };
    let [label, rest] = rooms(item, labels, columns);
    let text = Line::from(vec![
        Span::styled(sign, BOLD),
        Span::raw(format!("{}  ", padded(&fitted(&item.label, label), label))),
        Span::styled(padded(&fitted(&item.detail, rest), rest), DIM),
    ]);
    text.style(if *selected { REVERSED } else { Style::new() })
}

fn draw_search(frame: &mut Frame, line: Rect, picker: &Picker) {
    let (typed, cursor) = picker.typed();
    let hint = if typed.is_empty() { "type to search" } else { "" };
    let text = vec![Span::styled("> ", BOLD), Span::raw(typed.to_owned()), Span::styled(hint, DIM)];
    frame.render_widget(Paragraph::new(Line::from(text)), line);
    set_cursor(frame, line, 2 + cursor);
}

fn draw_prompt(frame: &mut Frame, screen: &Screen, prompt: &Prompt, layout: &mut ScreenLayout) {
    let area = frame.area();
    let width = without_slivers(area, MAX_PROMPT_WIDTH);
    let (text, style) = match &prompt.error {
        Some(error) => (error.as_str(), screen.theme.failure()),
        None => (prompt.hint.as_str(), DIM),
    };
    let columns = usize::from(width.saturating_sub(2)).max(1);
    let most = usize::from(area.height.saturating_sub(4));
    let text = first_lines(wrapped(text, columns), most, columns);
    let dialog_area = place(area, width, 4 + text.len() as u16);
    let inner = draw_box(frame, dialog_area, &prompt.title, true, layout);
    let [line, _, below] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Min(0)])
            .areas(inner);
    let (typed, cursor) = prompt.typed();
    // A long answer is scrolled to keep the cursor visible.
    let room = usize::from(line.width).saturating_sub(3);
    let hidden = if cursor > room { typed.unicode_truncate(cursor - room + 1).0 } else { "" };
    let seen = typed[hidden.len()..].unicode_truncate(room).0.to_owned();
    let typed_style = if prompt.untouched && !typed.is_empty() { REVERSED } else { Style::new() };
    let typed = Line::from(vec![Span::styled("> ", BOLD), Span::styled(seen, typed_style)]);
    frame.render_widget(Paragraph::new(typed), line);
    set_cursor(frame, line, 2 + cursor - display_width(hidden));
    let text: Vec<Line> = text.into_iter().map(|line| Line::styled(line, style)).collect();
    frame.render_widget(Paragraph::new(text), below);
}

/// Draws the box around a dialog, with its buttons; returns the area inside.
fn draw_box(
    frame: &mut Frame,
    dialog_area: Rect,
    title: &str,
    accepts: bool,
    layout: &mut ScreenLayout,
) -> Rect {
    let room = usize::from(dialog_area.width.saturating_sub(2));
    // The keys there do nothing meanwhile.
    let foot = frame.area().rows().next_back().unwrap_or_default();
    frame.render_widget(Clear, foot);
    // Leave out a part in brackets that does not fit.
    let title = if display_width(title) + 2 > room {
        title.split(" (").next().unwrap_or(title)
    } else {
        title
    };
    let title = fitted(title, room.saturating_sub(2));
    let block = Block::bordered().title(format!(" {title} "));
    let inner = block.inner(dialog_area);
    frame.render_widget(Clear, dialog_area);
    frame.render_widget(block, dialog_area);
    let mut bar = ClickableLine::default();
    if accepts {
        push_key(&mut bar, "Enter", " accept ", Style::new(), Click::Answer);
    }
    push_key(&mut bar, "Esc", " close ", Style::new(), Click::Close);
    let width = (bar.width() as u16).min(inner.width);
    let foot = Rect { y: dialog_area.bottom().saturating_sub(1), width, height: 1, ..inner };
    bar.draw(frame, foot, layout);
    layout.dialog = dialog_area;
    inner
}

fn set_cursor(frame: &mut Frame, line: Rect, column: usize) {
    if !line.is_empty() {
        let x = line.x + (column as u16).min(line.width - 1);
        frame.set_cursor_position(Position::new(x, line.y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_list_begin_below_each_other() {
        let names = [
            "maze",
            "\u{8ff7}\u{5bae}\u{5730}\u{56fe}",
            "e\u{301}te\u{301}",
            "\u{1f468}\u{200d}\u{1f467}",
        ];
        let detail = "wide \u{8ff7}\u{5bae} detail".repeat(3);
        let items = names.map(|name| Item::new(name, detail.clone(), Choice::Nothing));
        let picker = Picker::new("maps", items.to_vec());
        for item in picker.items() {
            let line = row_line(&PickerRow::Item(item, false), label_width(&picker, 40), 40);
            let label: usize = line.spans.iter().take(2).map(Span::width).sum();
            assert_eq!((label, line.width()), (1 + 8 + 2, 40), "{line}");
        }
    }
}
