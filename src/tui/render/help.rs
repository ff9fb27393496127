//! The help: every action, and the legend of the map.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};

use super::{BOLD, DIM, middle};
use crate::tui::action::{Binding, Mode, SECTIONS, When};
use crate::tui::scene;
use crate::tui::screen::Screen;

/// Columns of the help, if no line needs more.
const HELP_WIDTH: u16 = 76;

/// Draws the help in the middle of `area`, from line `first` or early enough to fill it; returns the first line shown.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, first: usize) -> usize {
    let intro = screen.scene().introduction();
    draw_lines(frame, area, lines(screen, &intro, &[Mode::Watching, Mode::Editing, Mode::Offered]), first)
}

/// Draws a help of these lines like [`draw`].
fn draw_lines(frame: &mut Frame, area: Rect, lines: Vec<Line<'static>>, first: usize) -> usize {
    let widest = lines.iter().map(Line::width).max().unwrap_or(0) as u16;
    let dialog_area = middle(area, HELP_WIDTH.max(widest + 2), (lines.len() as u16 + 2).min(area.height));
    let height = usize::from(dialog_area.height.saturating_sub(2));
    let first = first.min(lines.len().saturating_sub(height));
    let more = lines.len() > height;
    let mut block = Block::bordered().title(" help ");
    if more {
        let last = (first + height).min(lines.len());
        block =
            block.title_bottom(format!(" {} to {last} of {}: arrows, PgUp, PgDn; Esc closes ", first + 1, lines.len()));
    }
    frame.render_widget(Clear, dialog_area);
    let shown: Vec<Line> = lines.into_iter().skip(first).take(height).collect();
    frame.render_widget(Paragraph::new(shown).block(block), dialog_area);
    first
}

/// Draws the help of comparisons like [`draw`].
pub fn draw_for_comparisons(frame: &mut Frame, area: Rect, screen: &Screen, first: usize) -> usize {
    let intro = [
        " Two methods train on the same map with the same seed, A and B. Colours show",
        " the distance D that each has learned; @ walks to G with what it has learned",
        " so far, in both from the same start. Click on either map to set the goal of",
        " both. Nothing is saved.",
    ];
    draw_lines(frame, area, lines(screen, &intro, &[Mode::Comparing]), first)
}

/// Returns the introduction, the bindings active in any of `modes`, and the legend.
fn lines(screen: &Screen, intro: &[&'static str], modes: &[Mode]) -> Vec<Line<'static>> {
    let kind = screen.scene();
    let mut lines: Vec<Line> = intro.iter().copied().map(Line::raw).collect();
    for section in SECTIONS {
        let active =
            |b: &&Binding| !b.long.is_empty() && kind.offers(b.action) && modes.iter().any(|mode| b.is_active(*mode));
        let mut bindings = section.bindings.iter().filter(active).peekable();
        if bindings.peek().is_none() {
            continue;
        }
        lines.push(Line::default());
        lines.push(Line::styled(format!(" {}", section.title), BOLD));
        for binding in bindings {
            let keys = screen.keymap.display_keys(binding).join(" ");
            let keys = if keys.is_empty() { screen.keymap.key_of(binding.action) } else { keys };
            let when = match binding.when {
                When::Editing => " (in the editor)",
                When::Offered => " (while it is offered)",
                When::Always | When::Watching | When::Comparing => "",
            };
            lines.push(Line::from(vec![
                Span::styled(format!(" {keys:>15}  "), BOLD),
                Span::raw(kind.wording(binding)),
                Span::styled(when, DIM),
            ]));
        }
    }
    lines.push(Line::default());
    lines.extend(scene::legend_lines(screen));
    if let Some(folder) = crate::logging::folder() {
        lines.push(Line::default());
        lines.push(Line::raw(format!(" Log files: {}", folder.display())));
    }
    lines
}
