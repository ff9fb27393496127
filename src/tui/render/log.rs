//! The log, latest entry last.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::text::{clock, short, wrapped};

/// Draws as many entries as fit, wrapped; scrolling moves by half the height.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let width = usize::from(area.width).saturating_sub(2).max(8);
    let mut lines: Vec<Line> = Vec::new();
    for entry in screen.log.entries() {
        let when = format!(" {} at {}", clock(entry.seconds), short(entry.updates as f64));
        lines.push(Line::from(Span::styled(when, DIM)));
        lines.extend(
            wrapped(&entry.text, width).into_iter().map(|text| Line::from(format!("  {text}"))),
        );
    }
    if lines.is_empty() {
        lines.push(Line::styled(" no events yet", DIM));
    }
    let height = usize::from(area.height);
    let most = lines.len().saturating_sub(height);
    let back = (screen.scrolled * (height / 2).max(1)).min(most);
    let from = most - back;
    frame.render_widget(Paragraph::new(lines.split_off(from)), area);
}
