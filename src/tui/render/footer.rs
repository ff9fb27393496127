//! The bottom line: a notice, or the available actions and their keys.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Paragraph};

use super::ScreenPainter;
use crate::tui::action::{Action, Mode, bindings};
use crate::tui::keymap::Keymap;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::log::Notice;
use crate::tui::pane_text::{first_lines, wrapped};
use crate::tui::scene::Scene;
use crate::tui::scene::maze::Editor;
use crate::tui::screen::Screen;
use crate::tui::style::{BOLD, DIM, REVERSED};
use crate::tui::theme::Theme;
use crate::tui::tool::Tool;

const MAX_NOTICE_ROWS: usize = 4;

/// Keys at the end of the line that are the last to be left out.
const LAST_KEYS: [Action; 3] = [Action::Palette, Action::Help, Action::Quit];

/// Draws the line, and the rest of a long notice above it.
pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let notice = screen.log.notice();
    // The tools of the editor stay visible, as does the line above them that explains colours.
    let tools = scene.maze().map(|maze| &maze.editor).filter(|editor| editor.is_open());
    if let Some(notice) = notice {
        let at = if tools.is_some() { Rect { y: 0, ..area } } else { area };
        draw_notice(frame, at, &screen.theme, notice);
    }
    match tools {
        Some(editor) => editing(screen, editor, area.width).draw(frame, area, layout),
        None if notice.is_none() => {
            keys(screen, scene, Mode::Watching, area.width, layout.lacks_panel)
                .draw(frame, area, layout);
        }
        None => {}
    }
}

/// Draws a notice, wrapped: upwards from the row `at`, but downwards from the first one.
pub fn draw_notice(frame: &mut Frame, at: Rect, theme: &Theme, notice: Notice) {
    let style = match notice {
        Notice { is_error: true, .. } => theme.failure(),
        _ => BOLD,
    };
    let columns = usize::from(at.width).saturating_sub(2).max(8);
    let room = if at.y == 0 { frame.area().height } else { at.y + 1 };
    let most = MAX_NOTICE_ROWS.min(usize::from(room));
    let rows = first_lines(wrapped(notice.text, columns), most, columns);
    let height = rows.len() as u16;
    let y = if at.y == 0 { 0 } else { (at.y + 1).saturating_sub(height) };
    let area = Rect { y, height, ..at };
    let lines: Vec<Line> =
        rows.into_iter().map(|row| Line::styled(format!(" {row}"), style)).collect();
    frame.render_widget(Clear, area);
    frame.render_widget(Paragraph::new(lines), area);
}

/// Returns the actions of `mode` that have a short name and fit: where room is short, they move
/// together, then those in the middle are left out, but not the panes if they are hidden.
pub fn keys(
    screen: &Screen,
    scene: &Scene,
    mode: Mode,
    width: u16,
    lacks_panel: bool,
) -> ClickableLine {
    let mut keys: Vec<(Action, &str)> = Vec::new();
    for binding in
        bindings().filter(|b| !b.short.is_empty() && b.is_active(mode) && scene.offers(b.action))
    {
        let idle = binding.action == Action::TogglePause && !screen.snapshot.phase.is_training();
        keys.push((binding.action, if idle { "resume" } else { binding.short }));
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
    let line = |keys: &[(Action, &str)], space: &str| {
        let mut bar = ClickableLine::default();
        for (action, label) in keys {
            key(&mut bar, keymap, *action, &format!(" {label}{space}"), Style::new());
        }
        bar
    };
    // The trailing space need not fit.
    let roomy = line(&keys, " ");
    if roomy.width() <= usize::from(width) + 1 {
        return roomy;
    }
    while line(&keys, "").width() > usize::from(width) && keys.len() > 1 {
        let stays = |action: Action| lacks_panel && action == Action::NextPane;
        let last = keys.iter().rev().take_while(|(action, _)| LAST_KEYS.contains(action)).count();
        let before = keys.len() - last;
        let middle = (1..before).rev().find(|i| !stays(keys[*i].0));
        // Then the first of the last keys, for the sake of the panes.
        let next = if before > 1 && last > 0 { before } else { 0 };
        keys.remove(middle.unwrap_or(next));
    }
    line(&keys, "")
}

/// Returns the editor's tools with as many keys as fit; where room is short, only the selected one.
pub fn editing(screen: &Screen, editor: &Editor, width: u16) -> ClickableLine {
    let line = |tools: &[Tool], keys: &[(Action, &str)]| {
        let mut bar = ClickableLine::default();
        bar.push(Span::styled(" EDIT ", BOLD.patch(REVERSED)), None);
        for tool in tools {
            let style = if *tool == editor.tool { REVERSED } else { Style::new() };
            key(&mut bar, &screen.keymap, Action::Tool(*tool), tool.about().0, style);
        }
        bar.push(Span::raw(" "), None);
        for (action, label) in keys {
            key(&mut bar, &screen.keymap, *action, &format!(" {label} "), Style::new());
        }
        bar
    };
    let keys = [(Action::Apply, "use"), (Action::Undo, "undo"), (Action::ToggleEdit, "done")];
    let (all, own) = (&Tool::ALL[..], &[editor.tool][..]);
    let options = [(all, &keys[..]), (all, &keys[2..]), (own, &keys[..]), (own, &keys[2..])];
    let mut lines = options.map(|(tools, keys)| line(tools, keys)).into_iter();
    let fits = |bar: &ClickableLine| bar.width() <= usize::from(width);
    let mut bar = lines.find(fits).unwrap_or_else(|| line(own, &keys[2..]));
    let mouse = format!(" {}", editor.tool.about().1);
    if bar.width() + mouse.len() <= usize::from(width) {
        bar.push(Span::styled(mouse, DIM), None);
    }
    bar
}

fn key(bar: &mut ClickableLine, keymap: &Keymap, action: Action, label: &str, style: Style) {
    bar.push(Span::styled(format!(" {}", keymap.key_of(action)), BOLD), Click::Act(action));
    bar.push(Span::styled(label.to_owned(), style), Click::Act(action));
}
