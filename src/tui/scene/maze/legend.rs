//! The legend of the map: colours, overlays and signs.

use ratatui::text::{Line, Span};

use super::MazeState;
use super::edges::MAX_EDGES;
use super::map::{FRONTIER_SIGN, TRAIL_MARK};
use super::offers;
use crate::tui::canvas::{CANDIDATE_MARK, UNVISITED_MARK};
use crate::tui::layers::Overlay;
use crate::tui::scene::legend::{edge_lines, overlay_lines, sample, sign};
use crate::tui::scene::scale::SHORT_BAR_WIDTH;
use crate::tui::screen::Screen;
use crate::tui::text::heading;
use crate::tui::theme::{ColourDepth, Rgb};
use gdg::bridge::EdgeStatus;

/// Returns the pane's lines.
pub fn lines(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = overlay_lines(maze.scale(screen, SHORT_BAR_WIDTH), offers, screen, sign_of);
    lines.push(heading("signs"));
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let mut pairs = vec![
        [('G', theme.goal, "goal"), ('S', theme.walker, "start of @")],
        [('@', theme.walker, "walks to G"), ('s', theme.cursor, "g: map's own")],
    ];
    if screen.following.is_some() {
        pairs.push([('A', theme.agent, "followed agent"), ('\u{2691}', theme.agent, "its goal")]);
    }
    lines.extend(pairs.iter().map(|pair| signs(screen, pair)));
    if screen.run().method.plans() {
        let sizes =
            [' ', '\u{b7}', '\u{2022}', '\u{25cf}'].map(|sign| sample(screen, sign, theme.cursor));
        let of_sizes = sizes.into_iter().chain([Span::raw(" larger: more edges")]);
        lines.push(Line::from(of_sizes.collect::<Vec<_>>()));
    }
    if screen.run().method.bridges() {
        lines.push(sign(screen, FRONTIER_SIGN, theme.frontier, "frontier goals of agents"));
    }
    if maze.view.cut_off.contains(&true) {
        lines.push(sign(screen, '\\', theme.cursor, "hatched: no path to G"));
    }
    let trail = (if mono { TRAIL_MARK } else { '\u{2500}' }, theme.walker, "trail of @");
    let frontier = ('\u{2500}', theme.frontier, "frontier");
    let has_edge = !mono && !maze.view.exploration.is_complete(&maze.map);
    lines.push(signs(screen, &[trail, frontier][..=usize::from(has_edge)]));
    if screen.run().method.plans() {
        let tried = maze.edge_count(EdgeStatus::Confirmed) + maze.edge_count(EdgeStatus::Demoted);
        let walked = if tried > MAX_EDGES { "walked, near cursor" } else { "edges walked" };
        lines.extend(edge_lines(
            screen,
            |status| maze.edge_count(status),
            [walked, "failed", "untried, not shown"],
        ));
    }
    lines
}

/// Returns signs and their meanings beside each other.
fn signs(screen: &Screen, all: &[(char, Rgb, &str)]) -> Line<'static> {
    let mut line = Line::default();
    for (symbol, rgb, meaning) in all {
        let gap = if line.spans.is_empty() { " " } else { "  " };
        line.extend([
            Span::raw(gap),
            sample(screen, *symbol, *rgb),
            Span::raw(format!(" {meaning}")),
        ]);
    }
    line
}

/// Returns an overlay's sign.
fn sign_of(overlay: Overlay, screen: &Screen) -> Option<(char, Rgb)> {
    let theme = &screen.theme;
    let mono = theme.depth == ColourDepth::Mono;
    Some(match overlay {
        Overlay::Contours => return None,
        Overlay::Directions => ('\u{2192}', theme.cursor),
        Overlay::Unexplored => (if mono { UNVISITED_MARK } else { '\u{2592}' }, theme.frontier),
        Overlay::Agents => (if mono { 'o' } else { '\u{25a0}' }, theme.agent),
        Overlay::Candidates => (CANDIDATE_MARK, theme.cursor),
        Overlay::Edges => ('\u{2500}', theme.edges[0]),
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (if mono { '+' } else { '\u{25a0}' }, theme.path),
    })
}
