//! The minimap: the whole map in a corner while only a part of it is shown.

use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::style::Style;
use ratatui::widgets::{Block, Clear};

use super::MazeState;
use super::key::shown_goal;
use super::map::ground_style;
use crate::tui::canvas::Canvas;
use crate::tui::layout::ScreenLayout;
use crate::tui::marker::Marker;
use crate::tui::raster::{MapFrame, Viewport};
use crate::tui::theme::{Theme, blend};

/// Maximum columns and rows of the minimap, which takes at most 1 / `PANE_DIVISOR` of the pane's
/// width and height.
const MAX_SIZE: (u16, u16) = (24, 10);
const PANE_DIVISOR: u16 = 3;

/// Draws the minimap in a corner of `area`: the upper right one, unless it would hide the goal or
/// the cursor there.
pub fn draw(
    frame: &mut Frame,
    area: Rect,
    maze: &MazeState,
    layout: &mut ScreenLayout,
    theme: &Theme,
) {
    let Some(shown) = layout.map.as_ref().filter(|_| maze.viewport.zoom > 1.0) else {
        return;
    };
    let room = Rect {
        width: MAX_SIZE.0.min(area.width / PANE_DIVISOR),
        height: MAX_SIZE.1.min(area.height / PANE_DIVISOR),
        ..area
    };
    let inner =
        Rect { width: room.width.saturating_sub(2), height: room.height.saturating_sub(2), ..area };
    let Some(map_frame) = MapFrame::fit(inner, &maze.map, Marker::Quadrant, Viewport::default())
    else {
        return;
    };
    let (width, height) = (map_frame.area.width + 2, map_frame.area.height + 2);
    let (right, bottom) =
        (area.right().saturating_sub(width), area.bottom().saturating_sub(height));
    let corners = [(right, area.y), (area.x, area.y), (right, bottom), (area.x, bottom)];
    let corners = corners.map(|(x, y)| Rect { x, y, width, height });
    let goal = shown_goal(maze);
    let seen = [Some(goal), maze.inspecting, maze.editor.cursor].into_iter().flatten();
    let seen: Vec<Position> = seen.filter_map(|cell| shown.character_of(cell.centre())).collect();
    let outer = corners
        .into_iter()
        .find(|corner| !seen.iter().any(|at| corner.contains(*at)))
        .unwrap_or(corners[0]);
    let map_frame =
        MapFrame { area: Rect { x: outer.x + 1, y: outer.y + 1, ..map_frame.area }, ..map_frame };
    let mut canvas = Canvas::new(&map_frame);
    let [left, top, columns, rows] = shown.raster.window;
    for i in 0..canvas.len() {
        let (column, row) = (i % canvas.columns(), i / canvas.columns());
        let [.., width, height] = map_frame.raster.window;
        let x = (column as f32 + 0.5) / map_frame.raster.pixels.0 as f32 * width;
        let y = (row as f32 + 0.5) / map_frame.raster.pixels.1 as f32 * height;
        let inside = x >= left && x < left + columns && y >= top && y < top + rows;
        let (rgb, mark) = ground_style(map_frame.raster.ground(&maze.map, column, row), theme);
        let lit = rgb.map(|rgb| if inside { blend(rgb, theme.walker, 0.5) } else { rgb });
        canvas.set(i, lit, if inside && mark == ' ' { '.' } else { mark });
    }
    frame.render_widget(Clear, outer);
    frame.render_widget(Block::bordered().style(Style::new()), outer);
    canvas.paint(frame.buffer_mut(), &map_frame, theme);
    layout.minimap = Some(map_frame);
}
