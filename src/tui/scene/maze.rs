//! Mazes, seen from above.

mod act;
mod candidates;
mod edges;
mod editor;
mod edits;
pub mod info;
mod key;
mod legend;
pub mod map;
pub mod minimap;
mod mouse;
mod picture;
mod unexplored;
mod walk;

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::Rect;

use crate::tui::layout::ScreenLayout;
use crate::tui::raster::Viewport;
use crate::tui::screen::Screen;
pub use editor::Editor;
use gdg::map::{Cell, Grid};
use gdg::viewer::MazeView;
pub use key::shown_goal;
pub use legend::lines as legend_lines;
pub use map::Cache;
pub use walk::lines as walk_lines;

/// What the screen shows of a maze.
pub struct MazeState {
    /// The map as the user last edited it; the trainer follows.
    pub map: Arc<Grid>,
    /// The map as it is in a file: as it was opened, or saved last.
    pub kept_map: Arc<Grid>,
    /// The map editor.
    pub editor: Editor,
    /// The view shown.
    pub view: Arc<MazeView>,
    /// The goal that distances are measured to.
    pub goal: Cell,
    /// The cursor whose cell is described.
    pub inspecting: Option<Cell>,
    /// The cell under the mouse.
    pub hovered: Option<Cell>,
    /// The visible part of the map.
    pub viewport: Viewport,
}

impl MazeState {
    /// Creates the state that shows `map`.
    pub fn new(map: Arc<Grid>) -> Self {
        Self {
            kept_map: map.clone(),
            map,
            editor: Editor::default(),
            view: Arc::default(),
            goal: Cell::new(0, 0),
            inspecting: None,
            hovered: None,
            viewport: Viewport::default(),
        }
    }
}

/// Draws the map and everything on it into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    [map, info]: [Rect; 2],
    screen: &Screen,
    layout: &mut ScreenLayout,
    cache: &mut Cache,
) {
    map::draw(frame, map, screen, layout, cache);
    minimap::draw(frame, map, screen, layout);
    info::draw(frame, info, screen, layout);
}
