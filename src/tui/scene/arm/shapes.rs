//! Lines, balls and boxes on the pixels of a projection.

use crate::tui::canvas::{Canvas, Pen};
use crate::tui::projection::Projection;
use crate::tui::theme::Rgb;
use gdg::env::fetch_reach::Corners;

/// The pixels of a projection.
pub struct Sketch<'a> {
    /// The pixels.
    pub canvas: Canvas,
    /// What they show.
    pub projection: &'a Projection,
}

impl<'a> Sketch<'a> {
    /// Creates an empty sketch.
    pub fn new(projection: &'a Projection) -> Self {
        Self { canvas: Canvas::new(&projection.frame), projection }
    }

    /// Returns the pixels whose middle is at most `radius` metres from the line between two points
    /// on the screen, and at least those that the line passes.
    fn near(&self, [from, to]: [[f32; 2]; 2], radius: f32) -> Vec<usize> {
        let raster = &self.projection.frame.raster;
        let [left, top, ..] = raster.window;
        let [width, height] = self.projection.pixel_size();
        // Half a pixel's larger side: thinner lines would have gaps.
        let radius = radius.max(0.5 * width.max(height));
        let span = |a: f32, b: f32, origin: f32, size: f32, count: usize| {
            let (low, high) = (a.min(b) - radius - origin, a.max(b) + radius - origin);
            ((low / size).floor().max(0.0) as usize)
                ..((high / size).ceil().clamp(0.0, count as f32) as usize)
        };
        let rows = span(from[1], to[1], top, height, raster.pixels.1);
        let columns = span(from[0], to[0], left, width, raster.pixels.0);
        let along = [to[0] - from[0], to[1] - from[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        let is_near = |row: usize, column: usize| {
            let at = [
                left + (column as f32 + 0.5) * width - from[0],
                top + (row as f32 + 0.5) * height - from[1],
            ];
            let share = if squared > 0.0 {
                ((at[0] * along[0] + at[1] * along[1]) / squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (at[0] - share * along[0]).hypot(at[1] - share * along[1]) <= radius
        };
        rows.flat_map(|row| columns.clone().map(move |column| (row, column)))
            .filter(|(row, column)| is_near(*row, *column))
            .map(|(row, column)| row * raster.pixels.0 + column)
            .collect()
    }

    /// Draws a rod with round ends, `radius` metres thick.
    pub fn rod(&mut self, ends: [[f32; 3]; 2], radius: f32, rgb: Rgb, mark: char) {
        for i in self.near(ends.map(|end| self.projection.flat(end)), radius) {
            self.canvas.set(i, Some(rgb), mark);
        }
    }

    /// Draws a ball.
    pub fn ball(&mut self, at: [f32; 3], radius: f32, rgb: Rgb, mark: char) {
        self.rod([at, at], radius, rgb, mark);
    }

    /// Draws the outline of a ball.
    pub fn circle(&mut self, at: [f32; 3], radius: f32, rgb: Rgb, mark: char) {
        let middle = self.projection.flat(at);
        let corners = (circumference(radius) / self.projection.pixel_size()[0])
            .ceil()
            .clamp(12.0, 720.0) as usize;
        for n in 0..corners {
            let (sin, cos) = (std::f32::consts::TAU * n as f32 / corners as f32).sin_cos();
            self.canvas.dot(
                &self.projection.frame,
                [middle[0] + radius * cos, middle[1] + radius * sin],
                rgb,
                mark,
            );
        }
    }

    /// Draws thin lines.
    pub fn lines(&mut self, lines: impl Iterator<Item = [[f32; 3]; 2]>, pen: Pen) {
        let flat = lines.map(|ends| ends.map(|end| self.projection.flat(end))).collect::<Vec<_>>();
        self.canvas.lines(&self.projection.frame, flat.into_iter(), pen);
    }
}

fn circumference(radius: f32) -> f32 {
    std::f32::consts::TAU * radius
}

/// Returns the twelve edges of a box.
pub fn edges(corners: Corners) -> impl Iterator<Item = [[f32; 3]; 2]> {
    let corner = move |n: usize| -> [f32; 3] { std::array::from_fn(|i| corners[n >> i & 1][i]) };
    let pairs =
        (0..8usize).flat_map(|n| (0..3).map(move |i| (n, n | 1 << i))).filter(|(a, b)| a != b);
    pairs.map(move |(a, b)| [corner(a), corner(b)])
}
