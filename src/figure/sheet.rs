//! What is drawn on a page, in order.

use gdg::draw::{Picture, Rgb};

#[derive(Clone, Debug)]
pub struct Sheet {
    pub size: [f32; 2],
    /// What it shows, for the file's metadata.
    pub title: String,
    /// The first ones lie below. Positions count from the upper left corner.
    pub marks: Vec<Mark>,
}

/// Something drawn.
#[derive(Clone, Debug)]
pub enum Mark {
    /// A line from point to point.
    Line {
        points: Vec<[f32; 2]>,
        width: f32,
        colour: Rgb,
    },
    /// A filled polygon.
    Area {
        points: Vec<[f32; 2]>,
        colour: Rgb,
        /// How much it hides, from 0 to 1.
        opacity: f32,
    },
    Text(Text),
    Picture {
        /// Upper left corner.
        at: [f32; 2],
        size: [f32; 2],
        picture: Picture,
    },
}

/// A line of text.
#[derive(Clone, Debug)]
pub struct Text {
    /// A point of the baseline.
    pub at: [f32; 2],
    pub words: String,
    pub size: f32,
    pub colour: Rgb,
    /// Which part of the text is at that point.
    pub anchor: Anchor,
    /// Whether it runs upwards.
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

    /// Adds an opaque polygon.
    pub fn area(&mut self, points: Vec<[f32; 2]>, colour: Rgb) {
        self.marks.push(Mark::Area { points, colour, opacity: 1.0 });
    }

    pub fn text(&mut self, at: [f32; 2], text: &str, size: f32, anchor: Anchor, colour: Rgb) {
        let words = text.to_owned();
        self.marks.push(Mark::Text(Text { at, words, size, colour, anchor, turned: false }));
    }
}

/// Returns the corners of a polygon that looks like a circle.
pub fn circle([x, y]: [f32; 2], radius: f32) -> Vec<[f32; 2]> {
    const CORNERS: u16 = 32;
    let angle = |i| f32::from(i) * std::f32::consts::TAU / f32::from(CORNERS);
    let corner = |i| [x + radius * angle(i).cos(), y + radius * angle(i).sin()];
    (0..CORNERS).map(corner).collect()
}
