//! A sheet as PDF: one page of its size. Letters are outlines, as publishers ask that fonts are
//! embedded.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use ttf_parser::OutlineBuilder;

use super::letters;
use super::sheet::{Mark, Sheet};
use gdg::draw::{Picture, Rgb};

/// Objects of the file.
const CATALOG: i32 = 1;
const PAGES: i32 = 2;
const PAGE: i32 = 3;
const CONTENT: i32 = 4;
const INFO: i32 = 5;
/// The first object of those for opacities, and for pictures.
const OPACITIES: i32 = 10;
const PICTURES: i32 = 1000;

/// Opacities come in this many levels.
const LEVELS: f32 = 100.0;

/// The page's drawing, and what it refers to.
struct Drawing<'a> {
    content: Content,
    /// Levels of opacity.
    opacities: Vec<i32>,
    pictures: Vec<&'a Picture>,
}

/// Returns the file.
pub fn encode(sheet: &Sheet) -> Vec<u8> {
    let [width, height] = sheet.size;
    let mut content = Content::new();
    content.set_line_cap(LineCapStyle::RoundCap).set_line_join(LineJoinStyle::RoundJoin);
    // Downwards, as on the sheet.
    content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
    let mut drawing = Drawing { content, opacities: Vec::new(), pictures: Vec::new() };
    sheet.marks.iter().for_each(|mark| drawing.add(mark));
    let Drawing { content, opacities, pictures } = drawing;
    let mut pdf = Pdf::new();
    pdf.catalog(Ref::new(CATALOG)).pages(Ref::new(PAGES));
    pdf.pages(Ref::new(PAGES)).kids([Ref::new(PAGE)]).count(1);
    let mut page = pdf.page(Ref::new(PAGE));
    page.media_box(Rect::new(0.0, 0.0, width, height));
    page.parent(Ref::new(PAGES)).contents(Ref::new(CONTENT));
    let mut resources = page.resources();
    let mut states = resources.ext_g_states();
    for level in &opacities {
        states.pair(Name(opacity_name(*level).as_bytes()), Ref::new(OPACITIES + level));
    }
    states.finish();
    let mut objects = resources.x_objects();
    for i in 0..pictures.len() {
        objects.pair(Name(picture_name(i).as_bytes()), Ref::new(PICTURES + i as i32));
    }
    objects.finish();
    resources.finish();
    page.finish();
    for level in opacities {
        pdf.ext_graphics(Ref::new(OPACITIES + level)).non_stroking_alpha(level as f32 / LEVELS);
    }
    for (i, picture) in pictures.into_iter().enumerate() {
        let bytes: Vec<u8> = picture.pixels().iter().flat_map(|(r, g, b)| [*r, *g, *b]).collect();
        let packed = packed(&bytes);
        let mut image = pdf.image_xobject(Ref::new(PICTURES + i as i32), &packed);
        let (columns, rows) = picture.size();
        image.filter(Filter::FlateDecode);
        image.width(columns as i32).height(rows as i32);
        image.color_space().device_rgb();
        image.bits_per_component(8);
    }
    let content = packed(&content.finish());
    pdf.stream(Ref::new(CONTENT), &content).filter(Filter::FlateDecode);
    let mut info = pdf.document_info(Ref::new(INFO));
    info.title(TextStr(&sheet.title)).producer(TextStr("gdg-tui"));
    info.finish();
    pdf.finish()
}

impl<'a> Drawing<'a> {
    fn add(&mut self, mark: &'a Mark) {
        let content = &mut self.content;
        match mark {
            Mark::Line { points, width, colour } => {
                let [r, g, b] = shares(*colour);
                content.set_stroke_rgb(r, g, b).set_line_width(*width);
                trace(content, points);
                content.stroke();
            }
            Mark::Area { points, colour, opacity } => {
                let level = (LEVELS * opacity).round() as i32;
                if !self.opacities.contains(&level) {
                    self.opacities.push(level);
                }
                content.save_state().set_parameters(Name(opacity_name(level).as_bytes()));
                fill_with(content, *colour);
                trace(content, points);
                content.close_path().fill_nonzero().restore_state();
            }
            Mark::Text(text) => {
                fill_with(content, text.colour);
                letters::outline(text, &mut Pen { content, at: [0.0; 2] });
                self.content.fill_nonzero();
            }
            Mark::Picture { at, size, picture } => {
                let name = picture_name(self.pictures.len());
                self.pictures.push(picture);
                content.save_state();
                content.transform([size[0], 0.0, 0.0, -size[1], at[0], at[1] + size[1]]);
                content.x_object(Name(name.as_bytes())).restore_state();
            }
        }
    }
}

fn opacity_name(level: i32) -> String {
    format!("O{level}")
}

fn picture_name(i: usize) -> String {
    format!("P{i}")
}

fn shares((r, g, b): Rgb) -> [f32; 3] {
    [r, g, b].map(|part| f32::from(part) / 255.0)
}

fn fill_with(content: &mut Content, colour: Rgb) {
    let [r, g, b] = shares(colour);
    content.set_fill_rgb(r, g, b);
}

fn trace(content: &mut Content, points: &[[f32; 2]]) {
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 {
            content.move_to(*x, *y)
        } else {
            content.line_to(*x, *y)
        };
    }
}

/// Packs bytes; writing to memory does not fail.
fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}

/// Draws outlines; PDF has no quadratic curves.
struct Pen<'a> {
    content: &'a mut Content,
    at: [f32; 2],
}

impl OutlineBuilder for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.content.move_to(x, y);
        self.at = [x, y];
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.content.line_to(x, y);
        self.at = [x, y];
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let towards = |from: f32, to: f32| from + (to - from) * 2.0 / 3.0;
        let [x0, y0] = self.at;
        self.curve_to(towards(x0, x1), towards(y0, y1), towards(x, x1), towards(y, y1), x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.content.cubic_to(x1, y1, x2, y2, x, y);
        self.at = [x, y];
    }

    fn close(&mut self) {
        self.content.close_path();
    }
}
