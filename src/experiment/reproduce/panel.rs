//! A panel of a figure: ground with lines and dots on it.

pub use gdg::draw::WALL;
use gdg::draw::{Picture, Rgb};

/// Pixels along a panel's longer side, about.
pub const PANEL_PIXELS: usize = 330;

pub const FLOOR: Rgb = (244, 244, 240);
pub const PLAN: Rgb = (255, 70, 50);
pub const PATH: Rgb = (0, 114, 178);
pub const START: Rgb = (86, 180, 233);
pub const GOAL: Rgb = (230, 159, 0);

/// One map, or other ground, with what is drawn on it. Positions are in pixels of the picture.
#[derive(Clone, Debug)]
pub struct MapPanel {
    /// What it shows.
    pub title: String,
    /// Numbers, below the map.
    pub caption: String,
    /// The ground: the map's cells.
    pub picture: Picture,
    /// Lines, the first ones below.
    pub lines: Vec<PolyLine>,
    /// Outlines of circles.
    pub rings: Vec<Dot>,
    /// Dots, above the lines.
    pub dots: Vec<Dot>,
    /// The map as characters, for the terminal.
    pub text: String,
}

/// A line from stop to stop.
#[derive(Clone, Debug)]
pub struct PolyLine {
    /// The stops.
    pub stops: Vec<[f32; 2]>,
    /// Its colour.
    pub colour: Rgb,
    /// Its width.
    pub width: u32,
}

/// A dot with a dark edge, or a ring.
#[derive(Clone, Copy, Debug)]
pub struct Dot {
    /// Its centre.
    pub at: [f32; 2],
    /// Its colour.
    pub colour: Rgb,
    /// Its radius, without the edge.
    pub radius: u32,
}

impl Dot {
    /// Returns a dot that stands out from lines.
    pub fn new(at: [f32; 2], colour: Rgb) -> Self {
        Self { at, colour, radius: 5 }
    }
}
