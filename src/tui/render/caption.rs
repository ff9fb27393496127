//! The caption of the guided tour: a box beside what it explains, never over it.

use ratatui::layout::{Position, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Paragraph};

use super::ScreenPainter;
use crate::tui::action::Action;
use crate::tui::characters::{put, put_letter};
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::pane_text::wrapped;
use crate::tui::scene::MazeState;
use crate::tui::screen::ShownStep;
use crate::tui::theme::{BOLD, ColourDepth, REVERSED};

/// Widths of the box that are tried, in columns, and what border and padding take.
const WIDTHS: [u16; 4] = [40, 34, 30, 48];
const MARGIN_COLUMNS: u16 = 4;
const MARGIN_ROWS: u16 = 2;

const TRIES: u16 = 60;

/// Costs of covering a character of the subject, and of covering goal or agent, in rows of distance.
const COVERED_COST: f32 = 1000.0;
const HIDDEN_COST: f32 = 30.0;

/// Draws the caption into the map's `area`, and its signs on the map.
pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let (Some(tour), Some(map_frame)) = (&screen.tour, &layout.map) else { return };
    let (theme, buffer) = (&screen.theme, frame.buffer_mut());
    for (at, sign) in &tour.caption.marks {
        match map_frame.character_of(*at) {
            Some(at) if sign.is_alphabetic() => put_letter(buffer, at, *sign, theme.cursor, theme),
            Some(at) => put(buffer, at, *sign, None, theme),
            None => {}
        }
    }
    let characters = |positions: &[[f32; 2]]| {
        positions.iter().filter_map(|at| map_frame.character_of(*at)).collect::<Vec<_>>()
    };
    let mut subject = characters(&tour.caption.subject);
    subject.dedup();
    let goal_and_agent = |maze: &MazeState| [Some(maze.goal.centre()), maze.walker()];
    let others = scene.maze().map(goal_and_agent).into_iter().flatten().flatten();
    let others = characters(&others.collect::<Vec<_>>());
    let Some(place) = place(area, tour, &subject, &others, screen.layout.tour) else { return };
    layout.tour = Some((tour.step, place));
    draw_box(page, place, tour);
}

/// Returns the rows that the text takes in a box of `width` columns, border included.
fn rows(tour: &ShownStep, width: u16) -> u16 {
    wrapped(&tour.caption.text, usize::from(width - MARGIN_COLUMNS)).len() as u16 + MARGIN_ROWS
}

/// Returns the place of the box: unchanged while it does not cover the subject, otherwise the best.
fn place(
    area: Rect,
    tour: &ShownStep,
    subject: &[Position],
    others: &[Position],
    before: Option<(usize, Rect)>,
) -> Option<Rect> {
    if let Some((step, rect)) = before
        && step == tour.step
    {
        let now = Rect { height: rect.height.max(rows(tour, rect.width)), ..rect };
        if area.union(now) == area && !subject.iter().any(|at| now.contains(*at)) {
            return Some(now);
        }
    }
    let cost = |rect: Rect| {
        let covered = |of: &[Position]| of.iter().filter(|at| rect.contains(**at)).count() as f32;
        let gap = subject.first().map_or(0.0, |at| distance(rect, *at));
        COVERED_COST * covered(subject) + HIDDEN_COST * covered(others) + gap
    };
    let sizes = WIDTHS.into_iter().map(|width| (width, rows(tour, width)));
    let fitting = sizes.filter(|(width, rows)| *width <= area.width && *rows <= area.height);
    let stride = usize::from((area.width / TRIES).max(1));
    let places = fitting.flat_map(|(width, height)| {
        let xs = (area.x..=area.right() - width).step_by(stride);
        xs.flat_map(move |x| {
            (area.y..=area.bottom() - height).map(move |y| Rect { x, y, width, height })
        })
    });
    places.map(|rect| (rect, cost(rect))).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(rect, _)| rect)
}

/// Returns the distance between a box and a character, in rows.
fn distance(rect: Rect, at: Position) -> f32 {
    let gap = |at: u16, from: u16, end: u16| {
        f32::from(from.saturating_sub(at)) + f32::from((at + 1).saturating_sub(end))
    };
    let (across, down) = (gap(at.x, rect.x, rect.right()), gap(at.y, rect.y, rect.bottom()));
    (across / 2.0).hypot(down)
}

fn draw_box(page: &mut ScreenPainter, area: Rect, tour: &ShownStep) {
    let ScreenPainter { frame, screen, layout, .. } = page;
    let title = Line::styled(format!(" {} ", tour.title), BOLD.patch(REVERSED));
    let border = match screen.theme.depth {
        ColourDepth::Mono => BOLD,
        _ => BOLD.fg(screen.theme.colour(screen.theme.cursor)),
    };
    let block = Block::bordered().border_style(border).title(title).padding(Padding::horizontal(1));
    let inner = block.inner(area);
    frame.render_widget(Clear, area);
    frame.render_widget(block, area);
    let lines: Vec<Line> =
        wrapped(&tour.caption.text, usize::from(inner.width)).into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(lines), inner);
    let mut keys = ClickableLine::default();
    let next = if tour.is_last { "done" } else { "next" };
    for (action, label) in [(Action::NextTourStep, next), (Action::EndTour, "end")] {
        let key = screen.keymap.key_of(action);
        keys.push(Span::styled(format!(" {key} {label} "), Style::new()), Click::Act(action));
    }
    let width = (keys.width() as u16).min(area.width.saturating_sub(2));
    let bar = Rect { x: area.right() - 1 - width, y: area.bottom() - 1, width, height: 1 };
    keys.draw(frame, bar, layout);
}
