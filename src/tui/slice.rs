//! Which part of a space of goals is shown, and where on the screen.

use ratatui::layout::{Constraint, Position, Rect};

use super::marker::Marker;
use super::raster::MapFrame;
use gdg::draw::Raster;
use gdg::viewer::goals::Slice;

/// Two components of goals, and their pixels on the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownSlice {
    pub frame: MapFrame,
    pub slice: Slice,
}

impl ShownSlice {
    /// Fits `ranges` of the components `axes`, to the right and upwards, into `area`: to scale for
    /// positions, otherwise filling it. Returns `None` without room.
    pub fn fit(
        area: Rect,
        axes: [usize; 2],
        ranges: [[f32; 2]; 2],
        to_scale: bool,
        marker: Marker,
    ) -> Option<Self> {
        if area.is_empty() {
            return None;
        }
        let [across, up] = ranges.map(|[low, high]| high - low);
        // A character is twice as high as wide.
        let (columns, rows) = (f32::from(area.width), 2.0 * f32::from(area.height));
        let stretch = if to_scale { 1.0 } else { rows / columns * across / up };
        let scale = (columns / across).min(rows / (stretch * up));
        let side = |length: f32, most: u16| {
            Constraint::Length(((length * scale).round() as u16).clamp(1, most))
        };
        let area = area.centered(side(across, area.width), side(stretch * up / 2.0, area.height));
        let marker = if marker.wants_pixels() { Marker::Quadrant } else { marker };
        let per_character = marker.pixels();
        let pixels =
            (usize::from(area.width) * per_character.0, usize::from(area.height) * per_character.1);
        let (width, height) = (f32::from(area.width) / scale, 2.0 * f32::from(area.height) / scale);
        let [x, y] = ranges.map(|[low, high]| f32::midpoint(low, high));
        let window = [x - width / 2.0, -stretch * y - height / 2.0, width, height];
        let raster = Raster { window, pixels };
        let slice = Slice { axes, stretch, raster };
        Some(Self { frame: MapFrame { area, raster, marker }, slice })
    }

    /// Returns `near` with both components as they are shown at a screen position.
    pub fn point_at(&self, at: Position, near: &[f32]) -> Vec<f32> {
        self.slice.point(self.frame.middle_of(at), near)
    }
}
