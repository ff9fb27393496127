//! Draws the list of runs and what is beside or below it.
//!
//! ```text
//! +----------------------------------------------+
//! | folders, 12 of 34 runs, words                |  header
//! |   map method seed updates planned ... file   |  list
//! | A ...                                        |
//! |------------------------------+---------------|
//! | success over updates         | what differs  |  curves, settings
//! | keys or a notice                             |  footer
//! +----------------------------------------------+
//! ```

use std::path::Path;
use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Cell, Paragraph, Row, Table};

use super::list::{List, is_growing};
use super::{NO_RUNS, RunsScreen};
use crate::experiment::plot::Measure;
use crate::experiment::saved_runs::{CIRCUMSTANCES, COLUMNS, RunCells, SavedRun, changed, name};
use crate::tui::action::{Action, Binding, ListAction, Mode, bindings};
use crate::tui::dialog::Dialog;
use crate::tui::layout::{Click, ScreenLayout};
use crate::tui::pane_text::{fitted_line, wrapped};
use crate::tui::render::curves::{Axes, PaneCurve, draw_chart, draw_heading};
use crate::tui::render::dialog::draw_picker;
use crate::tui::render::{bars, curves, finish_frame, too_small};
use crate::tui::theme::{BOLD, DIM, REVERSED, Theme};
use gdg::text::{counted, display_width, fitted, grouped, sanitized};

/// The smallest screen with room for everything, in columns and rows.
const MIN_SIZE: (u16, u16) = (60, 16);

/// The most columns of a setting's name and of its value.
const MAX_NAME: usize = 22;
const MAX_VALUE: usize = 14;

/// The name of what marked runs differ in.
const HEAD: &str = "setting";

const MIN_ROWS: usize = 6;

/// Columns before a row, for its letter.
const MARGIN: usize = 2;

#[derive(Debug, Default)]
pub struct ClickAreas {
    pub layout: ScreenLayout,
    /// The names of the list's columns, and their indices.
    pub columns: Vec<(Rect, usize)>,
}

pub fn draw(frame: &mut Frame, screen: &RunsScreen) -> ClickAreas {
    let area = frame.area();
    let mut places = ClickAreas { layout: ScreenLayout::new(area), ..ClickAreas::default() };
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        too_small(frame, "the list", MIN_SIZE);
        return places;
    }
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(0), Constraint::Length(1)])
            .areas(area);
    let runs = drawn(&screen.list);
    let told = differences(&runs.iter().map(|(_, run)| *run).collect::<Vec<_>>());
    let width = 1 + widths(&told, runs.len()).iter().map(|width| width + 1).sum::<usize>();
    let [list, curves, settings] = panes(body, screen.list.all().len(), width);
    draw_list(frame, list, screen, &mut places);
    header(frame, head, screen, &places);
    let within = |frame: &mut Frame, area: Rect, borders| {
        let block = Block::new().borders(borders);
        let inner = block.inner(area);
        frame.render_widget(block, area);
        inner
    };
    let inner = within(frame, curves, Borders::TOP);
    let layout = &mut places.layout;
    let title = draw_curves(frame, inner, screen, &runs);
    layout.add(Rect { height: 1, ..title }, Click::Act(Action::List(ListAction::Axis)));
    let inner = within(frame, settings, Borders::TOP | Borders::LEFT);
    match screen.list.selected() {
        Some(run) if run.is_damaged() => {
            let problem = run.problem.as_deref().unwrap_or_default();
            let text = sanitized(&format!("{}{problem}", run.source.display()));
            let rows = wrapped(&text, usize::from(inner.width).saturating_sub(2).max(1));
            let rows = rows.into_iter().map(|row| Line::raw(format!(" {row}")));
            let lines = std::iter::once(Line::styled(" left out", BOLD)).chain(rows);
            frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), inner);
        }
        _ => draw_settings(frame, inner, &told, &runs, &screen.theme),
    }
    footer(frame, foot, screen, layout);
    if let Some(Dialog::Pick(list)) = &screen.dialog {
        layout.forget_clicks();
        draw_picker(frame, list, layout);
    }
    finish_frame(frame, &screen.theme);
    places
}

