//! The bytes of a checkpoint: a store in safetensors format with a checksum. Arrays that get
//! shorter by it are packed (see [`super::packed`]) and stored as tensors of bytes.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use serde::Deserialize;

use super::packed::{PackedError, Packer, Packing};
use crate::job::Job;
use crate::store::{Array, Store, StoreError};
use crate::train::policy_file::POLICY_KEY;

/// Beginning of the name of every format.
const FORMAT_PREFIX: &str = "gdg-tui checkpoint ";

/// Format name in the metadata. Format 1 had neither checksum nor history; formats 1 and 2 did not
/// name the world; formats 1 to 3 packed nothing.
const FORMAT: &str = "gdg-tui checkpoint 4";
const FORMAT_WITHOUT_PACKING: &str = "gdg-tui checkpoint 3";
const FORMAT_WITHOUT_WORLD: &str = "gdg-tui checkpoint 2";
const FORMAT_WITHOUT_CHECKSUM: &str = "gdg-tui checkpoint 1";

/// Metadata keys of the format, the checksum, and how each packed array is packed.
const FORMAT_KEY: &str = "format";
const CHECKSUM_KEY: &str = "checksum";
const PACKED_KEY: &str = "packed";

/// Maximum header size read, far above that of any checkpoint of this program.
pub const MAX_HEADER_BYTES: u64 = 64 << 20;

