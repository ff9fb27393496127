//! Sixel pictures, in colours that stay the same from patch to patch and from frame to frame as
//! long as they fit.
//!
//! The crate `icy_sixel` finds the best colours for each picture, which takes 28 ms for the map on
//! a screen of 200 x 60 characters, and makes the same ground differ from patch to patch.

use std::io::Write;

/// The most colours: as many as xterm has with its usual settings.
const COLOURS: usize = 256;

/// Rows of pixels in one band.
const BAND: usize = 6;

/// Bits per channel of a colour's bin, and the number of bins.
const BITS: u32 = 6;
const BINS: usize = 1 << (3 * BITS);

/// Levels per channel of the colours that every palette contains.
const SPARE_LEVELS: [u8; 3] = [0, 128, 255];

/// Sampling step for checking whether the colours still fit, in pixels, and the maximum mean
/// squared distance per channel at which they do.
const SAMPLING: usize = 61;
const MAX_ERROR: f32 = 8.0;

/// A bin whose nearest colour is not known yet.
const UNKNOWN: u16 = u16::MAX;

/// A picture's bands of rows as sixels, each cached until one of its rows changes.
#[derive(Default)]
pub struct Bands(Vec<Option<Band>>);

impl Bands {
    /// Invalidates the band of a row of pixels that has changed.
    pub fn forget(&mut self, row: usize) {
        if let Some(band) = self.0.get_mut(row / BAND) {
            *band = None;
        }
    }