/// Returns where the list, the curves and what runs differ in are: that gets the width that it needs.
fn panes(body: Rect, rows: usize, width: usize) -> [Rect; 3] {
    let fill = Constraint::Fill;
    // One more for names.
    let rows = u16::try_from(rows.max(MIN_ROWS) + 1).unwrap_or(u16::MAX).min(body.height / 2);
    let [list, rest] = Layout::vertical([Constraint::Length(rows), fill(1)]).areas(body);
    let width = (width as u16).clamp(rest.width * 2 / 5, rest.width * 3 / 5);
    let [curves, settings] = Layout::horizontal([fill(1), Constraint::Length(width)]).areas(rest);
    [list, curves, settings]
}

/// A run whose curve and settings are shown, with the number of its letter if it is marked.
type DrawnRun<'a> = (Option<usize>, &'a SavedRun);

fn drawn(list: &List) -> Vec<DrawnRun<'_>> {
    let is_drawn = |run: &&Arc<SavedRun>| list.mark(run).is_none() && !run.is_damaged();
    let selected = list.selected().filter(is_drawn).map(|run| (None, &**run));
    let marked = list.marked().iter().map(|(letter, run)| (Some(*letter), &**run));
    selected.into_iter().chain(marked).collect()
}

fn sign(letter: Option<usize>) -> char {
    letter.map_or('>', |letter| char::from(b'A' + letter as u8))
}

/// The signs of an order and of its reverse.
const ARROWS: [char; 2] = ['\u{2193}', '\u{2191}'];

fn style(letter: Option<usize>, theme: &Theme) -> Style {
    letter.map_or(Style::new(), |letter| curves::colour(theme, [letter; 2]).patch(BOLD))
}

/// Draws how many runs are listed, the words that they must have, and the rows in view.
fn header(frame: &mut Frame, area: Rect, screen: &RunsScreen, places: &ClickAreas) {
    let (view, first) = places.layout.rows;
    let RunsScreen { list, words, is_typing, .. } = screen;
    let is_run = |run: &&Arc<SavedRun>| !run.is_damaged();
    let [shown, all] =
        [list.shown().filter(is_run).count(), list.all().iter().filter(is_run).count()];
    let of = if shown == all { String::new() } else { format!("{shown} of ") };
    let name = if screen.awaited.is_some() { " gdg-tui watch " } else { " gdg-tui runs " };
    let mut spans = vec![
        Span::styled(name, BOLD.patch(REVERSED)),
        Span::styled(format!(" {} ", screen.title), BOLD),
        Span::raw(format!(" {of}{} ", counted(all as u64, "run"))),
    ];
    if *is_typing || !words.value().is_empty() {
        let cursor = if *is_typing { "_" } else { "" };
        spans.push(Span::raw(format!(" with words: {}{cursor} ", words.value())));
    }
    let marked = list.marked().len();
    if marked > 0 {
        spans.push(Span::raw(format!(" {marked} marked ")));
    }
    if let Some([read, all]) = screen.read.filter(|[read, all]| read < all) {
        spans.push(Span::raw(format!(" reading file {read} of {all} ")));
    }
    let rows = list.shown().len();
    let (sorted, reversed) = list.order;
    if rows > 1 && places.columns.iter().all(|(_, shown)| *shown != sorted) {
        let (name, arrow) = (COLUMNS[sorted].name, ARROWS[usize::from(reversed)]);
        spans.push(Span::raw(format!(" by {name}{arrow} ")));
    }
    if rows > usize::from(view.height) {
        let last = rows.min(first + usize::from(view.height));
        spans.push(Span::raw(format!(" {} to {last} of {rows} ", first + 1)));
    }
    if list.all().len() > all {
        let text = format!(" {} cannot be read ", counted((list.all().len() - all) as u64, "file"));
        spans.push(Span::styled(text, screen.theme.failure()));
    }
    frame.render_widget(fitted_line(Line::from(spans), area.width), area);
}