/// Error in a checkpoint's bytes.
#[derive(Debug, thiserror::Error)]
pub enum ContentError {
    /// Not a safetensors file.
    #[error("is not a safetensors file: {0}")]
    Foreign(#[from] SafeTensorError),
    /// A file without any bytes.
    #[error("is empty")]
    Empty,
    /// There is no header, or it is not JSON.
    #[error("is not a safetensors file")]
    Header,
    /// A safetensors file of something else.
    #[error("is {0}, not a checkpoint")]
    Other(&'static str),
    /// A format unknown to this version.
    #[error("has format {format:?}, written by version {version}; this version reads {FORMAT:?}")]
    Format {
        /// The format.
        format: String,
        /// The version of this program that wrote it.
        version: String,
    },
    /// The file is shorter or longer than its header says.
    #[error("is damaged: its size differs from what its header says")]
    Size,
    /// The contents do not match the checksum.
    #[error("is damaged: its checksum does not match its contents")]
    Damaged,
    /// A packed array cannot be unpacked.
    #[error(transparent)]
    Packed(#[from] PackedError),
    /// The packed arrays do not fit into memory: their size, and the largest possible one.
    #[error("has {} MB when unpacked, more than the {} MB for which there is room", .0 >> 20, .1 >> 20)]
    TooLarge(u64, u64),
    /// Contents are missing or invalid.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// A tensor as stored in the file.
struct Tensor {
    dtype: Dtype,
    bytes: Vec<u8>,
}

impl From<&Array> for Tensor {
    fn from(array: &Array) -> Self {
        let (dtype, bytes) = match array {
            Array::F32(v) => (Dtype::F32, v.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Array::U16(v) => (Dtype::U16, v.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Array::U32(v) => (Dtype::U32, v.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Array::U64(v) => (Dtype::U64, v.iter().flat_map(|v| v.to_le_bytes()).collect()),
        };
        Self { dtype, bytes }
    }
}

/// Returns the numbers of a tensor, or `None` for a type that a store does not support.
fn array(view: &TensorView) -> Option<Array> {
    fn numbers<T, const N: usize>(bytes: &[u8], parse: fn([u8; N]) -> T) -> Vec<T> {
        bytes.as_chunks::<N>().0.iter().map(|bytes| parse(*bytes)).collect()
    }
    let bytes = view.data();
    Some(match view.dtype() {
        Dtype::F32 => numbers(bytes, f32::from_le_bytes).into(),
        Dtype::U16 => numbers(bytes, u16::from_le_bytes).into(),
        Dtype::U32 => numbers(bytes, u32::from_le_bytes).into(),
        Dtype::U64 => numbers(bytes, u64::from_le_bytes).into(),
        _ => return None,
    })
}

/// Serialises `store` to the bytes of a checkpoint file, and says how many of its numbers are
/// packed.
///
/// # Errors
/// The format cannot represent the store.
pub fn to_bytes(store: Store, progress: &Job) -> Result<Vec<u8>, ContentError> {
    let (arrays, mut texts) = store.into_parts();
    let (mut packer, mut packings) = (Packer::default(), BTreeMap::new());
    let mut tensors = BTreeMap::new();
    let (mut done, all) = (0, arrays.values().map(Array::len).sum());
    for (name, array) in &arrays {
        progress.set(done, all);
        done += array.len();
        let tensor = match packer.pack(name, &arrays) {
            Some((packing, bytes)) => {
                packings.insert(name, packing);
                Tensor { dtype: Dtype::U8, bytes }
            }
            None => array.into(),
        };
        tensors.insert(name.clone(), tensor);
    }
    let packings = serde_json::to_string(&packings).map_err(|_| ContentError::Header)?;
    texts.insert(PACKED_KEY.to_owned(), packings);
    texts.insert("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    texts.insert(FORMAT_KEY.to_owned(), FORMAT.to_owned());
    serialized_with_checksum(&tensors, texts)
}

/// Serialises tensors and texts with a checksum over both.
fn serialized_with_checksum(
    tensors: &BTreeMap<String, Tensor>,
    mut texts: BTreeMap<String, String>,
) -> Result<Vec<u8>, ContentError> {
    let parts =
        tensors.iter().map(|(name, tensor)| (name.as_str(), tensor.dtype, tensor.bytes.as_slice()));
    let sum = checksum(texts.iter().map(|(name, text)| (name.as_str(), text.as_str())), parts);
    texts.insert(CHECKSUM_KEY.to_owned(), sum);
    let views = tensors.iter().map(|(name, Tensor { dtype, bytes })| {
        // Checkpoints never contain types smaller than a byte.
        let size = (dtype.bitsize() / 8).max(1);
        TensorView::new(*dtype, vec![bytes.len() / size], bytes).map(|view| (name.as_str(), view))
    });
    let views = views.collect::<Result<Vec<_>, _>>()?;
    Ok(safetensors::serialize(views, Some(texts.into_iter().collect()))?)
}

/// Returns the CRC-32 of texts and tensors, each in order of name so that it does not depend on the
/// order in the file.
fn checksum<'a>(
    texts: impl Iterator<Item = (&'a str, &'a str)>,
    tensors: impl Iterator<Item = (&'a str, Dtype, &'a [u8])>,
) -> String {
    let mut hasher = crc32fast::Hasher::new();
    // Length prefixes delimit names and contents.
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    for (name, text) in texts {
        add(name.as_bytes());
        add(text.as_bytes());
    }
    for (name, dtype, bytes) in tensors {
        add(name.as_bytes());
        add(format!("{dtype:?}").as_bytes());
        add(bytes);
    }
    format!("{:08x}", hasher.finalize())
}

/// Parses the bytes of a checkpoint file into a store whose packed arrays take at most `most` bytes
/// of memory.
///
/// # Errors
/// The bytes are not a valid checkpoint, or it needs more memory.
pub fn from_bytes(bytes: &[u8], most: u64) -> Result<Store, ContentError> {
    let (texts, tensors) = checked(bytes)?;
    let mut store = Store::default();
    unpacked_arrays(&tensors, &packings(&texts, most)?)?
        .into_iter()
        .for_each(|(name, array)| store.put(name, array));
    let kept = texts.into_iter().filter(|(name, _)| name != PACKED_KEY);
    kept.for_each(|(name, text)| store.put_text(name, text));
    Ok(store)
}

/// Checks the bytes of a checkpoint file as [`from_bytes`] does, but unpacks nothing: an array that
/// was damaged has another checksum, which is found out much faster.
///
/// # Errors
/// The bytes are not a valid checkpoint, or it needs more memory.
pub fn check(bytes: &[u8], most: u64) -> Result<(), ContentError> {
    checked(bytes).and_then(|(texts, _)| packings(&texts, most)).map(drop)
}

/// Returns the texts and tensors in a checkpoint's bytes, whose checksum is right.
fn checked(bytes: &[u8]) -> Result<(BTreeMap<String, String>, SafeTensors<'_>), ContentError> {
    let texts = checked_texts(bytes, bytes.len() as u64)?;
    let tensors = SafeTensors::deserialize(bytes)?;
    if texts.get(FORMAT_KEY).is_some_and(|format| format != FORMAT_WITHOUT_CHECKSUM) {
        let kept = texts.iter().filter(|(name, _)| *name != CHECKSUM_KEY);
        let views: BTreeMap<_, _> = tensors.iter().collect();
        let sum = checksum(
            kept.map(|(name, text)| (name.as_str(), text.as_str())),
            views.iter().map(|(name, view)| (*name, view.dtype(), view.data())),
        );
        let stated =
            texts.get(CHECKSUM_KEY).ok_or_else(|| StoreError::Missing(CHECKSUM_KEY.to_owned()))?;
        if *stated != sum {
            return Err(ContentError::Damaged);
        }
    }
    Ok((texts, tensors))
}

/// Returns how each array is packed, by its name. Unpacked, all take at most `most` bytes.
fn packings(
    texts: &BTreeMap<String, String>,
    most: u64,
) -> Result<BTreeMap<String, Packing>, ContentError> {
    let unreadable = |e: serde_json::Error| StoreError::Unreadable {
        name: PACKED_KEY.to_owned(),
        why: e.to_string(),
    };
    let packings: BTreeMap<String, Packing> = texts
        .get(PACKED_KEY)
        .map_or(Ok(BTreeMap::new()), |text| serde_json::from_str(text))
        .map_err(unreadable)?;
    let bytes = packings.values().map(Packing::unpacked_bytes).fold(0, u64::saturating_add);
    if bytes > most {
        return Err(ContentError::TooLarge(bytes, most));
    }
    Ok(packings)
}

/// Returns the arrays in `tensors`, unpacked.
fn unpacked_arrays(
    tensors: &SafeTensors,
    packings: &BTreeMap<String, Packing>,
) -> Result<BTreeMap<String, Array>, ContentError> {
    let views: BTreeMap<_, _> = tensors.iter().collect();
    let mut arrays = BTreeMap::new();
    for (name, view) in views {
        let found = match packings.get(name) {
            Some(packing) => Some(packing.unpack(name, view.data(), &arrays)?),
            None => array(&view),
        };
        found.map(|array| arrays.insert(name.to_owned(), array));
    }
    Ok(arrays)
}

/// Parses the texts of a checkpoint of `size` bytes from its start, which contains the header; the
/// tensors need not be present.
///
/// # Errors
/// The header is not from a checkpoint of this program, the format is unknown, or the file has
/// another size.
pub fn texts_from_start(start: &[u8], size: u64) -> Result<Store, ContentError> {
    let mut store = Store::default();
    checked_texts(start, size)?.into_iter().for_each(|(name, text)| store.put_text(name, text));
    Ok(store)
}

/// Returns the texts in a file's header. Tells a file of `size` bytes that was cut off from a whole
/// one.
fn checked_texts(start: &[u8], size: u64) -> Result<BTreeMap<String, String>, ContentError> {
    if size == 0 {
        return Err(ContentError::Empty);
    }
    let header = header(start)?;
    let texts = texts_of(metadata(header)?)?;
    match file_size(header) {
        Some(whole) if whole != size => Err(ContentError::Size),
        _ => Ok(texts),
    }
}

/// Returns the header at the start of a file, which begins with its length.
fn header(start: &[u8]) -> Result<&[u8], ContentError> {
    let (length, rest) = start.split_first_chunk::<8>().ok_or(ContentError::Header)?;
    let length = u64::from_le_bytes(*length);
    let whole = usize::try_from(length).ok().and_then(|length| rest.get(..length));
    let is_cut_off = rest.starts_with(b"{") && length <= MAX_HEADER_BYTES;
    whole.ok_or(if is_cut_off { ContentError::Size } else { ContentError::Header })
}

/// Returns whether a file that starts like this is a checkpoint of any version of this program.
pub fn is_start_of_checkpoint(start: &[u8]) -> bool {
    let texts = header(start).and_then(metadata).ok().flatten().unwrap_or_default();
    texts.get(FORMAT_KEY).is_some_and(|format| format.starts_with(FORMAT_PREFIX))
}

/// Parses the metadata in a header.
fn metadata(header: &[u8]) -> Result<Option<HashMap<String, String>>, ContentError> {
    #[derive(Deserialize)]
    struct Header {
        #[serde(rename = "__metadata__")]
        metadata: Option<HashMap<String, String>>,
    }
    // The safetensors library needs the whole file to read the header.
    serde_json::from_slice::<Header>(header)
        .map(|header| header.metadata)
        .map_err(|_| ContentError::Header)
}

/// Returns the size in bytes of the whole file with this header: the header's length, the header,
/// the tensors.
fn file_size(header: &[u8]) -> Option<u64> {
    #[derive(Deserialize)]
    struct Tensor {
        data_offsets: (u64, u64),
    }
    let entries: HashMap<String, serde_json::Value> = serde_json::from_slice(header).ok()?;
    let tensors = entries.into_iter().filter(|(name, _)| name != "__metadata__");
    let ends =
        tensors.map(|(_, entry)| Tensor::deserialize(entry).map(|tensor| tensor.data_offsets.1));
    let end = ends.collect::<Result<Vec<_>, _>>().ok()?.into_iter().max().unwrap_or(0);
    (8 + header.len() as u64).checked_add(end)
}

fn texts_of(
    metadata: Option<HashMap<String, String>>,
) -> Result<BTreeMap<String, String>, ContentError> {
    let texts: BTreeMap<String, String> = metadata.unwrap_or_default().into_iter().collect();
    let format = texts
        .get(FORMAT_KEY)
        .filter(|format| format.starts_with(FORMAT_PREFIX))
        .ok_or_else(|| {
            let is_policy = texts.contains_key(POLICY_KEY);
            ContentError::Other(if is_policy {
                "an exported policy"
            } else {
                "a safetensors file of another program"
            })
        })?;
    let known = [FORMAT, FORMAT_WITHOUT_PACKING, FORMAT_WITHOUT_WORLD, FORMAT_WITHOUT_CHECKSUM];
    if known.contains(&format.as_str()) {
        return Ok(texts);
    }
    let version = texts.get("version").map_or("unknown", String::as_str).to_owned();
    Err(ContentError::Format { format: format.clone(), version })
}

/// Returns the checkpoint with its checksum recomputed, for tests of the checks after it; `None` if
/// it is not a checkpoint.
pub fn with_updated_checksum(bytes: &[u8]) -> Option<Vec<u8>> {
    let (_, header) = SafeTensors::read_metadata(bytes).ok()?;
    let read = SafeTensors::deserialize(bytes).ok()?;
    let mut texts: BTreeMap<String, String> = header.metadata().clone()?.into_iter().collect();
    texts.remove(CHECKSUM_KEY);
    texts.insert(FORMAT_KEY.to_owned(), FORMAT.to_owned());
    let tensor = |view: &TensorView| Tensor { dtype: view.dtype(), bytes: view.data().to_vec() };
    serialized_with_checksum(
        &read.iter().map(|(name, view)| (name.to_owned(), tensor(&view))).collect(),
        texts,
    )
    .ok()
}

/// Returns the checkpoint with all arrays as plain tensors, for other programs and for tests; it
/// can be loaded too.
///
/// # Errors
/// The bytes are not a valid checkpoint.
pub fn unpacked(bytes: &[u8]) -> Result<Vec<u8>, ContentError> {
    let (arrays, mut texts) = from_bytes(bytes, u64::MAX)?.into_parts();
    texts.remove(CHECKSUM_KEY);
    let tensors = arrays.iter().map(|(name, array)| (name.clone(), array.into())).collect();
    serialized_with_checksum(&tensors, texts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_compares_the_checksum_and_unpacks_nothing() {
        let mut store = Store::default();
        store.put("a", vec![0.5_f32; 3_000]);
        let mut bytes = to_bytes(store, &Job::default()).expect("it can be stored");
        assert!(check(&bytes, u64::MAX).is_ok());
        assert!(matches!(check(&bytes, 100), Err(ContentError::TooLarge(12_000, 100))));
        bytes.iter_mut().rev().take(8).for_each(|byte| *byte = u8::MAX);
        assert!(matches!(check(&bytes, u64::MAX), Err(ContentError::Damaged)));
        // As nothing damages a file.
        let forged = with_updated_checksum(&bytes).expect("a checkpoint");
        assert!(check(&forged, u64::MAX).is_ok() && from_bytes(&forged, u64::MAX).is_err());
    }

    #[test]
    fn packing_says_how_far_it_is() {
        let (mut store, progress) = (Store::default(), Job::default());
        store.put("a", vec![0.5_f32; 3_000]);
        store.put("b", vec![0.5_f32; 1_000]);
        assert_eq!(progress.share(), None);
        progress.begin(0, 2);
        to_bytes(store, &progress).expect("it can be stored");
        // Before the second array, in the first of two stages.
        assert_eq!(progress.share(), Some(0.375));
    }
}
