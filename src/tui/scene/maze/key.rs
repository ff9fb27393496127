//! The inputs that map and field are drawn from, to tell whether a drawing is up to date.

use std::sync::Arc;

use super::MazeState;
use super::unexplored::Unexplored;
use crate::tui::layers::Overlays;
use crate::tui::layout::ScreenLayout;
use crate::tui::raster::MapFrame;
use crate::tui::screen::Screen;
use crate::tui::theme::ThemeName;
use gdg::draw::{Ground, Raster};
use gdg::map::{Cell, Grid};
use gdg::viewer::maze::{Exploration, film_goal};

/// The inputs that map and field are drawn from.
pub struct Key {
    map_frame: MapFrame,
    theme: ThemeName,
    overlays: Overlays,
    map: Arc<Grid>,
    /// The field, if it has been computed.
    pub field: Option<Arc<Vec<f32>>>,
    farthest: f32,
    least_contour_interval: f32,
    exploration: Arc<Exploration>,
    cut_off: Arc<Vec<bool>>,
    is_past: bool,
}

impl Key {
    pub fn new(map_frame: &MapFrame, maze: &MazeState, screen: &Screen) -> Self {
        Self {
            map_frame: map_frame.clone(),
            theme: screen.theme.name,
            overlays: screen.overlays,
            map: maze.map.clone(),
            field: Self::field_on(&map_frame.raster, maze, screen).cloned(),
            farthest: maze.farthest(screen),
            least_contour_interval: screen.least_contour_interval,
            exploration: maze.view.exploration.clone(),
            cut_off: maze.view.cut_off.clone(),
            is_past: maze.past().is_some(),
        }
    }

    /// Returns whether place and map match.
    pub fn same_place(&self, map_frame: &MapFrame, maze: &MazeState) -> bool {
        self.map_frame == *map_frame && Arc::ptr_eq(&self.map, &maze.map)
    }

    /// Returns whether place and style match.
    pub fn same_style(&self, map_frame: &MapFrame, maze: &MazeState, screen: &Screen) -> bool {
        let same_style = self.theme == screen.theme.name && self.overlays == screen.overlays;
        self.same_place(map_frame, maze) && same_style
    }

    /// Returns the field for `raster`, if it has been computed.
    pub fn field_on<'a>(
        raster: &Raster,
        maze: &'a MazeState,
        screen: &'a Screen,
    ) -> Option<&'a Arc<Vec<f32>>> {
        let view = &maze.view;
        (view.raster == Some(*raster) && (view.past.is_some() || view.kind == screen.field))
            .then_some(&view.field)
    }

    /// Returns whether a drawing from this is up to date.
    pub fn is_current(&self, map_frame: &MapFrame, maze: &MazeState, screen: &Screen) -> bool {
        let same_field = match (&self.field, Self::field_on(&map_frame.raster, maze, screen)) {
            (Some(own), Some(now)) => Arc::ptr_eq(own, now),
            (own, now) => own.is_none() && now.is_none(),
        };
        let same_exploration = Arc::ptr_eq(&self.exploration, &maze.view.exploration)
            && Arc::ptr_eq(&self.cut_off, &maze.view.cut_off);
        let same_time = self.is_past == maze.past().is_some();
        let scale = |farthest: f32, interval: f32| (farthest.to_bits(), interval.to_bits());
        let same_scale = scale(self.farthest, self.least_contour_interval)
            == scale(maze.farthest(screen), screen.least_contour_interval);
        self.same_style(map_frame, maze, screen)
            && same_field
            && same_scale
            && same_exploration
            && same_time
    }
}

/// Records the contour interval, which would be `own` outside of a comparison.
pub fn show_interval(own: Option<f32>, screen: &Screen, layout: &mut ScreenLayout) {
    (layout.own_contour_interval, layout.contour_interval) = (own, shown_interval(own, screen));
}

/// Returns the contour interval to show, given the interval `own` outside of a comparison.
pub fn shown_interval(own: Option<f32>, screen: &Screen) -> Option<f32> {
    own.map(|own| own.max(screen.least_contour_interval))
}

/// Returns the field with NaN where contour lines are not wanted: at walls within pixels, which
/// they would follow as distances jump there, and where values mean nothing.
pub fn open_field(field: &[f32], grounds: &[Ground], unexplored: &Unexplored) -> Vec<f32> {
    let is_open = |i: usize| matches!(grounds[i], Ground::Free(_)) && !unexplored.hides(i);
    field.iter().enumerate().map(|(i, value)| if is_open(i) { *value } else { f32::NAN }).collect()
}

/// Returns the goal that distances are shown to.
pub fn shown_goal(maze: &MazeState) -> Cell {
    let past = maze.past().and_then(|frame| film_goal(frame, &maze.map));
    past.unwrap_or(maze.goal)
}
