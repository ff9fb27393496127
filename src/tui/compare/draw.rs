//! Draws the comparison.
//!
//! ```text
//! +---------------------------------------------------+
//! | map, seed, phase                                  |  header
//! | A method, preset        | B method, preset        |
//! | map          facts      | map          facts      |  facts: below if the map gains
//! | meaning of colours      | meaning of colours      |
//! | success over environment steps                    |  curves
//! | keys, or a notice                                 |  footer
//! +---------------------------------------------------+
//! ```

use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::text::Span;
use ratatui::widgets::{Block, Borders, Paragraph, Wrap};

use super::facts::{Fact, column, facts, text};
use super::{Comparison, Side, curves};
use crate::tui::action::{Action, Mode};
use crate::tui::app::App;
use crate::tui::dialog::Dialog;
use crate::tui::interface::Interface;
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::log::Notice;
use crate::tui::raster::{MapFrame, Viewport};
use crate::tui::render::{footer, help, paint_page};
use crate::tui::scene::maze::{info, map, minimap};
use crate::tui::style::{BOLD, DIM, REVERSED};
use crate::tui::text::fitted_lines;
use gdg::engine::Phase;

/// The smallest screen with room for everything, in columns and rows.
pub const MIN_SIZE: (u16, u16) = (60, 18);

/// Columns of the facts beside a map.
const FACTS_WIDTH: u16 = 19;

/// Rows of the curves: a share of the screen's, within limits.
const CURVES_DIVISOR: u16 = 4;
const CURVES_ROWS: (u16, u16) = (7, 16);

/// Shares of the width: of the larger side, and of the other one.
const LARGER: (u16, u16) = (2, 1);

/// Draws everything; returns where it is.
pub fn draw(frame: &mut Frame, comparison: &mut Comparison) -> ScreenLayout {
    let area = frame.area();
    let mut layout = ScreenLayout::new(area);
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        too_small(frame, area);
        return layout;
    }
    let rows = (area.height / CURVES_DIVISOR).clamp(CURVES_ROWS.0, CURVES_ROWS.1);
    let [head, body, below, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(rows),
        Constraint::Length(1),
    ])
    .areas(area);
    header(frame, head, comparison, &mut layout);
    let share = |side: usize| match comparison.larger {
        Some(larger) if larger == side => Constraint::Fill(LARGER.0),
        Some(_) => Constraint::Fill(LARGER.1),
        None => Constraint::Fill(1),
    };
    // Equally large sides show their maps in the same size.
    let gap = 1 + u16::from(comparison.larger.is_none() && body.width.is_multiple_of(2));
    let [left, line, right] =
        Layout::horizontal([share(0), Constraint::Length(gap), share(1)]).areas(body);
    frame.render_widget(Block::new().borders(Borders::LEFT), line);
    let areas = [left, right];
    let facts = [0, 1].map(|own| {
        let (arrived, races) = comparison.race.results(own);
        facts(&comparison.sides[own], arrived, races)
    });
    let texts = [0, 1].map(|own| text(&facts[own], areas[own].width));
    let most = texts.iter().map(Vec::len).max().unwrap_or(0);
    let mut drawn = [0, 1].map(|own| {
        layout.add(Rect { height: 1, ..areas[own] }, Click::Act(Action::Larger(own)));
        let rows = if comparison.larger.is_none() { most } else { texts[own].len() };
        draw_side(frame, areas[own], &mut comparison.sides[own], &facts[own], rows as u16)
    });
    curves::draw(frame, below, comparison, &mut layout);
    draw_footer(frame, foot, comparison, &mut layout);
    let App { screen, scene, .. } = &comparison.sides[0].app;
    if let Some(Dialog::Help(help)) = screen.dialogs.last() {
        help::draw_for_comparisons(frame, screen, scene, help, &mut drawn[0]);
    }
    paint_page(frame, &screen.theme);
    // The same lines on both sides, from the next frame on.
    let interval = drawn.iter().filter_map(|side| side.own_contour_interval).fold(0.0, f32::max);
    for (side, drawn) in comparison.sides.iter_mut().zip(drawn) {
        side.app.screen.least_contour_interval = interval;
        side.app.drawn(drawn);
    }
    layout
}

