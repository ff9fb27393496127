//! PNG images.

use std::io::Cursor;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, EncodingError, Transformations};

use super::super::grid::Grid;
use super::super::text::{MapError, MapResult};
use super::MapFormat;
use super::image::Image;
use super::notes::{comment, with_comment};

pub const FORMAT: MapFormat = MapFormat {
    name: "png",
    about: "an image, a pixel a cell: dark is a wall, green S, red G, yellow both",
    endings: &["png"],
    loses: "",
    keeps_scale: |_| true,
    is: |source| is_png(source.bytes),
    read: |source| {
        with_comment(source.read_image(decode)?, source.file, texts(source.bytes).lines())
    },
    write: |grid, _| encode(grid).unwrap_or_default(),
    image: None,
};

pub fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

/// Decodes an image; transparent pixels are as over white.
pub fn decode(file: &str, bytes: &[u8]) -> MapResult<Image> {
    let damaged = |error: png::DecodingError| {
        let problem = format!("this image (PNG) is damaged: {error}");
        MapError::whole_file(file, problem, "save or download it again")
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

/// Returns the comments before an image.
fn texts(bytes: &[u8]) -> String {
    let Ok(reader) = Decoder::new(Cursor::new(bytes)).read_info() else { return String::new() };
    let texts = reader.info().uncompressed_latin1_text.iter().map(|chunk| chunk.text.as_str());
    texts.collect::<Vec<_>>().join("\n")
}

fn encode(grid: &Grid) -> Result<Vec<u8>, EncodingError> {
    let image = Image::of(grid);
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, image.width as u32, image.height() as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    if let Some(comment) = comment(grid, false) {
        encoder.add_text_chunk("Comment".to_owned(), comment)?;
    }
    encoder.write_header()?.write_image_data(image.pixels.as_flattened())?;
    Ok(file)
}
