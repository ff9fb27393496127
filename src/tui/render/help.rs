//! The help: every key, and what the map shows.

use ratatui::Frame;
use ratatui::layout::{Constraint, Flex, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};

use crate::tui::action::BINDINGS;
use crate::tui::app::App;
use crate::tui::colour::{self, Depth, Rgb};

/// Draws the overlay in the middle of `area`.
pub fn draw(frame: &mut Frame, area: Rect, app: &App) {
    let key = Style::new().add_modifier(Modifier::BOLD);
    let mut lines: Vec<Line> = BINDINGS
        .iter()
        .filter(|b| !b.long.is_empty())
        .map(|b| Line::from(vec![Span::styled(format!(" {:>10}  ", b.shown), key), Span::raw(b.long)]))
        .collect();
    lines.push(Line::default());
    lines.extend(legend(app.depth));
    let height = (lines.len() as u16 + 2).min(area.height);
    let [row] = Layout::vertical([Constraint::Length(height)]).flex(Flex::Center).areas(area);
    let [overlay] = Layout::horizontal([Constraint::Length(66.min(area.width))]).flex(Flex::Center).areas(row);
    frame.render_widget(Clear, overlay);
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(" help ")), overlay);
}

fn legend(depth: Depth) -> Vec<Line<'static>> {
    let sign = |rgb: Rgb, text: &'static str| Span::styled(text, Style::new().fg(depth.colour(rgb)));
    let entry = |sign: Span<'static>, meaning: &'static str| {
        Line::from(vec![Span::raw("         "), sign, Span::raw("  "), Span::raw(meaning)])
    };
    let field = match depth {
        Depth::Mono => "\u{b7} joins places equally far by the distance named above",
        _ => "colour: the distance named above, light near, dark far;",
    };
    let mut lines = vec![Line::raw(format!(" {field}"))];
    if depth != Depth::Mono {
        lines.push(Line::raw(" lines join places equally far from the goal"));
    }
    lines.push(entry(sign(colour::GOAL, " G"), "the goal"));
    lines.push(entry(sign(colour::WALKER, " @"), "an agent that walks there as well as it can by now"));
    lines.push(entry(sign(colour::PATH, " +"), "the path it plans, through bridge points"));
    lines
        .push(entry(sign(colour::AGENT, if depth == Depth::Mono { " o" } else { " \u{2580}" }), "agents that explore"));
    lines.push(entry(Span::raw(if depth == Depth::Mono { " :" } else { " \u{b7}" }), "bridge candidates"));
    lines
}
