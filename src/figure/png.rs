//! A sheet as pixels.

use miette::{IntoDiagnostic, Report, miette};
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap,
    PixmapPaint, PremultipliedColorU8, Stroke, Transform,
};
use ttf_parser::OutlineBuilder;

use super::letters;
use super::sheet::{Mark, Sheet};
use gdg::draw::{Picture, Rgb};

/// Pixels an inch.
const RESOLUTION: f32 = 300.0;

/// Returns the file.
///
/// # Errors
/// The sheet is too large, or cannot be encoded.
pub fn encode(sheet: &Sheet) -> Result<Vec<u8>, Report> {
    let scale = RESOLUTION / 72.0;
    let [width, height] = sheet.size.map(|length| (scale * length).ceil() as u32);
    let mut pixmap =
        Pixmap::new(width, height).ok_or_else(|| miette!("the figure is too large for a PNG"))?;
    pixmap.fill(Color::WHITE);
    let zoom = Transform::from_scale(scale, scale);
    for mark in &sheet.marks {
        paint(&mut pixmap, mark, zoom);
    }
    let mut picture = Picture::new((width as usize, height as usize), (255, 255, 255));
    // The background is opaque, so premultiplication changes nothing.
    let pixels = pixmap.pixels().iter().map(|pixel| (pixel.red(), pixel.green(), pixel.blue()));
    picture.pixels_mut().iter_mut().zip(pixels).for_each(|(to, from)| *to = from);
    picture.to_png("gdg-tui plot").into_diagnostic()
}

fn paint(pixmap: &mut Pixmap, mark: &Mark, zoom: Transform) {
    match mark {
        Mark::Line { points, width, colour } => {
            let (line_cap, line_join) = (LineCap::Round, LineJoin::Round);
            let stroke = Stroke { width: *width, line_cap, line_join, ..Stroke::default() };
            if let Some(path) = path(points, false) {
                pixmap.stroke_path(&path, &ink(*colour, 1.0), &stroke, zoom, None);
            }
        }
        Mark::Area { points, colour, opacity } => {
            if let Some(path) = path(points, true) {
                pixmap.fill_path(&path, &ink(*colour, *opacity), FillRule::Winding, zoom, None);
            }
        }
        Mark::Text(text) => {
            let mut pen = Pen(PathBuilder::new());
            letters::outline(text, &mut pen);
            if let Some(path) = pen.0.finish() {
                pixmap.fill_path(&path, &ink(text.colour, 1.0), FillRule::Winding, zoom, None);
            }
        }
        Mark::Picture { at, size, picture } => {
            let (columns, rows) = picture.size();
            let Some(mut pixels) = Pixmap::new(columns as u32, rows as u32) else { return };
            for (to, (r, g, b)) in pixels.pixels_mut().iter_mut().zip(picture.pixels()) {
                *to = PremultipliedColorU8::from_rgba(*r, *g, *b, u8::MAX).unwrap_or(*to);
            }
            let place = zoom
                .pre_translate(at[0], at[1])
                .pre_scale(size[0] / columns as f32, size[1] / rows as f32);
            // Cells of maps keep their edges.
            let paint = PixmapPaint { quality: FilterQuality::Nearest, ..PixmapPaint::default() };
            pixmap.draw_pixmap(0, 0, pixels.as_ref(), &paint, place, None);
        }
    }
}

fn ink((r, g, b): Rgb, opacity: f32) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, (255.0 * opacity).round() as u8);
    paint
}

fn path(points: &[[f32; 2]], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 { path.move_to(*x, *y) } else { path.line_to(*x, *y) }
    }
    if closed {
        path.close();
    }
    path.finish()
}

struct Pen(PathBuilder);

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}
