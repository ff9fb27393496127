//! What is drawn on a page, in order, and the widths and outlines of its text in DejaVu Sans.

use std::sync::LazyLock;

use tiny_skia::{Path, PathBuilder};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use gdg::draw::{Picture, Rgb};

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
