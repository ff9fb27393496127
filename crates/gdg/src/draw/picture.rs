//! Pictures as PNG files, and lines of text, in a font of one size that needs no fonts of the system.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use png::{Encoder, EncodingError};

use super::{Rgb, contour, contour_paths, trace};

#[derive(Clone, Debug)]
pub struct Picture {
    columns: usize,
    pixels: Vec<Rgb>,
}

impl Picture {
    pub fn new((columns, rows): (usize, usize), colour: Rgb) -> Self {
        Self { columns, pixels: vec![colour; columns * rows] }
    }

    /// Returns the columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.pixels.len() / self.columns)
    }

    /// Returns the pixels, row by row.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// Returns the pixels, row by row.
    pub fn pixels_mut(&mut self) -> &mut [Rgb] {
        &mut self.pixels
    }

    /// Draws a filled disc, positions and radius in pixels.
    pub fn disc(&mut self, at: [f32; 2], radius: f32, colour: Rgb) {
        self.lines(&[at, at], radius, colour);
    }

    /// Draws lines from stop to stop as wide as a disc of `radius`, and at least one pixel.
    pub fn lines(&mut self, stops: &[[f32; 2]], radius: f32, colour: Rgb) {
        let size = self.size();
        for ends in stops.windows(2) {
            trace([ends[0], ends[1]], radius, size, 1.0, false, |i, _| self.pixels[i] = colour);
        }
    }

    /// Draws the contour lines at all multiples of `interval` of a field of one value a pixel.
    pub fn contours(&mut self, field: &[f32], interval: f32) {
        let lines = contour_paths(field, self.columns, interval);
        for i in lines.into_iter().flat_map(|line| line.pixels(self.columns)) {
            self.pixels[i] = contour(self.pixels[i]);
        }
    }

    /// Encodes the picture as a PNG file that names the `software` that has made it.
    pub fn to_png(&self, software: &str) -> Result<Vec<u8>, EncodingError> {
        let (columns, rows) = self.size();
        let mut file = Vec::new();
        let mut encoder = Encoder::new(&mut file, columns as u32, rows as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        encoder.add_text_chunk("Software".to_owned(), software.to_owned())?;
        let mut writer = encoder.write_header()?;
        let bytes: Vec<u8> = self.pixels.iter().flat_map(|(r, g, b)| [*r, *g, *b]).collect();
        writer.write_image_data(&bytes)?;
        writer.finish()?;
        Ok(file)
    }
}

const HEIGHT: RasterHeight = RasterHeight::Size16;

fn weight(is_bold: bool) -> FontWeight {
    if is_bold { FontWeight::Bold } else { FontWeight::Regular }
}

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
