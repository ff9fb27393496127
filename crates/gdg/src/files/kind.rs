//! Identifies a file by its first bytes, to explain errors about wrong files.
//!
//! Readers ask only after they have failed, so a wrong guess never rejects a valid file.

use std::io::Read;
use std::path::Path;

/// How many bytes are looked at.
const PREFIX_BYTES: u64 = 8 << 10;

/// The longest header that a safetensors file may have.
const MAX_SAFETENSORS_HEADER: u64 = 100_000_000;

/// The formats that this program reads, and everything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileFormat {
    /// A map in Moving AI format.
    Map,
    /// Tasks in Moving AI format.
    Scenario,
    /// Checkpoints and policies.
    Safetensors,
    Json,
    /// Recorded transitions.
    Npz,
    Text,
    /// A file of other programs.
    Foreign,
}

/// What a reader reads.
#[derive(Debug)]
pub struct Wanted {
    /// With an article: `a map`.
    pub name: &'static str,
    /// What to give instead.
    pub help: &'static str,
    /// The formats whose errors the reader explains itself.
    pub own: &'static [FileFormat],
}

/// A file of another kind than expected.
#[derive(Debug)]
pub struct Mismatch {
    /// What it is: `is an image (PNG), not a map`.
    pub problem: String,
    pub help: String,
}

impl Wanted {
    /// Returns what the file at `path` is, if it is recognised as something else.
    pub fn mismatch(&self, path: &Path) -> Option<Mismatch> {
        let mut start = Vec::new();
        super::open(path).ok()?.take(PREFIX_BYTES).read_to_end(&mut start).ok()?;
        if start.is_empty() {
            return Some(Mismatch { problem: "is empty".to_owned(), help: self.help.to_owned() });
        }
        let (name, format, advice) = kind(&start)?;
        if self.own.contains(&format) {
            return None;
        }
        let help = match advice {
            Advice::Instead(advice) => advice.to_owned(),
            Advice::First(advice) => format!("{advice}; {}", self.help),
            Advice::None => self.help.to_owned(),
        };
        Some(Mismatch { problem: format!("is {name}, not {}", self.name), help })
    }
}

