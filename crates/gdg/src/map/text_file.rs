//! Reads files, splits bytes into lines, with the checks that all formats share, and errors: what is
//! wrong, where, and what is expected instead.

use std::io::ErrorKind;
use std::path::Path;

use super::grid::{MAX_CELLS, size_limits};
use crate::files;
use crate::text::{Excerpt, SourceLine, line_and_column, sanitized};

/// Size limit of a map or scenario file: room for the cells, line endings and a header.
const MAX_BYTES: u64 = 4 * MAX_CELLS as u64;

/// Reads a file that should contain a `kind`: a map, a scenario or an image.
pub fn read_file(path: &Path, kind: &str) -> MapResult<Vec<u8>> {
    files::read(path, MAX_BYTES).map_err(|error| {
        let help = format!("give a {kind} file");
        let (problem, help) = match (error.kind(), kind) {
            (ErrorKind::IsADirectory, _) => ("is a directory".to_owned(), help),
            (ErrorKind::FileTooLarge, "map") => {
                ("is too large for a map".to_owned(), size_limits())
            }
            (ErrorKind::FileTooLarge, _) => (format!("is too large for a {kind}"), help),
            _ => (format!("cannot be read: {error}"), help),
        };
        MapError::whole_file(&path.to_string_lossy(), problem, help)
    })
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct TextPosition {
    /// Line, from 0.
    pub line: usize,
    /// Column, from 0, in characters.
    pub column: usize,
}

pub struct TextFile<'a> {
    pub file: &'a str,
    /// All of it, without its byte-order mark.
    pub source: &'a str,
    /// Its lines, without their LF or CRLF.
    pub lines: Vec<&'a str>,
}

impl<'a> TextFile<'a> {
    /// Checks that `bytes` are non-empty text; drops a byte-order mark and trailing empty lines.
    pub fn new(file: &'a str, bytes: &'a [u8]) -> MapResult<Self> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if let Some(at) = bytes.iter().position(|b| *b == 0) {
            return Err(not_text(file, bytes, at, "a NUL byte"));
        }
        let source = std::str::from_utf8(bytes)
            .map_err(|e| not_text(file, bytes, e.valid_up_to(), "a byte that is not UTF-8"))?;
        let ends = if source.contains('\n') { '\n' } else { '\r' };
        let mut lines: Vec<&str> =
            source.split(ends).map(|line| line.strip_suffix('\r').unwrap_or(line)).collect();
        while lines.last().is_some_and(|l| l.is_empty()) {
            lines.pop();
        }
        if lines.is_empty() {
            return Err(MapError::whole_file(
                file,
                "the file is empty",
                "a map needs at least one free cell, a scenario the line 'version 1' and a task",
            ));
        }
        Ok(Self { file, source, lines })
    }

    pub fn place_of(&self, byte: usize) -> TextPosition {
        let (line, column) = line_and_column(self.source, byte);
        TextPosition { line: line - 1, column: column - 1 }
    }

    /// Creates an error at `columns` of line `line`, both from 0; a line past the end is shown as
    /// empty.
    pub fn error(
        &self,
        line: usize,
        columns: std::ops::Range<usize>,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) -> Box<MapError> {
        let text = self.lines.get(line).copied().unwrap_or_default();
        MapError::at(self.file, SourceLine { number: line, text }, columns, problem, help)
    }

    /// Creates an error about the character at `place`.
    pub fn error_at(
        &self,
        place: TextPosition,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) -> Box<MapError> {
        self.error(place.line, place.column..place.column + 1, problem, help)
    }

    /// Creates an error about the whole of line `line`.
    pub fn line_error(
        &self,
        line: usize,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) -> Box<MapError> {
        let length = self.lines.get(line).map_or(0, |l| l.chars().count());
        self.error(line, 0..length, problem, help)
    }
}

fn not_text(file: &str, bytes: &[u8], at: usize, found: &str) -> Box<MapError> {
    error_at_byte(
        file,
        bytes,
        at,
        format!("this is not a text file: {found}"),
        "maps and scenarios are plain text: one character per cell, or the Moving AI formats",
    )
}

/// Creates an error at a byte of a file that need not be text.
pub fn error_at_byte(
    file: &str,
    bytes: &[u8],
    at: usize,
    problem: impl Into<String>,
    help: impl Into<String>,
) -> Box<MapError> {
    let line = bytes[..at].split(|b| *b == b'\n').count() - 1;
    let from = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let to = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i);
    let before = String::from_utf8_lossy(&bytes[from..at]).chars().count();
    let text = String::from_utf8_lossy(&bytes[from..to]);
    MapError::at(file, SourceLine { number: line, text: &text }, before..before + 1, problem, help)
}

/// Result of reading a map or scenario.
pub type MapResult<T> = Result<T, Box<MapError>>;

/// An unusable file: its name and, where applicable, line and column (both from 1).
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}: {problem}", self.location())]
pub struct MapError {
    /// The file or the name of a built-in map.
    pub file: String,
    /// Line and column from 1, in characters; `None` if the error concerns the whole file.
    pub at: Option<(usize, usize)>,
    pub problem: String,
    /// What is expected instead.
    pub help: String,
    /// The offending part of the file.
    pub excerpt: Option<Excerpt>,
}

impl MapError {
    /// Creates an error about the whole file.
    pub fn whole_file(
        file: &str,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) -> Box<Self> {
        Box::new(Self {
            file: file.to_owned(),
            at: None,
            problem: problem.into(),
            help: help.into(),
            excerpt: None,
        })
    }

    /// Creates an error at `columns` (from 0, in characters) of a line.
    pub fn at(
        file: &str,
        line: SourceLine,
        columns: std::ops::Range<usize>,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) -> Box<Self> {
        let excerpt = Excerpt::new(file, line, columns.clone());
        Box::new(Self {
            file: file.to_owned(),
            at: Some((line.number + 1, columns.start + 1)),
            problem: problem.into(),
            help: help.into(),
            excerpt: Some(excerpt),
        })
    }

    fn location(&self) -> String {
        match self.at {
            Some((line, column)) => format!("{}:{line}:{column}", sanitized(&self.file)),
            None => sanitized(&self.file),
        }
    }
}
