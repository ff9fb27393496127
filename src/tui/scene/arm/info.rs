//! The line below the arm: what the colours mean.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Span;
use ratatui::widgets::Paragraph;

use crate::tui::layers::Overlay;
use crate::tui::render::DIM;
use crate::tui::render::scale::{BAR_WIDTH, scale};
use crate::tui::screen::Screen;

/// The most contour lines between the goal and the farthest point.
const MAX_CONTOURS: f32 = 8.0;

/// Draws the line.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let mut line = scale(screen, BAR_WIDTH);
    let interval = contours(screen).filter(|text| line.width() + text.len() <= usize::from(area.width));
    line.extend(interval.map(|text| Span::styled(text, DIM)));
    frame.render_widget(Paragraph::new(line), area);
}

/// Returns the steps between two contour lines if the farthest point is `farthest` steps away.
pub fn contour_steps(farthest: f32) -> f32 {
    [1.0, 2.0, 5.0, 10.0, 20.0, 50.0].into_iter().find(|steps| farthest / steps <= MAX_CONTOURS).unwrap_or(100.0)
}

fn contours(screen: &Screen) -> Option<String> {
    let shown = screen.field.is_distance() && screen.overlays.has(Overlay::Contours);
    shown.then(|| format!(", a line every {:.0}", contour_steps(screen.farthest())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_few_contour_lines_but_some() {
        assert_eq!([1.0, 8.0, 9.0, 30.0, 200.0, 1e9].map(contour_steps), [1.0, 1.0, 2.0, 5.0, 50.0, 100.0]);
    }
}
