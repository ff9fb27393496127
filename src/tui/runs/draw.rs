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

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph};

use super::list::{List, Row};
use super::{Deletion, RunsScreen};
use crate::experiment::plot::Measure;
use crate::experiment::runs::{COLUMNS, Dated, SavedRun, name};
use crate::tui::action::{Action, Binding, ListAction, Mode, When, bindings};
use crate::tui::layout::{Click, ScreenLayout};
use crate::tui::render::chart::{self, Curve};
use crate::tui::render::{curves, finish_frame, footer, help, middle, too_small};
use crate::tui::style::{BOLD, DIM, REVERSED};
use crate::tui::text::{fitted_line, fitted_lines, wrapped};
use crate::tui::theme::Theme;
use gdg::text::{counted, display_width, fitted, grouped, padded, sanitized};
use gdg::train::{Preset, list_settings};

/// The smallest screen with room for everything, in columns and rows.
const MIN_SIZE: (u16, u16) = (60, 16);

/// Columns from which curves and settings are beside the list.
const WIDE_SCREEN: u16 = 170;

/// The columns of the list that are left out first where there is no room.
const LEFT_OUT: [&str; 3] = ["written", "greedy", "state"];

/// The most columns of a text, of a setting's name and of its value, and the fewest of a file.
const MAX_TEXT: usize = 20;
const MAX_NAME: usize = 22;
const MAX_VALUE: usize = 14;
const MIN_FILE: usize = 14;

/// Rows of a list above curves, at least.
const MIN_ROWS: usize = 6;

/// Columns before a row, for its letter.
const MARGIN: usize = 3;

/// Where the parts of the screen are.
#[derive(Debug, Default)]
pub struct Places {
    pub layout: ScreenLayout,
    /// The names of the list's columns, and their indices.
    pub columns: Vec<(Rect, usize)>,
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
    let [list, curves, settings] = panes(body, screen.list.all().len());
    header(frame, head, screen);
    draw_list(frame, list, screen, &mut places);
    let within = |frame: &mut Frame, area: Rect, borders| {
        let block = Block::new().borders(borders);
        let inner = block.inner(area);
        frame.render_widget(block, area);
        inner
    };
    let edges = if curves.x > list.x { Borders::LEFT } else { Borders::NONE };
    let inner = within(frame, curves, edges | Borders::TOP);
    let runs = drawn(&screen.list);
    let layout = &mut places.layout;
    draw_curves(frame, inner, screen, &runs, layout);
    let inner = within(frame, settings, Borders::TOP | Borders::LEFT);
    let lines = match screen.list.selected() {
        Some(Row::Damaged(file, problem)) => {
            let text = sanitized(&format!("{}: {problem}", file.display()));
            let rows = wrapped(&text, usize::from(inner.width).saturating_sub(2).max(1));
            let rows = rows.into_iter().map(|row| Line::raw(format!(" {row}")));
            std::iter::once(Line::styled(" left out", BOLD)).chain(rows).collect()
        }
        _ => settings_lines(inner, &runs, &screen.theme),
    };
    frame.render_widget(Paragraph::new(fitted_lines(lines, inner.width)), inner);
    footer(frame, foot, screen, layout);
    if let Some(deletion) = &screen.deletion {
        layout.forget_clicks();
        draw_deletion(frame, area, deletion);
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
    let fill = Constraint::Fill;
    if body.width >= WIDE_SCREEN {
        let [list, rest] = Layout::horizontal([fill(1), fill(1)]).areas(body);
        let [curves, settings] = Layout::vertical([fill(2), fill(1)]).areas(rest);
        return [list, curves, settings];
    }
    // Two more for title and names.
    let rows = u16::try_from(rows.max(MIN_ROWS) + 2).unwrap_or(u16::MAX).min(body.height / 2);
    let [list, rest] = Layout::vertical([Constraint::Length(rows), fill(1)]).areas(body);
    let [curves, settings] = Layout::horizontal([fill(3), fill(2)]).areas(rest);
    [list, curves, settings]
}

/// A run whose curve and settings are shown, with the number of its letter if it is marked.
type Drawn<'a> = (Option<usize>, &'a SavedRun);

