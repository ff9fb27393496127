//! Smooth drawing on pixels: lines, discs, letters.

use gdg::draw::{TextPixel, paint_text, text_size};
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap,
    PixmapPaint, PremultipliedColorU8, Stroke, Transform,
};

use super::theme::Rgb;

/// Height of capitals and digits, as a share of the text height.
const CAPITAL_SHARE: f32 = 0.62;

/// Pixels to draw on.
#[derive(Clone)]
pub struct Sheet(pub Pixmap);

/// A colour and its opacity from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Ink(pub Rgb, pub f32);

impl Ink {
    fn paint(self) -> Paint<'static> {
        let Self((r, g, b), opacity) = self;
        let mut paint = Paint { anti_alias: true, ..Paint::default() };
        paint.set_color(Color::from_rgba8(
            r,
            g,
            b,
            (255.0 * opacity.clamp(0.0, 1.0)).round() as u8,
        ));
        paint
    }
}

impl Sheet {
    /// Creates a black sheet; `None` if the size is empty or too large.
    pub fn new((width, height): (u32, u32)) -> Option<Self> {
        let mut pixmap = Pixmap::new(width, height)?;
        pixmap.fill(Color::BLACK);
        Some(Self(pixmap))
    }

    /// Returns the colour of a pixel, if it is on the sheet.
    pub fn colour(&self, x: i32, y: i32) -> Option<Rgb> {
        let pixel = self.0.pixel(u32::try_from(x).ok()?, u32::try_from(y).ok()?)?;
        Some((pixel.red(), pixel.green(), pixel.blue()))
    }

