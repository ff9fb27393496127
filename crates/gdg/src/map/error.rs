//! Errors in map and scenario files: what is wrong, where, and what is expected instead.

use crate::text::{Excerpt, SourceLine, sanitized};

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
    /// What is wrong.
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
