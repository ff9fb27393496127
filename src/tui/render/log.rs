//! The log, latest entry last.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::DIM;
use super::text::{clock, short};
use crate::tui::screen::Screen;

/// Draws as many entries as fit, wrapped; scrolling moves by half the height.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let width = usize::from(area.width).saturating_sub(2).max(8);
    let mut lines: Vec<Line> = Vec::new();
    for entry in screen.log.entries() {
        let when = format!(" {} at {}", clock(entry.seconds), short(entry.updates as f64));
        lines.push(Line::from(Span::styled(when, DIM)));
        lines.extend(wrapped(&entry.text, width).into_iter().map(|text| Line::from(format!("  {text}"))));
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

/// Wraps text between words, or within words that are too long.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut rest: Vec<char> = word.chars().collect();
        while !rest.is_empty() {
            let line = lines.last_mut().expect("there is always a line");
            let used = line.chars().count();
            let gap = usize::from(used > 0);
            if used + gap + rest.len() <= width {
                line.extend(std::iter::repeat_n(' ', gap).chain(rest.drain(..)));
            } else if used == 0 {
                line.extend(rest.drain(..width));
            } else {
                lines.push(String::new());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn text_wraps_between_words_and_within_long_ones() {
        assert_eq!(wrapped("saved a/b at update 12", 10), ["saved a/b", "at update", "12"]);
        assert_eq!(wrapped("abcdefghijkl m", 5), ["abcde", "fghij", "kl m"]);
    }
}
