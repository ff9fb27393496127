//! Draws the list of runs and what is beside or below it.
//!
//! ```text
//! +----------------------------------------------+
//! | folders, what is being read                  |  header
//! | 12 of 34 runs, words                         |
//! |   map method seed updates success ... file   |  list
//! | A ...                                        |
//! |------------------------------+---------------|
//! | success over updates         | what differs  |  curves, settings
//! | keys or a notice                             |  footer
//! +----------------------------------------------+
//! ```

use std::ops::Range;
use std::path::Path;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph};

use super::list::{Column, Entry, List, name};
use super::{Question, RunsScreen, curves, settings, sign, style};
use crate::tui::action::{Action, Binding, Mode, When, bindings};
use crate::tui::layout::{Click, ScreenLayout};
use crate::tui::render::{finish_frame, footer, help, middle, too_small};
use crate::tui::style::{BOLD, DIM, REVERSED};
use crate::tui::text::{fitted_line, fitted_lines, wrapped};
use crate::tui::theme::Theme;
use gdg::text::{counted, display_width, fitted, padded, sanitized};

/// The smallest screen with room for everything, in columns and rows.
pub const MIN_SIZE: (u16, u16) = (60, 16);

/// Columns from which curves and settings are beside the list, and their share of the screen.
const WIDE_SCREEN: u16 = 170;

/// Columns that are left out first where there is no room, and the most columns of a text.
const LEFT_OUT: [Column; 3] = [Column::Written, Column::Greedy, Column::State];
const MAX_TEXT: usize = 20;

/// Columns that are shortened then, the widest first, and the fewest columns that they keep.
const SHORTENED: [Column; 3] = [Column::Map, Column::Method, Column::Seed];
const MIN_TEXT: usize = 6;

/// The fewest columns of files' names, the widest value of a setting, and columns of the settings'
/// names, at most.
const MIN_FILE: usize = 14;
const MAX_VALUE: usize = 14;
const MAX_NAME: usize = 22;

/// Rows of a list above curves, at least.
const MIN_ROWS: usize = 6;

/// Columns before a row, for its letter.
const MARGIN: usize = 3;

/// Where the parts of the list are.
#[derive(Debug, Default)]
pub struct Places {
    /// What can be clicked besides.
    pub layout: ScreenLayout,
    /// The names of the columns.
    pub columns: Vec<(Rect, Column)>,
    /// The rows, and the first run in them.
    pub rows: (Rect, usize),
}

/// Draws everything.
pub fn draw(frame: &mut Frame, screen: &RunsScreen) -> Places {
    let area = frame.area();
    let mut places = Places { layout: ScreenLayout::new(area), ..Places::default() };
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        too_small(frame, "the list", MIN_SIZE);
        return places;
    }
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)])
            .areas(area);
    let rows = screen.list.count() + screen.list.problems.len();
    let [list, curves, settings] = panes(body, rows);
    header(frame, head, screen);
    draw_list(frame, list, screen, &mut places);
    let runs = drawn(&screen.list);
    let line = |frame: &mut Frame, area: Rect, borders| {
        let block = Block::new().borders(borders);
        let inner = block.inner(area);
        frame.render_widget(block, area);
        inner
    };
    let is_beside = curves.x > list.x;
    let edges = if is_beside { Borders::LEFT } else { Borders::NONE };
    let inner = line(frame, curves, edges | Borders::TOP);
    let Places { layout, .. } = &mut places;
    curves::draw(frame, inner, &runs, screen.curves, &screen.theme, layout);
    let inner = line(frame, settings, Borders::TOP | Borders::LEFT);
    match screen.list.selected_damage() {
        Some((path, problem)) => draw_damage(frame, inner, path, problem),
        None => draw_settings(frame, inner, &runs, &screen.theme),
    }
    footer(frame, foot, screen, layout);
    if let Some(question) = &screen.question {
        layout.forget_clicks();
        draw_question(frame, area, question);
    }
    if let Some(shown) = &screen.help {
        layout.forget_clicks();
        help::draw_for_lists(frame, &screen.keymap, shown, layout);
    }
    finish_frame(frame, &screen.theme);
    places
}

