//! The legend of the map: colours, overlays and signs.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::edges::MAX_EDGES;
use super::map::FRONTIER_SIGN;
use crate::bridge::EdgeStatus;
use crate::tui::action::Action;
use crate::tui::canvas::{CANDIDATE_MARK, UNVISITED_MARK};
use crate::tui::layers::Overlay;
use crate::tui::render::DIM;
use crate::tui::render::scale::scale;
use crate::tui::render::text::heading;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Rgb};

/// Returns the pane's lines.
pub fn lines(screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = vec![scale(screen, 5), heading("toggle by key or click")];
    for overlay in Overlay::ALL {
        let key = screen.keymap.key_of(Action::Toggle(overlay));
        let shown = screen.overlays.has(overlay);
        let mut line =
            Line::from(vec![Span::raw(format!(" {key:<2}")), Span::raw(if shown { "[x] " } else { "[ ] " })]);
        line.spans.push(Span::styled(overlay.name(), if shown { Style::new() } else { DIM }));
        line.spans.extend(symbol_of(overlay, screen));
        lines.push(line);
    }
    lines.push(heading("signs"));
    let theme = &screen.theme;
    for [(symbol, rgb, meaning), (second, second_rgb, second_meaning)] in [
        [('G', theme.goal, "goal"), ('S', theme.walker, "start of @")],
        [('@', theme.walker, "walking agent"), ('s', theme.cursor, "g: map's")],
    ] {
        lines.push(Line::from(vec![
            Span::raw(" "),
            sample(screen, symbol, rgb),
            Span::raw(format!(" {meaning}  ")),
            sample(screen, second, second_rgb),
            Span::raw(format!(" {second_meaning}")),
        ]));
    }
    if screen.run().method.plans() {
        let sizes = [' ', '\u{b7}', '\u{2022}', '\u{25cf}'].map(|sign| sample(screen, sign, theme.cursor));
        let of_sizes = sizes.into_iter().chain([Span::raw(" larger: more edges")]);
        lines.push(Line::from(of_sizes.collect::<Vec<_>>()));
    }
    if screen.run().method.bridges() {
        let sign = sample(screen, FRONTIER_SIGN, theme.frontier);
        lines.push(Line::from(vec![Span::raw(" "), sign, Span::raw(" frontier goals of agents")]));
    }
    if screen.run().method.plans() {
        let of = |status: EdgeStatus| screen.maze.view.edges.iter().filter(|(_, s)| *s == status).count();
        let many = of(EdgeStatus::Confirmed) + of(EdgeStatus::Demoted) > MAX_EDGES;
        lines.push(heading(if many { "edges (near the cursor)" } else { "edges" }));
        let kinds = [
            (EdgeStatus::Confirmed, "walked"),
            (EdgeStatus::Demoted, "failed"),
            (EdgeStatus::Untried, "untried, not shown"),
        ];
        for ((status, name), rgb) in kinds.into_iter().zip(theme.edges) {
            let text = format!(" {} {name}", of(status));
            lines.push(Line::from(vec![Span::raw(" "), sample(screen, '\u{2500}', rgb), Span::raw(text)]));
        }
    }
    lines
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
        Overlay::Contours => return Vec::new(),
        Overlay::Directions => ('\u{2192}', theme.cursor),
        Overlay::Unexplored => (if mono { UNVISITED_MARK } else { '\u{2592}' }, theme.frontier),
        Overlay::Agents => (if mono { 'o' } else { '\u{25a0}' }, theme.agent),
        Overlay::Candidates => (CANDIDATE_MARK, theme.cursor),
        Overlay::Edges => ('\u{2500}', theme.edges[0]),
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (if mono { '+' } else { '\u{25a0}' }, theme.path),
    };
    vec![Span::raw(" "), sample(screen, symbol, rgb)]
}
