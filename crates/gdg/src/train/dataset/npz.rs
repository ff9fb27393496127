//! Arrays of NumPy in an archive (`.npz`), and its CRC-32, from one open file: what replaces the file
//! meanwhile is not read.

use std::fmt::Display;
use std::fs::{File, Metadata};
use std::io::{BufReader, Error, ErrorKind, Read};
use std::path::Path;
use std::time::SystemTime;

use candle_core::{DType, Device, Tensor};
use flate2::Crc;
use zip::ZipArchive;
use zip::read::ZipFile;

use crate::files::{self, Format, Wanted};
use crate::pulse::Progress;

/// Most numbers of an array: 4 GB of memory.
const MOST_NUMBERS: usize = 1 << 30;

/// No file is packed more tightly than this: the limit of Deflate.
const MOST_PACKED: u64 = 1_040;

/// Longest header of an array; NumPy itself reads none longer than 10,000 bytes.
const MOST_OF_A_HEADER: usize = 10_000;

/// Bytes that are read at a time, whole numbers of every kind.
const CHUNK: usize = 1 << 20;

/// The ending of an array's name in the archive.
const ENDING: &str = ".npy";

/// What is read as data.
const DATA: Wanted =
    Wanted { name: "an .npz file of NumPy", help: "numpy.savez writes one", own: &[Format::Npz] };

/// What is wrong with an archive that is recognised as one.
const CUT_OFF: &str = "is no .npz file of NumPy, or its end is missing";

/// What tells whether a file is still the same, without reading it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
    /// Differs if another file has taken its place.
    inode: Option<u64>,
}

impl Stamp {
    fn new(facts: &Metadata) -> Self {
        #[cfg(unix)]
        let inode = Some(std::os::unix::fs::MetadataExt::ino(facts));
        #[cfg(not(unix))]
        let inode = None;
        Self { bytes: facts.len(), modified: facts.modified().ok(), inode }
    }

    /// Returns whether the file at `path` still has this stamp.
    pub fn is_of(&self, path: &Path) -> bool {
        std::fs::metadata(path).is_ok_and(|facts| Self::new(&facts) == *self)
    }
}

/// An open file of known CRC-32.
#[derive(Debug)]
pub struct Opened {
    file: File,
    /// As it was before anything was read.
    pub stamp: Stamp,
    /// CRC-32 of its contents.
    pub checksum: u32,
}

impl Opened {
    /// Opens a file, and reports progress as one of several parts.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn new(
        path: &Path,
        [part, parts]: [usize; 2],
        progress: &Progress,
    ) -> std::io::Result<Self> {
        let file = files::open(path)?;
        let stamp = Stamp::new(&file.metadata()?);
        let all = stamp.bytes as usize;
        let tell = |bytes| progress.set(part * all + bytes as usize, parts * all);
        Ok(Self { checksum: checksum_of(&file, tell)?, file, stamp })
    }
}

