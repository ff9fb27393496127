//! The bytes of a checkpoint: a safetensors file whose metadata describe the run, and whose tensors
//! are the state, packed, and the CRC-32 of all bytes before.

use std::collections::BTreeMap;
use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use serde::Deserialize;
use serde_json::json;

use crate::job::Job;
use crate::store::StoreError;
use crate::train::policy_file::POLICY_KEY;

/// The format, and the beginning of the name of every format. Formats 1 to 4 were those of versions
/// before 0.3.
const FORMAT: &str = "gdg-tui checkpoint 6";
const FORMAT_PREFIX: &str = "gdg-tui checkpoint ";

const FORMAT_KEY: &str = "format";
const VERSION_KEY: &str = "version";

/// Maximum header size read, far above that of any checkpoint of this program.
pub const MAX_HEADER_BYTES: u64 = 64 << 20;

/// The state is packed in parts of this size, each of them unless that does not shorten it: most bits
/// of weights are random.
const PART: usize = 1 << 14;

/// Bytes of the checksum, and of the state's length before its parts.
const SUM_BYTES: usize = 4;
const LENGTH_BYTES: usize = 8;

const PACKED: &str = "is damaged: its state cannot be unpacked";

fn damaged() -> StoreError {
    StoreError::inconsistent(PACKED)
}

const NO_HEADER: &str = "is not a safetensors file";
const SIZE: &str = "is damaged: its size differs from what its header says";

pub type Texts = BTreeMap<String, String>;

/// Returns the bytes of a checkpoint file, and says how much of the `state` is packed.
pub fn to_bytes(texts: &Texts, state: &[u8], progress: &Job) -> Vec<u8> {
    let mut packed = (state.len() as u64).to_le_bytes().to_vec();
    for (i, part) in state.chunks(PART).enumerate() {
        progress.set(i * PART, state.len());
        let short = deflated(part);
        let part = short.as_deref().unwrap_or(part);
        packed.extend((part.len() as u32).to_le_bytes());
        packed.extend(part);
    }
    let mut metadata = json!({FORMAT_KEY: FORMAT, VERSION_KEY: env!("CARGO_PKG_VERSION")});
    texts.iter().for_each(|(name, text)| metadata[name] = text.as_str().into());
    let tensor = |from: usize, to: usize| {
        let size = to - from;
        json!({ "dtype": "U8", "shape": [size], "data_offsets": [from, to] })
    };
    let header = json!({
        "__metadata__": metadata,
        "state": tensor(0, packed.len()),
        "checksum": tensor(packed.len(), packed.len() + SUM_BYTES),
    })
    .to_string();
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.into_bytes());
    bytes.extend(packed);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

fn deflated(part: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
    let short = encoder.write_all(part).and_then(|()| encoder.finish()).ok();
    short.filter(|short| short.len() < part.len())
}

/// Returns the texts and the state in a checkpoint's bytes; the state takes at most `most` bytes of
/// memory.
pub fn from_bytes(bytes: &[u8], most: u64) -> Result<(Texts, Vec<u8>), StoreError> {
    let (texts, length, mut packed) = checked(bytes, most)?;
    let mut state = Vec::new();
    while (state.len() as u64) < length {
        let part = (length - state.len() as u64).min(PART as u64);
        let (stored, rest) = packed.split_first_chunk().ok_or_else(damaged)?;
        let stored = u32::from_le_bytes(*stored) as usize;
        let (own, rest) = rest.split_at_checked(stored).ok_or_else(damaged)?;
        let before = state.len() as u64;
        if stored as u64 == part {
            state.extend(own);
        } else {
            // Never more than expected, whatever the file says.
            let mut decoder = DeflateDecoder::new(own).take(part + 1);
            decoder.read_to_end(&mut state).map_err(|_| damaged())?;
        }
        StoreError::unless(state.len() as u64 == before + part, PACKED)?;
        packed = rest;
    }
    StoreError::unless(packed.is_empty(), PACKED)?;
    Ok((texts, state))
}