fn draw_list(frame: &mut Frame, area: Rect, screen: &RunsScreen, places: &mut ClickAreas) {
    let RunsScreen { list, theme, .. } = screen;
    let [names, rows] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
    let cells = RunCells::of(list.shown());
    let columns = cells.columns(usize::from(area.width).saturating_sub(MARGIN + 1), "");
    let widths = columns.iter().map(|(_, width)| Constraint::Length(*width as u16));
    let widths: Vec<Constraint> =
        [Constraint::Length(MARGIN as u16)].into_iter().chain(widths).collect();
    let areas = Layout::horizontal(widths.clone()).spacing(1).split(names);
    places.columns = areas[1..].iter().zip(&columns).map(|(area, of)| (*area, of.0)).collect();
    let cell =
        |text: &str, (i, width): &(usize, usize)| Line::raw(COLUMNS[*i].fitted(text, *width));
    let (sorted, reversed) = list.order;
    let heads = columns.iter().map(|of| match COLUMNS[of.0].name {
        name if of.0 != sorted => cell(name, of).style(DIM),
        name => cell(&format!("{name}{}", ARROWS[usize::from(reversed)]), of).style(BOLD),
    });
    let head: Row = [Line::default()].into_iter().chain(heads).collect();
    let (room, position) = (usize::from(rows.height), list.position());
    let first = (position + 1).saturating_sub(room);
    places.layout.rows = (rows, first);
    let shown = list.shown().enumerate().skip(first).take(room).map(|(i, run)| {
        let letter = list.mark(run);
        let sign = letter.map_or(String::new(), |_| format!(" {}", sign(letter)));
        // Those that cannot be read come last, and have none.
        let own = cells.0.get(i).into_iter();
        let cells = own.flat_map(|own| columns.iter().map(|of| cell(&own[of.0], of)));
        let row: Row =
            [Line::styled(sign, style(letter, theme))].into_iter().chain(cells).collect();
        if i == position { row.style(REVERSED) } else { row }
    });
    frame.render_widget(Table::new(shown, widths).header(head), area);
    for (run, area) in list.shown().skip(first).zip(rows.rows()) {
        if let Some(problem) = run.problem.as_ref().filter(|_| run.is_damaged()) {
            let text = Line::styled(format!("   {}{problem}", name(&run.source)), DIM);
            frame.render_widget(fitted_line(text, area.width), area);
        }
    }
    if list.shown().len() == 0 {
        let text = match screen.read {
            _ if !list.all().is_empty() => {
                let key = screen.keymap.key_of(Action::Close);
                format!("no run has \"{}\": {key} shows all", screen.words.value())
            }
            Some([read, all]) if read == all => NO_RUNS.to_owned(),
            _ => "reading ...".to_owned(),
        };
        frame.render_widget(fitted_line(Line::styled(format!("   {text}"), DIM), rows.width), rows);
    }
}