/// Returns the marked runs, and first the selected one.
fn drawn(list: &List) -> Vec<Drawn<'_>> {
    let selected = list.selected().filter(|row| list.mark(row).is_none());
    let marked = list.marked().iter().map(|(letter, row)| (Some(*letter), row));
    let rows = selected.map(|row| (None, row)).into_iter().chain(marked);
    rows.filter_map(|(letter, row)| Some((letter, row.run()?))).collect()
}

/// Returns the letter of a marked run, or the sign of the selected one.
fn sign(letter: Option<usize>) -> char {
    letter.map_or('>', |letter| char::from(b'A' + letter as u8))
}

/// Returns the style of a marked run's letter and curve.
fn style(letter: Option<usize>, theme: &Theme) -> Style {
    letter.map_or(Style::new(), |letter| curves::colour(theme, letter).patch(BOLD))
}

fn header(frame: &mut Frame, area: Rect, screen: &RunsScreen) {
    let mut spans = vec![
        Span::styled(" gdg-tui runs ", BOLD.patch(REVERSED)),
        Span::styled(format!(" {} ", screen.title), BOLD),
    ];
    if let Some([read, all]) = screen.read.filter(|[read, all]| read < all) {
        spans.push(Span::raw(format!(" reading file {read} of {all} ")));
    }
    let damaged = screen.list.all().iter().filter(|row| row.run().is_none()).count();
    if damaged > 0 {
        let count = counted(damaged as u64, "file");
        let text = format!(" {count} cannot be read, see the end of the list ");
        spans.push(Span::styled(text, screen.theme.failure()));
    }
    frame.render_widget(fitted_line(Line::from(spans), area.width), area);
}

/// Draws the list below its title and the names of its columns.
fn draw_list(frame: &mut Frame, area: Rect, screen: &RunsScreen, places: &mut Places) {
    let RunsScreen { list, theme, .. } = screen;
    let [title, names, rows] =
        Layout::vertical([Constraint::Length(1), Constraint::Length(1), Constraint::Min(0)])
            .areas(area);
    let widths = widths(list, usize::from(area.width));
    let (sorted, reversed) = list.order;
    let mut at = names.x + MARGIN as u16;
    let mut heads = vec![Span::raw(" ".repeat(MARGIN))];
    for (column, width) in &widths {
        let arrow = if reversed { '\u{2191}' } else { '\u{2193}' };
        let name = COLUMNS[*column].name;
        let (text, style) =
            if *column == sorted { (format!("{name}{arrow}"), BOLD) } else { (name.into(), DIM) };
        heads.push(Span::styled(cell(&text, *column, *width), style));
        places.columns.push((Rect { x: at, width: *width as u16, ..names }, *column));
        at += *width as u16 + 1;
    }
    frame.render_widget(fitted_line(Line::from(heads), names.width), names);
    let (room, position) = (usize::from(rows.height), list.position());
    let first = (position + 1).saturating_sub(room);
    places.layout.rows = (rows, first);
    let lines = list.shown().enumerate().skip(first).take(room).map(|(i, row)| {
        let letter = list.mark(row);
        let line = match row {
            Row::Run(run) => {
                let sign = letter.map_or(' ', |_| sign(letter));
                let cells = widths.iter().map(|(column, width)| {
                    Span::raw(cell(&(COLUMNS[*column].cell)(run), *column, *width))
                });
                let sign = Span::styled(format!(" {sign} "), style(letter, theme));
                let mut line = Line::from(sign);
                line.extend(cells);
                line
            }
            Row::Damaged(file, problem) => {
                Line::styled(format!("   {}  {problem}", name(file)), DIM)
            }
        };
        if i == position { line.style(REVERSED) } else { line }
    });
    let mut lines: Vec<Line> = lines.collect();
    let is_read = screen.read.is_some_and(|[read, all]| read == all);
    if list.all().is_empty() {
        let none = "   no runs here yet: train with --save FILE, or press s in the interface";
        lines.push(Line::styled(if is_read { none } else { "   reading ..." }, DIM));
    }
    let block = list_title(screen, [first + 1, first + lines.len()]);
    frame.render_widget(block, title);
    frame.render_widget(Paragraph::new(fitted_lines(lines, rows.width)), rows);
}

