//! Mazes, seen from above.

mod act;
mod editor;
mod map;
mod mouse;
mod texts;

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::legend::scale;
use crate::tui::action::Action;
use crate::tui::layout::ScreenLayout;
use crate::tui::raster::Viewport;
use crate::tui::screen::Screen;
pub use act::{maze_on, place_walker};
pub use editor::Editor;
use gdg::map::{Cell, Grid};
use gdg::train::FilmFrame;
use gdg::viewer::{Field, MazeView};
pub use map::{Cache, shown_goal};
pub use texts::{legend_lines, walk_lines};

/// The state of a maze on the screen.
pub struct MazeState {
    /// The map as the user last edited it; the trainer follows.
    pub map: Arc<Grid>,
    /// The map as last opened or saved.
    pub kept_map: Arc<Grid>,
    pub editor: Editor,
    pub view: Arc<MazeView>,
    /// The goal that distances are measured to.
    pub goal: Cell,
    /// The cursor whose cell is described.
    pub inspecting: Option<Cell>,
    pub hovered: Option<Cell>,
    pub viewport: Viewport,
    /// The mouse position the map is being dragged from.
    dragged_from: Option<Position>,
    /// The goal request, and the cells cut off from it, that the user has been warned of.
    warned_of: Option<(u64, Arc<Vec<bool>>)>,
}

impl MazeState {
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
            dragged_from: None,
            warned_of: None,
        }
    }

    /// Returns the frame of the film that is shown: the viewer's latest, to avoid flicker.
    pub fn past(&self) -> Option<&FilmFrame> {
        self.view.past.as_deref()
    }

    /// Returns the field that the colours show: for the past, only D is available.
    pub fn shown_field(&self, screen: &Screen) -> Field {
        if self.past().is_some() { Field::Learned } else { screen.field }
    }

    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        self.view.farthest.max(1.0)
    }

    /// Returns the largest value that the colours show.
    pub fn farthest(&self, screen: &Screen) -> f32 {
        self.own_farthest().max(screen.least_farthest)
    }

    /// Returns the colour scale with a bar of `bar` characters.
    pub fn scale(&self, screen: &Screen, bar: usize) -> Line<'static> {
        scale(&screen.theme, self.shown_field(screen), self.farthest(screen), bar)
            .unwrap_or_else(|| Line::raw(format!(" {NOUN} only ")))
    }
}

/// The word for what is drawn.
pub const NOUN: &str = "map";

pub const INTRODUCTION: &str = "Colours show the learned distance D to the goal G: light near, \
     dark far. The agents see no walls and get no reward. @ walks to G with what it has learned \
     so far; click on the map to set another goal. The editor draws walls and closes doors.";

/// Returns whether an action applies to a maze: all but those that turn the view.
pub fn offers(action: Action) -> bool {
    !matches!(action, Action::Projection | Action::Alone)
}

/// Draws the map and everything on it into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    [area, info]: [Rect; 2],
    maze: &MazeState,
    screen: &Screen,
    layout: &mut ScreenLayout,
    cache: &mut Cache,
) {
    map::draw(frame, area, maze, screen, layout, cache);
    texts::draw_info(frame, info, maze, screen, layout);
}
