//! Edges of the bridge graph: those that agents have walked along or failed to, near the cursor if
//! there are many.

use super::MazeState;
use crate::tui::canvas::{Canvas, Pen};
use crate::tui::raster::MapFrame;
use crate::tui::screen::Screen;
use gdg::bridge::EdgeStatus;
use gdg::viewer::ShownEdge;

/// The most edges drawn: more of them would hide the map.
pub const MAX_EDGES: usize = 300;

/// Number of opacity levels by which edges fade with distance from the cursor, and the lowest
/// level.
const FADES: usize = 5;
const LEAST_OPACITY: f32 = 0.2;

/// Opacity of walked and of failed edges.
const WALKED_OPACITY: f32 = 0.85;
const FAILED_OPACITY: f32 = 0.9;

/// Draws the edges.
pub fn draw(canvas: &mut Canvas, map_frame: &MapFrame, maze: &MazeState, screen: &Screen) {
    let [walked, failed, _] = screen.theme.edges;
    for (status, opacity, edges) in groups(map_frame, maze) {
        let (rgb, mark) =
            if status == EdgeStatus::Confirmed { (walked, '=') } else { (failed, 'x') };
        // Each group is blended with the ground only once.
        canvas.lines(map_frame, edges.into_iter(), Pen { rgb, share: opacity, mark });
    }
}

/// Edges with the same record and opacity: their ends.
type Group = (EdgeStatus, f32, Vec<[[f32; 2]; 2]>);

/// Returns the ends of edges by record and opacity, in the order in which they are drawn: the
/// nearest go on top, and failed ones over walked ones.
pub fn groups(map_frame: &MapFrame, maze: &MazeState) -> Vec<Group> {
    let edges = shown(maze, map_frame.raster.window);
    let fades = if edges.len() < MAX_EDGES { 1 } else { FADES };
    let chunk = edges.len().div_ceil(fades).max(1);
    let mut groups = Vec::new();
    for (n, edges) in edges.chunks(chunk).enumerate().collect::<Vec<_>>().into_iter().rev() {
        let fade = 1.0 - (1.0 - LEAST_OPACITY) * n as f32 / fades as f32;
        for (status, opacity) in
            [(EdgeStatus::Confirmed, WALKED_OPACITY), (EdgeStatus::Demoted, FAILED_OPACITY)]
        {
            let own = edges.iter().filter(|(_, own)| *own == status).map(|(ends, _)| *ends);
            groups.push((status, fade * opacity, own.collect()));
        }
    }
    groups
}

/// Returns the walked and failed edges within `window` (left, top, width, height) that are nearest
/// to the cursor, the mouse or else the goal, nearest first.
fn shown(maze: &MazeState, [left, top, width, height]: [f32; 4]) -> Vec<ShownEdge> {
    let [x, y] = maze.inspecting.or(maze.hovered).unwrap_or(maze.goal).centre();
    let middle = |[a, b]: [[f32; 2]; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
    let off = |edge: &ShownEdge| {
        let at = middle(edge.0);
        (at[0] - x).hypot(at[1] - y)
    };
    let inside = |edge: &ShownEdge| {
        let at = middle(edge.0);
        at[0] >= left && at[1] >= top && at[0] <= left + width && at[1] <= top + height
    };
    let tried = maze.view.edges.iter().filter(|edge| edge.1 != EdgeStatus::Untried && inside(edge));
    let mut edges: Vec<ShownEdge> = tried.copied().collect();
    if edges.len() > MAX_EDGES {
        edges.select_nth_unstable_by(MAX_EDGES, |a, b| off(a).total_cmp(&off(b)));
        edges.truncate(MAX_EDGES);
    }
    edges.sort_by(|a, b| off(a).total_cmp(&off(b)));
    edges
}
