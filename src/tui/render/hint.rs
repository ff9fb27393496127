//! The hint above the map: which moment is shown, or for a while what the screen shows.

use ratatui::layout::Rect;
use ratatui::text::Span;
use ratatui::widgets::Clear;

use super::ScreenPainter;
use crate::tui::action::Action;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use crate::tui::style::{BOLD, REVERSED};
use crate::tui::theme::ColourDepth;
use gdg::text::grouped;

/// A text, with keys and what they do.
type Hint = (String, Vec<(Action, &'static str)>);

/// Draws the line at the top of the map's `area`, if there is anything to say.
pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let is_shown = screen.banner.is_some() && !screen.on_paper;
    let hints = match past(screen, scene) {
        _ if screen.tour.is_some() => None,
        None if is_shown => what_to_see(screen),
        past => past,
    };
    let lines = hints.into_iter().flatten().map(|(text, keys)| {
        let mut line = ClickableLine::default();
        line.push(Span::styled(format!(" {text}"), REVERSED), None);
        for (action, what) in keys.into_iter().filter(|_| !screen.on_paper) {
            let key = format!(" {} ", screen.keymap.key_of(action));
            line.push(Span::styled(key, BOLD.patch(REVERSED)), Click::Act(action));
            line.push(Span::styled(what, REVERSED), Click::Act(action));
        }
        line
    });
    // The first that fits, or else the last.
    let lines: Vec<ClickableLine> = lines.collect();
    let fits = lines.iter().position(|line| line.width() <= usize::from(area.width));
    let fits = fits.unwrap_or(lines.len().saturating_sub(1));
    let Some(line) = lines.into_iter().nth(fits) else { return };
    let width = (line.width() as u16).min(area.width);
    let row = Rect { height: area.height.min(1), ..area };
    let area = Rect { x: area.x + (area.width - width) / 2, width, ..row };
    // Nothing of a projection's label stays beside it.
    frame.render_widget(Clear, if scene.maze().is_some() { area } else { row });
    line.draw(frame, area, layout);
}

/// Describes which moment of the past is shown, and how to get back.
fn past(screen: &Screen, scene: &Scene) -> Option<Vec<Hint>> {
    let (frame, snapshot) = (screen.past.as_ref()?, &screen.snapshot);
    let [then, now] = [snapshot.learned(frame.updates), snapshot.updates()].map(grouped);
    let success = snapshot
        .success_at(frame.updates)
        .map_or(String::new(), |rate| format!(", success {rate:.2}"));
    // The film keeps D and the agents, but not the walls.
    let walls = if snapshot.is_edited_since(frame.updates) { ", walls of today" } else { "" };
    let goal = if scene.shown_goal() == scene.goal() { "" } else { ": G is the film's" };
    let texts = [
        format!("update {then} of {now}{success}{walls}{goal}"),
        format!("update {then}{walls}{goal}"),
        format!("update {then}"),
    ];
    let keys = [(Action::Back, ""), (Action::Forth, ""), (Action::Close, "now ")];
    Some(texts.map(|text| (text, keys.to_vec())).to_vec())
}

/// Explains the colours and the effect of a click.
fn what_to_see(screen: &Screen) -> Option<Vec<Hint>> {
    let mono = screen.theme.depth == ColourDepth::Mono;
    let colours = if mono { "@ walks to G" } else { "light = near G" };
    let help = (Action::Help, "help ");
    screen.explains.then(|| {
        vec![
            (
                format!("{colours} \u{b7} click: a new goal \u{b7} new here? gdg-tui tour \u{b7}"),
                vec![help],
            ),
            (format!("{colours} \u{b7} click: a new goal \u{b7}"), vec![help]),
            ("click: goal \u{b7}".to_owned(), vec![help]),
        ]
    })
}
