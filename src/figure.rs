//! Figures of curves and maps at the size of print, as SVG, PNG and PDF. Lengths are in points, 72
//! an inch; no font of the system is needed.

mod chart;
mod labels;
mod letters;
mod pdf;
mod png;
mod sheet;
mod svg;
mod ticks;

use std::path::Path;

use miette::Report;

pub use chart::{Chart, Curve, Page, Point, Range, colour};
pub use letters::fitted;
pub use sheet::{Anchor, Mark, Sheet, Text, circle};
pub use ticks::tick;

/// A millimetre in points.
pub const MILLIMETRE: f32 = 72.0 / 25.4;

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Drawing for browsers and editors, with text as text.
    Svg,
    /// Pixels, 300 an inch.
    Png,
    /// Drawing for papers, with letters as outlines: it needs no fonts.
    Pdf,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Svg, Self::Png, Self::Pdf];

    /// Returns the extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
            Self::Pdf => "pdf",
        }
    }

    /// Returns the format that a file's extension names.
    pub fn of(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|format| gdg::files::has_extension(path, format.extension()))
    }

    /// Returns `sheet` as a file.
    ///
    /// # Errors
    /// It is too large, or cannot be encoded.
    pub fn encode(self, sheet: &Sheet) -> Result<Vec<u8>, Report> {
        match self {
            Self::Svg => svg::encode(sheet).map(String::into_bytes),
            Self::Png => png::encode(sheet),
            Self::Pdf => Ok(pdf::encode(sheet)),
        }
    }
}