/// A recognised file: what it is, with an article.
type Kind = (&'static str, FileFormat, Advice);

/// Advice for a kind of file, whatever was wanted.
#[derive(Clone, Copy)]
enum Advice {
    /// Only this: the wanted file is inside.
    Instead(&'static str),
    /// This first, then the reader's own advice.
    First(&'static str),
    None,
}

const UNPACK: Advice = Advice::Instead("unpack it first, and give the file within");
const UNDOTTED: Advice = Advice::Instead("give the file without ._ in its name");
const NUMPY: Advice = Advice::First("its arrays have to be written in another format");

/// First bytes of files of other programs.
const FOREIGN: [(&[u8], &str, Advice); 15] = [
    (b"\x89PNG", "an image (PNG)", Advice::None),
    (b"\xff\xd8\xff", "an image (JPEG)", Advice::None),
    (b"GIF8", "an image (GIF)", Advice::None),
    (b"P2\n", "an image (PGM)", Advice::None),
    (b"P5\n", "an image (PGM)", Advice::None),
    (b"%PDF", "a document (PDF)", Advice::None),
    (b"\x89HDF", "an HDF5 file", Advice::None),
    (b"\x80\x02", "a Python pickle", Advice::None),
    (b"\x80\x04", "a Python pickle", Advice::None),
    (b"\x93NUMPY", "a NumPy array (npy)", NUMPY),
    (b"\x1f\x8b", "a compressed file or archive (GZIP)", UNPACK),
    (b"\xfd7zXZ", "a compressed file or archive (XZ)", UNPACK),
    (b"\x28\xb5\x2f\xfd", "a compressed file or archive (ZSTD)", UNPACK),
    (b"PK\x03\x04", "a compressed file or archive (ZIP)", UNPACK),
    (b"\0\x05\x16\x07", "what macOS notes about another file", UNDOTTED),
];

/// Returns what a file with these first bytes is, or `None` if that is unknown.
fn kind(start: &[u8]) -> Option<Kind> {
    let prefixed = || FOREIGN.iter().find(|(first, ..)| start.starts_with(first));
    wide_text(start)
        .or_else(|| own_binary(start))
        .or_else(|| prefixed().map(|(_, name, advice)| (*name, FileFormat::Foreign, *advice)))
        .or_else(|| own_text(start))
        .or_else(|| {
            // The last character may be cut off.
            let chunk = start.utf8_chunks().next()?;
            let is_plain = |c: char| !c.is_control() || c.is_whitespace();
            let is_text = chunk.valid().len() + 4 > start.len()
                && !chunk.valid().trim().is_empty()
                && chunk.valid().chars().all(is_plain);
            is_text.then_some(("a text file", FileFormat::Text, Advice::None))
        })
}

/// Recognises UTF-16, with a byte-order mark or, for mostly Latin text, without.
fn wide_text(start: &[u8]) -> Option<Kind> {
    const HELP: &str = "save it as UTF-8: in an editor, with iconv -f UTF-16 -t UTF-8, or in PowerShell, whose > writes \
                        UTF-16, with | Out-File -Encoding ascii FILE";
    let characters = start[..start.len().min(256)].as_chunks::<2>().0;
    let is_latin = |[a, b]: &[u8; 2]| (*a == 0) != (*b == 0);
    let is_wide = start.starts_with(b"\xff\xfe")
        || start.starts_with(b"\xfe\xff")
        || characters.len() > 1 && characters.iter().all(is_latin);
    is_wide.then_some(("text in UTF-16", FileFormat::Foreign, Advice::Instead(HELP)))
}

fn own_binary(start: &[u8]) -> Option<Kind> {
    if let Some((length, header)) = start.split_first_chunk::<8>()
        && (2..MAX_SAFETENSORS_HEADER).contains(&u64::from_le_bytes(*length))
        && header.starts_with(b"{")
    {
        let advice = Advice::First("gdg-tui --resume FILE resumes a checkpoint");
        return Some(("a safetensors file", FileFormat::Safetensors, advice));
    }
    // The name of its first file begins at byte 30, and its length is at 26.
    let length = usize::from(u16::from_le_bytes(*start.get(26..)?.first_chunk()?));
    let is_npz = start.starts_with(b"PK\x03\x04")
        && start.get(30..30 + length).is_some_and(|name| name.ends_with(b".npy"));
    is_npz.then_some(("an archive of NumPy arrays (npz)", FileFormat::Npz, NUMPY))
}

/// Recognises the text formats of this program, pointers to other files, and web pages.
fn own_text(start: &[u8]) -> Option<Kind> {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let text = String::from_utf8_lossy(start).to_ascii_lowercase();
    let mut words = text.split_whitespace();
    let has = |part: &str| text.contains(part);
    let foreign = |name, advice| (name, FileFormat::Foreign, Advice::Instead(advice));
    Some(match (words.next()?, words.next().unwrap_or_default()) {
        ("version", address) if address.starts_with("https://") => foreign(
            "a Git LFS pointer, which stands for the file",
            "run 'git lfs pull' in its repository, which puts the file itself in its place",
        ),
        (path, _) if path.contains("/annex/objects/") => foreign(
            "a git-annex pointer, which stands for the file",
            "run 'git annex get FILE', which puts the file itself in its place",
        ),
        ("version", _) => ("a scenario", FileFormat::Scenario, Advice::None),
        ("type", "octile") => ("a map in Moving AI format", FileFormat::Map, Advice::None),
        _ if text.starts_with('<') && (has("<html") || has("<!doctype html")) => foreign(
            "a web page (HTML)",
            "open it in a browser: it may say why the file could not be downloaded",
        ),
        _ if text.starts_with('<') => ("XML", FileFormat::Foreign, Advice::None),
        _ if text.starts_with('{') => ("JSON", FileFormat::Json, Advice::None),
        _ if text.starts_with('[')
            && text[1..].trim_start().starts_with(['[', '{', '"', '0', '1']) =>
        {
            ("JSON", FileFormat::Json, Advice::None)
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_their_first_bytes() {
        let zip = |name: &str| {
            let length = [name.len() as u8, 0, 0, 0];
            [b"PK\x03\x04".as_slice(), &[0; 22], &length, name.as_bytes()].concat()
        };
        // The prefix may end within a character.
        let cut = "é".repeat(5000);
        for (start, expected) in [
            (&b"version https://git-lfs.github.com/spec/v1\noid"[..], "a Git LFS pointer"),
            (b"\xff\xfe#\0", "text in UTF-16"),
            (b"#\0.\0\n\0", "text in UTF-16"),
            (b"\x89PNG\r\n\x1a\n", "an image (PNG)"),
            (&zip("a.txt"), "a compressed file or archive (ZIP)"),
            (&zip("arr_0.npy"), "an archive of NumPy arrays"),
            (b"\n<!DOCTYPE html>\n<title>", "a web page"),
            (b"<?xml version=\"1.0\"?><Error>", "XML"),
            (b"{\"tau\": 1}", "JSON"),
            (b"[[1, 0]]", "JSON"),
            (b"\x02\0\0\0\0\0\0\0{}", "a safetensors file"),
            (b"Type Octile\n", "a map in Moving AI format"),
            (b"version 1\n", "a scenario"),
            (b"[keys]\n", "a text file"),
            (&cut.as_bytes()[..8191], "a text file"),
            (b"", "unknown"),
            (b"\x01\x02\x03", "unknown"),
        ] {
            let found = kind(start).map_or("unknown", |(name, ..)| name);
            assert!(found.starts_with(expected), "{:?}: {found}", String::from_utf8_lossy(start));
        }
    }
}
