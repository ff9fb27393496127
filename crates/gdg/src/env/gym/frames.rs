//! The messages between the program and a worker: a kind and a length, then that many bytes, all
//! little-endian. `worker.py` is the other side.

use crate::env::Rendering;

/// Bytes before the contents of a frame.
pub const HEADER_BYTES: usize = 8;

/// Largest reply whose size is not known beforehand: descriptions and errors.
pub const MAX_TEXT_BYTES: usize = 1 << 20;

/// What the program asks a worker to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// The worker's own source, before all else.
    Source = 0,
    /// Import what is needed and describe the environment.
    Open = 1,
    /// Have at least this number of environments.
    Make = 2,
    /// Begin an episode.
    Reset = 3,
    /// Step the first environments.
    Step = 4,
    /// Return the full states of the first environments.
    Save = 5,
    /// Put an environment into a full state.
    Restore = 6,
    /// Return the rewards of pairs of goals.
    Reward = 7,
    /// Return a picture of an environment.
    Picture = 8,
}

/// The two kinds of replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// What was asked for.
    Done,
    /// JSON that says why it cannot be done.
    Failed,
}

/// Why the header of a reply is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadHeader {
    /// The kind is unknown.
    Kind(u32),
    /// The length is not what can be expected.
    Length(u32),
}

/// The length of a reply that is expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// Exactly this many bytes.
    Exactly(usize),
    /// At most this many bytes.
    AtMost(usize),
}

/// Returns a request as a frame.
pub fn request(kind: Request, body: &[u8]) -> Vec<u8> {
    let mut frame = Vec::with_capacity(HEADER_BYTES + body.len());
    frame.extend((kind as u32).to_le_bytes());
    frame.extend((body.len() as u32).to_le_bytes());
    frame.extend(body);
    frame
}

/// Returns the kind of a reply and the number of bytes that follow. Memory is not taken before the
/// length has been checked.
///
/// # Errors
/// These bytes do not begin such a reply.
pub fn reply_header(
    header: [u8; HEADER_BYTES],
    expected: Expected,
) -> Result<(Reply, usize), BadHeader> {
    let [kind, length] =
        [0, 4].map(|at| u32::from_le_bytes(std::array::from_fn(|i| header[at + i])));
    let (kind, fits) = match kind {
        0 => (Reply::Done, expected),
        1 => (Reply::Failed, Expected::AtMost(MAX_TEXT_BYTES)),
        other => return Err(BadHeader::Kind(other)),
    };
    let fits = match fits {
        Expected::Exactly(bytes) => length as usize == bytes,
        Expected::AtMost(bytes) => length as usize <= bytes,
    };
    if fits { Ok((kind, length as usize)) } else { Err(BadHeader::Length(length)) }
}

/// Returns numbers as bytes.
pub fn f32_bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Returns numbers as bytes.
pub fn f64_bytes(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Returns bytes as numbers.
pub fn f32_numbers(bytes: &[u8]) -> impl Iterator<Item = f32> + '_ {
    bytes.as_chunks().0.iter().map(|number| f32::from_le_bytes(*number))
}

/// Returns bytes as numbers.
pub fn f64_numbers(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    bytes.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number))
}

/// Bytes that one number of a full state keeps exactly.
const PACKED_BYTES: usize = 6;

/// Returns bytes as their number and whole numbers, as many as `longest` bytes need.
pub fn packed(bytes: &[u8], longest: usize) -> Vec<f64> {
    let number = |chunk: &[u8]| chunk.iter().rev().fold(0, |all, byte| all << 8 | u64::from(*byte));
    let numbers = bytes.chunks(PACKED_BYTES).map(|chunk| number(chunk) as f64);
    let mut all: Vec<f64> = std::iter::once(bytes.len() as f64).chain(numbers).collect();
    all.resize(1 + longest.div_ceil(PACKED_BYTES), 0.0);
    all
}

/// Returns the bytes that [`packed`] was given, if these numbers are some.
pub fn unpacked(numbers: &[f64]) -> Option<Vec<u8>> {
    let (length, numbers) = numbers.split_first()?;
    let mut bytes: Vec<u8> = numbers
        .iter()
        .flat_map(|number| (*number as u64).to_le_bytes().into_iter().take(PACKED_BYTES))
        .collect();
    let is_sound = *length >= 0.0 && *length <= bytes.len() as f64;
    bytes.truncate(*length as usize);
    is_sound.then_some(bytes)
}

/// Reads width and height, u32 each, and the pixels; or 0, 0 and a text.
///
/// # Errors
/// The text, or that these bytes are no picture.
pub fn rendering(bytes: &[u8]) -> Result<Rendering, String> {
    let nothing = || "what it renders is no picture".to_owned();
    let (head, rest) = bytes.split_at_checked(8).ok_or_else(nothing)?;
    let [width, height] =
        [0, 4].map(|at| u32::from_le_bytes(std::array::from_fn(|i| head[at + i])) as usize);
    if (width, height) == (0, 0) {
        return Err(String::from_utf8_lossy(rest).into_owned());
    }
    let (pixels, none) = rest.as_chunks();
    let is_whole = none.is_empty() && Some(pixels.len()) == width.checked_mul(height);
    if is_whole && !pixels.is_empty() {
        Ok(Rendering::new(width, pixels.to_vec()))
    } else {
        Err(nothing())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(kind: u32, length: u32) -> [u8; HEADER_BYTES] {
        let mut header = [0; HEADER_BYTES];
        header[..4].copy_from_slice(&kind.to_le_bytes());
        header[4..].copy_from_slice(&length.to_le_bytes());
        header
    }

    #[test]
    fn a_reply_of_another_size_than_expected_is_refused_before_it_is_read() {
        let step = Expected::Exactly(40);
        assert_eq!(reply_header(header(0, 40), step), Ok((Reply::Done, 40)));
        assert_eq!(reply_header(header(0, 0), step), Err(BadHeader::Length(0)));
        assert_eq!(reply_header(header(0, 1 << 31), step), Err(BadHeader::Length(1 << 31)));
        assert_eq!(reply_header(header(1, 400), step), Ok((Reply::Failed, 400)));
        assert_eq!(reply_header(header(1, u32::MAX), step), Err(BadHeader::Length(u32::MAX)));
        assert_eq!(reply_header(*b"Hello, w", step), Err(BadHeader::Kind(0x6c6c_6548)));
        let text = Expected::AtMost(MAX_TEXT_BYTES);
        assert_eq!(reply_header(header(0, 17), text), Ok((Reply::Done, 17)));
    }

    #[test]
    fn numbers_survive_as_bytes() {
        let (single, double) = ([0.1, -0.0, f32::MAX], [0.1, -1e300]);
        assert!(f32_numbers(&f32_bytes(&single)).eq(single));
        assert!(f64_numbers(&f64_bytes(&double)).eq(double));
        assert_eq!(request(Request::Make, &[5, 0, 0, 0]), [2, 0, 0, 0, 4, 0, 0, 0, 5, 0, 0, 0]);
        let bytes: Vec<u8> = (0..=255).collect();
        for length in [0, 1, 6, 255] {
            let numbers = packed(&bytes[..length], 256);
            assert_eq!(numbers.len(), 44, "all of one length");
            assert_eq!(unpacked(&numbers).as_deref(), Some(&bytes[..length]));
        }
        for damaged in [&[][..], &[7.0, 0.0], &[-1.0, 0.0], &[f64::NAN, 0.0]] {
            assert_eq!(unpacked(damaged), None);
        }
    }
}
