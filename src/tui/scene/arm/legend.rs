//! The legend of the arm: colours, overlays and signs.

use ratatui::text::Line;

use super::{ArmState, offers};
use crate::tui::layers::Overlay;
use crate::tui::scene::legend::{edge_lines, overlay_lines, sign};
use crate::tui::scene::scale::SHORT_BAR_WIDTH;
use crate::tui::screen::Screen;
use crate::tui::text::heading;
use crate::tui::theme::{ColourDepth, Rgb, blend};
use gdg::env::Scene;

/// Returns the pane's lines.
pub fn lines(arm: &ArmState, screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = overlay_lines(arm.scale(screen, SHORT_BAR_WIDTH), offers, screen, sign_of);
    lines.push(heading("signs"));
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let of_depth = |of_mono: char, other: char| if mono { of_mono } else { other };
    let signs = [
        ('G', theme.goal, "goal, and 5 cm around it"),
        ('@', theme.walker, "grip of the arm"),
        (of_depth('O', '\u{25cf}'), theme.walker, "joints"),
        (of_depth('.', '\u{2500}'), theme.frontier, "region of goals"),
        (of_depth('=', '\u{2500}'), blend(theme.wall, theme.cursor, 0.3), "edge of the table"),
    ];
    lines.extend(signs.map(|(symbol, rgb, meaning)| sign(screen, symbol, rgb, meaning)));
    if matches!(&screen.snapshot.scene, Scene::Arm(scene) if scene.wall().is_some()) {
        lines.push(sign(screen, of_depth('#', '\u{2500}'), theme.edges[1], "the wall"));
    }
    if screen.run().method.plans() {
        lines.push(heading("edges"));
        lines.extend(edge_lines(
            screen,
            |status| arm.edge_count(status),
            ["walked", "failed", "untried"],
        ));
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
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (if mono { '+' } else { '\u{2500}' }, theme.path),
        Overlay::Contours | Overlay::Directions | Overlay::Unexplored => return None,
    })
}
