//! The parts that all legends share.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::text::heading;
use crate::tui::theme::{Rgb, Theme};
use gdg::bridge::EdgeStatus;

/// Returns the overlays that are available.
pub fn overlays(offers: impl Fn(Action) -> bool) -> impl Iterator<Item = Overlay> {
    Overlay::ALL.into_iter().filter(move |overlay| offers(Action::Toggle(*overlay)))
}

/// Returns the colour scale, and a line for each available overlay with its sign.
pub fn overlay_lines(
    scale: Line<'static>,
    offers: impl Fn(Action) -> bool,
    screen: &Screen,
    sign_of: impl Fn(Overlay, &Screen) -> Option<(char, Rgb)>,
) -> Vec<Line<'static>> {
    let mut lines = vec![scale, heading("toggle by key or click")];
    for overlay in overlays(offers) {
        let key = screen.keymap.key_of(Action::Toggle(overlay));
        let shown = screen.overlays.has(overlay);
        let mut line = Line::from(vec![
            Span::raw(format!(" {key:<2}")),
            Span::raw(if shown { "[x] " } else { "[ ] " }),
        ]);
        line.push_span(Span::styled(overlay.name(), if shown { Style::new() } else { DIM }));
        if let Some((sign, rgb)) = sign_of(overlay, screen) {
            line.extend([Span::raw(" "), sample(screen, sign, rgb)]);
        }
        lines.push(line);
    }
    lines
}

/// Returns the numbers of walked, failed and untried edges, each followed by its text in
/// `meanings`.
pub fn edge_lines(
    screen: &Screen,
    count: impl Fn(EdgeStatus) -> usize,
    meanings: [&'static str; 3],
) -> impl Iterator<Item = Line<'static>> {
    let kinds =
        [EdgeStatus::Confirmed, EdgeStatus::Demoted, EdgeStatus::Untried].into_iter().zip(meanings);
    kinds.zip(screen.theme.edges).map(move |((status, name), rgb)| {
        sign(screen, '\u{2500}', rgb, &format!("{} {name}", count(status)))
    })
}

/// Returns a sign and its meaning.
pub fn sign(screen: &Screen, sign: char, rgb: Rgb, meaning: &str) -> Line<'static> {
    Line::from(vec![Span::raw(" "), sample(screen, sign, rgb), Span::raw(format!(" {meaning}"))])
}

/// Returns a sign in its colour.
pub fn sample(screen: &Screen, sign: char, rgb: Rgb) -> Span<'static> {
    let Theme { page, wall, .. } = &screen.theme;
    let style = Style::new().fg(screen.theme.colour(rgb));
    // Use the map's wall colour as a ground, since it is darker than a light page.
    let is_faint = page.is_some_and(|(_, ground)| distance(rgb, ground) < FAINT);
    Span::styled(
        sign.to_string(),
        if is_faint { style.bg(screen.theme.colour(*wall)) } else { style },
    )
}

/// Signs closer to the page's colour than this, summed over the channels, get another ground.
const FAINT: u32 = 150;

fn distance((r, g, b): Rgb, other: Rgb) -> u32 {
    [(r, other.0), (g, other.1), (b, other.2)].iter().map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
}