/// Returns the texts in a checkpoint's bytes, whose checksum is right, the length of its state, and
/// that packed.
fn checked(bytes: &[u8], most: u64) -> Result<(Texts, u64, &[u8]), StoreError> {
    let texts = texts(bytes, bytes.len() as u64)?;
    let (all, sum) = bytes.split_last_chunk().ok_or_else(|| StoreError::inconsistent(SIZE))?;
    let is_sound = crc32fast::hash(all) == u32::from_le_bytes(*sum);
    StoreError::unless(is_sound, "is damaged: its checksum does not match its contents")?;
    let state = &all[8 + header(bytes)?.len()..];
    let (length, packed) = state.split_first_chunk().ok_or_else(damaged)?;
    let length = u64::from_le_bytes(*length);
    if length > most {
        let (length, most) = (length >> 20, most >> 20);
        return Err(StoreError::inconsistent(format!(
            "has {length} MB when unpacked, more than the {most} MB for which there is room"
        )));
    }
    Ok((texts, length, packed))
}

#[derive(Deserialize)]
struct Header {
    #[serde(rename = "__metadata__", default)]
    metadata: Texts,
    state: Option<Tensor>,
}

impl Header {
    fn format(&self) -> Option<&str> {
        let format = self.metadata.get(FORMAT_KEY)?;
        format.starts_with(FORMAT_PREFIX).then_some(format)
    }
}

#[derive(Deserialize)]
struct Tensor {
    data_offsets: (u64, u64),
}

/// Returns the header at the start of a file, which begins with its length.
fn header(start: &[u8]) -> Result<&[u8], StoreError> {
    let (length, rest) =
        start.split_first_chunk().ok_or_else(|| StoreError::inconsistent(NO_HEADER))?;
    let length = u64::from_le_bytes(*length);
    let whole = usize::try_from(length).ok().and_then(|length| rest.get(..length));
    let is_cut_off = rest.starts_with(b"{") && length <= MAX_HEADER_BYTES;
    whole.ok_or_else(|| StoreError::inconsistent(if is_cut_off { SIZE } else { NO_HEADER }))
}

/// Returns the texts of a checkpoint of `size` bytes from its start, which contains the header.
/// Tells a file that was cut off from a whole one.
pub fn texts(start: &[u8], size: u64) -> Result<Texts, StoreError> {
    StoreError::unless(size > 0, "is empty")?;
    let header = header(start)?;
    let parsed: Header =
        serde_json::from_slice(header).map_err(|_| StoreError::inconsistent(NO_HEADER))?;
    let Some(format) = parsed.format() else {
        let is_policy = parsed.metadata.contains_key(POLICY_KEY);
        let what =
            if is_policy { "an exported policy" } else { "a safetensors file of another program" };
        return Err(StoreError::inconsistent(format!("is {what}, not a checkpoint")));
    };
    if format != FORMAT {
        let version = parsed.metadata.get(VERSION_KEY).map_or("0.2.0", String::as_str);
        let this = env!("CARGO_PKG_VERSION");
        return Err(StoreError::inconsistent(format!(
            "was saved by version {version} of gdg-tui: open it with that version; this is version \
             {this}, which reads checkpoints of its own format only"
        )));
    }
    let (from, to) = parsed.state.ok_or_else(|| StoreError::inconsistent(NO_HEADER))?.data_offsets;
    let whole = to.checked_add((8 + header.len() + SUM_BYTES) as u64);
    StoreError::unless(from == 0 && to >= LENGTH_BYTES as u64 && whole == Some(size), SIZE)?;
    Ok(parsed.metadata)
}