/// Draws a message that the screen is too small.
fn too_small(frame: &mut Frame, area: Rect) {
    let (width, height) = MIN_SIZE;
    let text = format!(
        "a comparison needs {width} x {height} characters: this terminal has {} x {}",
        area.width, area.height
    );
    let rows = (text.len() as u16).div_ceil(area.width.max(1)).min(area.height);
    let middle = area.centered_vertically(Constraint::Length(rows));
    frame.render_widget(
        Paragraph::new(text).wrap(Wrap { trim: true }).alignment(Alignment::Center),
        middle,
    );
}

fn header(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let side = training_side(comparison);
    let screen = &side.app.screen;
    let mut bar = ClickableLine::default();
    let act = |action| Some(Click::Act(action));
    bar.push(Span::styled(" gdg-tui compare ", BOLD.patch(REVERSED)), act(Action::Help));
    bar.push(Span::styled(format!(" {} ", side.maze().map.name()), BOLD), None);
    bar.push(Span::raw(format!("seed {} ", screen.run().seed)), None);
    let phase = if matches!(screen.snapshot.phase, Phase::Failed(_)) {
        "stopped".to_owned()
    } else {
        side.app.scene.phase(screen)
    };
    bar.push(Span::styled(format!(" {phase} "), BOLD), act(Action::TogglePause));
    bar.push(Span::styled(" nothing is saved", DIM), None);
    bar.draw(frame, area, layout);
}

/// Returns the side that shows whether training runs: one that trains, if any does.
fn training_side(comparison: &Comparison) -> &Side {
    let [a, b] = comparison.sides.each_ref();
    if b.app.is_training() && !a.app.is_training() { b } else { a }
}

/// Draws a side, with its facts beside the map or in as many rows below it; returns where the map
/// is.
fn draw_side(
    frame: &mut Frame,
    area: Rect,
    side: &mut Side,
    facts: &[Fact],
    rows: u16,
) -> ScreenLayout {
    let Side { app: App { screen, scene, .. }, title, cache, .. } = side;
    let mut layout = ScreenLayout::new(frame.area());
    let stopped = match &screen.snapshot.phase {
        Phase::Failed(error) => format!("stopped: {error} "),
        _ => String::new(),
    };
    let block =
        Block::new().borders(Borders::TOP).title(Span::styled(format!(" {title} {stopped}"), BOLD));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let [inner, meaning] =
        Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(inner);
    let beside =
        Layout::horizontal([Constraint::Min(0), Constraint::Length(FACTS_WIDTH)]).areas(inner);
    let below = Layout::vertical([Constraint::Min(0), Constraint::Length(rows)]).areas(inner);
    // The map as large as possible.
    let Some(maze) = scene.maze() else { return layout };
    let scale = |[room, _]: [Rect; 2]| {
        let frame = MapFrame::fit(room, &maze.map, screen.marker, Viewport::default());
        frame.map_or(0.0, |frame| frame.scale())
    };
    let ([room, known], lines) = if scale(beside) >= scale(below) {
        (beside, column(facts))
    } else {
        (below, text(facts, inner.width))
    };
    layout.map_pane = room;
    map::draw(frame, room, maze, screen, &mut layout, cache);
    minimap::draw(frame, room, maze, &mut layout, &screen.theme);
    frame.render_widget(Paragraph::new(fitted_lines(lines, known.width)), known);
    info::draw(frame, meaning, maze, screen, &layout);
    layout
}

/// Draws a notice, or the available actions and their keys.
fn draw_footer(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let App { screen, scene, .. } = &training_side(comparison).app;
    match comparison.notice() {
        Some((text, notice)) => {
            footer::draw_notice(frame, area, screen, Notice { text: &text, ..notice });
        }
        None => {
            footer::keys(screen, scene, Mode::Comparing, area.width, false)
                .draw(frame, area, layout);
        }
    }
}
