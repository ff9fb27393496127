//! PGM and PPM images, in binary and as text.

use super::super::grid::{Grid, MAX_SIDE};
use super::super::text::error_at_byte;
use super::super::text::{MapError, MapResult};
use super::image::Image;
use super::notes::{comment, with_comment};
use super::{MapFormat, Mark, marks};

pub const FORMAT: MapFormat = MapFormat {
    name: "pgm",
    about: "an image in PGM or PPM, with the colours of PNG",
    endings: &["pgm", "ppm", "pnm"],
    loses: "",
    keeps_scale: |_| true,
    is: |source| is_pgm(source.bytes),
    read: |source| {
        with_comment(source.read_image(decode)?, source.file, header(source.bytes).lines())
    },
    write: |grid, _| write(grid, comment(grid, true)),
    image: None,
};

const HEADER: &str = "a PGM image begins with P2 or P5, its width, its height and its brightest value, up to 65,535; then \
                      its pixels follow";

pub fn is_pgm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', b' ' | b'\t' | b'\r' | b'\n', ..])
}

/// What is left to read of a file.
struct Reader<'a> {
    file: &'a str,
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn error(&self, at: usize, problem: impl Into<String>) -> Box<MapError> {
        error_at_byte(self.file, self.bytes, at, problem, HEADER)
    }

    /// Reads the next number; comments run from `#` to the end of their line.
    fn number(&mut self, range: std::ops::RangeInclusive<usize>) -> MapResult<usize> {
        let mut in_comment = false;
        let skipped = self.bytes[self.at..].iter().take_while(|byte| {
            in_comment = **byte == b'#' || in_comment && **byte != b'\n';
            in_comment || byte.is_ascii_whitespace()
        });
        let from = self.at + skipped.count();
        let is_in = |byte: &&u8| !byte.is_ascii_whitespace() && **byte != b'#';
        let digits = self.bytes[from..].iter().take_while(is_in);
        let to = from + digits.count();
        let text = String::from_utf8_lossy(&self.bytes[from..to]);
        self.at = to;
        match text.parse() {
            Ok(number) if range.contains(&number) => Ok(number),
            _ if text.is_empty() => Err(self.error(from, "the image ends too early")),
            _ => {
                let text = text.chars().take(20).collect::<String>();
                let (least, most) = range.into_inner();
                let problem = format!("{text:?} is not a number from {least} to {most}");
                Err(self.error(from, problem))
            }
        }
    }

    /// Reads the next sample of a binary image.
    fn sample(&mut self, bytes: usize, most: usize) -> MapResult<usize> {
        let Some(sample) = self.bytes.get(self.at..self.at + bytes) else {
            let help = "save or download it again";
            return Err(MapError::whole_file(self.file, "the image ends too early", help));
        };
        self.at += bytes;
        Ok(sample.iter().fold(0, |all, byte| all << 8 | usize::from(*byte)).min(most))
    }
}

/// Decodes an image.
pub fn decode(file: &str, bytes: &[u8]) -> MapResult<Image> {
    let mut reader = Reader { file, bytes, at: 2 };
    let width = reader.number(1..=MAX_SIDE)?;
    let height = reader.number(1..=MAX_SIDE)?;
    Image::check_size(file, width, height)?;
    let most = reader.number(1..=65_535)?;
    let is_binary = matches!(bytes[1], b'5' | b'6');
    if is_binary {
        // One blank ends the header, or a comment with the end of its line.
        let rest = &bytes[reader.at..];
        let comment = rest.starts_with(b"#").then(|| rest.iter().position(|byte| *byte == b'\n'));
        reader.at += comment.flatten().unwrap_or(0) + 1;
    }
    let width_of_sample = if most > 255 { 2 } else { 1 };
    let mut sample = || {
        let sample =
            if is_binary { reader.sample(width_of_sample, most) } else { reader.number(0..=most) };
        sample.map(|sample| (sample * 255 / most) as u8)
    };
    let is_grey = matches!(bytes[1], b'2' | b'5');
    let mut pixels = Vec::with_capacity(width * height);
    for _ in 0..width * height {
        pixels.push(if is_grey { [sample()?; 3] } else { [sample()?, sample()?, sample()?] });
    }
    Ok(Image { width, pixels })
}

/// Returns the first line of a file and the comments after it.
fn header(bytes: &[u8]) -> String {
    let lines = bytes.split_inclusive(|byte| *byte == b'\n').enumerate();
    let header = lines.take_while(|(i, line)| *i == 0 || line.starts_with(b"#"));
    header.map(|(_, line)| String::from_utf8_lossy(line)).collect()
}

/// Returns a map as a binary PGM, with a comment.
pub fn write(grid: &Grid, comment: Option<String>) -> Vec<u8> {
    let comment = comment.map_or(String::new(), |comment| format!("# {comment}\n"));
    let header = format!("P5\n{comment}{} {}\n255\n", grid.width(), grid.height());
    let grey = |mark| if mark == Mark::Wall { 0 } else { 255 };
    header.into_bytes().into_iter().chain(marks(grid).flatten().map(grey)).collect()
}
