//! Placement of the map on the screen, and the visible part of it; parallel projections of spaces of
//! goals, defined by a direction to the right and one upwards.

use std::f32::consts::{FRAC_PI_2, TAU};

use ratatui::layout::{Constraint, Layout, Position, Rect};

use super::choices::Marker;
use gdg::draw::Raster;
use gdg::map::{Cell, Grid};
use gdg::viewer::Plane;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewport {
    /// Magnification compared to showing the whole map; 1 for the whole map.
    pub zoom: f32,
    /// The position in the middle, if only a part is shown.
    pub centre: [f32; 2],
}

impl Default for Viewport {
    fn default() -> Self {
        Self { zoom: 1.0, centre: [0.0; 2] }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct MapFrame {
    pub area: Rect,
    pub raster: Raster,
    pub marker: Marker,
}

impl MapFrame {
    /// Fits the part of the map that `view` shows into `area`.
    pub fn fit(area: Rect, map: &Grid, marker: Marker, view: Viewport) -> Option<Self> {
        if area.width == 0 || area.height == 0 {
            return None;
        }
        let (width, height) = (map.width() as f32, map.height() as f32);
        // A character is twice as high as wide.
        let fitting = (f32::from(area.width) / width).min(2.0 * f32::from(area.height) / height);
        // A whole number of half blocks per cell looks best, if it costs little room.
        let whole = fitting >= 1.0 && fitting.floor() >= 0.9 * fitting;
        let scale = view.zoom * if whole { fitting.floor() } else { fitting };
        let columns = ((width * scale).round() as u16).clamp(1, area.width);
        let rows = ((height * scale / 2.0).ceil() as u16).clamp(1, area.height);
        let per_character = marker.resolved(scale).pixels();
        let pixels = (usize::from(columns) * per_character.0, usize::from(rows) * per_character.1);
        let shown = [f32::from(columns) / scale, 2.0 * f32::from(rows) / scale];
        let shown = if view.zoom > 1.0 { shown } else { [width, shown[1]] };
        // Stay within the map.
        let from =
            |middle: f32, shown: f32, all: f32| (middle - shown / 2.0).min(all - shown).max(0.0);
        let [x, y] = view.centre;
        let window = if view.zoom > 1.0 {
            [from(x, shown[0], width), from(y, shown[1], height), shown[0], shown[1]]
        } else {
            [0.0, 0.0, shown[0], shown[1]]
        };
        let area = Rect {
            x: area.x + (area.width - columns) / 2,
            y: area.y + (area.height - rows) / 2,
            width: columns,
            height: rows,
        };
        Some(Self { area, raster: Raster { window, pixels }, marker: marker.resolved(scale) })
    }

    pub fn scale(&self) -> f32 {
        f32::from(self.area.width) / self.raster.window[2]
    }

    pub fn character_of(&self, at: [f32; 2]) -> Option<Position> {
        let (column, row) = self.raster.pixel_of(at)?;
        let (across, down) = self.marker.pixels();
        let [x, y] = [column / across, row / down].map(|at| at as u16);
        Some(Position::new(self.area.x + x, self.area.y + y))
    }

    /// Returns the position on the map at the middle of a character.
    pub fn middle_of(&self, at: Position) -> [f32; 2] {
        let [left, top, width, height] = self.raster.window;
        let share = |i: u16, n: u16| (f32::from(i) + 0.5) / f32::from(n);
        [
            left + share(at.x.saturating_sub(self.area.x), self.area.width) * width,
            top + share(at.y.saturating_sub(self.area.y), self.area.height) * height,
        ]
    }

    /// Returns all cells that a character shows: at least one, or none outside the map.
    pub fn cells_at(&self, at: Position, map: &Grid) -> Vec<Cell> {
        let Some(middle) = self.cell_at(at, map) else { return Vec::new() };
        let [left, top, width, height] = self.raster.window;
        // Cells whose centres lie within the character.
        let span = |i: u16, n: u16, from: f32, size: f32, max: usize, middle: usize| {
            let at = |i: u16| (from + f32::from(i) / f32::from(n) * size + 0.5).max(0.0) as usize;
            let (first, end) = (at(i), at(i + 1).min(max));
            if first < end { first..end } else { middle..middle + 1 }
        };
        let xs = span(at.x - self.area.x, self.area.width, left, width, map.width(), middle.x);
        let ys = span(at.y - self.area.y, self.area.height, top, height, map.height(), middle.y);
        ys.flat_map(|y| xs.clone().map(move |x| Cell::new(x, y))).collect()
    }

    pub fn cell_at(&self, at: Position, map: &Grid) -> Option<Cell> {
        if !self.area.contains(at) {
            return None;
        }
        let [x, y] = self.middle_of(at);
        Some(Cell::new((x as usize).min(map.width() - 1), (y as usize).min(map.height() - 1)))
    }
}

/// The region shown without zoom, in metres: arm, table and goals.
const WORKSPACE: [[f32; 3]; 2] = [[0.62, 0.33, 0.3], [1.66, 1.17, 1.12]];

/// Share of the extent that keeps the workspace's corners in view from every side. The free
/// projection shows only this much, since the arm is in the middle.
const FREE_SHARE: f32 = 0.8;

/// The smallest area in characters that has room for all projections.
const ALL_SIZE: (u16, u16) = (66, 28);

/// A direction to look from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Angle {
    /// From the robot's right: x to the right, z up.
    #[default]
    Side,
    /// From in front of it: y to the right, z up.
    Front,
    /// From above: x to the right, y up.
    Top,
    Free,
}

impl Angle {
    pub const ALL: [Self; 4] = [Self::Side, Self::Front, Self::Top, Self::Free];

