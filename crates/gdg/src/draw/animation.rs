//! Animated PNG files (APNG). Each frame stores what has changed since the one before: the smallest
//! rectangle around it, transparent where nothing has.

use png::{BlendOp, Encoder, EncodingError};

use super::Picture;

/// Resolution of the time that a frame is shown, in parts of a second.
const TIME_UNITS: u16 = 100;

/// An animation being written.
pub struct Animation<'a> {
    writer: png::Writer<&'a mut Vec<u8>>,
    drawn: Option<Picture>,
}

impl<'a> Animation<'a> {
    /// Begins an animation of `frames` pictures of one size in an empty `file`, which says first
    /// how many there are.
    ///
    /// # Errors
    /// Errors of the encoder.
    pub fn begin(
        file: &'a mut Vec<u8>,
        (columns, rows): (usize, usize),
        frames: usize,
    ) -> Result<Self, EncodingError> {
        let mut encoder = Encoder::new(file, columns as u32, rows as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        encoder.set_animated(frames as u32, 0)?;
        Ok(Self { writer: encoder.write_header()?, drawn: None })
    }

    /// Adds a frame that is shown for a number of seconds.
    ///
    /// # Errors
    /// Errors of the encoder.
    pub fn add(&mut self, picture: Picture, seconds: f64) -> Result<(), EncodingError> {
        let (area, pixels) = changes(self.drawn.as_ref(), &picture);
        let writer = &mut self.writer;
        // The first frame covers the whole picture, and has its place already.
        if self.drawn.is_some() {
            // Any size is valid at the corner; the position is still that of the previous frame.
            writer.set_frame_position(0, 0)?;
            writer.set_frame_dimension(area[2], area[3])?;
            writer.set_frame_position(area[0], area[1])?;
            writer.set_blend_op(BlendOp::Over)?;
        }
        let units = (seconds * f64::from(TIME_UNITS)).round().clamp(1.0, f64::from(u16::MAX));
        writer.set_frame_delay(units as u16, TIME_UNITS)?;
        writer.write_image_data(&pixels)?;
        self.drawn = Some(picture);
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// Errors of the encoder: fewer frames were added than announced.
    pub fn finish(self) -> Result<(), EncodingError> {
        self.writer.finish()
    }
}

/// Returns the smallest rectangle (left, top, width, height in pixels) around what differs from
/// `before`, and its pixels as red, green, blue and opacity: transparent where they are the same.
fn changes(before: Option<&Picture>, now: &Picture) -> ([u32; 4], Vec<u8>) {
    let (columns, rows) = now.size();
    let same = |at: usize| before.is_some_and(|before| before.pixels()[at] == now.pixels()[at]);
    let changed =
        (0..columns * rows).filter(|at| !same(*at)).map(|at| (at % columns, at / columns));
    let bounds =
        changed.fold(None, |bounds: Option<[usize; 4]>, (x, y)| {
            Some(bounds.map_or([x, y, x, y], |[x0, y0, x1, y1]| {
                [x0.min(x), y0.min(y), x1.max(x), y1.max(y)]
            }))
        });
    // A frame has at least one pixel.
    let [left, top, right, bottom] = bounds.unwrap_or([0; 4]);
    let mut pixels = Vec::with_capacity(4 * (right - left + 1) * (bottom - top + 1));
    for y in top..=bottom {
        for at in y * columns + left..=y * columns + right {
            let (r, g, b) = now.pixels()[at];
            pixels.extend(if same(at) { [0; 4] } else { [r, g, b, u8::MAX] });
        }
    }
    ([left, top, right - left + 1, bottom - top + 1].map(|v| v as u32), pixels)
}
