//! The legend of the arm: colours, overlays and signs.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use crate::bridge::EdgeStatus;
use crate::env::Scene;
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::render::DIM;
use crate::tui::render::scale::scale;
use crate::tui::render::text::heading;
use crate::tui::scene::overlays;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Rgb, blend};

/// Returns the pane's lines.
pub fn lines(screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = vec![scale(screen, 5), heading("toggle by key or click")];
    for overlay in overlays(screen) {
        let key = screen.keymap.key_of(Action::Toggle(overlay));
        let shown = screen.overlays.has(overlay);
        let mut line =
            Line::from(vec![Span::raw(format!(" {key:<2}")), Span::raw(if shown { "[x] " } else { "[ ] " })]);
        line.push_span(Span::styled(overlay.name(), if shown { Style::new() } else { DIM }));
        line.extend(symbol_of(overlay, screen));
        lines.push(line);
    }
    lines.push(heading("signs"));
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let sign = |of_mono: char, other: char| if mono { of_mono } else { other };
    let signs = [
        ('G', theme.goal, "goal, and 5 cm around it"),
        ('@', theme.walker, "grip of the arm"),
        (sign('O', '\u{25cf}'), theme.walker, "joints"),
        (sign('.', '\u{2500}'), theme.frontier, "region of goals"),
        (sign('=', '\u{2500}'), blend(theme.wall, theme.cursor, 0.3), "edge of the table"),
    ];
    lines.extend(signs.map(|(symbol, rgb, meaning)| named(screen, symbol, rgb, meaning)));
    if matches!(&screen.snapshot.scene, Scene::Arm(scene) if scene.wall().is_some()) {
        lines.push(named(screen, sign('#', '\u{2500}'), theme.edges[1], "the wall"));
    }
    if screen.run().method.plans() {
        lines.push(heading("edges"));
        let of = |status: EdgeStatus| screen.arm.view.edges.iter().filter(|(_, s)| *s == status).count();
        let kinds =
            [(EdgeStatus::Confirmed, "walked"), (EdgeStatus::Demoted, "failed"), (EdgeStatus::Untried, "untried")];
        for ((status, name), rgb) in kinds.into_iter().zip(theme.edges) {
            lines.push(named(screen, '\u{2500}', rgb, &format!("{} {name}", of(status))));
        }
    }
    lines
}

fn named(screen: &Screen, symbol: char, rgb: Rgb, meaning: &str) -> Line<'static> {
    Line::from(vec![Span::raw(" "), sample(screen, symbol, rgb), Span::raw(format!(" {meaning}"))])
}

/// Returns a sign in its colour.
fn sample(screen: &Screen, symbol: char, rgb: Rgb) -> Span<'static> {
    Span::styled(symbol.to_string(), Style::new().fg(screen.theme.colour(rgb)))
}

/// Returns an overlay's sign, after a space.
fn symbol_of(overlay: Overlay, screen: &Screen) -> Vec<Span<'static>> {
    let theme = &screen.theme;
    let mono = theme.depth == ColourDepth::Mono;
    let (symbol, rgb) = match overlay {
        Overlay::Agents => (if mono { 'o' } else { '\u{25cf}' }, theme.frontier),
        Overlay::Candidates => (if mono { '.' } else { '\u{2022}' }, theme.cursor),
        Overlay::Edges => ('\u{2500}', theme.edges[0]),
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (if mono { '+' } else { '\u{2500}' }, theme.path),
        Overlay::Contours | Overlay::Directions | Overlay::Unexplored => return Vec::new(),
    };
    vec![Span::raw(" "), sample(screen, symbol, rgb)]
}
