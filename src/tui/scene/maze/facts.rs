//! Texts about a maze: about a cell, the scale, and in the legend.

use ratatui::text::Line;

use super::MazeState;
use crate::tui::layout::ScreenLayout;
use crate::tui::pane_text::short;
use crate::tui::scene::legend::{edge_lines, sign, signs};
use crate::tui::scene::overlays::{FRONTIER_SIGN, TRAIL_MARK};
use crate::tui::screen::Screen;
use crate::tui::theme::ColourDepth;
use gdg::map::Cell;

/// Describes the cell under the cursor or the mouse, walls and D first.
pub fn cell_facts(maze: &MazeState, cell: Cell) -> String {
    let place = format!("cell {},{}", cell.x, cell.y);
    if !maze.map.is_free(cell) {
        return format!(" {place}: wall");
    }
    let Some(facts) = maze.view.inspected.filter(|facts| facts.cell == cell) else {
        return format!(" {place}");
    };
    let learned = facts.learned;
    let visits = facts.visits.map(|visits| format!(", {} visits", short(f64::from(visits))));
    let visits = visits.unwrap_or_default();
    match facts.truth {
        // There is no relative error of zero steps.
        Some(0) => format!(" {place}: D {learned:.1}, true 0 ({learned:+.1} steps){visits}"),
        Some(truth) => {
            let error = 100.0 * (learned - truth as f32) / truth as f32;
            format!(" {place}: D {learned:.1}, true {truth} ({error:+.0} %){visits}")
        }
        None => format!(" {place}: D {learned:.1}, no path to G"),
    }
}

pub fn scaled_down_text(screen: &Screen, layout: &ScreenLayout) -> String {
    let cells = layout.map.as_ref().map_or(0.0, |map| match screen.picture_character() {
        Some(character) => 1.0 / (map.scale() * f32::from(character.0)),
        None => map.raster.cells_per_pixel(),
    });
    if cells > 1.01 { format!(", 1 dot = {cells:.1} cells") } else { String::new() }
}

pub fn legend(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let trail = (if mono { TRAIL_MARK } else { '\u{2500}' }, theme.walker, "trail of @");
    let pairs = [
        [('G', theme.goal, "goal"), ('S', theme.walker, "start of @")],
        [('@', theme.walker, "walks to G"), trail],
    ];
    let mut lines: Vec<Line> = pairs.iter().map(|pair| signs(screen, pair)).collect();
    if !maze.map.starts().is_empty() || !maze.map.goals().is_empty() {
        lines.push(sign(screen, 's', theme.cursor, "g: S and G of the file"));
    }
    if screen.run().method.bridges() {
        lines.push(sign(screen, FRONTIER_SIGN, theme.frontier, "frontier goals of agents"));
    }
    if maze.view.cut_off.contains(&true) {
        lines.push(sign(screen, '\\', theme.cursor, "hatched: no path to G"));
    }
    if !mono && !maze.view.exploration.is_complete(&maze.map) {
        lines.push(sign(screen, '\u{2500}', theme.frontier, "frontier of visited places"));
    }
    if screen.run().method.plans() {
        let graph = &maze.view.graph;
        let names = ["edges walked", "failed", "untried, not shown"];
        lines.extend(edge_lines(screen, graph, names));
    }
    lines
}
