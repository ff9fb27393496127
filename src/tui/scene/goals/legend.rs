//! The legend of a space of goals: colours, overlays and signs.

use ratatui::text::Line;

use super::draw::short;
use super::{GoalsState, offers, space};
use crate::tui::layers::Overlay;
use crate::tui::scene::legend::{edge_lines, overlay_lines, sign};
use crate::tui::scene::scale::SHORT_BAR_WIDTH;
use crate::tui::screen::Screen;
use crate::tui::text::heading;
use crate::tui::theme::{ColourDepth, Rgb};

/// Returns the pane's lines.
pub fn lines(state: &GoalsState, screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = overlay_lines(state.scale(screen, SHORT_BAR_WIDTH), offers, screen, sign_of);
    lines.push(heading("signs"));
    let theme = &screen.theme;
    if let Some(space) = space(screen) {
        let text = format!("goal, and {} around it", short(space.spec().goal_radius));
        lines.push(sign(screen, 'G', theme.goal, &text));
    }
    lines.push(sign(screen, '@', theme.walker, "agent that reaches for it"));
    if screen.run().method.plans() {
        lines.push(heading("edges"));
        let count = |status| state.edge_count(status);
        lines.extend(edge_lines(screen, count, ["walked", "failed", "untried"]));
    }
    lines
}

/// Returns an overlay's sign.
fn sign_of(overlay: Overlay, screen: &Screen) -> Option<(char, Rgb)> {
    let theme = &screen.theme;
    let mono = theme.depth == ColourDepth::Mono;
    Some(match overlay {
        Overlay::Agents => (if mono { 'o' } else { '\u{25cf}' }, theme.frontier),
        Overlay::Candidates => (if mono { '.' } else { '\u{2022}' }, theme.cursor),
        Overlay::Edges => ('\u{2500}', theme.edges[0]),
        Overlay::Search => ('x', theme.search[1]),
        Overlay::Path => (if mono { '+' } else { '\u{2500}' }, theme.path),
        Overlay::Contours | Overlay::Directions | Overlay::Unexplored => return None,
    })
}
