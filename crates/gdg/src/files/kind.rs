//! Identifies a file by its first bytes, to explain errors about wrong files.
//!
//! Readers ask only after they have failed, so a wrong guess never rejects a valid file.

use std::io::Read;
use std::path::Path;

use infer::MatcherType;

/// How many bytes are looked at.
const PREFIX_BYTES: u64 = 8 << 10;

/// The longest header that a safetensors file may have.
const MAX_SAFETENSORS_HEADER: u64 = 100_000_000;

/// The formats that this program reads, and everything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A map in Moving AI format.
    Map,
    /// Tasks in Moving AI format.
    Scenario,
    /// Checkpoints and policies.
    Safetensors,
    /// Settings.
    Json,
    /// Recorded transitions.
    Npz,
    /// Any other text.
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
    pub own: &'static [Format],
}

/// A file of another kind than expected.
#[derive(Debug)]
pub struct Mismatch {
    /// What it is: `is an image (PNG), not a map`.
    pub problem: String,
    /// What to do.
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
        let Kind { name, format, advice } = kind(&start)?;
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

/// A recognised file.
struct Kind {
    /// With an article.
    name: String,
    format: Format,
    advice: Advice,
}

/// Advice for a kind of file, whatever was wanted.
enum Advice {
    /// Only this: the wanted file is inside.
    Instead(&'static str),
    /// This first, then the reader's own advice.
    First(&'static str),
    None,
}

impl Kind {
    fn new(name: impl Into<String>, format: Format, advice: Advice) -> Self {
        Self { name: name.into(), format, advice }
    }

    fn foreign(name: impl Into<String>) -> Self {
        Self::new(name, Format::Foreign, Advice::None)
    }

    fn hides_the_file(name: impl Into<String>, advice: &'static str) -> Self {
        Self::new(name, Format::Foreign, Advice::Instead(advice))
    }
}

/// Returns what a file with these first bytes is, or `None` if that is unknown.
fn kind(start: &[u8]) -> Option<Kind> {
    wide_text(start)
        .or_else(|| binary(start))
        .or_else(|| own_text(start))
        .or_else(|| listed(start))
        .or_else(|| {
            let text = start
                .utf8_chunks()
                .next()
                .filter(|chunk| chunk.valid().len() + 4 > start.len())?
                .valid();
            let is_plain = |c: char| !c.is_control() || c.is_whitespace();
            (!text.trim().is_empty() && text.chars().all(is_plain))
                .then(|| Kind::new("a text file", Format::Text, Advice::None))
        })
}

/// Recognises UTF-16 and UTF-32, with a byte-order mark or, for mostly Latin text, without.
fn wide_text(start: &[u8]) -> Option<Kind> {
    const UTF_16: &str = "save it as UTF-8: in an editor, with iconv -f UTF-16 -t UTF-8, or in PowerShell, whose > writes \
                          UTF-16, with | Out-File -Encoding ascii FILE";
    const UTF_32: &str = "save it as UTF-8: in an editor, or with iconv -f UTF-32 -t UTF-8";
    /// Whether all characters, of `N` bytes, have only one byte that is not 0: the one at `place`.
    fn is_latin<const N: usize>(start: &[u8], place: usize) -> bool {
        let characters = start[..start.len().min(256)].as_chunks::<N>().0;
        let fits = |bytes: &[u8; N]| {
            bytes.iter().enumerate().all(|(i, byte)| (*byte != 0) == (i == place))
        };
        characters.len() > 1 && characters.iter().all(fits)
    }
    let utf_16 = || Some(Kind::hides_the_file("text in UTF-16", UTF_16));
    let utf_32 = || Some(Kind::hides_the_file("text in UTF-32", UTF_32));
    match start {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => utf_32(),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => utf_16(),
        _ if is_latin::<4>(start, 0) || is_latin::<4>(start, 3) => utf_32(),
        _ if is_latin::<2>(start, 0) || is_latin::<2>(start, 1) => utf_16(),
        _ => None,
    }
}

/// Recognises the field's binary formats, which general libraries lack.
fn binary(start: &[u8]) -> Option<Kind> {
    const NUMPY: Advice = Advice::First("its arrays have to be written in another format");
    const AS_TEXT: Advice = Advice::First("save what it holds as plain text");
    if let Some((length, header)) = start.split_first_chunk::<8>()
        && (2..MAX_SAFETENSORS_HEADER).contains(&u64::from_le_bytes(*length))
        && header.starts_with(b"{")
    {
        let advice = Advice::First("gdg-tui --resume FILE resumes a checkpoint");
        return Some(Kind::new("a safetensors file", Format::Safetensors, advice));
    }
    if start.starts_with(b"PK\x03\x04") {
        let length = usize::from(u16::from_le_bytes(*start.get(26..)?.first_chunk()?));
        let first = start.get(30..)?;
        let first = &first[..length.min(first.len())];
        if first.ends_with(b".npy") {
            return Some(Kind::new("an archive of NumPy arrays (npz)", Format::Npz, NUMPY));
        }
        let is_of_office =
            [&b"[Content_Types].xml"[..], b"_rels/", b"docProps/", b"xl/", b"word/", b"mimetype"];
        if is_of_office.iter().any(|name| first.starts_with(name)) {
            return Some(Kind::new(
                "a document or a spreadsheet of an office program",
                Format::Foreign,
                AS_TEXT,
            ));
        }
        return first.ends_with(b"data.pkl").then(|| Kind::foreign("a PyTorch checkpoint"));
    }
    if start.starts_with(b"SQLite format 3") {
        return Some(Kind::foreign("a database (SQLite)"));
    }
    Some(match start {
        [b'{', b'\\', b'r', b't', b'f', ..] => {
            Kind::new("a document (RTF)", Format::Foreign, AS_TEXT)
        }
        [b'P', b'1' | b'4', b' ' | b'\r' | b'\n', ..] => Kind::foreign("an image (PBM)"),
        [b'P', b'2' | b'5', b' ' | b'\r' | b'\n', ..] => Kind::foreign("an image (PGM)"),
        [b'P', b'3' | b'6', b' ' | b'\r' | b'\n', ..] => Kind::foreign("an image (PPM)"),
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => {
            Kind::new("a NumPy array (npy)", Format::Foreign, NUMPY)
        }
        [0x89, b'H', b'D', b'F', b'\r', b'\n', ..] => Kind::foreign("an HDF5 file"),
        [0x80, 2..=5, ..] => Kind::foreign("a Python pickle (PyTorch checkpoints were such files)"),
        [b'I', b'I', b'*', 0, ..] | [b'M', b'M', 0, b'*', ..] => Kind::foreign("an image (TIFF)"),
        [0, 5, 0x16, 7, ..] => Kind::hides_the_file(
            "what macOS notes about another file",
            "give the file without ._ in its name",
        ),
        _ => return None,
    })
}

/// Recognises the text formats of this program, pointers to other files, and markup.
fn own_text(start: &[u8]) -> Option<Kind> {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let text = String::from_utf8_lossy(start).to_ascii_lowercase();
    let mut words = text.split_whitespace();
    let (first, second) = (words.next()?, words.next().unwrap_or_default());
    Some(match (first, second) {
        ("version", address) if address.starts_with("https://") => Kind::hides_the_file(
            "a Git LFS pointer, which stands for the file",
            "run 'git lfs pull' in its repository, which puts the file itself in its place",
        ),
        (path, _) if path.contains("/annex/objects/") => Kind::hides_the_file(
            "a git-annex pointer, which stands for the file",
            "run 'git annex get FILE', which puts the file itself in its place",
        ),
        ("version", _) => Kind::new("a scenario", Format::Scenario, Advice::None),
        ("type", "octile") => Kind::new("a map in Moving AI format", Format::Map, Advice::None),
        _ if ["image:", "resolution:"]
            .iter()
            .all(|key| text.lines().any(|line| line.starts_with(key))) =>
        {
            Kind::foreign("the description of a ROS map (YAML)")
        }
        _ if text.starts_with('<') => markup(&text),
        _ if text.starts_with('{') => json(&text),
        _ if text.starts_with('[')
            && text[1..].trim_start().starts_with(['[', '{', '"', '0', '1']) =>
        {
            Kind::new("JSON", Format::Json, Advice::None)
        }
        _ => return None,
    })
}

/// Tells web pages and pictures from other XML.
fn markup(text: &str) -> Kind {
    if text.contains("<html") || text.contains("<!doctype html") {
        let advice = "open it in a browser: it may say why the file could not be downloaded";
        return Kind::hides_the_file("a web page (HTML)", advice);
    }
    Kind::foreign(if text.contains("<svg") { "an image (SVG)" } else { "XML" })
}

/// Tells recordings from other JSON.
fn json(text: &str) -> Kind {
    let is_recording = ["\"width\"", "\"term\""].iter().any(|key| text.contains(key));
    if is_recording && text.contains("\"version\"") {
        let advice = Advice::First("asciinema play FILE shows it");
        return Kind::new("a screen recording", Format::Foreign, advice);
    }
    Kind::new("JSON", Format::Json, Advice::None)
}

/// Recognises what the library knows: images, archives, documents and many more.
fn listed(start: &[u8]) -> Option<Kind> {
    const UNPACK: &str = "unpack it first, and give the file within";
    let found = infer::get(start)?;
    let subtype = found.mime_type().rsplit('/').next().unwrap_or_default();
    let subtype = subtype.strip_prefix("x-").unwrap_or(subtype);
    let short = if subtype.len() > 8 { found.extension() } else { subtype };
    let short = short.to_ascii_uppercase();
    Some(match found.matcher_type() {
        MatcherType::Archive if short == "PDF" => Kind::foreign("a document (PDF)"),
        MatcherType::Archive => {
            Kind::hides_the_file(format!("a compressed file or archive ({short})"), UNPACK)
        }
        MatcherType::Image => Kind::foreign(format!("an image ({short})")),
        MatcherType::Video => Kind::foreign(format!("a video ({short})")),
        MatcherType::Audio => Kind::foreign(format!("a sound ({short})")),
        MatcherType::Doc | MatcherType::Book => Kind::foreign(format!("a document ({short})")),
        MatcherType::App => Kind::foreign(format!("a program ({short})")),
        _ => Kind::foreign(format!("a file of another kind ({short})")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name_of(start: &[u8]) -> String {
        kind(start).map_or("unknown".to_owned(), |kind| kind.name)
    }

    #[test]
    fn files_are_told_by_their_first_bytes() {
        let zip = |name: &str| {
            [b"PK\x03\x04".as_slice(), &[0; 22], &[name.len() as u8, 0, 0, 0], name.as_bytes()]
                .concat()
        };
        for (start, expected) in [
            (&b"version https://git-lfs.github.com/spec/v1\noid"[..], "a Git LFS pointer"),
            (b"\xff\xfe#\0", "text in UTF-16"),
            (b"#\0.\0\n\0", "text in UTF-16"),
            (b"\xff\xfe\0\0#\0\0\0", "text in UTF-32"),
            (b"\0\0\0#\0\0\0.", "text in UTF-32"),
            (b"P2\n2 2\n", "an image (PGM)"),
            (b"SQLite format 3\0", "a database"),
            (b"{\\rtf1\\ansi", "a document (RTF)"),
            (&zip("[Content_Types].xml"), "a document or a spreadsheet"),
            (b"image: a.pgm\nresolution: 0.05\n", "the description of a ROS map"),
            (b"\x89PNG\r\n\x1a\n", "an image (PNG)"),
            (b"\xff\xd8\xff\xe0", "an image (JPEG)"),
            (b"GIF89a", "an image (GIF)"),
            (b"BM\x36\0\0\0", "an image (BMP)"),
            (b"II*\0\x08\0\0\0", "an image (TIFF)"),
            (b"RIFF\x24\0\0\0WEBPVP8 ", "an image (WEBP)"),
            (b"%PDF-1.7", "a document (PDF)"),
            (b"\x1f\x8b\x08\0", "a compressed file or archive (GZIP)"),
            (b"BZh91AY&SY", "a compressed file or archive (BZIP2)"),
            (b"\xfd7zXZ\0", "a compressed file or archive (XZ)"),
            (b"\x28\xb5\x2f\xfd\x04\0\0\0", "a compressed file or archive (ZSTD)"),
            (&zip("a.txt"), "a compressed file or archive (ZIP)"),
            (&zip("arr_0.npy"), "an archive of NumPy arrays"),
            (&zip("archive/data.pkl"), "a PyTorch checkpoint"),
            (b"\x93NUMPY\x01\0", "a NumPy array"),
            (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
            (b"\x80\x04\x95", "a Python pickle"),
            (b"\0\x05\x16\x07\0\x02", "what macOS notes"),
            (b"\n<!DOCTYPE html>\n<title>", "a web page"),
            (b"<?xml version=\"1.0\"?><Error>", "XML"),
            (b"{\"version\": 3, \"term\": {}}", "a screen recording"),
            (b"{\"version\":2,\"width\":4}", "a screen recording"),
            (b"{\"tau\": 1}", "JSON"),
            (b"[[1, 0]]", "JSON"),
            (b"\x02\0\0\0\0\0\0\0{}", "a safetensors file"),
            (b"Type Octile\n", "a map in Moving AI format"),
            (b"version 1\n", "a scenario"),
            (b"[keys]\n", "a text file"),
            (b"", "unknown"),
            (b"\x01\x02\x03", "unknown"),
        ] {
            let found = name_of(start);
            assert!(found.starts_with(expected), "{:?}: {found}", String::from_utf8_lossy(start));
        }
    }

    #[test]
    fn the_prefix_may_end_within_a_character() {
        let text = "é".repeat(5000);
        assert_eq!(name_of(&text.as_bytes()[..8191]), "a text file");
    }
}