/// Draws the curves of runs; returns where their title is.
fn draw_curves(frame: &mut Frame, area: Rect, screen: &RunsScreen, runs: &[DrawnRun]) -> Rect {
    let (RunsScreen { theme, .. }, (measure, axis)) = (screen, screen.curves);
    let curve = |(letter, run): &DrawnRun| {
        let stem = run.source.file_stem().map_or(&*run.source, Path::new);
        let points = run.evaluations.iter();
        // A single curve is in the colour of what it shows, several in those of their runs.
        let own = measure.colour(run.plans());
        let is_alone = runs.len() == 1;
        PaneCurve {
            name: format!("{} {}", sign(*letter), stem.display()),
            style: if is_alone { curves::colour(theme, [own, 0]) } else { style(*letter, theme) },
            marker: letter.map_or(Marker::Braille, |letter| curves::marker(theme, letter)),
            points: points
                .filter_map(|at| Some((axis.of(at), measure.of(&at.evaluation)?)))
                .collect(),
        }
    };
    let all: Vec<PaneCurve> = runs.iter().map(curve).collect();
    let is_share = measure != Measure::Error;
    let title = curves::title(measure, axis);
    let [head, body] = draw_heading(frame, area, title, all.iter().map(PaneCurve::label));
    let points = || all.iter().flat_map(|curve| &curve.points);
    if points().next().is_none() {
        let is_evaluated = runs.iter().any(|(_, run)| !run.evaluations.is_empty());
        let text = match is_evaluated {
            _ if runs.is_empty() => " no run",
            true => " not known of these runs",
            false => " not evaluated yet",
        };
        frame.render_widget(Paragraph::new(text).style(DIM), body);
        return head;
    }
    let last = points().map(|point| point.0).fold(1.0, f64::max);
    let high = if is_share { 1.0 } else { points().map(|point| point.1).fold(0.01, f64::max) };
    let y_labels = [0.0, high]
        .map(|y| if is_share { format!("{y:.1}") } else { format!("{:.0} %", 100.0 * y) });
    let axes = Axes { x: [0.0, last], over: axis, y: [0.0, high], y_labels };
    // The first ones last, on top.
    draw_chart(frame, body, axes, all.iter().rev().map(PaneCurve::line));
    head
}

/// Returns the names in which runs differ, each before its value in every run; of a single run, all
/// that it does not share with its preset.
fn differences(runs: &[&SavedRun]) -> Vec<Vec<String>> {
    let row = |name: &str, value: &dyn Fn(&SavedRun) -> String| -> Vec<String> {
        [name.to_owned()].into_iter().chain(runs.iter().map(|run| value(run))).collect()
    };
    let facts = [
        row("map", &|run| run.map.clone()),
        row("method", &|run| run.method.clone()),
        row("variant", &|run| run.variant.clone().unwrap_or_default()),
        row("seed", &|run| run.seed.to_string()),
        row("updates", &|run| grouped(run.updates)),
        row("left out", &|run| {
            run.problem.as_ref().map_or(String::new(), |at| format!("line {}", &at[1..]))
        }),
    ];
    let edits = row("map edited", &|run| match &run.edits[..] {
        [] => String::new(),
        [(at, _)] => format!("at {}", grouped(*at)),
        [.., (last, _)] => format!("{} times, last at {}", run.edits.len(), grouped(*last)),
    });
    let circumstances = CIRCUMSTANCES
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, name)| row(name, &|run| run.circumstances()[i].clone().unwrap_or_default()));
    let circumstances = [edits].into_iter().chain(circumstances);
    let value = |run: &SavedRun, name: &str| run.setting(name).unwrap_or("-").to_owned();
    let names = changed(runs);
    let settings = names.into_iter().map(|name| row(name, &|run| value(run, name)));
    let is_told = |row: &Vec<String>| match &row[1..] {
        [value] => !value.is_empty(),
        values => values.iter().any(|value| *value != values[0]),
    };
    facts.into_iter().chain(circumstances).chain(settings).filter(is_told).collect()
}

/// Returns the widths of names and of the values of each run, which need a gap before each.
fn widths(rows: &[Vec<String>], runs: usize) -> Vec<usize> {
    let widest = |i: usize| rows.iter().map(|row| display_width(&row[i])).max().unwrap_or(0);
    let values = |i| widest(i).min(if runs == 1 { usize::MAX } else { MAX_VALUE }).max(1);
    [widest(0).clamp(HEAD.len(), MAX_NAME)].into_iter().chain((1..=runs).map(values)).collect()
}

