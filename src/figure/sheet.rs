//! The marks drawn on a page, in order, with text in DejaVu Sans; and the page as a file: as SVG,
//! where text can be edited and searched; as pixels; and as PDF, with letters as outlines, since
//! publishers want no fonts that are not embedded.

use std::io::Write;
use std::sync::LazyLock;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use miette::{IntoDiagnostic, Report, miette};
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use svg::Document;
use svg::node::Comment;
use svg::node::element::{Group, Image, Polygon, Polyline, Rectangle, Text as Letters, Title};
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, PathSegment,
    Pixmap, PixmapPaint, PremultipliedColorU8, Stroke, Transform,
};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use gdg::draw::{Picture, Rgb, hex};
use gdg::text::sanitized;

#[derive(Clone, Debug)]
pub struct Sheet {
    pub size: [f32; 2],
    /// What it shows, for the file's metadata.
    pub title: String,
    /// The first ones lie below. Positions count from the upper left corner.
    pub marks: Vec<Mark>,
}

#[derive(Clone, Debug)]
pub enum Mark {
    Line {
        points: Vec<[f32; 2]>,
        width: f32,
        colour: Rgb,
    },
    Area {
        points: Vec<[f32; 2]>,
        colour: Rgb,
        /// How much it hides, from 0 to 1.
        opacity: f32,
    },
    Text(Text),
    Picture {
        at: [f32; 2],
        size: [f32; 2],
        picture: Picture,
    },
}

#[derive(Clone, Debug)]
pub struct Text {
    /// A point of the baseline.
    pub at: [f32; 2],
    pub words: String,
    pub size: f32,
    pub colour: Rgb,
    /// Which part of the text is at that point.
    pub anchor: Anchor,
    pub turned: bool,
}

/// A part of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    pub fn share(self) -> f32 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

impl Sheet {
    pub fn line(&mut self, points: Vec<[f32; 2]>, width: f32, colour: Rgb) {
        if points.len() > 1 {
            self.marks.push(Mark::Line { points, width, colour });
        }
    }

    pub fn area(&mut self, points: Vec<[f32; 2]>, colour: Rgb) {
        self.marks.push(Mark::Area { points, colour, opacity: 1.0 });
    }

    pub fn text(&mut self, at: [f32; 2], text: &str, size: f32, anchor: Anchor, colour: Rgb) {
        let words = text.to_owned();
        self.marks.push(Mark::Text(Text { at, words, size, colour, anchor, turned: false }));
    }
}

pub fn circle([x, y]: [f32; 2], radius: f32) -> Vec<[f32; 2]> {
    const CORNERS: u16 = 32;
    let angle = |i| f32::from(i) * std::f32::consts::TAU / f32::from(CORNERS);
    let corner = |i| [x + radius * angle(i).cos(), y + radius * angle(i).sin()];
    (0..CORNERS).map(corner).collect()
}

/// The font, unless it cannot be read, in which case text is left out.
static FACE: LazyLock<Option<Face>> =
    LazyLock::new(|| Face::parse(dejavu::sans::regular(), 0).ok());

pub fn text_width(text: &str, size: f32) -> f32 {
    FACE.as_ref().map_or(0.0, |face| glyphs(face, text).map(|(_, advance)| size * advance).sum())
}

/// Returns the size of letters, at most `size`, at which `text` is at most `room` wide.
pub fn fitted(text: &str, size: f32, room: f32) -> f32 {
    size * (room / text_width(text, size)).min(1.0)
}

/// Returns the glyphs of `text`, each with its share of the letters' size.
fn glyphs<'a>(face: &'a Face, text: &'a str) -> impl Iterator<Item = (GlyphId, f32)> + 'a {
    let per_em = f32::from(face.units_per_em());
    text.chars().map(move |c| {
        let glyph = face.glyph_index(c).unwrap_or_default();
        (glyph, f32::from(face.glyph_hor_advance(glyph).unwrap_or(0)) / per_em)
    })
}

pub fn outline(text: &Text) -> Option<Path> {
    let face = FACE.as_ref()?;
    let scale = text.size / f32::from(face.units_per_em());
    let along = -text.anchor.share() * text_width(&text.words, text.size);
    let mut pen = Pen { text, scale, along, path: PathBuilder::new() };
    for (glyph, advance) in glyphs(face, &text.words) {
        face.outline_glyph(glyph, &mut pen);
        pen.along += text.size * advance;
    }
    pen.path.finish()
}

struct Pen<'a> {
    text: &'a Text,
    scale: f32,
    /// Distance from the text's point along the baseline.
    along: f32,
    path: PathBuilder,
}