/// Returns whether a file that starts like this is a checkpoint of any version of this program.
pub fn is_start_of_checkpoint(start: &[u8]) -> bool {
    let header = header(start).ok().and_then(|header| serde_json::from_slice(header).ok());
    header.is_some_and(|header: Header| header.format().is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts_of(about: &str) -> Texts {
        Texts::from([("about".to_owned(), about.to_owned())])
    }

    /// Some of it random, some not, of more than one part.
    fn state(length: usize) -> Vec<u8> {
        let random = |i: usize| (i as u32).wrapping_mul(2_654_435_761).to_be_bytes()[0];
        (0..length).map(|i| if i / 40_000 % 2 == 0 { random(i * i) } else { 7 }).collect()
    }

    fn checkpoint(length: usize) -> Vec<u8> {
        to_bytes(&texts_of("a \"run\""), &state(length), &Job::default())
    }

    fn forged(mut bytes: Vec<u8>) -> Vec<u8> {
        bytes.truncate(bytes.len() - SUM_BYTES);
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    #[test]
    fn states_of_any_length_are_packed_and_restored() {
        for length in [0, 1, PART - 1, PART, PART + 1, 300_000] {
            let bytes = checkpoint(length);
            let (texts, found) = from_bytes(&bytes, u64::MAX).expect("its own bytes");
            assert!(found == state(length) && texts["about"] == "a \"run\"", "{length}");
            assert!(checked(&bytes, u64::MAX).is_ok() && is_start_of_checkpoint(&bytes));
        }
        assert!(checkpoint(300_000).len() < 250_000, "parts that are not random are packed");
    }

    #[test]
    fn what_takes_too_much_memory_is_refused_before_it_is_unpacked() {
        let bytes = checkpoint(300_000);
        for result in [checked(&bytes, 100).map(drop), from_bytes(&bytes, 100).map(drop)] {
            assert!(result.is_err_and(|error| error.to_string().contains("there is room")));
        }
        // 50 MB of zeros in one part, which should have 64 KB.
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&vec![0; 50_000_000]).expect("in memory");
        let bomb = encoder.finish().expect("in memory");
        let mut bytes = checkpoint(0);
        let end = bytes.len() - SUM_BYTES - LENGTH_BYTES;
        let text = String::from_utf8_lossy(&bytes[8..end])
            .replace("[0,8]", &format!("[0,{}]", LENGTH_BYTES + 4 + bomb.len()));
        bytes = (text.len() as u64).to_le_bytes().to_vec();
        bytes.extend(text.into_bytes());
        bytes.extend((PART as u64).to_le_bytes());
        bytes.extend((bomb.len() as u32).to_le_bytes());
        bytes.extend(bomb);
        bytes.extend([0; SUM_BYTES]);
        assert_eq!(from_bytes(&forged(bytes), u64::MAX), Err(StoreError::inconsistent(PACKED)));
    }

    #[test]
    fn checkpoints_of_other_versions_are_refused_with_the_version_that_opens_them() {
        let bytes = checkpoint(10);
        for (format, version) in [("2", "0.1.0"), ("4", "0.2.0"), ("9", "7.1.0")] {
            let header = header(&bytes).expect("its header");
            let text = String::from_utf8_lossy(header)
                .replace(FORMAT, &format!("{FORMAT_PREFIX}{format}"))
                .replace(env!("CARGO_PKG_VERSION"), version);
            let other = [&bytes[..8], text.as_bytes(), &[0; 100]].concat();
            let error = texts(&other, 1_000).expect_err("another format").to_string();
            assert!(error.contains("open it with that version; this is"), "{error}");
            assert!(error.contains(version) && is_start_of_checkpoint(&other), "{error}");
        }
    }

    #[test]
    fn damage_of_any_byte_is_found() {
        let good = checkpoint(3_000);
        for at in 0..good.len() {
            for bits in [1, 0x80, 0xff] {
                let mut bytes = good.clone();
                bytes[at] ^= bits;
                assert!(checked(&bytes, u64::MAX).is_err(), "byte {at}");
            }
            assert!(checked(&good[..at], u64::MAX).is_err(), "cut off at {at}");
        }
    }
}
