//! Tracks the pictures on the screen, and what to send to change them.
//! A picture is cut into patches, rectangles of whole characters, around the text that lies over
//! it. Only patches that differ from what the terminal shows are sent.

use std::io::Write;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};

use super::{Graphics, Redraw, TerminalPicture};

/// Columns and rows of a whole patch: small, since little moves from frame to frame.
const PATCH: (u16, u16) = (8, 4);

/// After a picture has been drawn and sent, the next one waits for this multiple of the time taken,
/// at most [`LONGEST_REST`]: so that a slow terminal can keep up and, during training, so that
/// training loses less than 5 % of its speed.
const REST_FACTOR: u32 = 1;
const TRAINING_REST_FACTOR: u32 = 25;
const LONGEST_REST: Duration = Duration::from_secs(1);

/// How long after user input pictures are drawn as if training were paused.
const AWAKE: Duration = Duration::from_millis(300);

struct Patch {
    area: Rect,
    /// Red, green and blue, row by row.
    pixels: Vec<u8>,
}

#[derive(Default)]
pub struct Patches {
    shown: Vec<Patch>,
    /// Earliest time of the next update of changed pictures.
    resting_until: Option<Instant>,
    awake_until: Option<Instant>,
    /// Whether what is shown is out of date.
    is_behind: bool,
}

impl Patches {
    pub fn forget(&mut self) {
        self.shown.clear();
    }

    /// Whether something was left out because the terminal could not keep up.
    pub fn is_behind(&self) -> bool {
        self.is_behind
    }

    /// Pauses updates after `end`, when the terminal has read the latest, by the time it `took`.
    pub fn rest(&mut self, end: Instant, took: Duration, is_training: bool) {
        let factor = if is_training && !is_ahead(self.awake_until) {
            TRAINING_REST_FACTOR
        } else {
            REST_FACTOR
        };
        self.resting_until = Some(end + LONGEST_REST.min(factor * took));
    }

    pub fn redraw(&self, is_training: bool) -> Redraw {
        match is_training && !is_ahead(self.awake_until) {
            _ if self.is_resting() => Redraw::Nothing,
            true => Redraw::Moving,
            false => Redraw::All,
        }
    }

    fn is_resting(&self) -> bool {
        is_ahead(self.resting_until)
    }

    /// Resumes updates, for a moment without pauses.
    pub fn wake(&mut self) {
        self.resting_until = None;
        self.awake_until = Some(Instant::now() + AWAKE);
    }

    /// Returns the bytes that show `pictures` where `screen` reserves places for them.
    pub fn update(
        &mut self,
        pictures: &[&TerminalPicture],
        screen: &Buffer,
        graphics: Graphics,
    ) -> std::io::Result<Vec<u8>> {
        let mut out = Vec::new();
        let is_resting = self.is_resting();
        let mut before = std::mem::take(&mut self.shown);
        let wanted: Vec<(Rect, &TerminalPicture)> = pictures
            .iter()
            .flat_map(|picture| cut(picture, screen).into_iter().map(move |area| (area, *picture)))
            .collect();
        let is_new = |area: &Rect| !before.iter().any(|patch| patch.area == *area);
        // Delete old patches first: a new one in the same place has the same id.
        for patch in &before {
            if !wanted.iter().any(|(area, _)| *area == patch.area) {
                delete(&mut out, patch.area.as_position());
            }
        }
        self.is_behind = false;
        if is_resting && !wanted.iter().any(|(area, _)| is_new(area)) {
            before.retain(|patch| wanted.iter().any(|(area, _)| *area == patch.area));
            self.is_behind = !wanted.is_empty();
            self.shown = before;
            return Ok(out);
        }
        for (area, picture) in wanted {
            let at = before.iter().position(|patch| patch.area == area);
            let empty = Patch { area, pixels: Vec::new() };
            let mut patch = at.map_or(empty, |at| before.swap_remove(at));
            let (across, down) = graphics.character;
            let size = (u32::from(area.width * across), u32::from(area.height * down));
            let rows = || rows(picture, area, graphics);
            if !patch.pixels.chunks_exact(3 * size.0 as usize).eq(rows()) {
                patch.pixels = rows().flatten().copied().collect();
                encode(&mut out, area, &patch.pixels, size)?;
            }
            self.shown.push(patch);
        }
        Ok(out)
    }