/// Returns the line that says how many runs are listed, the words that they must have, and the
/// first and the last row in view.
fn list_title(screen: &RunsScreen, [first, last]: [usize; 2]) -> Block<'static> {
    let RunsScreen { list, words, is_typing, .. } = screen;
    let shown = list.shown().filter(|row| row.run().is_some()).count() as u64;
    let all = list.all().iter().filter(|row| row.run().is_some()).count() as u64;
    let of = if shown == all { String::new() } else { format!("{shown} of ") };
    let mut title = vec![Span::styled(format!(" {of}{} ", counted(all, "run")), BOLD)];
    if *is_typing || !words.value().is_empty() {
        let cursor = if *is_typing { "_" } else { "" };
        title.push(Span::raw(format!(" with words: {}{cursor} ", words.value())));
    }
    let block = Block::new().borders(Borders::TOP).title(Line::from(title));
    let rows = list.shown().len();
    if first == 1 && last >= rows {
        return block;
    }
    block.title(Line::raw(format!(" {first} to {last} of {rows} ")).right_aligned())
}

/// Returns the columns that there is room for, and their widths: wide enough for every run, but for
/// long texts and the file.
fn widths(list: &List, room: usize) -> Vec<(usize, usize)> {
    let max_text = (room / 7).clamp(6, MAX_TEXT);
    let runs = || {
        list.shown().filter_map(|row| match row {
            Row::Run(run) => Some(run),
            Row::Damaged(..) => None,
        })
    };
    let widest = |i: usize| {
        let column = &COLUMNS[i];
        let width = |run: &Dated| display_width(&(column.cell)(run));
        let most = match (column.number, i) {
            (Some(_), _) => usize::MAX,
            (None, i) if i + 1 == COLUMNS.len() => MIN_FILE,
            _ => max_text,
        };
        // And the sign of the order.
        let widest = runs().map(width).max().unwrap_or(0);
        (i, widest.min(most).max(column.name.len() + 1))
    };
    let mut widths: Vec<(usize, usize)> = (0..COLUMNS.len()).map(widest).collect();
    let needed = |widths: &[(usize, usize)]| {
        MARGIN + widths.iter().map(|(_, width)| width + 1).sum::<usize>()
    };
    for column in LEFT_OUT {
        if needed(&widths) > room {
            widths.retain(|(kept, _)| COLUMNS[*kept].name != column);
        }
    }
    let rest = room.saturating_sub(needed(&widths));
    widths.iter_mut().last().into_iter().for_each(|(_, file)| *file += rest);
    widths
}

/// Returns a text in the width of its column, and a blank.
fn cell(text: &str, column: usize, width: usize) -> String {
    let text = fitted(text, width);
    if COLUMNS[column].number.is_some() {
        let gap = width.saturating_sub(display_width(&text));
        return format!("{:gap$}{text} ", "");
    }
    format!("{} ", padded(&text, width))
}

