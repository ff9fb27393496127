//! Images as maps, one pixel a cell: PNG, and PGM and PPM in binary and as text. Dark pixels are
//! walls, green ones starts, red ones goals, yellow ones both.

use std::io::Cursor;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, EncodingError, Transformations};

use super::super::grid::{Grid, MAX_SIDE, is_size, size_limits};
use super::super::text_file::{MapError, MapResult, error_at_byte};
use super::{CellMark, MapFormat, Source, grid, marks};

pub const PNG: MapFormat = MapFormat {
    name: "png",
    about: "an image, a pixel a cell: dark is a wall, green S, red G, yellow both",
    endings: &["png"],
    loses: "",
    besides: "shades of grey",
    is: |source| is_png(source.bytes),
    read,
    write: |grid, _| encode_png(grid).unwrap_or_default(),
};

pub const PGM: MapFormat = MapFormat {
    name: "pgm",
    about: "an image in PGM or PPM, with the colours of PNG; written in grey",
    endings: &["pgm", "ppm", "pnm"],
    loses: "starts and goals",
    besides: "shades of grey and comments",
    is: |source| is_pgm(source.bytes),
    read,
    write: |grid, _| encode_pgm(grid),
};

/// Channels of a strong colour are at least this bright, the others at most as bright as [`DARK`].
const BRIGHT: u8 = 160;
const DARK: u8 = 96;

/// Channels of a colour that is no mark, nor a shade of grey, differ by more.
const COLOURFUL: u8 = 120;

const PGM_HEADER: &str = "a PGM image begins with P2 or P5, its width, its height and its brightest value, up to 65,535; then \
                          its pixels follow";

const COLOURS: &str =
    "green (0, 255, 0) is a start, red a goal, yellow both; paint what is a wall or free in grey";

const SAVE_AGAIN: &str = "save or download it again";

fn read(source: &Source) -> MapResult<Grid> {
    let help = "dark pixels are walls: --threshold says how dark, from 0 to 1";
    Image::decode(source.file, source.bytes, help)?.map(
        source,
        |shade| shade < source.threshold,
        help,
    )
}

/// An image, row by row from the top.
pub struct Image {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Image {
    /// Decodes an image in any of the formats; transparent pixels are as over white.
    pub fn decode(file: &str, bytes: &[u8], help: &str) -> MapResult<Self> {
        if is_png(bytes) {
            decode_png(file, bytes)
        } else if is_pgm(bytes) {
            decode_pgm(file, bytes)
        } else {
            Err(MapError::whole_file(file, "is not an image that can be read", help))
        }
    }

    fn check_size(file: &str, width: usize, height: usize) -> MapResult<()> {
        if is_size(width, height) {
            return Ok(());
        }
        let problem = format!("an image of {width} x {height} pixels cannot be a map");
        Err(MapError::whole_file(file, problem, size_limits()))
    }

    /// Returns the map called as `source`; pixels without a strong colour are walls where `is_wall`
    /// says so of their brightness, from 0 to 1.
    pub fn map(
        &self,
        source: &Source,
        is_wall: impl Fn(f32) -> bool,
        help: &str,
    ) -> MapResult<Grid> {
        let mark = |pixel: &[u8; 3]| match (pixel[0], pixel[1], pixel[2]) {
            (BRIGHT.., BRIGHT.., ..=DARK) => CellMark::Both,
            (BRIGHT.., ..=DARK, ..=DARK) => CellMark::Goal,
            (..=DARK, BRIGHT.., ..=DARK) => CellMark::Start,
            _ => {
                let sum: u16 = pixel.iter().map(|channel| u16::from(*channel)).sum();
                if is_wall(f32::from(sum) / 765.0) { CellMark::Wall } else { CellMark::Free }
            }
        };
        let marks: Vec<CellMark> = self.pixels.iter().map(mark).collect();
        let is_unclear = |(pixel, mark): &(&[u8; 3], &CellMark)| {
            let least = pixel.iter().min().unwrap_or(&0);
            matches!(mark, CellMark::Wall | CellMark::Free)
                && pixel.iter().any(|channel| channel - least > COLOURFUL)
        };
        if let Some(([r, g, b], _)) = self.pixels.iter().zip(&marks).find(is_unclear) {
            let problem = format!("the colour ({r}, {g}, {b}) is neither a mark nor a grey");
            return Err(MapError::whole_file(source.file, problem, COLOURS));
        }
        grid(source, self.width, &marks, help)
    }
}

fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

fn decode_png(file: &str, bytes: &[u8]) -> MapResult<Image> {
    let damaged = |error: png::DecodingError| {
        let problem = format!("this image (PNG) is damaged: {error}");
        MapError::whole_file(file, problem, SAVE_AGAIN)
    };
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(damaged)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    Image::check_size(file, width, height)?;
    let mut samples = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let frame = reader.next_frame(&mut samples).map_err(damaged)?;
    let over_white = |grey: u8, alpha: u8| {
        ((u16::from(grey) * u16::from(alpha) + 255 * (255 - u16::from(alpha))) / 255) as u8
    };
    let pixel = |samples: &[u8]| match *samples {
        [grey] => [grey; 3],
        [grey, alpha] => [over_white(grey, alpha); 3],
        [red, green, blue] => [red, green, blue],
        [red, green, blue, alpha] => [red, green, blue].map(|channel| over_white(channel, alpha)),
        _ => [0; 3],
    };
    let pixels = samples.chunks_exact(frame.color_type.samples()).map(pixel);
    Ok(Image { width, pixels: pixels.take(width * height).collect() })
}

fn encode_png(grid: &Grid) -> Result<Vec<u8>, EncodingError> {
    let colour = |mark| match mark {
        CellMark::Wall => [0, 0, 0],
        CellMark::Free => [255, 255, 255],
        CellMark::Start => [0, 176, 0],
        CellMark::Goal => [224, 0, 0],
        CellMark::Both => [240, 200, 0],
    };
    let pixels: Vec<u8> = marks(grid).flatten().flat_map(colour).collect();
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, grid.width() as u32, grid.height() as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(file)
}

fn is_pgm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', b' ' | b'\t' | b'\r' | b'\n', ..])
}

