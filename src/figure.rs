//! Figures of curves and maps at the size of print, as SVG, PNG and PDF. Lengths are in points, 72
//! an inch; no font of the system is needed.

mod chart;
mod sheet;

use std::path::Path;

use miette::Report;

pub use chart::{COLOURS, Chart, ChartPage, Curve, Point, colour, round_top};
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

    /// Encodes the figure of a table, with checksums near its end, of it and of the table.
    pub fn encode_with_table(self, sheet: &Sheet, table: &[u8]) -> Result<Vec<u8>, Report> {
        let mut file = self.encode(sheet)?;
        let (at, before) = match self {
            Self::Svg => return Ok(text_with_sums(file, table)),
            // Its last chunk has twelve bytes.
            Self::Png => (file.len() - 12, PNG_COMMENT),
            Self::Pdf => {
                (file.windows(9).rposition(|w| w == b"startxref").unwrap_or(0), &b"% "[..])
            }
        };
        let end = file.split_off(at);
        file = with_sums(file, before, table);
        let sum = crc32fast::hash(&file[at + 4..]).to_be_bytes();
        file.extend(if self == Self::Png { &sum[..] } else { b"\n" });
        Ok([file, end].concat())
    }
}

/// What the checksums of a file come after.
const MARK: &[u8] = b"gdg-tui ";

/// The beginning of a chunk with the checksums: its length without this and its own checksum.
const PNG_COMMENT: &[u8] = b"\0\0\0\x21tEXtComment\0";

/// Adds `before` and checksums of a file and of the table behind it.
fn with_sums(mut file: Vec<u8>, before: &[u8], table: &[u8]) -> Vec<u8> {
    file.extend(before);
    let [own, behind] = [&file, table].map(crc32fast::hash);
    file.extend([MARK, format!("{own:08x} {behind:08x}").as_bytes()].concat());
    file
}

/// Adds a comment with the checksums to text in XML or Markdown.
pub fn text_with_sums(text: Vec<u8>, table: &[u8]) -> Vec<u8> {
    [with_sums(text, b"<!-- ", table), b" -->\n".to_vec()].concat()
}

/// Largest file that is recognised as one of this program.
pub const MOST_BYTES: u64 = 64 << 20;

/// Returns the checksum of the table behind a file, if the file is as this program has made it.
pub fn table_behind(file: &Path) -> Option<u32> {
    let file = gdg::files::read(file, MOST_BYTES).ok()?;
    let at = file.windows(MARK.len()).rposition(|part| part == MARK)?;
    let (sums, after) = file[at + MARK.len()..].split_first_chunk::<17>()?;
    let number = |digits| u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok();
    // The ends of PNG and PDF are longer, and nobody adds to those by hand.
    let is_whole = after.len() <= if after.starts_with(b" -->") { 5 } else { 32 };
    let is_own = is_whole && number(&sums[..8])? == crc32fast::hash(&file[..at]);
    is_own.then(|| number(&sums[9..]))?
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
