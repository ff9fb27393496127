//! A plotters backend that draws smooth pixels, with a font of its own: no font of the system is
//! needed.

use std::convert::Infallible;

use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

use gdg::draw::{Picture, Rgb, TextPixel, has_letter, paint_text, text_size};

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Draws `pictures` at their upper left corners on a white background, and on top what `paint`
/// draws; `None` if the size is empty or too large.
pub fn draw<'p, E>(
    (width, height): (u32, u32),
    pictures: impl Iterator<Item = (&'p Picture, (i32, i32))>,
    paint: impl FnOnce(Canvas) -> Result<(), E>,
) -> Option<Result<Picture, E>> {
    let mut pixmap = Pixmap::new(width, height)?;
    pixmap.fill(Color::WHITE);
    let mut canvas = Canvas(&mut pixmap);
    pictures.for_each(|(picture, at)| canvas.put(picture, at));
    if let Err(error) = paint(canvas) {
        return Some(Err(error));
    }
    let mut picture = Picture::new((width as usize, height as usize), (255, 255, 255));
    // The background is opaque, so premultiplication changes nothing.
    let pixels = pixmap.pixels().iter().map(|pixel| (pixel.red(), pixel.green(), pixel.blue()));
    picture.pixels_mut().iter_mut().zip(pixels).for_each(|(to, from)| *to = from);
    Some(Ok(picture))
}

/// What plotters draws on.
pub struct Canvas<'a>(&'a mut Pixmap);

impl Canvas<'_> {
    /// Copies a picture with its upper left corner at (`left`, `top`).
    fn put(&mut self, picture: &Picture, (left, top): (i32, i32)) {
        let columns = picture.size().0;
        for (i, pixel) in picture.pixels().iter().enumerate() {
            self.blend(left + (i % columns) as i32, top + (i / columns) as i32, *pixel, 1.0);
        }
    }

    /// Mixes a colour into a pixel, unless it lies outside.
    fn blend(&mut self, x: i32, y: i32, colour: Rgb, share: f64) {
        let (width, height) = (self.0.width() as i32, self.0.height() as i32);
        if !(0..width).contains(&x) || !(0..height).contains(&y) {
            return;
        }
        let at = 4 * (y * width + x) as usize;
        let mix = |old: u8, new: u8| {
            (f64::from(old) + share * (f64::from(new) - f64::from(old))).round() as u8
        };
        for (old, new) in
            self.0.data_mut()[at..at + 3].iter_mut().zip([colour.0, colour.1, colour.2])
        {
            *old = mix(*old, new);
        }
    }

    fn fill(&mut self, path: Option<Path>, colour: BackendColor) {
        if let Some(path) = path {
            self.0.fill_path(&path, &paint(colour), FillRule::Winding, Transform::identity(), None);
        }
    }

    fn stroke(&mut self, path: Option<Path>, colour: BackendColor, width: u32) {
        let stroke = Stroke {
            width: width as f32,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        if let Some(path) = path {
            self.0.stroke_path(&path, &paint(colour), &stroke, Transform::identity(), None);
        }
    }
}

fn paint(colour: BackendColor) -> Paint<'static> {
    let (r, g, b) = colour.rgb;
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, (255.0 * colour.alpha.clamp(0.0, 1.0)).round() as u8);
    paint
}

/// Returns a path through the centres of pixels.
fn path(stops: impl IntoIterator<Item = BackendCoord>, closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (i, (x, y)) in stops.into_iter().enumerate() {
        let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
        if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    if closed {
        path.close();
    }
    path.finish()
}

fn is_bold(style: &impl BackendTextStyle) -> bool {
    matches!(style.style(), FontStyle::Bold)
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width(), self.0.height())
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Drawn {
        self.blend(x, y, colour.rgb, colour.alpha);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        if fill {
            let rect =
                Rect::from_ltrb(left as f32, top as f32, right as f32 + 1.0, bottom as f32 + 1.0);
            self.fill(rect.map(PathBuilder::from_rect), style.color());
        } else {
            let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
            self.stroke(path(corners, true), style.color(), style.stroke_width());
        }
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        stops: I,
        style: &S,
    ) -> Drawn {
        self.stroke(path(stops, false), style.color(), style.stroke_width());
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let circle = PathBuilder::from_circle(x as f32 + 0.5, y as f32 + 0.5, radius as f32);
        if fill {
            self.fill(circle, style.color());
        } else {
            self.stroke(circle, style.color(), style.stroke_width());
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        stops: I,
        style: &S,
    ) -> Drawn {
        self.fill(path(stops, true), style.color());
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Drawn {
        // The font has the letters of English; nothing else is drawn.
        let known = |letter| if has_letter(letter) { letter } else { '?' };
        let text: String = text.chars().map(known).collect();
        let (colour, transform) = (style.color(), style.transform());
        let [width, height] = text_size(&text, is_bold(style)).map(|size| size as i32);
        let left = match style.anchor().h_pos {
            HPos::Left => 0,
            HPos::Center => -width / 2,
            HPos::Right => -width,
        };
        let top = match style.anchor().v_pos {
            VPos::Top => 0,
            VPos::Center => -height / 2,
            VPos::Bottom => -height,
        };
        paint_text(&text, is_bold(style), |TextPixel { column, row, coverage }| {
            let (dx, dy) = transform.transform(left + column as i32, top + row as i32);
            let share = colour.alpha * f64::from(coverage) / 255.0;
            self.blend(x + dx, y + dy, colour.rgb, share);
        });
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let [width, height] = text_size(text, is_bold(style)).map(|size| size as u32);
        Ok((width, height))
    }
}