/// Returns the CRC-32 of all bytes; calls `tell` with how many have been read.
fn checksum_of(mut bytes: impl Read, tell: impl Fn(u64)) -> std::io::Result<u32> {
    let (mut crc, mut done, mut chunk) = (Crc::new(), 0, vec![0; CHUNK]);
    tell(done);
    loop {
        match bytes.read(&mut chunk) {
            Ok(0) => return Ok(crc.sum()),
            Ok(read) => {
                crc.update(&chunk[..read]);
                done += read as u64;
                tell(done);
            }
            // By a signal that is handled.
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The arrays of a file.
pub struct Arrays {
    archive: ZipArchive<BufReader<File>>,
    stamp: Stamp,
}

/// An array of the archive.
struct Array<'a> {
    /// What is left to read of it.
    bytes: ZipFile<'a, BufReader<File>>,
    kind: DType,
    shape: Vec<usize>,
}

impl Arrays {
    /// Returns the arrays of the file that has been opened at `path`.
    ///
    /// # Errors
    /// It is no such archive.
    pub fn new(path: &Path, Opened { file, stamp, .. }: Opened) -> Result<Self, String> {
        let explained = |error| {
            log::debug!("{}: {error}", path.display());
            DATA.mismatch(path).map_or(CUT_OFF.to_owned(), |found| found.problem)
        };
        let archive = ZipArchive::new(BufReader::new(file)).map_err(explained)?;
        Ok(Self { archive, stamp })
    }

    /// Returns the names of the arrays in alphabetical order.
    pub fn names(&self) -> Vec<String> {
        let names = self.archive.file_names().flatten();
        let mut names: Vec<String> =
            names.filter_map(|name| name.strip_suffix(ENDING).map(str::to_owned)).collect();
        names.sort();
        names
    }

    /// Returns the shape of an array, if the file can hold it.
    ///
    /// # Errors
    /// It is damaged, or stored in another way.
    pub fn shape(&mut self, name: &str) -> Result<Vec<usize>, String> {
        self.array(name).map(|array| array.shape)
    }

    /// Returns the numbers of an array.
    ///
    /// # Errors
    /// It is damaged, stored in another way, or no longer of this `shape`.
    pub fn numbers(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        let Array { mut bytes, kind, shape: found } = self.array(name)?;
        if found != shape {
            return Err(CHANGED.to_owned());
        }
        let size = kind.size_in_bytes();
        let (mut left, mut chunk) = (shape.iter().product::<usize>() * size, vec![0; CHUNK]);
        let mut numbers = Vec::with_capacity(left / size);
        let mut read = || {
            while left > 0 {
                let part = &mut chunk[..left.min(CHUNK)];
                bytes.read_exact(part)?;
                left -= part.len();
                let count = part.len() / size;
                let part = Tensor::from_raw_buffer(part, kind, &[count], &Device::Cpu)?;
                numbers.extend(part.to_dtype(DType::F32)?.to_vec1::<f32>()?);
            }
            // The archive compares the CRC-32 of an array where that ends.
            Ok::<_, candle_core::Error>((&mut bytes).take(1).read_to_end(&mut Vec::new())?)
        };
        match read() {
            Ok(0) => Ok(numbers),
            Ok(_) => Err(damaged(name, &"it goes on beyond its shape")),
            Err(error) => Err(damaged(name, &error)),
        }
    }

    /// Returns the stamp of the file, if it is still as it was when it was opened: it may have been
    /// written over.
    ///
    /// # Errors
    /// It is not.
    pub fn close(self) -> Result<Stamp, String> {
        let facts = self.archive.into_inner().get_ref().metadata();
        let is_same = facts.is_ok_and(|facts| Stamp::new(&facts) == self.stamp);
        if is_same { Ok(self.stamp) } else { Err(CHANGED.to_owned()) }
    }

    /// Returns an array, read up to the end of its header.
    fn array(&mut self, name: &str) -> Result<Array<'_>, String> {
        let most = self.stamp.bytes.saturating_mul(MOST_PACKED);
        let found = self.archive.by_name(&format!("{name}{ENDING}"));
        let mut bytes = found.map_err(|error| damaged(name, &error))?;
        let header = header(&mut bytes).map_err(|error| damaged(name, &error))?;
        if value(&header, "fortran_order").is_some_and(|order| order.starts_with("True")) {
            return Err(format!(
                "{name} is stored column by column (Fortran order): save \
                 numpy.ascontiguousarray({name})"
            ));
        }
        let kind = value(&header, "descr").and_then(kind).ok_or_else(|| {
            format!(
                "{name} has numbers of a kind that cannot be read: save {name}.astype('float32')"
            )
        })?;
        let shape = value(&header, "shape").and_then(shape);
        let shape = shape.ok_or_else(|| damaged(name, &"its header has no shape"))?;
        let count = shape.iter().try_fold(1_usize, |count, n| count.checked_mul(*n));
        match count.filter(|count| *count <= MOST_NUMBERS) {
            Some(count) if (count * kind.size_in_bytes()) as u64 <= most => {
                Ok(Array { bytes, kind, shape })
            }
            _ => Err(format!(
                "{name} has shape {shape:?}: more than the file holds, or than {MOST_NUMBERS} \
                 numbers"
            )),
        }
    }
}

/// What is wrong with a file that another program has written over.
const CHANGED: &str = "has changed while it was read";

fn damaged(name: &str, error: &dyn Display) -> String {
    format!("{name} cannot be read, as if the file were damaged: {error}")
}

/// Reads the header of an array: a dictionary of Python.
fn header(array: &mut impl Read) -> std::io::Result<String> {
    let other = |problem: &str| Error::new(ErrorKind::InvalidData, problem);
    let mut start = [0; 8];
    array.read_exact(&mut start)?;
    if !start.starts_with(b"\x93NUMPY") {
        return Err(other("it is no array of NumPy"));
    }
    // The length has four bytes from version 2 on.
    let mut length = [0; 4];
    array.read_exact(&mut length[..if start[6] == 1 { 2 } else { 4 }])?;
    let length = u32::from_le_bytes(length) as usize;
    if length > MOST_OF_A_HEADER {
        return Err(other("its header is too long"));
    }
    let mut header = vec![0; length];
    array.read_exact(&mut header)?;
    String::from_utf8(header).map_err(|_| other("its header is no text"))
}

/// Returns what follows a key of a header.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

/// Returns the kind of numbers that a header names, if they can be read.
fn kind(value: &str) -> Option<DType> {
    let (kind, _) = value.strip_prefix('\'')?.split_once('\'')?;
    Some(match kind.trim_start_matches(['<', '=', '|']) {
        "b1" | "?" | "u1" | "B" => DType::U8,
        "i2" | "h" => DType::I16,
        "i4" | "i" => DType::I32,
        "i8" | "q" => DType::I64,
        "u4" | "I" => DType::U32,
        "f2" | "e" => DType::F16,
        "f4" | "f" => DType::F32,
        "f8" | "d" => DType::F64,
        _ => return None,
    })
}

/// Returns the shape that a header names.
fn shape(value: &str) -> Option<Vec<usize>> {
    let (lengths, _) = value.strip_prefix('(')?.split_once(')')?;
    let lengths = lengths.split(',').map(str::trim).filter(|length| !length.is_empty());
    lengths.map(|length| length.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// Bytes whose every other read is interrupted by a signal.
    struct Interrupted(&'static [u8], bool);

    impl Read for Interrupted {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            self.1 = !self.1;
            if self.1 { Err(ErrorKind::Interrupted.into()) } else { self.0.read(&mut into[..2]) }
        }
    }

    #[test]
    fn a_checksum_goes_on_where_a_signal_interrupts_it() {
        let told = RefCell::new(Vec::new());
        let found = checksum_of(Interrupted(b"12345", false), |done| told.borrow_mut().push(done));
        assert_eq!(found.expect("a checksum"), crc32fast::hash(b"12345"));
        assert_eq!(told.into_inner(), [0, 2, 4, 5]);
    }

    #[test]
    fn what_takes_the_place_of_an_open_file_is_not_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, other] = ["d.npz", "other.npz"].map(|name| folder.path().join(name));
        let write = |path: &Path, numbers: &[f32]| {
            let array = Tensor::new(numbers, &Device::Cpu).expect("an array");
            Tensor::write_npz(&[("a", array)], path).expect("written");
        };
        let open = || Opened::new(&file, [0, 1], &Progress::default()).expect("opened");
        write(&file, &[1.0, 2.0]);
        let (stamp, opened) = (open().stamp, open());
        write(&other, &[3.0]);
        std::fs::rename(&other, &file).expect("replaced");
        let mut arrays = Arrays::new(&file, opened).expect("arrays");
        assert_eq!(arrays.numbers("a", &[2]), Ok(vec![1.0, 2.0]));
        assert!(arrays.close() == Ok(stamp.clone()) && !stamp.is_of(&file));
        // Written over, the file that is open has other contents.
        let mut arrays = Arrays::new(&file, open()).expect("arrays");
        write(&file, &[4.0, 5.0]);
        assert_eq!(arrays.numbers("a", &[1]), Err(CHANGED.to_owned()));
        assert_eq!(arrays.close(), Err(CHANGED.to_owned()));
    }
}
