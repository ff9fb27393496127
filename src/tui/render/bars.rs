//! The lines around the map: the top line with the run, the hint above the map, and the bottom line
//! with keys or a notice.

use ratatui::Frame;
use ratatui::layout::{Constraint, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::ScreenPainter;
use crate::tui::action::{Action, Binding, Mode, bindings};
use crate::tui::choices::{Overlay, Tool};
use crate::tui::keymap::Keymap;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::log::Notice;
use crate::tui::pane_text::{first_lines, wrapped};
use crate::tui::scene::maze::Editor;
use crate::tui::scene::{Scene, legend};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, ColourDepth, DIM, REVERSED, Theme};
use gdg::text::{fitted, grouped};
use gdg::viewer::Field;

/// Names of maps longer than this are shortened before anything is left out; and the least of a file's.
const LONG_TITLE: usize = 24;
const LEAST_FILE: usize = 12;

pub fn draw_header(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let run = screen.run();
    // The file, and the updates that it does not have.
    let file = screen.snapshot.saved.as_ref().and_then(|(_, path)| path.file_stem());
    let saved = match (file, screen.snapshot.unsaved_updates()) {
        (None, 0) => [String::new(), String::new()],
        (None, _) => [" unsaved".to_owned(), String::new()],
        (Some(file), 0) => [format!(" {} ", file.display()), String::new()],
        (Some(file), more) => [format!(" {} ", file.display()), format!("+{}", grouped(more))],
    };
    let speed =
        screen.snapshot.speed.map_or(String::new(), |speed| format!(" (at most {speed:.0}/s)"));
    let changed = screen.changed_settings.len();
    let changed = if changed > 0 { format!("({changed} changed) ") } else { String::new() };
    let name = if screen.elsewhere.is_some() { " gdg-tui watch " } else { " gdg-tui " };
    let mut parts = vec![
        (Span::styled(name, BOLD.patch(REVERSED)), Action::Help),
        (Span::styled(format!(" {} ", scene.title(&screen.snapshot)), BOLD), Action::OpenMap),
        (Span::raw(format!("{} ", run.method.name())), Action::Method),
        (Span::raw(format!("{} {changed}", run.preset.name())), Action::Preset),
        (Span::raw(format!("seed {} ", run.seed)), Action::NewSeed),
        (Span::styled(format!(" {}{speed}", scene.phase(screen)), BOLD), Action::TogglePause),
    ];
    parts.extend(saved.map(|part| (Span::styled(part, DIM), Action::Save)));
    // If room is short, shorten long names, then leave out what identifies the run.
    shorten(&mut parts, Action::OpenMap, area, LONG_TITLE);
    for left_out in [Action::NewSeed, Action::Preset, Action::Method, Action::Save] {
        if file.is_some() {
            shorten(&mut parts, Action::Save, area, 0);
        }
        if parts_width(&parts) > usize::from(area.width) {
            parts.retain(|(_, action)| *action != left_out);
        }
    }
    shorten(&mut parts, Action::OpenMap, area, 0);
    let mut bar = ClickableLine::default();
    parts.into_iter().for_each(|(span, action)| bar.push(span, Click::Act(action)));
    bar.draw(frame, area, layout);
}

fn parts_width(parts: &[(Span, Action)]) -> usize {
    parts.iter().map(|(span, _)| span.width()).sum()
}

/// Shortens the name that `of` acts on so that the line fits, but to no fewer columns than `least`.
fn shorten(parts: &mut [(Span, Action)], of: Action, area: Rect, least: usize) {
    // The blank at the end may be cut off.
    let missing = parts_width(parts).saturating_sub(usize::from(area.width) + 1);
    let named = |(part, action): &&mut (Span, Action)| *action == of && missing < part.width();
    if let Some((part, _)) = parts.iter_mut().find(named).filter(|_| missing > 0) {
        let name = part.content.trim().to_owned();
        // The blanks around it remain. Little of a file's name says less than that there is one.
        let room = part.width().saturating_sub(2 + missing).max(least);
        let is_bare = of == Action::Save && room < LEAST_FILE;
        part.content =
            format!(" {} ", if is_bare { "saved".into() } else { fitted(&name, room) }).into();
    }
}

/// Draws the line in the `row` above the map, if there is anything to say.
pub fn draw_hint(page: &mut ScreenPainter, row: Rect) {
    let ScreenPainter { frame, screen, scene, .. } = page;
    let is_shown = screen.banner.is_some() && !screen.on_paper;
    let hints = match past(screen, scene) {
        _ if screen.tour.is_some() => return,
        None if is_shown && (screen.explains || scene.is_editing()) => what_to_see(screen, scene),
        None if !screen.on_paper => walks(screen, scene),
        past => past.unwrap_or_default(),
    };
    draw_first_that_fits(frame, row, hints);
}

/// Says how walks go, with and without a plan.
pub fn walks(screen: &Screen, scene: &Scene) -> Vec<String> {
    legend::both_walks(&**scene, screen).into_iter().flatten().collect()
}