/// Draws the curves of runs; a click on the title changes the axis.
fn draw_curves(
    frame: &mut Frame,
    area: Rect,
    screen: &RunsScreen,
    runs: &[Drawn],
    layout: &mut ScreenLayout,
) {
    let (RunsScreen { theme, .. }, (measure, axis)) = (screen, screen.curves);
    let curve = |(letter, run): &Drawn| {
        let stem = sanitized(&run.source.file_stem().unwrap_or_default().to_string_lossy());
        let points = run.evaluations.iter();
        Curve {
            name: format!("{} {stem}", sign(*letter)),
            style: style(*letter, theme),
            marker: letter.map_or(Marker::Braille, |letter| curves::marker(theme, letter)),
            points: points
                .filter_map(|at| Some((axis.of(at)?, measure.of(&at.evaluation)?)))
                .collect(),
        }
    };
    let all: Vec<Curve> = runs.iter().map(curve).collect();
    let names = all.iter().map(|curve| Span::styled(format!("  {}", curve.name), curve.style));
    let title = format!(" {} over {}", measure.label(), axis.label());
    let heading = chart::heading(&Span::styled(title, BOLD), names, area.width);
    let [head, body] =
        Layout::vertical([Constraint::Length(heading.len() as u16), Constraint::Min(0)])
            .areas(area);
    layout.add(Rect { height: 1, ..head }, Click::Act(Action::List(ListAction::Axis)));
    frame.render_widget(Paragraph::new(heading), head);
    let points = || all.iter().flat_map(|curve| &curve.points);
    if points().next().is_none() {
        let is_evaluated = runs.iter().any(|(_, run)| !run.evaluations.is_empty());
        let text = if is_evaluated { " not known of these runs" } else { " not evaluated yet" };
        return frame.render_widget(Paragraph::new(text).style(DIM), body);
    }
    let last = points().map(|point| point.0).fold(1.0, f64::max);
    let is_share = measure != Measure::Error;
    let high = if is_share { 1.0 } else { points().map(|point| point.1).fold(0.01, f64::max) };
    let y_labels = [0.0, high]
        .map(|y| if is_share { format!("{y:.1}") } else { format!("{:.0} %", 100.0 * y) });
    let axes = chart::Axes { x: [0.0, last], over: axis, y: [0.0, high], y_labels };
    // The first ones last, on top.
    chart::draw(frame, body, axes, all.iter().rev().map(Curve::line));
}

/// Returns the names in which runs differ, each with its value in every run; of a single run, all
/// that it does not share with its preset.
fn differences(runs: &[&SavedRun]) -> Vec<(String, Vec<String>)> {
    fn own(run: &SavedRun) -> impl Iterator<Item = (&str, &str)> {
        run.settings.iter().filter_map(|setting| setting.split_once('='))
    }
    let row = |name: &str, value: &dyn Fn(&SavedRun) -> String| {
        (name.to_owned(), runs.iter().map(|run| value(run)).collect::<Vec<String>>())
    };
    let facts = [
        row("map", &|run| run.map.clone()),
        row("method", &|run| run.method.clone()),
        row("variant", &|run| run.variant.clone().unwrap_or_default()),
        row("seed", &|run| run.seed.to_string()),
        row("updates", &|run| grouped(run.updates)),
        row("left out", &|run| match run.skipped.lines {
            0 => String::new(),
            _ if runs.len() == 1 => format!("line {}", run.skipped),
            lines => counted(lines, "line"),
        }),
    ];
    // A setting's value is the run's own, or else its preset's.
    let value = |run: &SavedRun, name: &str| {
        let of = |name: &str| own(run).find(|(own, _)| *own == name).map(|(_, value)| value);
        let of_preset = || {
            let settings = list_settings(&Preset::named(of("preset")?)?.settings());
            settings.into_iter().find(|(known, _)| known == name).map(|(_, value)| value)
        };
        of(name).map(str::to_owned).or_else(of_preset).unwrap_or_else(|| "-".to_owned())
    };
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in runs.iter().flat_map(|run| own(run)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let settings = names.into_iter().map(|name| row(name, &|run| value(run, name)));
    let is_told = |(_, values): &(String, Vec<String>)| match &values[..] {
        [value] => !value.is_empty(),
        values => values.iter().any(|value| *value != values[0]),
    };
    facts.into_iter().chain(settings).filter(is_told).collect()
}

/// Returns what the runs differ in, side by side, as far as there is room.
fn settings_lines(area: Rect, runs: &[Drawn], theme: &Theme) -> Vec<Line<'static>> {
    let rows = differences(&runs.iter().map(|(_, run)| *run).collect::<Vec<_>>());
    let names = rows.iter().map(|(name, _)| display_width(name)).max().unwrap_or(0).min(MAX_NAME);
    let room = usize::from(area.width).saturating_sub(names + 2);
    let widest = rows.iter().flat_map(|(_, values)| values).map(|value| display_width(value));
    let most = if runs.len() == 1 { room } else { MAX_VALUE };
    let width = widest.max().unwrap_or(0).clamp(1, most.max(1));
    let columns = (room / (width + 1)).clamp(1, runs.len().max(1));
    let mut lines = vec![match runs.len() {
        0 | 1 => Line::styled(" run", BOLD),
        all if columns < all => {
            Line::styled(format!(" differences: {columns} of {all} runs"), BOLD)
        }
        _ => Line::styled(" differences", BOLD),
    }];
    if runs.len() > 1 {
        let letters = runs.iter().take(columns).map(|(letter, _)| {
            let text = padded(&sign(*letter).to_string(), width + 1);
            Span::styled(text, style(*letter, theme).patch(BOLD))
        });
        lines.push(std::iter::once(Span::raw(" ".repeat(names + 2))).chain(letters).collect());
        if rows.is_empty() {
            lines.push(Line::styled(" none: these runs should be the same", DIM));
        }
    }
    for (name, values) in rows {
        let name = format!(" {} ", padded(&fitted(&name, names), names));
        let mut line = Line::from(Span::styled(name, DIM));
        for value in values.iter().take(columns) {
            line.push_span(Span::raw(format!("{} ", padded(&fitted(value, width), width))));
        }
        lines.push(line);
    }
    let height = usize::from(area.height);
    if lines.len() > height {
        lines.truncate(height.saturating_sub(1));
        lines.push(Line::styled(" ...", DIM));
    }
    lines
}