/// Returns the areas of the list, which has `rows` rows, of the curves and of the settings.
fn panes(body: Rect, rows: usize) -> [Rect; 3] {
    if body.width >= WIDE_SCREEN {
        let [list, rest] =
            Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(body);
        let [curves, settings] =
            Layout::vertical([Constraint::Fill(2), Constraint::Fill(1)]).areas(rest);
        return [list, curves, settings];
    }
    // Two more for title and names.
    let rows = u16::try_from(rows.max(MIN_ROWS) + 2).unwrap_or(u16::MAX).min(body.height / 2);
    let [list, rest] = Layout::vertical([Constraint::Length(rows), Constraint::Min(0)]).areas(body);
    let [curves, settings] =
        Layout::horizontal([Constraint::Fill(3), Constraint::Fill(2)]).areas(rest);
    [list, curves, settings]
}

/// Returns the runs whose curves and settings are shown: the marked ones, and the selected one.
fn drawn(list: &List) -> Vec<(Option<usize>, &Entry)> {
    let marked = list.marked().into_iter().map(|(mark, entry)| (Some(mark), entry));
    let selected = list.selected().filter(|entry| list.mark(entry).is_none());
    selected.map(|entry| (None, entry)).into_iter().chain(marked).collect()
}

fn header(frame: &mut Frame, area: Rect, screen: &RunsScreen) {
    let RunsScreen { title, read: [read, all], list, .. } = screen;
    let mut spans = vec![
        Span::styled(" gdg-tui runs ", BOLD.patch(REVERSED)),
        Span::styled(format!(" {title} "), BOLD),
    ];
    if read < all {
        spans.push(Span::raw(format!(" reading file {read} of {all} ")));
    }
    if !list.problems.is_empty() {
        let count = counted(list.problems.len() as u64, "file");
        let place = if list.damaged().len() > 0 { ", see the end of the list" } else { "" };
        let text = format!(" {count} cannot be read{place} ");
        spans.push(Span::styled(text, screen.theme.failure()));
    }
    frame.render_widget(fitted_line(Line::from(spans), area.width), area);
}

/// Draws the list below its title and the names of its columns.
fn draw_list(frame: &mut Frame, area: Rect, screen: &RunsScreen, places: &mut Places) {
    let RunsScreen { list, .. } = screen;
    let [title, names, rows] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Min(0)])
            .areas(area);
    let widths = widths(list, usize::from(area.width));
    let (sorted, reversed) = list.order();
    let mut at = names.x + MARGIN as u16;
    let mut heads = vec![Span::raw(" ".repeat(MARGIN))];
    for (column, width) in &widths {
        let sign = if reversed { '\u{2191}' } else { '\u{2193}' };
        let is_sorted = *column == sorted;
        let text =
            if is_sorted { format!("{}{sign}", column.name()) } else { column.name().to_owned() };
        heads.push(Span::styled(cell(&text, *column, *width), if is_sorted { BOLD } else { DIM }));
        places.columns.push((Rect { x: at, width: *width as u16, ..names }, *column));
        at += *width as u16 + 1;
    }
    frame.render_widget(fitted_line(Line::from(heads), names.width), names);
    let (room, position) = (usize::from(rows.height), list.position());
    let first = (position + 1).saturating_sub(room);
    places.rows = (rows, first);
    draw_title(frame, title, screen, first..list.rows().min(first + room));
    let runs = list.shown().enumerate().skip(first).map(|(i, entry)| {
        let line = row(entry, list.mark(entry), &widths, &screen.theme);
        line.style(if i == position { REVERSED } else { Style::new() })
    });
    let skipped = first.saturating_sub(list.shown().len());
    let damaged = list.damaged().enumerate().skip(skipped).map(|(i, (path, problem))| {
        let is_selected = i + list.shown().len() == position;
        let style = if is_selected { REVERSED } else { DIM };
        Line::styled(format!("   {}  {problem}", name(path)), style)
    });
    let lines: Vec<Line> = runs.chain(damaged).take(room).collect();
    frame.render_widget(Paragraph::new(fitted_lines(lines, rows.width)), rows);
    if list.count() == 0 && list.problems.is_empty() {
        let text = if screen.read[0] < screen.read[1] || !screen.has_read {
            "   reading ..."
        } else {
            "   no runs here yet: train with --save FILE, or press s in the interface"
        };
        frame.render_widget(fitted_line(Line::styled(text, DIM), rows.width), rows);
    }
}

