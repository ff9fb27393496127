//! Patches of pictures as bytes for the terminal.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ratatui::layout::{Position, Rect};

use super::Protocol;

/// The most bytes of a picture in one of kitty's escape sequences.
const KITTY_CHUNK_BYTES: usize = 4096;

/// The order of kitty pictures among text: above it, as there is none below them.
const KITTY_LAYER: i32 = 1;

impl Protocol {
    /// Writes a patch of `pixels`, red, green and blue, at its place.
    pub fn patch(
        self,
        out: &mut Vec<u8>,
        area: Rect,
        pixels: &[u8],
        size: (u32, u32),
    ) -> std::io::Result<()> {
        write!(out, "\x1b[{};{}H", area.y + 1, area.x + 1)?;
        let data = png(pixels, size)?;
        let encoded = STANDARD.encode(&data);
        if self == Self::Kitty {
            return kitty(out, area, &encoded);
        }
        let (bytes, columns, rows) = (data.len(), area.width, area.height);
        write!(out, "\x1b]1337;File=inline=1;size={bytes};width={columns};height={rows};")?;
        write!(out, "preserveAspectRatio=0;doNotMoveCursor=1:{encoded}\x07")
    }

    /// Deletes a patch that may be fully covered. On iTerm2, text replaces pictures.
    pub fn delete(self, out: &mut Vec<u8>, at: Position) {
        if self == Self::Kitty {
            out.extend(format!("\x1b_Ga=d,d=I,i={},q=2\x1b\\", kitty_id(at)).bytes());
        }
    }
}

/// Writes a picture, a PNG file in base64, at the cursor.
fn kitty(out: &mut Vec<u8>, area: Rect, data: &str) -> std::io::Result<()> {
    let (id, columns, rows) = (kitty_id(area.as_position()), area.width, area.height);
    // Replaces the picture of the same number; q=2 asks for no answer, C=1 leaves the cursor where
    // it is.
    let mut head = format!("a=T,f=100,i={id},p=1,q=2,C=1,c={columns},r={rows},z={KITTY_LAYER},");
    let mut chunks = data.as_bytes().chunks(KITTY_CHUNK_BYTES).peekable();
    while let Some(chunk) = chunks.next() {
        write!(out, "\x1b_G{head}m={};", u8::from(chunks.peek().is_some()))?;
        out.write_all(chunk)?;
        out.write_all(b"\x1b\\")?;
        "q=2,".clone_into(&mut head);
    }
    Ok(())
}

/// Deletes all pictures of the screen shown, which is the program's own.
pub const DELETE_ALL: &[u8] = b"\x1b_Ga=d,d=A,q=2\x1b\\";

/// Returns the unique id of the patch whose upper left character is at `at`.
fn kitty_id(at: Position) -> u32 {
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

    const AREA: Rect = Rect::new(3, 4, 40, 2);

    fn encoded(protocol: Protocol) -> String {
        // Noise, which cannot be compressed.
        let mut random = 1_u32;
        let noise = (0..3 * 80 * 40).map(|_| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 24) as u8
        });
        let mut out = Vec::new();
        let pixels: Vec<u8> = noise.collect();
        protocol.patch(&mut out, AREA, &pixels, (80, 40)).expect("encoded");
        String::from_utf8(out).expect("text")
    }

    fn decoded(base64: &str) -> (u32, u32) {
        let file = STANDARD.decode(base64).expect("base64");
        let reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a picture");
        reader.info().size()
    }

    #[test]
    fn kitty_gets_a_whole_picture_in_chunks() {
        let text = encoded(Protocol::Kitty);
        let chunks: Vec<&str> = text.split("\x1b_G").collect();
        assert_eq!(chunks[0], "\x1b[5;4H", "row and column count from 1");
        assert!(chunks.len() > 2 && chunks[1].contains("c=40,r=2") && chunks[1].contains("m=1;"));
        let last = chunks[chunks.len() - 1];
        assert!(last.starts_with("q=2,m=0;"), "{last}");
        let data: String = chunks[1..]
            .iter()
            .map(|c| c.split_once(';').expect("data").1.trim_end_matches("\x1b\\"))
            .collect();
        assert_eq!(decoded(&data), (80, 40));
        assert!(chunks[1..].iter().all(|chunk| chunk.len() < KITTY_CHUNK_BYTES + 100));
        // It is deleted under the number it was sent with.
        let mut out = Vec::new();
        Protocol::Kitty.delete(&mut out, AREA.as_position());
        let id = format!("i={},", kitty_id(AREA.as_position()));
        assert!(text.contains(&id) && String::from_utf8_lossy(&out).contains(&id));
    }

    #[test]
    fn iterm2_gets_a_picture_of_its_size_in_characters() {
        let text = encoded(Protocol::Iterm2);
        let (head, data) = text.trim_end_matches('\x07').split_once(':').expect("data");
        assert!(
            head.starts_with("\x1b[5;4H\x1b]1337;File=inline=1;")
                && head.contains("width=40;height=2;"),
            "{head}"
        );
        assert_eq!(decoded(data), (80, 40));
    }
}