    /// Invalidates all bands after the colours have changed.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// A band of rows.
struct Band {
    sixels: Vec<u8>,
    /// The indices of its colours.
    used: [bool; COLOURS],
}

/// The palette in use.
#[derive(Default)]
pub struct Palette {
    colours: Vec<[u8; 3]>,
    /// The nearest colour of each bin, computed on demand.
    nearest: Vec<u16>,
}

fn bin([r, g, b]: [u8; 3]) -> usize {
    [r, g, b].iter().fold(0, |bin, channel| bin << BITS | usize::from(*channel >> (8 - BITS)))
}

fn squared_distance(a: [u8; 3], b: [u8; 3]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

impl Palette {
    /// Chooses colours for a picture unless the present ones fit; returns whether they have changed.
    pub fn adapt(&mut self, pixels: &[[u8; 3]]) -> bool {
        if !self.colours.is_empty() && self.error(pixels) <= MAX_ERROR {
            return false;
        }
        let mut bins = vec![[0_u32; 4]; BINS];
        for [r, g, b] in pixels {
            let own = &mut bins[bin([*r, *g, *b])];
            own.iter_mut().zip([*r, *g, *b, 1]).for_each(|(sum, more)| *sum += u32::from(more));
        }
        let mut used: Vec<[u32; 4]> = bins.into_iter().filter(|bin| bin[3] > 0).collect();
        used.sort_by_key(|bin| std::cmp::Reverse(bin[3]));
        let spare = SPARE_LEVELS.iter().flat_map(|r| {
            SPARE_LEVELS.iter().flat_map(move |g| SPARE_LEVELS.iter().map(move |b| [*r, *g, *b]))
        });
        let popular = used.iter().map(|[r, g, b, count]| [r, g, b].map(|sum| (sum / count) as u8));
        self.colours = spare.chain(popular).take(COLOURS).collect();
        self.nearest = vec![UNKNOWN; BINS];
        true
    }

    /// Returns the mean squared distance per channel of a picture's colours from the palette.
    fn error(&mut self, pixels: &[[u8; 3]]) -> f32 {
        let sample: Vec<[u8; 3]> = pixels.iter().step_by(SAMPLING).copied().collect();
        let off = |rgb: &[u8; 3]| {
            let nearest = self.index(*rgb);
            squared_distance(*rgb, self.colours[nearest])
        };
        let sum: u32 = sample.iter().map(off).sum();
        sum as f32 / (3 * sample.len().max(1)) as f32
    }

    /// Returns the index of the nearest colour.
    fn index(&mut self, rgb: [u8; 3]) -> usize {
        let bin = bin(rgb);
        if self.nearest[bin] == UNKNOWN {
            let nearest =
                (0..self.colours.len()).min_by_key(|i| squared_distance(self.colours[*i], rgb));
            self.nearest[bin] = nearest.unwrap_or(0) as u16;
        }
        usize::from(self.nearest[bin])
    }

    /// Writes pixels, red, green and blue, as a sixel picture at the cursor, reusing its known `bands`.
    pub fn encode(
        &mut self,
        out: &mut Vec<u8>,
        pixels: &[u8],
        (width, height): (u32, u32),
        bands: &mut Bands,
    ) -> std::io::Result<()> {
        if self.colours.is_empty() {
            self.adapt(pixels.as_chunks().0);
        }
        let columns = width as usize;
        let rows = pixels.chunks(3 * BAND * columns);
        bands.0.resize_with(rows.len(), || None);
        let mut lines: Vec<Line> = (0..COLOURS).map(|_| Line::default()).collect();
        let mut used = [false; COLOURS];
        for (band, pixels) in bands.0.iter_mut().zip(rows) {
            let band = band.get_or_insert_with(|| self.band(pixels, columns, &mut lines));
            used.iter_mut().zip(band.used).for_each(|(used, own)| *used |= own);
        }
        // Pixels that are not set stay as they are; width and height of a pixel are equal.
        write!(out, "\x1bP0;1q\"1;1;{width};{height}")?;
        for (i, [r, g, b]) in self.colours.iter().enumerate().filter(|(i, _)| used[*i]) {
            let percent = |channel: &u8| (u32::from(*channel) * 100 + 127) / 255;
            write!(out, "#{i};2;{};{};{}", percent(r), percent(g), percent(b))?;
        }
        bands.0.iter().flatten().for_each(|band| out.extend(&band.sixels));
        out.extend(b"\x1b\\");
        Ok(())
    }

    /// Encodes the pixels of one band; `lines` are empty before and afterwards.
    fn band(&mut self, pixels: &[u8], columns: usize, lines: &mut [Line]) -> Band {
        // The colours of each column, a byte for each row: many columns are like the one before.
        let indices = self.indices(pixels);
        let mut own = vec![0_u64; columns];
        for (row, indices) in indices.chunks(columns).enumerate() {
            own.iter_mut()
                .zip(indices)
                .for_each(|(own, index)| *own |= u64::from(*index) << (8 * row));
        }
        let (rows, mut x) = (indices.len() / columns, 0);
        for same in own.chunk_by(|a, b| a == b) {
            let mut parts = [(0, 0); BAND];
            let mut count = 0;
            for (row, index) in same[0].to_le_bytes()[..rows].iter().enumerate() {
                if let Some((_, sixel)) = parts[..count].iter_mut().find(|(own, _)| own == index) {
                    *sixel |= 1 << row;
                } else {
                    parts[count] = (*index, 1 << row);
                    count += 1;
                }
            }
            parts[..count]
                .iter()
                .for_each(|(index, sixel)| lines[usize::from(*index)].push(x, *sixel, same.len()));
            x += same.len();
        }
        let mut band = Band { sixels: Vec::new(), used: [false; COLOURS] };
        for (index, line) in lines.iter_mut().enumerate().filter(|(_, line)| line.count > 0) {
            if !band.sixels.is_empty() {
                band.sixels.push(b'$');
            }
            band.used[index] = true;
            band.sixels.push(b'#');
            band.sixels.extend(index.to_string().bytes());
            line.finish(&mut band.sixels);
        }
        band.sixels.push(b'-');
        band
    }

    fn indices(&mut self, pixels: &[u8]) -> Vec<u8> {
        let (pixels, _) = pixels.as_chunks::<3>();
        let mut indices = vec![0; pixels.len()];
        let mut before = ([0; 3], self.index([0; 3]) as u8);
        for (index, pixel) in indices.iter_mut().zip(pixels) {
            // Many pixels are like the one before.
            if before.0 != *pixel {
                before = (*pixel, self.index(*pixel) as u8);
            }
            *index = before.1;
        }
        indices
    }
}

/// The sixels of one colour in a band, from left to right.
#[derive(Default)]
struct Line {
    text: Vec<u8>,
    /// The latest sixel, the number of equal ones in a row, and the column after them.
    sixel: u8,
    count: usize,
    end: usize,
}

impl Line {
    /// Adds `times` equal sixels from column `x` on.
    fn push(&mut self, x: usize, sixel: u8, times: usize) {
        if self.end == x && self.sixel == sixel && self.count > 0 {
            self.count += times;
        } else {
            run(&mut self.text, self.sixel, self.count);
            run(&mut self.text, 0, x - self.end);
            (self.sixel, self.count) = (sixel, times);
        }
        self.end = x + times;
    }

    /// Writes the line and begins another.
    fn finish(&mut self, out: &mut Vec<u8>) {
        run(&mut self.text, self.sixel, self.count);
        out.append(&mut self.text);
        (self.count, self.end) = (0, 0);
    }
}

/// Writes `count` equal sixels.
fn run(out: &mut Vec<u8>, sixel: u8, count: usize) {
    let character = b'?' + sixel;
    if count > 3 {
        out.push(b'!');
        out.extend(count.to_string().bytes());
        out.push(character);
    } else {
        out.extend(std::iter::repeat_n(character, count));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decodes a sixel picture: each pixel's colour in per cent.
    fn decoded(text: &str) -> Vec<Vec<[u32; 3]>> {
        let body = text
            .strip_prefix("\x1bP0;1q\"1;1;")
            .and_then(|text| text.strip_suffix("\x1b\\"))
            .expect("sixels");
        let digits =
            |text: &str| text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (width, rest) = body.split_once(';').expect("a width");
        let (height, mut rest) = rest.split_at(digits(rest));
        let (width, height): (usize, usize) =
            (width.parse().expect("a number"), height.parse().expect("a number"));
        let mut picture = vec![vec![[999; 3]; width]; height];
        let (mut colours, mut colour) = (vec![[0; 3]; COLOURS], 0);
        let (mut x, mut y) = (0, 0);
        while let Some(c) = rest.chars().next() {
            rest = &rest[1..];
            let mut number = || {
                let (number, after) = rest.split_at(digits(rest));
                rest = after;
                number.parse::<usize>().expect("a number")
            };
            match c {
                '#' => {
                    colour = number();
                    if let Some(definition) = rest.strip_prefix(";2;") {
                        let length = definition
                            .find(|c: char| !c.is_ascii_digit() && c != ';')
                            .expect("an end");
                        let mut parts =
                            definition[..length].split(';').map(|n| n.parse().expect("a number"));
                        colours[colour] =
                            std::array::from_fn(|_| parts.next().expect("three numbers"));
                        rest = &definition[length..];
                    }
                }
                '$' => x = 0,
                '-' => (x, y) = (0, y + BAND),
                _ => {
                    let (count, sixel) = if c == '!' {
                        let count = number();
                        let sixel = rest.as_bytes()[0];
                        rest = &rest[1..];
                        (count, sixel)
                    } else {
                        (1, c as u8)
                    };
                    for _ in 0..count {
                        let set = (0..BAND).filter(|row| (sixel - b'?') >> row & 1 == 1);
                        set.for_each(|row| picture[y + row][x] = colours[colour]);
                        x += 1;
                    }
                }
            }
        }
        picture
    }

    #[test]
    fn a_picture_is_encoded_pixel_by_pixel() {
        // Runs, single pixels, and a last band that is not full.
        let (width, height) = (23_usize, 8_usize);
        let rgb =
            |i: usize| if i % width < 9 { [255, 0, 0] } else { [(i * 37 % 3 * 100) as u8, 0, 255] };
        let pixels: Vec<u8> = (0..width * height).flat_map(rgb).collect();
        let mut out = Vec::new();
        let size = (width as u32, height as u32);
        Palette::default().encode(&mut out, &pixels, size, &mut Bands::default()).expect("encoded");
        let picture = decoded(&String::from_utf8(out).expect("text"));
        for (i, got) in picture.concat().into_iter().enumerate() {
            let expected = rgb(i).map(|channel| u32::from(channel) * 100);
            assert!(
                got.iter().zip(expected).all(|(got, own)| (got * 255).abs_diff(own) <= 128),
                "pixel {i}: {got:?}"
            );
        }
    }
}