/// Reads the number that follows in a PGM; comments run from `#` to the end of their line.
fn next_number(file: &str, bytes: &[u8], at: &mut usize, most: usize) -> MapResult<usize> {
    let mut in_comment = false;
    let skipped = bytes[*at..].iter().take_while(|byte| {
        in_comment = **byte == b'#' || in_comment && **byte != b'\n';
        in_comment || byte.is_ascii_whitespace()
    });
    let from = *at + skipped.count();
    *at = from + bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let number = str::from_utf8(&bytes[from..*at]).ok().and_then(|text| text.parse().ok());
    number.filter(|number| *number <= most).ok_or_else(|| {
        let problem = if from == bytes.len() {
            "the image ends too early".to_owned()
        } else {
            format!("this is not a number up to {most}")
        };
        error_at_byte(file, bytes, from, problem, PGM_HEADER)
    })
}

fn decode_pgm(file: &str, bytes: &[u8]) -> MapResult<Image> {
    let mut at = 2;
    let mut number = |most| next_number(file, bytes, &mut at, most);
    let (width, height) = (number(MAX_SIDE)?, number(MAX_SIDE)?);
    Image::check_size(file, width, height)?;
    let most = number(65_535)?.max(1);
    let channels = if matches!(bytes[1], b'2' | b'5') { 1 } else { 3 };
    let count = width * height * channels;
    let shade = |sample: usize| (sample.min(most) * 255 / most) as u8;
    let samples: Vec<u8> = if matches!(bytes[1], b'2' | b'3') {
        (0..count).map(|_| number(most).map(shade)).collect::<MapResult<_>>()?
    } else {
        // One blank ends the header, or a comment with the end of its line.
        let rest = &bytes[at..];
        let comment = rest.starts_with(b"#").then(|| rest.iter().position(|byte| *byte == b'\n'));
        let rest = rest.get(comment.flatten().unwrap_or(0) + 1..).unwrap_or_default();
        let sample = |bytes: &[u8]| bytes.iter().fold(0, |all, byte| all << 8 | usize::from(*byte));
        let samples = rest.chunks_exact(if most > 255 { 2 } else { 1 });
        samples.take(count).map(|bytes| shade(sample(bytes))).collect()
    };
    if samples.len() < count {
        return Err(MapError::whole_file(file, "the image ends too early", SAVE_AGAIN));
    }
    let pixel = |samples: &[u8]| [samples[0], samples[channels / 2], samples[channels - 1]];
    Ok(Image { width, pixels: samples.chunks_exact(channels).map(pixel).collect() })
}

/// Returns a map as a binary PGM.
pub fn encode_pgm(grid: &Grid) -> Vec<u8> {
    let header = format!("P5\n{} {}\n255\n", grid.width(), grid.height());
    let grey = |mark| if mark == CellMark::Wall { 0 } else { 255 };
    header.into_bytes().into_iter().chain(marks(grid).flatten().map(grey)).collect()
}