    /// Draws a line through `points`, smooth around its corners if it `is_curved`.
    pub fn line(&mut self, points: &[[f32; 2]], is_curved: bool, width: f32, ink: Ink) {
        let Some(path) = path(points, is_curved) else { return };
        let stroke = Stroke {
            width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        self.0.stroke_path(&path, &ink.paint(), &stroke, Transform::identity(), None);
    }

    /// Fills a polygon.
    pub fn polygon(&mut self, corners: &[[f32; 2]], ink: Ink) {
        let Some(path) = path(corners, false) else { return };
        self.0.fill_path(&path, &ink.paint(), FillRule::Winding, Transform::identity(), None);
    }

    /// Fills a rectangle given by its left, top, right and bottom.
    pub fn rectangle(&mut self, [left, top, right, bottom]: [f32; 4], ink: Ink) {
        if let Some(area) = tiny_skia::Rect::from_ltrb(left, top, right, bottom) {
            self.0.fill_rect(area, &ink.paint(), Transform::identity(), None);
        }
    }

    /// Fills a rectangle given by its left, top, right and bottom, rounded to whole pixels: faster,
    /// for thousands of small ones.
    pub fn tint(&mut self, [left, top, right, bottom]: [f32; 4], Ink((r, g, b), opacity): Ink) {
        let (width, height) = (self.0.width() as usize, self.0.height() as usize);
        let span = |from: f32, to: f32, size: usize| {
            (from.round().max(0.0) as usize).min(size)..(to.round().max(0.0) as usize).min(size)
        };
        for y in span(top, bottom, height) {
            span(left, right, width).for_each(|x| self.blend(y * width + x, [r, g, b], opacity));
        }
    }

    /// Fills a disc. Faster than a path: there may be thousands.
    pub fn disc(&mut self, [x, y]: [f32; 2], radius: f32, Ink((r, g, b), opacity): Ink) {
        let (width, height) = (self.0.width() as i32, self.0.height() as i32);
        let span = |at: f32, size: i32| {
            ((at - radius - 0.5).floor() as i32).max(0)
                ..((at + radius + 1.5).ceil() as i32).min(size)
        };
        for row in span(y, height) {
            for column in span(x, width) {
                let off = (column as f32 + 0.5 - x).hypot(row as f32 + 0.5 - y);
                let share = opacity * (radius + 0.5 - off).clamp(0.0, 1.0);
                if share > 0.0 {
                    self.blend((row * width + column) as usize, [r, g, b], share);
                }
            }
        }
    }

    /// Mixes a colour into a pixel.
    fn blend(&mut self, i: usize, rgb: [u8; 3], share: f32) {
        for (old, new) in self.0.data_mut()[4 * i..4 * i + 3].iter_mut().zip(rgb) {
            *old = (f32::from(*old) + share * (f32::from(new) - f32::from(*old)) + 0.5) as u8;
        }
    }

    /// Writes a line of text with its middle at a point, `height` pixels high, rotated by an angle
    /// in rad.
    pub fn text(
        &mut self,
        text: &str,
        [x, y]: [f32; 2],
        height: f32,
        angle: f32,
        is_bold: bool,
        ink: Ink,
    ) {
        let [columns, rows] = text_size(text, is_bold);
        let Some(mut written) = Pixmap::new(columns as u32, rows as u32) else { return };
        let Ink((r, g, b), opacity) = ink;
        paint_text(text, is_bold, |TextPixel { column, row, coverage }| {
            let alpha = (opacity * f32::from(coverage)) as u8;
            let of = |channel: u8| (u16::from(channel) * u16::from(alpha) / 255) as u8;
            let pixel = PremultipliedColorU8::from_rgba(of(r), of(g), of(b), alpha);
            if let (Some(to), Some(pixel)) =
                (written.pixels_mut().get_mut(row * columns + column), pixel)
            {
                *to = pixel;
            }
        });
        let scale = height / rows as f32;
        let transform = Transform::from_translate(-(columns as f32) / 2.0, -(rows as f32) / 2.0)
            .post_scale(scale, scale)
            .post_rotate(angle.to_degrees())
            .post_translate(x, y);
        // Keep unscaled, unrotated text crisp.
        let quality = if scale == 1.0 && angle == 0.0 {
            FilterQuality::Nearest
        } else {
            FilterQuality::Bilinear
        };
        let paint = PixmapPaint { quality, ..PixmapPaint::default() };
        self.0.draw_pixmap(0, 0, written.as_ref(), &paint, transform, None);
    }

    /// Draws a letter on a disc.
    pub fn badge(&mut self, letter: char, at: [f32; 2], radius: f32, ground: Rgb, letters: Rgb) {
        self.disc(at, radius + 1.5, Ink(letters, 0.8));
        self.disc(at, radius, Ink(ground, 1.0));
        let height = 1.3 * radius / CAPITAL_SHARE;
        self.text(&letter.to_string(), at, height, 0.0, true, Ink(letters, 1.0));
    }

    /// Draws an arrow around a point, in a direction of length 1.
    pub fn arrow(
        &mut self,
        [x, y]: [f32; 2],
        [dx, dy]: [f32; 2],
        length: f32,
        width: f32,
        ink: Ink,
    ) {
        let (half, head) = (0.5 * length, 0.4 * length);
        let along = |by: f32, aside: f32| [x + by * dx - aside * dy, y + by * dy + aside * dx];
        let tip = along(half, 0.0);
        self.line(&[along(-half, 0.0), along(half - 0.5 * head, 0.0)], false, width, ink);
        self.polygon(&[tip, along(half - head, 0.5 * head), along(half - head, -0.5 * head)], ink);
    }
}

/// Returns the length of `text` in pixels if it is `height` pixels high.
pub fn text_width(text: &str, height: f32) -> f32 {
    let [columns, rows] = text_size(text, false);
    height / rows as f32 * columns as f32
}

/// Returns the path through `points`; a curved one passes through the middles between them instead.
fn path(points: &[[f32; 2]], is_curved: bool) -> Option<Path> {
    let [first, .., last] = points else { return None };
    let mut builder = PathBuilder::with_capacity(points.len() + 1, points.len() + 1);
    builder.move_to(first[0], first[1]);
    for ends in points[1..].windows(2) {
        let [x, y] = ends[0];
        if is_curved {
            builder.quad_to(x, y, 0.5 * (x + ends[1][0]), 0.5 * (y + ends[1][1]));
        } else {
            builder.line_to(x, y);
        }
    }
    builder.line_to(last[0], last[1]);
    builder.finish()
}