/// Draws how many runs are listed, the words that they must have, and which rows are in view.
fn draw_title(frame: &mut Frame, area: Rect, screen: &RunsScreen, rows: Range<usize>) {
    let RunsScreen { list, words, is_typing, .. } = screen;
    let (shown, all) = (list.shown().len() as u64, list.count() as u64);
    let counts = if shown == all {
        counted(all, "run")
    } else {
        format!("{shown} of {}", counted(all, "run"))
    };
    let mut title = vec![Span::styled(format!(" {counts} "), BOLD)];
    if *is_typing || !words.value().is_empty() {
        title.push(Span::raw(format!(" with words: {}", words.value())));
        title.push(Span::raw(if *is_typing { "_ " } else { " " }));
    }
    let mut block = Block::new().borders(Borders::TOP).title(Line::from(title));
    if rows.len() < list.rows() {
        let text = format!(" {} to {} of {} ", rows.start + 1, rows.end, list.rows());
        block = block.title(Line::raw(text).right_aligned());
    }
    frame.render_widget(block, area);
}

/// Returns the columns with their widths, as many as there is room for.
fn widths(list: &List, room: usize) -> Vec<(Column, usize)> {
    let widest = |column: Column| {
        let cells = list.shown().map(|entry| display_width(&column.cell(entry)));
        let most = if column == Column::File { usize::MAX } else { MAX_TEXT };
        // And the sign of the order.
        cells.max().unwrap_or(0).min(most).max(column.name().len() + 1)
    };
    let mut widths: Vec<(Column, usize)> =
        Column::ALL.into_iter().map(|column| (column, widest(column))).collect();
    let needed = |widths: &[(Column, usize)]| {
        let all = widths.iter().map(|(column, width)| match column {
            Column::File => (*width).min(MIN_FILE) + 1,
            _ => width + 1,
        });
        MARGIN + all.sum::<usize>()
    };
    for column in LEFT_OUT {
        if needed(&widths) > room {
            widths.retain(|(kept, _)| *kept != column);
        }
    }
    while needed(&widths) > room {
        let texts = widths.iter_mut().filter(|(column, _)| SHORTENED.contains(column));
        match texts.max_by_key(|(_, width)| *width) {
            Some((_, width)) if *width > MIN_TEXT => *width -= 1,
            _ => break,
        }
    }
    let others = MARGIN + widths.iter().rev().skip(1).map(|(_, width)| width + 1).sum::<usize>();
    if let Some((_, file)) = widths.last_mut() {
        *file = (*file).min(room.saturating_sub(others));
    }
    widths
}

/// Returns a row: the letter of a marked run, then the columns.
fn row(
    entry: &Entry,
    mark: Option<usize>,
    widths: &[(Column, usize)],
    theme: &Theme,
) -> Line<'static> {
    let letter = mark.map_or(' ', |_| sign(mark));
    let mut spans = vec![Span::styled(format!(" {letter} "), style(mark, theme))];
    spans.extend(
        widths.iter().map(|(column, width)| Span::raw(cell(&column.cell(entry), *column, *width))),
    );
    Line::from(spans)
}

/// Returns a text in the width of its column, and a blank.
fn cell(text: &str, column: Column, width: usize) -> String {
    let text = fitted(text, width);
    let gap = width.saturating_sub(display_width(&text));
    if column.is_number() {
        format!("{:gap$}{text} ", "")
    } else {
        format!("{} ", padded(&text, width))
    }
}