/// Draws the first hint that fits into a row, or else the last, in place of what is there.
pub fn draw_first_that_fits(frame: &mut Frame, row: Rect, hints: Vec<String>) {
    let lines = hints.into_iter().map(|text| Line::styled(format!(" {text} "), REVERSED));
    let lines: Vec<Line> = lines.collect();
    let fits = |line: &&Line| line.width() <= usize::from(row.width);
    let Some(line) = lines.iter().find(fits).or(lines.last()) else { return };
    frame.render_widget(Clear, row);
    let width = Constraint::Length((line.width() as u16).min(row.width));
    frame.render_widget(line, row.centered_horizontally(width));
}

/// Describes which moment of the past is shown.
fn past(screen: &Screen, scene: &Scene) -> Option<Vec<String>> {
    let (frame, snapshot) = (screen.past.as_ref()?, &screen.snapshot);
    let [then, now] = [snapshot.learned(frame.updates), snapshot.updates()].map(grouped);
    let known = snapshot.evaluation_at(frame.updates);
    let success = known.map_or(String::new(), |e| format!(", {}", e.success(frame.updates)));
    // The film keeps D and the agents, but not the walls.
    let walls = if snapshot.is_edited_since(frame.updates) { ", walls of today" } else { "" };
    let goal = if scene.shown_goal() == scene.goal() { "" } else { ": G is the film's" };
    Some(vec![
        format!("update {then} of {now}{success}{walls}{goal}"),
        format!("update {then}{walls}{goal}"),
        format!("update {then}"),
    ])
}

fn what_to_see(screen: &Screen, scene: &Scene) -> Vec<String> {
    let mono = screen.theme.depth == ColourDepth::Mono;
    let colours = match screen.field {
        _ if mono => "@ walks to G \u{b7} ",
        Field::Learned => "light = near G \u{b7} ",
        _ => "",
    };
    if scene.is_editing() {
        let [apply, help] = [Action::Apply, Action::Help].map(|key| screen.keymap.key_of(key));
        return vec![format!("draw by mouse, or by arrows and {apply} \u{b7} {help} help")];
    }
    let all = format!("{colours}click sets a goal");
    vec![format!("{all} \u{b7} new here? gdg-tui tour"), all, "click sets a goal".to_owned()]
}

const MAX_NOTICE_ROWS: usize = 4;

/// Keys at the end of the line that are the last to be left out.
const LAST_KEYS: [Action; 3] = [Action::Save, Action::Help, Action::Quit];

/// Draws the line, and a notice over the map.
pub fn draw_footer(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    on_top(screen, scene, area.width)
        .unwrap_or_else(|| keys(&[(screen, scene)], Mode::Watching, area.width, layout.lacks_panel))
        .draw(frame, area, layout);
    if let Some(notice) = screen.log.notice().filter(|_| screen.dialogs.is_empty()) {
        // The line below the map says what a cell or a colour is.
        let map = layout.map_pane;
        let foot = if map.is_empty() { area } else { Rect { y: map.bottom() - 1, ..map } };
        draw_notice(frame, foot, &screen.theme, notice);
    }
}

/// Draws a notice, wrapped, in the rows above `foot`.
pub fn draw_notice(frame: &mut Frame, foot: Rect, theme: &Theme, notice: Notice) {
    let style = match notice {
        Notice { is_error: true, .. } => theme.failure(),
        _ => BOLD,
    };
    let columns = usize::from(foot.width).saturating_sub(2).max(8);
    let most = MAX_NOTICE_ROWS.min(usize::from(foot.y));
    let rows = first_lines(wrapped(notice.text, columns), most, columns);
    let height = rows.len() as u16;
    let area = Rect { y: foot.y - height, height, ..foot };
    let lines: Vec<Line> =
        rows.into_iter().map(|row| Line::styled(format!(" {row}"), style)).collect();
    frame.render_widget(Clear, area);
    frame.render_widget(Paragraph::new(lines), area);
}

/// Returns the actions of `mode` that have a short name, do something in one of the runs and fit: where
/// room is short, those in the middle are left out, but not the panes if they are hidden.
pub fn keys(of: &[(&Screen, &Scene)], mode: Mode, width: u16, lacks_panel: bool) -> ClickableLine {
    let Some((screen, scene)) = of.first() else { return ClickableLine::default() };
    let mut keys: Vec<(Action, &str)> = Vec::new();
    let own = scene.mode(screen);
    let is_shown = |b: &&Binding| match own {
        Mode::Elsewhere => (b.is_active(mode) || b.is_active(own)) && !b.changes_run(),
        _ => b.is_active(mode),
    };
    let does = |b: &&Binding| {
        let offers = |run: &(&Screen, &Scene)| legend::offers(&**run.1, run.0, b.action);
        !b.short.is_empty() && of.iter().any(offers)
    };
    for binding in bindings().filter(does).filter(is_shown) {
        let label = match binding.action {
            Action::TogglePause if !screen.snapshot.phase.is_training() => "train",
            Action::Quit if screen.from_list => "list",
            _ => binding.short,
        };
        keys.push((binding.action, label));
    }
    fitting(keys, &screen.keymap, width, lacks_panel)
}

