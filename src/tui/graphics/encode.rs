//! Patches of pictures as bytes for the terminal.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ratatui::layout::{Position, Rect};

/// The most bytes of a picture in one of kitty's escape sequences.
const CHUNK_BYTES: usize = 4096;

/// The order of pictures among text: above it, as there is none below them.
const LAYER: i32 = 1;

/// Deletes all pictures of the screen shown, which is the program's own.
pub const DELETE_ALL: &[u8] = b"\x1b_Ga=d,d=A,q=2\x1b\\";

/// Writes a patch of `pixels`, red, green and blue, at its place.
pub fn patch(
    out: &mut Vec<u8>,
    area: Rect,
    pixels: &[u8],
    size: (u32, u32),
) -> std::io::Result<()> {
    let data = STANDARD.encode(png(pixels, size)?);
    let (id, columns, rows) = (id(area.as_position()), area.width, area.height);
    write!(out, "\x1b[{};{}H", area.y + 1, area.x + 1)?;
    // Replaces the picture of the same number; q=2 asks for no answer, C=1 leaves the cursor where
    // it is.
    let mut head = format!("a=T,f=100,i={id},p=1,q=2,C=1,c={columns},r={rows},z={LAYER},");
    let mut chunks = data.as_bytes().chunks(CHUNK_BYTES).peekable();
    while let Some(chunk) = chunks.next() {
        write!(out, "\x1b_G{head}m={};", u8::from(chunks.peek().is_some()))?;
        out.write_all(chunk)?;
        out.write_all(b"\x1b\\")?;
        "q=2,".clone_into(&mut head);
    }
    Ok(())
}

/// Deletes a patch that may be fully covered.
pub fn delete(out: &mut Vec<u8>, at: Position) {
    out.extend(format!("\x1b_Ga=d,d=I,i={},q=2\x1b\\", id(at)).bytes());
}

/// Returns the unique id of the patch whose upper left character is at `at`.
fn id(at: Position) -> u32 {
    // Not the lowest ones, which other programs are likely to use.
    0x0100_0000 + (u32::from(at.y) << 12 | u32::from(at.x))
}

/// Encodes pixels as a PNG file, as fast as possible.
fn png(pixels: &[u8], (width, height): (u32, u32)) -> std::io::Result<Vec<u8>> {
    let mut file = Vec::with_capacity(pixels.len() / 2);
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fastest);
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_picture_is_sent_in_chunks() {
        // Noise, which cannot be compressed.
        let mut random = 1_u32;
        let noise = (0..3 * 80 * 40).map(|_| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 24) as u8
        });
        let (area, pixels, mut out) =
            (Rect::new(3, 4, 40, 2), noise.collect::<Vec<_>>(), Vec::new());
        patch(&mut out, area, &pixels, (80, 40)).expect("encoded");
        let text = String::from_utf8(out).expect("text");
        let chunks: Vec<&str> = text.split("\x1b_G").collect();
        assert_eq!(chunks[0], "\x1b[5;4H", "row and column count from 1");
        assert!(chunks.len() > 2 && chunks[1].contains("c=40,r=2") && chunks[1].contains("m=1;"));
        assert!(chunks[chunks.len() - 1].starts_with("q=2,m=0;"));
        assert!(chunks[1..].iter().all(|chunk| chunk.len() < CHUNK_BYTES + 100));
        let data = chunks[1..].iter().map(|chunk| chunk.split_once(';').expect("data").1);
        let data: String = data.map(|chunk| chunk.trim_end_matches("\x1b\\")).collect();
        let file = STANDARD.decode(data).expect("base64");
        let reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a picture");
        assert_eq!(reader.info().size(), (80, 40));
        // It is deleted under the number it was sent with.
        let mut out = Vec::new();
        delete(&mut out, area.as_position());
        let id = format!("i={},", id(area.as_position()));
        assert!(text.contains(&id) && String::from_utf8_lossy(&out).contains(&id));
    }
}