/// Draws what the runs differ in, side by side.
fn draw_settings(frame: &mut Frame, area: Rect, runs: &[(Option<usize>, &Entry)], theme: &Theme) {
    let all: Vec<&_> = runs.iter().map(|(_, entry)| &*entry.run).collect();
    let rows = settings::rows(&all);
    let names = rows.iter().map(|(name, _)| display_width(name)).max().unwrap_or(0).min(MAX_NAME);
    let room = usize::from(area.width).saturating_sub(names + 2);
    let widest = rows.iter().flat_map(|(_, values)| values).map(|value| display_width(value));
    let most = if runs.len() == 1 { room } else { MAX_VALUE };
    let width = widest.max().unwrap_or(0).clamp(1, most.max(1));
    let columns = (room / (width + 1)).clamp(1, runs.len().max(1));
    let title = match runs.len() {
        0 | 1 => " run".to_owned(),
        all if columns < all => format!(" differences: {columns} of {all} runs"),
        _ => " differences".to_owned(),
    };
    let mut lines = vec![Line::styled(title, BOLD)];
    let mut head = vec![Span::raw(" ".repeat(names + 2))];
    for (mark, _) in &runs[..columns.min(runs.len())] {
        let letter = sign(*mark).to_string();
        head.push(Span::styled(padded(&letter, width + 1), style(*mark, theme).patch(BOLD)));
    }
    if runs.len() > 1 {
        lines.push(Line::from(head));
    }
    if rows.is_empty() && runs.len() > 1 {
        lines.push(Line::styled(" none: these runs should be the same", DIM));
    }
    for (name, values) in rows {
        let mut spans =
            vec![Span::styled(format!(" {} ", padded(&fitted(&name, names), names)), DIM)];
        spans.extend(
            values
                .iter()
                .take(columns)
                .map(|value| Span::raw(format!("{} ", padded(&fitted(value, width), width)))),
        );
        lines.push(Line::from(spans));
    }
    let rows = usize::from(area.height);
    if lines.len() > rows {
        lines.truncate(rows.saturating_sub(1));
        lines.push(Line::styled(" ...", DIM));
    }
    frame.render_widget(Paragraph::new(fitted_lines(lines, area.width)), area);
}

/// Draws why a file cannot be read, which its row may have no room for.
fn draw_damage(frame: &mut Frame, area: Rect, path: &Path, problem: &str) {
    let text = sanitized(&format!("{}: {problem}", path.display()));
    let columns = usize::from(area.width).saturating_sub(2).max(1);
    let rows = wrapped(&text, columns).into_iter().map(|row| Line::raw(format!(" {row}")));
    let title = Line::styled(" left out", BOLD);
    let lines: Vec<Line> = std::iter::once(title).chain(rows).collect();
    frame.render_widget(Paragraph::new(fitted_lines(lines, area.width)), area);
}

/// Draws a question above everything: every file that would be deleted, as far as there is room.
fn draw_question(frame: &mut Frame, area: Rect, Question { title, files }: &Question) {
    let columns = usize::from(area.width).saturating_sub(6).max(1);
    let room = usize::from(area.height).saturating_sub(4);
    let names = files.iter().map(|file| wrapped(&sanitized(&file.display().to_string()), columns));
    let names: Vec<Vec<String>> = names.collect();
    let (mut lines, mut named) = (Vec::new(), 0);
    for name in &names {
        // All but the last one leave room for how many there are more.
        let left = usize::from(named + 1 < names.len());
        if lines.len() + name.len() + left > room {
            break;
        }
        lines.extend(name.iter().cloned());
        named += 1;
    }
    if named < names.len() {
        lines.push(format!("and {} more", names.len() - named));
    }
    let keys = " y: yes  n: no ";
    let widest = lines.iter().chain([title]).map(|line| display_width(line)).max().unwrap_or(0);
    let box_area = middle(area, (widest + 4) as u16, lines.len() as u16 + 2);
    let lines: Vec<Line> = lines.iter().map(|line| Line::raw(format!(" {line}"))).collect();
    let block = Block::bordered().title(Span::styled(format!(" {title} "), BOLD));
    let block = block.title_bottom(Span::styled(keys, BOLD.patch(REVERSED)));
    frame.render_widget(Clear, box_area);
    frame.render_widget(Paragraph::new(lines).block(block), box_area);
}

/// Draws a notice, or keys.
fn footer(frame: &mut Frame, area: Rect, screen: &RunsScreen, layout: &mut ScreenLayout) {
    if let Some(notice) = screen.log.notice() {
        return footer::draw_notice(frame, area, &screen.theme, notice);
    }
    if screen.is_typing {
        let text = " type words that runs must have   Enter keeps them   Esc shows all runs";
        return frame.render_widget(fitted_line(Line::styled(text, DIM), area.width), area);
    }
    let named = |is_own: bool| {
        let is_shown = move |b: &&Binding| {
            !b.short.is_empty() && b.is_active(Mode::Listing) && (b.when == When::Listing) == is_own
        };
        bindings().filter(is_shown).map(|b| (b.action, b.short))
    };
    let keys = named(true).chain(named(false)).collect();
    footer::fitting(keys, &screen.keymap, area.width, false).draw(frame, area, layout);
    layout.add(Rect { height: 1, ..layout.screen }, Click::Act(Action::Help));
}