    /// Returns the bytes that delete all pictures, before the screen is left or cleared.
    pub fn clear(&mut self) -> &'static [u8] {
        self.shown.clear();
        DELETE_ALL
    }
}

fn is_ahead(moment: Option<Instant>) -> bool {
    moment.is_some_and(|moment| Instant::now() < moment)
}

/// Cuts a picture into patches: a grid, with holes where text is.
fn cut(picture: &TerminalPicture, screen: &Buffer) -> Vec<Rect> {
    let area = picture.area.intersection(screen.area);
    let (width, height) = PATCH;
    let starts = |from: u16, to: u16, step: u16| (from..to).step_by(usize::from(step));
    let mut patches = Vec::new();
    for y in starts(area.y, area.bottom(), height) {
        for x in starts(area.x, area.right(), width) {
            free_parts(Rect::new(x, y, width, height).intersection(area), screen, &mut patches);
        }
    }
    patches
}

/// Adds the parts of `area` without text: all of it, or what each row has of them.
fn free_parts(area: Rect, screen: &Buffer, parts: &mut Vec<Rect>) {
    let is_free = |at: Position| TerminalPicture::owns(&screen[at]);
    if area.positions().all(is_free) {
        return parts.push(area);
    }
    for row in area.rows() {
        let free: Vec<u16> = row.positions().filter(|at| is_free(*at)).map(|at| at.x).collect();
        let runs = free.chunk_by(|a, b| a + 1 == *b);
        parts.extend(runs.map(|run| Rect::new(run[0], row.y, run.len() as u16, 1)));
    }
}

/// Returns the rows of a picture in the place of the characters of `area`, three bytes a pixel.
fn rows(picture: &TerminalPicture, area: Rect, graphics: Graphics) -> impl Iterator<Item = &[u8]> {
    let (across, down) = (usize::from(graphics.character.0), usize::from(graphics.character.1));
    let [left, top] = [area.x - picture.area.x, area.y - picture.area.y].map(usize::from);
    let (width, height) = (usize::from(area.width) * across, usize::from(area.height) * down);
    (top * down..top * down + height).map(move |row| {
        let from = row * picture.columns + left * across;
        picture.pixels[from..from + width].as_flattened()
    })
}

/// The most bytes of a picture in one of kitty's escape sequences.
const CHUNK_BYTES: usize = 4096;

/// The order of pictures among text: above it, as there is none below them.
const LAYER: i32 = 1;

/// Deletes all pictures of the screen shown, which is the program's own.
pub const DELETE_ALL: &[u8] = b"\x1b_Ga=d,d=A,q=2\x1b\\";

