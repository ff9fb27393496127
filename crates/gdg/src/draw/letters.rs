//! Lines of text as pixels, in a font of one size that needs no fonts of the system.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// The size of letters, in pixels.
const HEIGHT: RasterHeight = RasterHeight::Size16;

/// The weight of letters.
fn weight(is_bold: bool) -> FontWeight {
    if is_bold { FontWeight::Bold } else { FontWeight::Regular }
}

/// A pixel of a line of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextPixel {
    /// Column from the left end of the line.
    pub column: usize,
    /// Row from the top.
    pub row: usize,
    /// How much of the pixel the letter covers, of 255; at least 1.
    pub coverage: u8,
}

/// Returns the width and height of a line of text, in pixels.
pub fn text_size(line: &str, is_bold: bool) -> [usize; 2] {
    [line.chars().count() * get_raster_width(weight(is_bold), HEIGHT), HEIGHT.val()]
}

/// Returns whether the font has a character: the letters, digits and signs of English.
pub fn has_letter(letter: char) -> bool {
    get_raster(letter, FontWeight::Regular, HEIGHT).is_some()
}

/// Calls `paint` for every pixel that a line of text covers. Characters that the font lacks are
/// left blank.
pub fn paint_text(line: &str, is_bold: bool, mut paint: impl FnMut(TextPixel)) {
    let advance = get_raster_width(weight(is_bold), HEIGHT);
    for (i, letter) in line.chars().enumerate() {
        let Some(letter) = get_raster(letter, weight(is_bold), HEIGHT) else { continue };
        for (row, pixels) in letter.rows().enumerate() {
            for (column, coverage) in pixels.iter().enumerate().filter(|(_, c)| **c > 0) {
                paint(TextPixel { column: i * advance + column, row, coverage: *coverage });
            }
        }
    }
}
