//! Which part of a space of goals is shown, and where on the screen.

use ratatui::layout::{Constraint, Position, Rect};

use super::marker::Marker;
use super::raster::MapFrame;
use gdg::draw::Raster;
use gdg::viewer::goals::Slice;

/// Two components of goals, and their pixels on the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownSlice {
    /// The pixels.
    pub frame: MapFrame,
    /// What they show.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_click_gives_the_place_that_is_shown_there() {
        let ranges = [[-2.0, 6.0], [100.0, 101.0]];
        for to_scale in [true, false] {
            let area = Rect::new(3, 2, 60, 20);
            let shown =
                ShownSlice::fit(area, [2, 0], ranges, to_scale, Marker::Auto).expect("room");
            assert_eq!(shown.frame.area == area, !to_scale, "only without a scale it is filled");
            let place = [100.3, 7.0, 5.0];
            let at = shown.frame.character_of(shown.slice.flat(&place)).expect("in view");
            let back = shown.point_at(at, &[0.0, 7.0, 0.0]);
            let most = if to_scale { 0.3 } else { 0.06 };
            assert!(
                (back[0] - place[0]).abs() < most && (back[2] - place[2]).abs() < 0.1,
                "{back:?}"
            );
            assert_eq!(back[1], 7.0, "what is not shown stays");
        }
    }
}