/// Writes a patch of `pixels`, red, green and blue, at its place.
fn encode(out: &mut Vec<u8>, area: Rect, pixels: &[u8], size: (u32, u32)) -> std::io::Result<()> {
    let data = STANDARD.encode(png(pixels, size)?);
    let (id, columns, rows) = (id(area.as_position()), area.width, area.height);
    write!(out, "\x1b[{};{}H", area.y + 1, area.x + 1)?;
    // Replaces the picture of that number; q=2 asks for no answer, C=1 leaves the cursor.
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
fn delete(out: &mut Vec<u8>, at: Position) {
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
    use ratatui::style::Style;

    use super::*;

    const KITTY: Graphics = Graphics { character: (4, 8) };
    const SCREEN: Rect = Rect::new(0, 0, 60, 30);
    const AREA: Rect = Rect::new(2, 1, 40, 20);

    fn picture(area: Rect, (across, down): (u16, u16)) -> TerminalPicture {
        let (columns, rows) = (usize::from(area.width * across), usize::from(area.height * down));
        TerminalPicture { area, columns, pixels: vec![[0; 3]; columns * rows] }
    }

    fn screen(pictures: &[&TerminalPicture]) -> Buffer {
        let mut screen = Buffer::empty(SCREEN);
        pictures.iter().for_each(|picture| TerminalPicture::reserve(picture.area, &mut screen));
        screen
    }

    /// Returns what is on the screen: how many patches cover each character.
    fn covered(patches: &Patches) -> Vec<u32> {
        let of = |at: Position| {
            patches.shown.iter().filter(|patch| patch.area.contains(at)).count() as u32
        };
        SCREEN.positions().map(of).collect()
    }

    fn sent(patches: &mut Patches, pictures: &[&TerminalPicture], screen: &Buffer) -> String {
        String::from_utf8(patches.update(pictures, screen, KITTY).expect("encoded")).expect("text")
    }

    #[test]
    fn a_picture_is_covered_once_and_sent_once() {
        let (mut picture, mut patches) = (picture(AREA, KITTY.character), Patches::default());
        let screen = screen(&[&picture]);
        assert_eq!(sent(&mut patches, &[&picture], &screen).matches("a=T").count(), 25, "5 x 5");
        let expected: Vec<u32> =
            SCREEN.positions().map(|at| u32::from(AREA.contains(at))).collect();
        assert_eq!(covered(&patches), expected);
        assert_eq!(sent(&mut patches, &[&picture], &screen), "", "nothing has changed");
        picture.pixels[80 * 160 + 80][0] = 255;
        let text = sent(&mut patches, &[&picture], &screen);
        assert!(text.starts_with("\x1b[10;19H") && text.matches("a=T").count() == 1, "{text}");
        patches.forget();
        assert_eq!(sent(&mut patches, &[&picture], &screen).matches("a=T").count(), 25);
    }

    #[test]
    fn text_over_a_picture_wins() {
        let (picture, mut patches) = (picture(AREA, KITTY.character), Patches::default());
        let mut with_text = screen(&[&picture]);
        sent(&mut patches, &[&picture], &with_text);
        // Even blanks, such as those of a dialog.
        with_text.set_string(10, 5, "hello", Style::new());
        with_text[(30, 12)].reset();
        with_text[(20, 6)].reset();
        let text = sent(&mut patches, &[&picture], &with_text);
        assert_eq!(text.matches("a=d").count(), 3, "the patches below the text");
        let is_text = |at: Position| {
            at.y == 5 && (10..15).contains(&at.x) || [(30, 12), (20, 6)].contains(&(at.x, at.y))
        };
        let expected: Vec<u32> =
            SCREEN.positions().map(|at| u32::from(AREA.contains(at) && !is_text(at))).collect();
        assert_eq!(covered(&patches), expected);
        // Without text, all of it is back, and without pictures, nothing is left.
        sent(&mut patches, &[&picture], &screen(&[&picture]));
        assert_eq!(covered(&patches).iter().sum::<u32>(), AREA.area());
        let text = sent(&mut patches, &[], &Buffer::empty(SCREEN));
        assert_eq!((text.matches("a=d").count(), covered(&patches).iter().sum::<u32>()), (25, 0));
    }

    #[test]
    fn a_terminal_that_cannot_follow_is_sent_less_but_no_text_is_hidden() {
        let (mut picture, mut patches) = (picture(AREA, KITTY.character), Patches::default());
        let mut screen = screen(&[&picture]);
        sent(&mut patches, &[&picture], &screen);
        patches.rest(Instant::now(), Duration::from_mins(1), false);
        picture.pixels[0][0] = 255;
        assert_eq!(sent(&mut patches, &[&picture], &screen), "");
        assert!(patches.is_behind());
        screen.set_string(3, 2, "text", Style::new());
        assert!(sent(&mut patches, &[&picture], &screen).contains("a=d"));
        assert!(!patches.is_behind());
    }

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
        encode(&mut out, area, &pixels, (80, 40)).expect("encoded");
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
