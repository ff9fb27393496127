//! The hint above the map: which moment is shown, or for a while how to draw on the map or what the
//! screen shows.

use ratatui::layout::Rect;
use ratatui::text::Span;
use ratatui::widgets::Clear;

use super::{Page, footer};
use crate::tui::action::Action;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use crate::tui::style::{BOLD, REVERSED};
use crate::tui::theme::ColourDepth;
use gdg::text::grouped;

/// Draws the line at the top of the map's `area`, if there is anything to say.
pub fn draw(page: &mut Page, area: Rect) {
    let Page { frame, screen, scene, layout } = page;
    if screen.tour.is_some() {
        return;
    }
    let width = usize::from(area.width);
    let line = past(screen, scene, width);
    if line.is_none() && (screen.on_paper || screen.banner.is_none()) {
        return;
    }
    let line = line
        .or_else(|| how_to_draw(screen, scene, frame.area().width))
        .or_else(|| what_to_see(screen, width));
    let Some(line) = line else { return };
    let width = (line.width() as u16).min(area.width);
    let area =
        Rect { x: area.x + (area.width - width) / 2, width, height: area.height.min(1), ..area };
    frame.render_widget(Clear, area);
    line.draw(frame, area, layout);
}

/// Describes which moment of the past is shown, and how to get back.
fn past(screen: &Screen, scene: &Scene, width: usize) -> Option<ClickableLine> {
    let (frame, snapshot) = (screen.past.as_ref()?, &screen.snapshot);
    let [then, now] = [snapshot.learned(frame.updates), snapshot.updates()].map(grouped);
    let success = snapshot
        .success_at(frame.updates)
        .map_or(String::new(), |rate| format!(", success {rate:.2}"));
    let other_goal = scene.shows_other_goal();
    let goal = |text: &str| if other_goal { format!(": {text}") } else { String::new() };
    // The film keeps D and the agents, but not the walls.
    let walls = if snapshot.is_edited_since(frame.updates) { ", walls of today" } else { "" };
    let (long, short) = (goal("D to G, the film's goal"), goal("G is the film's"));
    let texts = [
        (format!("update {then} of {now}{success}{walls}{long}"), " back and forth"),
        (format!("update {then}{success}{walls}{short}"), " back and forth"),
        (format!("update {then}{success}{walls}{short}"), ""),
        (format!("update {then}{walls}{short}"), ""),
        (format!("update {then}{walls}"), " back and forth"),
        (format!("update {then}"), ""),
    ];
    if screen.on_paper {
        return fitting(texts.map(|(text, _)| plain(&format!(" {text} "))), width);
    }
    let lines = texts.map(|(text, directions)| {
        let mut line = ClickableLine::default();
        let keys = [(Action::Back, ""), (Action::Forth, directions), (Action::Close, " now ")];
        for ((action, word), before) in
            keys.into_iter().zip([&*format!(" {text} \u{b7} "), " ", " \u{b7} "])
        {
            line.push(Span::styled(before.to_owned(), REVERSED), None);
            line.push(
                Span::styled(screen.keymap.key_of(action), BOLD.patch(REVERSED)),
                Click::Act(action),
            );
            line.push(Span::styled(word, REVERSED), Click::Act(action));
        }
        line
    });
    fitting(lines, width)
}

/// Explains the mouse in the editor until it is used, unless the bottom line of `width` columns
/// does.
fn how_to_draw(screen: &Screen, scene: &Scene, width: u16) -> Option<ClickableLine> {
    let editor = &scene.maze()?.editor;
    let mouse = footer::untold_mouse(screen, editor, width).filter(|_| !editor.has_changed)?;
    Some(plain(&format!(" {mouse} ")))
}

fn plain(text: &str) -> ClickableLine {
    let mut line = ClickableLine::default();
    line.push(Span::styled(text.to_owned(), REVERSED), None);
    line
}

/// Explains the colours and the effect of a click.
fn what_to_see(screen: &Screen, width: usize) -> Option<ClickableLine> {
    if !screen.explains {
        return None;
    }
    let mono = screen.theme.depth == ColourDepth::Mono;
    let long =
        if mono { "@ walks to G as far as it has learned" } else { "light = few steps to G" };
    let short = if mono { "@ walks to G" } else { "light = near G" };
    let texts = [
        (long, "click anywhere: a new goal", true),
        (short, "click: a new goal", false),
        (short, "click: goal", false),
    ];
    let lines = texts.map(|(colours, click, names_tour)| {
        let mut line = ClickableLine::default();
        line.push(Span::styled(format!(" {colours} \u{b7} {click} \u{b7}"), REVERSED), None);
        push_key(&mut line, screen, Action::Help, "help");
        if names_tour {
            line.push(Span::styled("\u{b7} new here? gdg-tui tour ", REVERSED), None);
        }
        line
    });
    fitting(lines, width)
}

fn push_key(line: &mut ClickableLine, screen: &Screen, action: Action, what: &str) {
    let key = format!(" {} ", screen.keymap.key_of(action));
    line.push(Span::styled(key, BOLD.patch(REVERSED)), Click::Act(action));
    line.push(Span::styled(format!("{what} "), REVERSED), Click::Act(action));
}

/// Returns the first of `lines` with at most `width` columns, or else the last one.
fn fitting<const N: usize>(lines: [ClickableLine; N], width: usize) -> Option<ClickableLine> {
    let fits = lines.iter().position(|line| line.width() <= width).unwrap_or(N - 1);
    lines.into_iter().nth(fits)
}