    #[must_use]
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }

    /// Returns its name, with the axes to the right and up.
    pub fn name(self) -> &'static str {
        match self {
            Self::Side => "side x\u{2192} z\u{2191}",
            Self::Front => "front y\u{2192} z\u{2191}",
            Self::Top => "top x\u{2192} y\u{2191}",
            Self::Free => "free",
        }
    }

    fn orbit(self, free: Orbit) -> Orbit {
        match self {
            Self::Side => Orbit { yaw: -FRAC_PI_2, pitch: 0.0 },
            Self::Front => Orbit { yaw: 0.0, pitch: 0.0 },
            Self::Top => Orbit { yaw: -FRAC_PI_2, pitch: FRAC_PI_2 },
            Self::Free => free,
        }
    }
}

/// The viewing direction in rad: yaw from the front, and pitch above the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    pub yaw: f32,
    pub pitch: f32,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { yaw: -0.9, pitch: 0.45 }
    }
}

impl Orbit {
    /// Turns by angles in rad; the eye stays between the floor's plane and the zenith.
    pub fn turn(&mut self, yaw: f32, pitch: f32) {
        self.yaw = (self.yaw + yaw).rem_euclid(TAU);
        self.pitch = (self.pitch + pitch).clamp(0.0, FRAC_PI_2);
    }

