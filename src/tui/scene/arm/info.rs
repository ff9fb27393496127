//! The line below the arm: what the colours mean.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Span;
use ratatui::widgets::Paragraph;

use super::ArmState;
use crate::tui::layout::ScreenLayout;
use crate::tui::scene::scale::BAR_WIDTH;
use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::theme::ColourDepth;

/// Draws the line.
pub fn draw(frame: &mut Frame, area: Rect, arm: &ArmState, screen: &Screen, layout: &ScreenLayout) {
    let mut line = arm.scale(screen, BAR_WIDTH);
    let interval = layout.contour_interval.filter(|_| screen.theme.depth != ColourDepth::Mono);
    let interval = interval
        .map(|steps| format!(", a line every {steps:.0}"))
        .filter(|text| line.width() + text.len() <= usize::from(area.width));
    line.extend(interval.map(|text| Span::styled(text, DIM)));
    frame.render_widget(Paragraph::new(line), area);
}