/// Returns actions with their labels, as many as fit, like [`keys`].
pub fn fitting(
    mut keys: Vec<(Action, &str)>,
    keymap: &Keymap,
    width: u16,
    lacks_panel: bool,
) -> ClickableLine {
    let line = |keys: &[(Action, &str)]| {
        let mut bar = ClickableLine::default();
        for (action, label) in keys {
            key(&mut bar, keymap, *action, &format!(" {label} "), Style::new());
        }
        bar
    };
    keys.sort_by_key(|(action, _)| LAST_KEYS.contains(action));
    // The trailing space need not fit.
    while line(&keys).width() > usize::from(width) + 1 && keys.len() > 1 {
        let stays = |action: Action| lacks_panel && action == Action::NextPane;
        let last = keys.iter().filter(|(action, _)| LAST_KEYS.contains(action)).count();
        let before = keys.len() - last;
        // What newcomers need least goes first.
        let least = (1..before).find(|i| keys[*i].0 == Action::Toggle(Overlay::Ghost));
        let middle = least.or_else(|| (1..before).rev().find(|i| !stays(keys[*i].0)));
        // Then the first of the last keys, for the sake of the panes.
        let next = if before > 1 && last > 0 { before } else { 0 };
        keys.remove(middle.unwrap_or(next));
    }
    line(&keys)
}

/// Returns the name and the keys of what is on top of the map, if anything is: the past, the editor or
/// a cursor.
pub fn on_top(screen: &Screen, scene: &Scene, width: u16) -> Option<ClickableLine> {
    let maze = scene.maze();
    let (name, own, text) = if screen.past.is_some() {
        let own = [(Action::Back, "earlier"), (Action::Forth, "later"), (Action::Close, "now")];
        ("PAST", own, "panes show the present")
    } else if let Some(editor) = maze.map(|maze| &maze.editor).filter(|editor| editor.is_open()) {
        return Some(editing(screen, editor, width));
    } else {
        maze?.inspecting?;
        let own = [Action::GoalHere, Action::StartHere, Action::Inspect];
        ("CELL", [(own[0], "goal"), (own[1], "start"), (own[2], "done")], "arrows move")
    };
    let keys = [&own[..], &[(Action::Help, "help"), (Action::Quit, "quit")]].concat();
    Some(named_keys(screen, name, &[], &keys, text, width))
}

/// Returns the editor's tools with as many keys as fit; where room is short, only the selected one.
fn editing(screen: &Screen, editor: &Editor, width: u16) -> ClickableLine {
    let [undo, save] = [(Action::Undo, "undo"), (Action::SaveMap, "save map")];
    let done = (Action::ToggleEdit, "done");
    let (all, own) = (&Tool::ALL[..], &[editor.tool][..]);
    let keys = [&[undo, save, done][..], &[save, done], &[done]];
    let line = |tools: &[Tool], keys: &[(Action, &'static str)]| {
        let styled = |tool: &Tool| {
            let style = if *tool == editor.tool { REVERSED } else { Style::new() };
            (Action::Tool(*tool), tool.about().0, style)
        };
        let tools: Vec<_> = tools.iter().map(styled).collect();
        named_keys(screen, "EDIT", &tools, keys, editor.tool.about().1, width)
    };
    let options = [all, own].into_iter().flat_map(|tools| keys.map(|keys| line(tools, keys)));
    // The trailing blank may be cut off.
    let fits = |bar: &ClickableLine| bar.width() <= usize::from(width) + 1;
    { options }.find(fits).unwrap_or_else(|| line(own, &[done]))
}

/// Returns a bar: the name of what is on top, its keys, and a text if there is room.
fn named_keys(
    screen: &Screen,
    name: &str,
    tools: &[(Action, &str, Style)],
    keys: &[(Action, &str)],
    text: &str,
    width: u16,
) -> ClickableLine {
    let mut bar = ClickableLine::default();
    bar.push(Span::styled(format!(" {name}"), BOLD.patch(REVERSED)), None);
    for (action, label, style) in tools {
        key(&mut bar, &screen.keymap, *action, &format!(" {label}"), *style);
    }
    if !tools.is_empty() {
        bar.push(" ".into(), None);
    }
    for (action, label) in keys {
        key(&mut bar, &screen.keymap, *action, &format!(" {label} "), Style::new());
    }
    if bar.width() + text.len() < usize::from(width) {
        bar.push(Span::styled(format!(" {text}"), DIM), None);
    }
    bar
}

/// Adds the key of an action, and what it does.
pub fn key(bar: &mut ClickableLine, keymap: &Keymap, action: Action, label: &str, style: Style) {
    push_key(bar, &keymap.key_of(action), label, style, Click::Act(action));
}

pub fn push_key(bar: &mut ClickableLine, key: &str, label: &str, style: Style, click: Click) {
    bar.push(Span::styled(format!(" {key}"), BOLD), click);
    bar.push(Span::styled(label.to_owned(), style), click);
}