fn draw_settings(
    frame: &mut Frame,
    area: Rect,
    rows: &[Vec<String>],
    runs: &[DrawnRun],
    theme: &Theme,
) {
    let mut widths = widths(rows, runs.len());
    // Where room is short, the widest are cut.
    let room = usize::from(area.width);
    while widths.iter().map(|width| width + 1).sum::<usize>() > room
        && let Some(widest) = widths.iter_mut().max().filter(|width| **width > 1)
    {
        *widest -= 1;
    }
    let letter = |(letter, _): &DrawnRun| {
        Span::styled(sign(*letter).to_string(), style(*letter, theme).patch(BOLD))
    };
    let letters = runs.iter().filter(|_| runs.len() > 1).map(letter);
    let title = if runs.len() > 1 { HEAD } else { "run" };
    let head = [Span::styled(fitted(title, widths[0]), BOLD)].into_iter().chain(letters);
    let rows = rows.iter().map(|row| {
        let cell = |(i, text): (usize, &String)| {
            let text = if text.is_empty() { "-" } else { text };
            Cell::new(fitted(text, widths[i])).style(if i == 0 { DIM } else { Style::new() })
        };
        row.iter().enumerate().map(cell).collect::<Row>()
    });
    let columns = widths.iter().map(|width| Constraint::Length(*width as u16));
    let table = Table::new(rows, columns).header(head.collect());
    let [_, area] = Layout::horizontal([Constraint::Length(1), Constraint::Min(0)]).areas(area);
    frame.render_widget(table, area);
}

fn footer(frame: &mut Frame, area: Rect, screen: &RunsScreen, layout: &mut ScreenLayout) {
    if let Some(notice) = screen.log.notice() {
        // Over the line between the list and the curves.
        let foot = Rect { y: layout.rows.0.bottom() + 1, ..area };
        bars::draw_notice(frame, foot, &screen.theme, notice);
    }
    if let Some((_, text)) = &screen.awaited {
        let text = Line::styled(format!(" {text}"), BOLD);
        return frame.render_widget(fitted_line(text, area.width), area);
    }
    if screen.is_typing {
        let text = " type words that runs must have   Enter keeps them   Esc shows all runs";
        return frame.render_widget(fitted_line(Line::styled(text, DIM), area.width), area);
    }
    let is_watched = screen.list.selected().is_some_and(|run| is_growing(run));
    let is_shown = |b: &&Binding| !b.short.is_empty() && b.is_active(Mode::Listing);
    let all = (Action::Close, "all");
    let all = [all].into_iter().filter(|_| !screen.words.value().is_empty());
    let keys = bindings().filter(is_shown).map(|b| match b.action {
        Action::List(ListAction::Open) if screen.list.pair().is_some() => (b.action, "compare"),
        Action::List(ListAction::Open) if is_watched => (b.action, "watch"),
        action => (action, b.short),
    });
    bars::fitting(all.chain(keys).collect(), &screen.keymap, area.width, false)
        .draw(frame, area, layout);
    layout.add(Rect { height: 1, ..layout.screen }, Click::Act(Action::Help));
}

#[cfg(test)]
mod tests {
    use super::super::tests::saved;
    use super::*;
    use gdg::train::Preset;

    #[test]
    fn settings_that_one_run_leaves_to_its_preset_have_the_presets_value() {
        let one = saved("a", "trap", "gdg", 1, &[]);
        let hidden = Preset::Default.settings().learn.hidden.to_string();
        assert_ne!(hidden, "16");
        let other = SavedRun { settings: vec!["preset=default".to_owned()], ..one.clone() };
        assert_eq!(
            differences(&[&one, &other]),
            [["hidden".to_owned(), "16".to_owned(), hidden]],
            "map, method and seed are the same"
        );
        let third = SavedRun { seed: 2, ..other.clone() };
        let differ = differences(&[&other, &third]);
        assert_eq!(differ, [["seed", "1", "2"]]);
        let alone: Vec<String> =
            differences(&[&one]).into_iter().map(|row| row[0].clone()).collect();
        assert_eq!(alone, ["map", "method", "seed", "updates", "preset", "hidden"]);
    }
}
