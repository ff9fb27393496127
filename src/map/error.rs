//! What is wrong with a file, where, and what would be right.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

/// Result of reading a map or scenario.
pub type MapResult<T> = Result<T, Box<MapError>>;

/// A file that cannot be used: names the file, and where it applies line and column (both from 1).
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}: {what}", self.place())]
pub struct MapError {
    /// The file or built-in name.
    pub file: String,
    /// Line and column from 1, in characters; absent where the file as a whole is meant.
    pub at: Option<(usize, usize)>,
    /// What is wrong.
    pub what: String,
    /// What would be right.
    pub right: String,
    excerpt: Option<Excerpt>,
}

/// Characters shown on each side of the place that is wrong: maps have lines of thousands.
const SHOWN_AROUND: usize = 36;

/// The part of the offending line that is shown.
#[derive(Debug, Clone)]
struct Excerpt {
    file: String,
    line: usize,
    /// Column of the excerpt's first character, from 0.
    first_column: usize,
    text: String,
    /// The offending bytes within `text`.
    span: SourceSpan,
}

impl MapError {
    /// An error about the file as a whole.
    pub fn whole(file: &str, what: impl Into<String>, right: impl Into<String>) -> Box<Self> {
        Box::new(Self { file: file.to_owned(), at: None, what: what.into(), right: right.into(), excerpt: None })
    }

    /// An error at `columns` (from 0, in characters) of line number `line` (from 0), whose text is `text`.
    pub fn at(
        file: &str,
        (line, text): (usize, &str),
        columns: std::ops::Range<usize>,
        what: impl Into<String>,
        right: impl Into<String>,
    ) -> Box<Self> {
        let first_column = columns.start.saturating_sub(SHOWN_AROUND);
        let shown: Vec<char> = text.chars().skip(first_column).take(2 * SHOWN_AROUND).map(printable).collect();
        let bytes = |until: usize| -> usize { shown.iter().take(until).map(|c| c.len_utf8()).sum() };
        let (from, to) = (bytes(columns.start - first_column), bytes(columns.end.max(columns.start) - first_column));
        let excerpt = Excerpt {
            file: file.to_owned(),
            line,
            first_column,
            text: shown.iter().collect(),
            span: (from, to - from).into(),
        };
        Box::new(Self {
            file: file.to_owned(),
            at: Some((line + 1, columns.start + 1)),
            what: what.into(),
            right: right.into(),
            excerpt: Some(excerpt),
        })
    }

    fn place(&self) -> String {
        match self.at {
            Some((line, column)) => format!("{}:{line}:{column}", self.file),
            None => self.file.clone(),
        }
    }
}

/// Control characters would move the cursor of the terminal that shows the error.
fn printable(c: char) -> char {
    if c.is_control() { '\u{fffd}' } else { c }
}

impl Diagnostic for MapError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.right))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_ref().map(|e| e as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let excerpt = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), excerpt.span))))
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        // Asked without context, miette wants to know where the span itself begins.
        let alone = context_lines_before == 0 && context_lines_after == 0;
        let from = if alone { span.offset().min(self.text.len()) } else { 0 };
        let column = self.first_column + self.text[..from].chars().count();
        let data = &self.text.as_bytes()[from..];
        let contents =
            MietteSpanContents::new_named(self.file.clone(), data, (from, data.len()).into(), self.line, column, 1);
        Ok(Box::new(contents))
    }
}