    /// Returns the directions to the right and upwards.
    fn axes(self) -> [[f32; 3]; 2] {
        let ((sy, cy), (sp, cp)) = (self.yaw.sin_cos(), self.pitch.sin_cos());
        [[-sy, cy, 0.0], [-sp * cy, -sp * sy, cp]]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Magnification compared to showing everything, at least 1.
    pub zoom: f32,
    /// The point in the middle, in metres.
    pub focus: [f32; 3],
}

impl Default for Camera {
    fn default() -> Self {
        let [low, high] = WORKSPACE;
        Self { zoom: 1.0, focus: std::array::from_fn(|i| f32::midpoint(low[i], high[i])) }
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub struct ShownAngles {
    /// The chosen projection: arrow keys move the goal in its plane.
    pub angle: Angle,
    /// Whether it is shown alone even if there is room for others.
    pub alone: bool,
    pub orbit: Orbit,
    /// The part that all projections show.
    pub camera: Camera,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// Where the eye is, unless two components of goals are shown.
    pub angle: Option<Angle>,
    pub frame: MapFrame,
    /// Directions and pixels for the viewer.
    pub plane: Plane,
}

impl Projection {
    /// Shows what is around `middle`, in characters whose width is 1 / `scale` of the plane's unit.
    fn around(
        area: Rect,
        angle: Option<Angle>,
        [across, up]: [Vec<f32>; 2],
        ([x, y], scale, stretch): ([f32; 2], f32, f32),
        marker: Marker,
    ) -> Self {
        // A character is twice as high as wide.
        let (width, height) = (f32::from(area.width) / scale, 2.0 * f32::from(area.height) / scale);
        let marker = if marker.wants_pixels() { Marker::Quadrant } else { marker };
        let (right, down) = marker.pixels();
        let pixels = (usize::from(area.width) * right, usize::from(area.height) * down);
        let raster = Raster { window: [x - width / 2.0, y - height / 2.0, width, height], pixels };
        let plane = Plane { raster, across, up, stretch };
        Self { angle, frame: MapFrame { area, raster, marker }, plane }
    }

    /// Fits what an arm's camera shows into `area`; `None` without room.
    fn of_arm(area: Rect, angle: Angle, shown: &ShownAngles, marker: Marker) -> Option<Self> {
        let (orbit, camera) = (shown.orbit, shown.camera);
        let axes = angle.orbit(orbit).axes();
        let size = |direction: [f32; 3]| {
            (0..3).map(|i| (WORKSPACE[1][i] - WORKSPACE[0][i]) * direction[i].abs()).sum::<f32>()
        };
        let (columns, rows) = (f32::from(area.width), f32::from(area.height));
        let share = if angle == Angle::Free { FREE_SHARE } else { 1.0 };
        let scale = camera.zoom / share * (columns / size(axes[0])).min(2.0 * rows / size(axes[1]));
        let [x, up] = axes.map(|axis| (0..3).map(|i| camera.focus[i] * axis[i]).sum::<f32>());
        let axes = axes.map(|direction| direction.to_vec());
        let placed = ([x, -up], scale, 1.0);
        (!area.is_empty()).then(|| Self::around(area, Some(angle), axes, placed, marker))
    }

    /// Fits `ranges` of the components `axes` of goals of `count` numbers, to the right and upwards,
    /// into `area`: to scale for positions, otherwise filling it. Returns `None` without room.
    pub fn of_components(
        area: Rect,
        (axes, count): ([usize; 2], usize),
        ranges: [[f32; 2]; 2],
        to_scale: bool,
        marker: Marker,
    ) -> Option<Self> {
        if area.is_empty() {
            return None;
        }
        let [across, up] = ranges.map(|[low, high]| high - low);
        let (columns, rows) = (f32::from(area.width), 2.0 * f32::from(area.height));
        let stretch = if to_scale { 1.0 } else { rows / columns * across / up };
        let scale = (columns / across).min(rows / (stretch * up));
        let side = |length: f32, most: u16| {
            Constraint::Length(((length * scale).round() as u16).clamp(1, most))
        };
        let area = area.centered(side(across, area.width), side(stretch * up / 2.0, area.height));
        let [x, y] = ranges.map(|[low, high]| f32::midpoint(low, high));
        let unit = |axis: usize| (0..count).map(|i| f32::from(u8::from(i == axis))).collect();
        // Goals of a single number are on a line.
        let up = if axes[0] == axes[1] { vec![0.0; count] } else { unit(axes[1]) };
        let placed = ([x, -stretch * y], scale, stretch);
        Some(Self::around(area, None, [unit(axes[0]), up], placed, marker))
    }

    /// Returns the place at a screen position, at the depth of `near`.
    pub fn point_at(&self, at: Position, near: &[f32]) -> Vec<f32> {
        self.plane.point(self.frame.middle_of(at), near)
    }
}

pub fn has_room(area: Rect) -> bool {
    area.width >= ALL_SIZE.0 && area.height >= ALL_SIZE.1
}

/// Places the projections of an arm: all of them in the quarters of `area`, or the chosen one alone.
pub fn arrange(area: Rect, shown: &ShownAngles, marker: Marker) -> Vec<Projection> {
    let fit = |area: Rect, angle: Angle| Projection::of_arm(area, angle, shown, marker);
    if shown.alone || !has_room(area) {
        return fit(area, shown.angle).into_iter().collect();
    }
    let halves = |area: Rect, layout: Layout| layout.spacing(1).areas::<2>(area);
    let rows = halves(area, Layout::vertical([Constraint::Fill(1); 2]));
    let areas = rows.map(|row| halves(row, Layout::horizontal([Constraint::Fill(1); 2])));
    let all = areas.into_iter().flatten().zip(Angle::ALL);
    all.filter_map(|(area, angle)| fit(area, angle)).collect()
}
