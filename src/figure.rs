//! Figures of curves and maps at the size of print, as SVG, PNG and PDF. Lengths are in points, 72
//! an inch; no font of the system is needed.

mod chart;
mod sheet;

use std::path::Path;

use miette::Report;

pub use chart::{Chart, ChartPage, Curve, Point, colour, round_top};
pub use sheet::{Anchor, Mark, PIXEL, Sheet, fitted};

/// A millimetre in points.
pub const MILLIMETRE: f32 = 72.0 / 25.4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureFormat {
    /// Drawing for browsers and editors, with text as text.
    Svg,
    Png,
    /// Drawing for papers, with letters as outlines: it needs no fonts.
    Pdf,
}

impl FigureFormat {
    pub const ALL: [Self; 3] = [Self::Svg, Self::Png, Self::Pdf];

    pub fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
            Self::Pdf => "pdf",
        }
    }

    pub fn of(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|format| gdg::files::has_extension(path, format.extension()))
    }

    pub fn encode(self, sheet: &Sheet) -> Result<Vec<u8>, Report> {
        match self {
            Self::Svg => sheet::svg(sheet).map(String::into_bytes),
            Self::Png => sheet::png(sheet),
            Self::Pdf => Ok(sheet::pdf(sheet)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(text: &str) -> Sheet {
        let mut sheet =
            Sheet { size: [40.0, 20.0], title: "a figure".to_owned(), marks: Vec::new() };
        sheet.text([2.0, 10.0], text, 7.0, Anchor::Start, (0, 0, 0));
        sheet
    }

    #[test]
    fn no_letters_act_in_svg() {
        let file = FigureFormat::Svg.encode(&sheet("a\u{1}\u{9b}\u{202e}<b")).expect("a file");
        let text = String::from_utf8(file).expect("text");
        assert!(text.contains("a?¿\u{fffd}&lt;b"), "{text}");
    }
}