impl Pen<'_> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        let (along, up) = (self.along + self.scale * x, self.scale * y);
        let [x, y] = self.text.at;
        if self.text.turned { (x - up, y - along) } else { (x + along, y - up) }
    }
}

impl OutlineBuilder for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) =
            (self.place(x1, y1), self.place(x2, y2), self.place(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// Pixels of a PNG, an inch.
const RESOLUTION: f32 = 300.0;

/// A pixel of a PNG, in points.
pub const PIXEL: f32 = 72.0 / RESOLUTION;

/// A line, a polygon or letters, and how they are drawn.
struct DrawnMark {
    path: Path,
    colour: Rgb,
    opacity: f32,
    /// Of lines; all else is filled.
    width: Option<f32>,
}

/// Returns what a mark is drawn as, if it is not a picture.
fn drawn_mark(mark: &Mark) -> Option<DrawnMark> {
    let (points, colour, opacity, width) = match mark {
        Mark::Line { points, width, colour } => (points, *colour, 1.0, Some(*width)),
        Mark::Area { points, colour, opacity } => (points, *colour, *opacity, None),
        Mark::Text(text) => {
            let (path, colour) = (outline(text)?, text.colour);
            return Some(DrawnMark { path, colour, opacity: 1.0, width: None });
        }
        Mark::Picture { .. } => return None,
    };
    let mut path = PathBuilder::new();
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 { path.move_to(*x, *y) } else { path.line_to(*x, *y) }
    }
    if width.is_none() {
        path.close();
    }
    Some(DrawnMark { path: path.finish()?, colour, opacity, width })
}

pub fn png(sheet: &Sheet) -> Result<Vec<u8>, Report> {
    let scale = RESOLUTION / 72.0;
    let [width, height] = sheet.size.map(|length| (scale * length - 0.01).ceil() as u32);
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
    if let Some(DrawnMark { path, colour: (r, g, b), opacity, width }) = drawn_mark(mark) {
        let mut paint = Paint { anti_alias: true, ..Paint::default() };
        paint.set_color_rgba8(r, g, b, (255.0 * opacity).round() as u8);
        let (line_cap, line_join) = (LineCap::Round, LineJoin::Round);
        match width.map(|width| Stroke { width, line_cap, line_join, ..Stroke::default() }) {
            Some(stroke) => pixmap.stroke_path(&path, &paint, &stroke, zoom, None),
            None => pixmap.fill_path(&path, &paint, FillRule::Winding, zoom, None),
        }
    }
    let Mark::Picture { at, size, picture } = mark else { return };
    let (columns, rows) = picture.size();
    let Some(mut pixels) = Pixmap::new(columns as u32, rows as u32) else { return };
    for (to, (r, g, b)) in pixels.pixels_mut().iter_mut().zip(picture.pixels()) {
        *to = PremultipliedColorU8::from_rgba(*r, *g, *b, u8::MAX).unwrap_or(*to);
    }
    let place =
        zoom.pre_translate(at[0], at[1]).pre_scale(size[0] / columns as f32, size[1] / rows as f32);
    // Cells of maps keep their edges.
    let paint = PixmapPaint { quality: FilterQuality::Nearest, ..PixmapPaint::default() };
    pixmap.draw_pixmap(0, 0, pixels.as_ref(), &paint, place, None);
}

pub fn svg(sheet: &Sheet) -> Result<String, Report> {
    let [width, height] = sheet.size;
    let ground = Rectangle::new().set("width", "100%").set("height", "100%").set("fill", "#fff");
    let mut document = Document::new()
        .set("width", format!("{width}pt"))
        .set("height", format!("{height}pt"))
        .set("viewBox", (0, 0, width, height))
        .set("font-family", "DejaVu Sans, Verdana, sans-serif")
        .set("fill", "none")
        .set("stroke-linejoin", "round")
        .set("stroke-linecap", "round")
        .add(Title::new(sanitized(&sheet.title)))
        .add(Comment::new("gdg-tui"))
        .add(ground);
    let hundredths = |length: f32| (100.0 * length).round() / 100.0;
    let corners = |points: &[[f32; 2]]| {
        let corner = |[x, y]: &[f32; 2]| format!("{},{}", hundredths(*x), hundredths(*y));
        points.iter().map(corner).collect::<Vec<_>>().join(" ")
    };
    let letters = |text: &Text| {
        let [x, y] = text.at.map(hundredths);
        let anchor = match text.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let turn = if text.turned { " rotate(-90)" } else { "" };
        Group::new().set("transform", format!("translate({x} {y}){turn}")).add(
            Letters::new(sanitized(&text.words))
                .set("font-size", text.size)
                .set("fill", hex(text.colour))
                .set("text-anchor", anchor),
        )
    };
    for mark in &sheet.marks {
        document = match mark {
            Mark::Line { points, width, colour } => document.add(
                Polyline::new()
                    .set("points", corners(points))
                    .set("stroke", hex(*colour))
                    .set("stroke-width", *width),
            ),
            Mark::Area { points, colour, opacity } => {
                let area = Polygon::new().set("points", corners(points)).set("fill", hex(*colour));
                document.add(if *opacity < 1.0 { area.set("fill-opacity", *opacity) } else { area })
            }
            Mark::Text(text) => document.add(letters(text)),
            Mark::Picture { at, size, picture } => {
                let data = STANDARD.encode(picture.to_png("gdg-tui").into_diagnostic()?);
                document.add(
                    Image::new()
                        .set("x", at[0])
                        .set("y", at[1])
                        .set("width", size[0])
                        .set("height", size[1])
                        .set("image-rendering", "pixelated")
                        .set("href", format!("data:image/png;base64,{data}")),
                )
            }
        };
    }
    Ok(document.to_string() + "\n")
}

pub fn pdf(sheet: &Sheet) -> Vec<u8> {
    let [width, height] = sheet.size;
    let mut content = Content::new();
    content.set_line_cap(LineCapStyle::RoundCap).set_line_join(LineJoinStyle::RoundJoin);
    // Downwards, as on the sheet.
    content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
    sheet.marks.iter().for_each(|mark| add(&mut content, mark));
    // All bands have the same.
    let band = sheet.marks.iter().find_map(|mark| match mark {
        Mark::Area { opacity, .. } if *opacity < 1.0 => Some(*opacity),
        _ => None,
    });
    let mut pdf = Pdf::new();
    let [of_catalog, of_pages, of_page, of_content, of_info, of_band] =
        [1, 2, 3, 4, 5, 6].map(Ref::new);
    pdf.catalog(of_catalog).pages(of_pages);
    pdf.pages(of_pages).kids([of_page]).count(1);
    let mut page = pdf.page(of_page);
    page.media_box(Rect::new(0.0, 0.0, width, height));
    page.parent(of_pages).contents(of_content);
    let mut resources = page.resources();
    resources.ext_g_states().pair(Name(b"Band"), of_band);
    resources.finish();
    page.finish();
    pdf.ext_graphics(of_band).non_stroking_alpha(band.unwrap_or(1.0));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let packed = encoder.write_all(&content.finish()).and_then(|()| encoder.finish());
    // Writing to memory does not fail.
    let packed = packed.unwrap_or_default();
    pdf.stream(of_content, &packed).filter(Filter::FlateDecode);
    let mut info = pdf.document_info(of_info);
    info.title(TextStr(&sheet.title)).producer(TextStr("gdg-tui"));
    info.finish();
    pdf.finish()
}

fn add(content: &mut Content, mark: &Mark) {
    // Only figures of maps have pictures, and those are never written as PDF.
    let Some(DrawnMark { path, colour: (r, g, b), opacity, width }) = drawn_mark(mark) else {
        return;
    };
    let [r, g, b] = [r, g, b].map(|part| f32::from(part) / 255.0);
    content.save_state();
    match width {
        Some(width) => content.set_stroke_rgb(r, g, b).set_line_width(width),
        None => content.set_fill_rgb(r, g, b),
    };
    if opacity < 1.0 {
        content.set_parameters(Name(b"Band"));
    }
    trace(content, &path);
    if width.is_some() {
        content.stroke()
    } else {
        content.fill_nonzero()
    };
    content.restore_state();
}

/// Adds a path; PDF has no quadratic curves.
fn trace(content: &mut Content, path: &Path) {
    let mut at = tiny_skia::Point::zero();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(to) => {
                content.move_to(to.x, to.y);
                at = to;
            }
            PathSegment::LineTo(to) => {
                content.line_to(to.x, to.y);
                at = to;
            }
            PathSegment::QuadTo(by, to) => {
                let towards = |from: f32, to: f32| from + (to - from) * 2.0 / 3.0;
                let [x1, y1] = [towards(at.x, by.x), towards(at.y, by.y)];
                let [x2, y2] = [towards(to.x, by.x), towards(to.y, by.y)];
                content.cubic_to(x1, y1, x2, y2, to.x, to.y);
                at = to;
            }
            PathSegment::CubicTo(by, then, to) => {
                content.cubic_to(by.x, by.y, then.x, then.y, to.x, to.y);
                at = to;
            }
            PathSegment::Close => {
                content.close_path();
            }
        }
    }
}
