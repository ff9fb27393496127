//! The line below the map: facts about a cell, or what the colours mean.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::render::DIM;
use crate::tui::render::scale::{BAR_WIDTH, SHORT_BAR_WIDTH, scale};
use crate::tui::render::text::short;
use crate::tui::screen::Screen;
use crate::tui::theme::ColourDepth;
use crate::view::contour_interval;

/// Draws the line.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, layout: &ScreenLayout) {
    let cell = screen.maze.inspecting.or(screen.maze.hovered);
    let line = if cell.is_some() {
        cell_facts(screen)
    } else {
        let width = usize::from(area.width);
        let scaled = scaled_down_texts(screen, layout);
        let shortest = scaled.last().map_or(0, String::len);
        let mut line = scale(screen, BAR_WIDTH);
        if line.width() + shortest > width {
            line = scale(screen, SHORT_BAR_WIDTH);
        }
        let used = line.width();
        let scaled = scaled.into_iter().find(|text| used + text.len() <= width);
        for text in scaled.into_iter().chain(contour_text(screen)) {
            if line.width() + text.len() <= width {
                line.push_span(Span::styled(text, DIM));
            }
        }
        line
    };
    frame.render_widget(Paragraph::new(line), area);
}

fn cell_facts(screen: &Screen) -> Line<'static> {
    let Some(cell) = screen.maze.inspecting.or(screen.maze.hovered) else { return Line::default() };
    let place = format!(" cell {},{}", cell.x, cell.y);
    if !screen.maze.map.is_free(cell) {
        return Line::from(format!("{place}: wall"));
    }
    let Some(facts) = screen.maze.view.inspected.filter(|facts| facts.cell == cell) else { return Line::from(place) };
    let (learned, visits) = (facts.learned, short(f64::from(facts.visits)));
    Line::from(match facts.truth {
        Some(truth) => {
            let error = 100.0 * (learned - truth as f32) / (truth as f32).max(1.0);
            format!("{place}: D {learned:.1}, true {truth} ({error:+.0} %), {visits} visits")
        }
        None => format!("{place}: D {learned:.1}, no path to G"),
    })
}

/// Says how many cells a dot of the map shows, if it shows several: at length, and in short.
fn scaled_down_texts(screen: &Screen, layout: &ScreenLayout) -> Vec<String> {
    let cells = layout.map.as_ref().map_or(0.0, |map| map.raster.cells_per_pixel());
    let short = format!(", 1 dot = {cells:.1} cells");
    let key = screen.keymap.key_of(Action::ZoomIn);
    if cells > 1.01 { vec![format!("{short}: {key} zooms in"), short] } else { Vec::new() }
}

/// Returns the distance between contour lines, if they are shown.
fn contour_text(screen: &Screen) -> Option<String> {
    let shown = screen.field.is_distance() && screen.overlays.has(Overlay::Contours);
    let shown = shown && screen.theme.depth != ColourDepth::Mono;
    shown.then(|| format!(", a line every {:.0}", contour_interval(screen.maze.view.farthest.max(1.0))))
}
