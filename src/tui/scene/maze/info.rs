//! The line below the map: facts about a cell, or what the colours mean.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::MazeState;
use crate::tui::action::Action;
use crate::tui::layout::ScreenLayout;
use crate::tui::scene::scale::{BAR_WIDTH, SHORT_BAR_WIDTH};
use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::text::{fitted_line, short};
use crate::tui::theme::ColourDepth;

/// Draws the line.
pub fn draw(
    frame: &mut Frame,
    area: Rect,
    maze: &MazeState,
    screen: &Screen,
    layout: &ScreenLayout,
) {
    let cell = maze.inspecting.or(maze.hovered);
    let width = usize::from(area.width);
    let line =
        if cell.is_some() { cell_facts(width, maze) } else { meaning(width, maze, screen, layout) };
    frame.render_widget(Paragraph::new(fitted_line(line, area.width)), area);
}

/// Explains colours, pixels and lines, with the texts and the bar that fit into `width`.
fn meaning(
    width: usize,
    maze: &MazeState,
    screen: &Screen,
    layout: &ScreenLayout,
) -> Line<'static> {
    let [long, short] = scaled_down_texts(screen, layout);
    let interval = contour_text(screen, layout);
    let texts =
        [[&*interval, &*long], [&interval, &short], [&interval, ""], [&long, ""], [&short, ""]]
            .map(|texts| texts.concat());
    let bars = || (SHORT_BAR_WIDTH..=BAR_WIDTH).rev();
    let options = texts.iter().flat_map(|text| bars().map(move |bar| (text, bar)));
    let lines = options.map(|(text, bar)| {
        let mut line = maze.scale(screen, bar);
        // Without a bar, a blank ends the line.
        let text =
            if line.to_string().ends_with(' ') { text.trim_start_matches(", ") } else { text };
        line.push_span(Span::styled(text.to_owned(), DIM));
        line
    });
    lines
        .into_iter()
        .find(|line| line.width() <= width)
        .unwrap_or_else(|| maze.scale(screen, SHORT_BAR_WIDTH))
}

/// Describes the cell under the cursor or the mouse, with as many facts as fit into `width`: walls
/// and D first.
fn cell_facts(width: usize, maze: &MazeState) -> Line<'static> {
    let Some(cell) = maze.inspecting.or(maze.hovered) else { return Line::default() };
    let place = format!("{},{}", cell.x, cell.y);
    if !maze.map.is_free(cell) {
        return Line::from(format!(" cell {place}: wall"));
    }
    let Some(facts) = maze.view.inspected.filter(|facts| facts.cell == cell) else {
        return Line::from(format!(" cell {place}"));
    };
    let learned = facts.learned;
    let visits = facts
        .visits
        .map_or(String::new(), |visits| format!(", {} visits", short(f64::from(visits))));
    let (what, visits) = match facts.truth {
        // There is no relative error of zero steps.
        Some(0) => (format!("D {learned:.1}, true 0 ({learned:+.1} steps)"), visits),
        Some(truth) => {
            let error = 100.0 * (learned - truth as f32) / truth as f32;
            (format!("D {learned:.1}, true {truth} ({error:+.0} %)"), visits)
        }
        None => (format!("D {learned:.1}, no path to G"), String::new()),
    };
    let texts = [format!(" cell {place}: {what}{visits}"), format!(" {place}: {what}{visits}")]
        .map(Line::from);
    texts
        .into_iter()
        .find(|line| line.width() <= width)
        .unwrap_or_else(|| Line::from(format!(" {place}: {what}")))
}

/// Describes how many cells a dot of the map shows, if several, in a long and a short form.
fn scaled_down_texts(screen: &Screen, layout: &ScreenLayout) -> [String; 2] {
    let cells = layout.map.as_ref().map_or(0.0, |map| match screen.picture_character() {
        Some(character) => 1.0 / (map.scale() * f32::from(character.0)),
        None => map.raster.cells_per_pixel(),
    });
    let short = format!(", 1 dot = {cells:.1} cells");
    let key = screen.keymap.key_of(Action::ZoomIn);
    match cells > 1.01 {
        true if screen.on_paper => [short.clone(), short],
        true => [format!("{short} ({key} zooms in)"), short],
        false => Default::default(),
    }
}

/// Describes the contour interval, if contour lines are shown.
fn contour_text(screen: &Screen, layout: &ScreenLayout) -> String {
    let interval = layout.contour_interval.filter(|_| screen.theme.depth != ColourDepth::Mono);
    interval.map_or_else(String::new, |interval| format!(", a line every {interval:.0}"))
}
