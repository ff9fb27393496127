//! The bottom line: a notice, or the available actions and their keys.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Clear;

use super::{BOLD, DIM, REVERSED};
use crate::tui::action::{Action, Binding, Mode, bindings};
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::scene::Tool;
use crate::tui::screen::Screen;

/// Draws the line.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, layout: &mut ScreenLayout) {
    if let Some((notice, fades)) = screen.log.notice() {
        let notice = Line::styled(format!(" {notice}"), if fades { DIM } else { BOLD });
        if !screen.maze.editor.is_open() {
            return frame.render_widget(notice, area);
        }
        // The tools stay visible, so the notice goes above them.
        let above = Rect { y: area.y.saturating_sub(1), ..area };
        frame.render_widget(Clear, above);
        frame.render_widget(notice, above);
    }
    let bar = if screen.maze.editor.is_open() { editing(screen, area.width) } else { keys(screen, Mode::Watching) };
    bar.draw(frame, area, layout);
}

/// Returns the actions of `mode` that have a short name.
pub fn keys(screen: &Screen, mode: Mode) -> ClickableLine {
    let mut bar = ClickableLine::default();
    let here = |b: &&Binding| b.is_active(mode) && screen.scene().offers(b.action);
    for binding in bindings().filter(|b| !b.short.is_empty()).filter(here) {
        let idle = binding.action == Action::TogglePause && !screen.snapshot.phase.is_training();
        let short = if idle { "resume" } else { binding.short };
        key(&mut bar, screen, binding.action, &format!(" {short} "), Style::new());
    }
    bar
}

/// Returns the editor's tools, followed by as much else as fits.
fn editing(screen: &Screen, width: u16) -> ClickableLine {
    let mut bar = ClickableLine::default();
    bar.push(Span::styled(" EDIT ", BOLD.patch(REVERSED)), None);
    for tool in Tool::ALL {
        let style = if tool == screen.maze.editor.tool { REVERSED } else { Style::new() };
        key(&mut bar, screen, Action::Tool(tool), tool.name(), style);
    }
    bar.push(Span::raw(" "), None);
    for (action, label) in [(Action::Apply, "use"), (Action::Undo, "undo"), (Action::ToggleEdit, "done")] {
        if bar.width() + screen.keymap.key_of(action).len() + label.len() + 3 <= usize::from(width) {
            key(&mut bar, screen, action, &format!(" {label} "), Style::new());
        }
    }
    let mouse = " drag: walls  right drag: floor";
    if bar.width() + mouse.len() <= usize::from(width) {
        bar.push(Span::styled(mouse, DIM), None);
    }
    bar
}

/// Adds an action's key and label, both clickable.
fn key(bar: &mut ClickableLine, screen: &Screen, action: Action, label: &str, style: Style) {
    bar.push(Span::styled(format!(" {}", screen.keymap.key_of(action)), BOLD), Click::Act(action));
    bar.push(Span::styled(label.to_owned(), style), Click::Act(action));
}