/// Draws the question above everything, with the files that would be deleted, as far as there is
/// room.
fn draw_deletion(frame: &mut Frame, area: Rect, Deletion { question, files }: &Deletion) {
    let columns = usize::from(area.width).saturating_sub(6).max(1);
    let room = usize::from(area.height).saturating_sub(4);
    let names = files.iter().map(|file| sanitized(&file.display().to_string()));
    let mut lines: Vec<String> = names.flat_map(|name| wrapped(&name, columns)).collect();
    if lines.len() > room {
        lines.truncate(room.saturating_sub(1));
        lines.push("and more".to_owned());
    }
    let widest = lines.iter().chain([question]).map(|line| display_width(line)).max().unwrap_or(0);
    let box_area = middle(area, (widest + 4) as u16, lines.len() as u16 + 2);
    let lines: Vec<Line> = lines.iter().map(|line| Line::raw(format!(" {line}"))).collect();
    let block = Block::bordered()
        .title(Span::styled(format!(" {question} "), BOLD))
        .title_bottom(Span::styled(" y: yes  n: no ", BOLD.patch(REVERSED)));
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

#[cfg(test)]
mod tests {
    use super::super::tests::saved;
    use super::*;

    #[test]
    fn settings_that_one_run_leaves_to_its_preset_have_the_presets_value() {
        let one = saved("a", "trap", "gdg", 1, &[]);
        let all = list_settings(&Preset::Default.settings());
        let hidden = all.into_iter().find(|(known, _)| known == "hidden").expect("a setting").1;
        assert_ne!(hidden, "16");
        let other = SavedRun { settings: vec!["preset=default".to_owned()], ..one.clone() };
        assert_eq!(
            differences(&[&one, &other]),
            [("hidden".to_owned(), vec!["16".to_owned(), hidden])],
            "map, method and seed are the same"
        );
        let third = SavedRun { seed: 2, ..other.clone() };
        let differ = differences(&[&other, &third]);
        assert_eq!(differ, [("seed".to_owned(), vec!["1".to_owned(), "2".to_owned()])]);
        let alone: Vec<String> = differences(&[&one]).into_iter().map(|(name, _)| name).collect();
        assert_eq!(alone, ["map", "method", "seed", "updates", "preset", "hidden"]);
    }
}
