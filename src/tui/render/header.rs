//! The top line: map, method, preset, seed, phase, unsaved updates.

use ratatui::layout::Rect;
use ratatui::text::Span;

use super::ScreenPainter;
use crate::tui::action::Action;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::style::{BOLD, DIM, REVERSED};
use gdg::text::fitted;

/// Names longer than this, in columns, are shortened before anything is left out.
const LONG_TITLE: usize = 24;

pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let run = screen.run();
    let saved = match &screen.snapshot.saved {
        _ if screen.snapshot.unsaved_updates() > 0 => " unsaved".to_owned(),
        Some((_, path)) => {
            path.file_name().map_or(String::new(), |f| format!(" {}", f.to_string_lossy()))
        }
        None => String::new(),
    };
    let speed =
        screen.snapshot.speed.map_or(String::new(), |speed| format!(" (at most {speed:.0}/s)"));
    let changed = screen.changed_settings.len();
    let changed = if changed > 0 { format!("({changed} changed) ") } else { String::new() };
    let mut parts = vec![
        (Span::styled(" gdg-tui ", BOLD.patch(REVERSED)), Action::Help),
        (Span::styled(format!(" {} ", scene.title(&screen.snapshot)), BOLD), Action::OpenMap),
        (Span::raw(format!("{} ", run.method.name())), Action::Method),
        (Span::raw(format!("{} {changed}", run.preset.name())), Action::Preset),
        (Span::raw(format!("seed {} ", run.seed)), Action::NewSeed),
        (Span::styled(format!(" {}{speed}", scene.phase(screen)), BOLD), Action::TogglePause),
        (Span::styled(saved, DIM), Action::Save),
    ];
    // If room is short, shorten a long name, then leave out what identifies the run before its
    // state.
    shorten_title(&mut parts, area, LONG_TITLE);
    for left_out in [Action::NewSeed, Action::Preset, Action::Method, Action::Save] {
        if width(&parts) > usize::from(area.width) {
            parts.retain(|(_, action)| *action != left_out);
        }
    }
    shorten_title(&mut parts, area, 0);
    let mut bar = ClickableLine::default();
    parts.into_iter().for_each(|(span, action)| bar.push(span, Click::Act(action)));
    bar.draw(frame, area, layout);
}

fn width(parts: &[(Span, Action)]) -> usize {
    parts.iter().map(|(span, _)| span.width()).sum()
}

/// Shortens the name of the map so that the line fits, but to no fewer columns than `least`.
fn shorten_title(parts: &mut [(Span, Action)], area: Rect, least: usize) {
    let missing = width(parts).saturating_sub(usize::from(area.width));
    if let Some((title, _)) = parts.iter_mut().find(|(_, action)| *action == Action::OpenMap) {
        let name = title.content.trim().to_owned();
        // The blanks around it remain.
        let room = title.width().saturating_sub(2 + missing).max(least);
        title.content = format!(" {} ", fitted(&name, room)).into();
    }
}
