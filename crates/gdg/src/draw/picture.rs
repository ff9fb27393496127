//! Pictures as PNG files.

use super::colour::{Rgb, blend, contour};
use super::contour::contour_lines;
use super::letters::{TextPixel, paint_text};
use super::segment::positions_along;

/// A picture in memory.
#[derive(Clone, Debug)]
pub struct Picture {
    columns: usize,
    /// Row by row.
    pixels: Vec<Rgb>,
}

impl Picture {
    /// Creates a picture in one colour.
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

    /// Colours the pixel at a position, unless it lies outside the picture.
    pub fn set(&mut self, x: isize, y: isize, colour: Rgb) {
        let (columns, rows) = self.size();
        if (0..columns as isize).contains(&x) && (0..rows as isize).contains(&y) {
            self.pixels[y as usize * columns + x as usize] = colour;
        }
    }

    /// Draws a filled disc, positions and radius in pixels.
    pub fn disc(&mut self, [x, y]: [f32; 2], radius: f32, colour: Rgb) {
        let span = |at: f32| (at - radius).floor() as isize..=(at + radius).floor() as isize;
        for row in span(y) {
            for column in span(x) {
                let off = [column as f32 + 0.5 - x, row as f32 + 0.5 - y];
                if off[0] * off[0] + off[1] * off[1] <= radius * radius {
                    self.set(column, row, colour);
                }
            }
        }
    }

    /// Draws lines from stop to stop as wide as a disc of `radius`, and at least one pixel.
    pub fn lines(&mut self, stops: &[[f32; 2]], radius: f32, colour: Rgb) {
        for ends in stops.windows(2) {
            let (from, to) = (ends[0], ends[1]);
            // Two samples per pixel leave no gaps.
            let longer = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
            for at in positions_along([from, to], (2.0 * longer).ceil().max(1.0) as usize) {
                self.set(at[0].floor() as isize, at[1].floor() as isize, colour);
                self.disc(at, radius, colour);
            }
        }
    }

    /// Draws the contour lines at all multiples of `interval` of a field of one value a pixel.
    pub fn contours(&mut self, field: &[f32], interval: f32) {
        let lines = contour_lines(field, self.columns, interval);
        for i in lines.into_iter().flat_map(|line| line.pixels) {
            self.pixels[i] = contour(self.pixels[i]);
        }
    }

    /// Writes text from an upper left corner to the right; characters that the font lacks are left
    /// out.
    pub fn text(&mut self, text: &str, [left, top]: [usize; 2], colour: Rgb) {
        let columns = self.columns;
        paint_text(text, false, |TextPixel { column, row, coverage }| {
            let (x, y) = (left + column, top + row);
            if let Some(pixel) = self.pixels.get_mut(y * columns + x).filter(|_| x < columns) {
                *pixel = blend(*pixel, colour, f32::from(coverage) / 255.0);
            }
        });
    }

    /// Copies a picture to an upper left corner, as far as it fits.
    pub fn put(&mut self, picture: &Self, [left, top]: [usize; 2]) {
        let columns = picture.size().0;
        for (i, pixel) in picture.pixels.iter().enumerate() {
            self.set((left + i % columns) as isize, (top + i / columns) as isize, *pixel);
        }
    }

    /// Encodes the picture as a PNG file that names the `software` that has made it.
    ///
    /// # Errors
    /// Errors of the encoder.
    pub fn to_png(&self, software: &str) -> Result<Vec<u8>, png::EncodingError> {
        let (columns, rows) = self.size();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, columns as u32, rows as u32);
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
