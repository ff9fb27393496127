//! The top line: map, method, preset, seed, phase, unsaved updates.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Span;

use super::{BOLD, DIM, REVERSED};
use crate::tui::action::Action;
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::screen::Screen;

/// Draws the line.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, layout: &mut ScreenLayout) {
    let run = screen.run();
    let unsaved = screen.unsaved_updates();
    let saved = match &screen.snapshot.saved {
        _ if unsaved > 0 => " unsaved".to_owned(),
        Some((_, path)) => path.file_name().map_or(String::new(), |f| format!(" {}", f.to_string_lossy())),
        None => String::new(),
    };
    let speed = screen.snapshot.speed.map_or(String::new(), |speed| format!(" (at most {speed:.0}/s)"));
    let act = |action| Some(Click::Act(action));
    let mut bar = ClickableLine::default();
    bar.push(Span::styled(" gdg-tui ", BOLD.patch(REVERSED)), act(Action::Help));
    bar.push(Span::styled(format!(" {} ", screen.title()), BOLD), act(Action::OpenMap));
    bar.push(Span::raw(format!("{} ", run.method.name())), act(Action::Method));
    let changed = screen.changed_settings.len();
    let changed = if changed > 0 { format!("({changed} changed) ") } else { String::new() };
    bar.push(Span::raw(format!("{} {changed}", run.preset.name())), act(Action::Preset));
    bar.push(Span::raw(format!("seed {} ", run.seed)), act(Action::NewSeed));
    bar.push(Span::styled(format!(" {}{speed}", screen.phase()), BOLD), act(Action::TogglePause));
    bar.push(Span::styled(saved, DIM), act(Action::Save));
    let unsaved = format!("  {unsaved} updates since the last checkpoint");
    if screen.snapshot.saved.is_some() && bar.width() + unsaved.len() < usize::from(area.width) {
        bar.push(Span::styled(unsaved, DIM), act(Action::Save));
    }
    bar.draw(frame, area, layout);
}
