//! The part of a line that an error shows: lines can have thousands or even millions of characters.

use std::ops::Range;

use unicode_width::UnicodeWidthChar;

use super::sanitized;

/// Characters shown on each side of the error.
const CONTEXT_CHARS: usize = 36;

#[derive(Clone, Copy, Debug)]
pub struct SourceLine<'a> {
    /// Its number, from 0.
    pub number: usize,
    /// Its text, without its line ending.
    pub text: &'a str,
}

/// The offending part of a line and its surroundings.
#[derive(Debug, Clone)]
pub struct Excerpt {
    /// The file, safe to display.
    pub file: String,
    /// The line's number, from 0.
    pub line: usize,
    /// Column of the excerpt's first character, from 0.
    pub first_column: usize,
    /// The part of the line that is shown, safe to display.
    pub text: String,
    /// Offset and length of the offending bytes within `text`.
    pub span: (usize, usize),
}

impl Excerpt {
    /// Creates an excerpt around `columns` (from 0, in characters) of a line.
    pub fn new(file: &str, line: SourceLine, columns: Range<usize>) -> Self {
        let first_column = columns.start.saturating_sub(CONTEXT_CHARS);
        let shown = line.text.chars().skip(first_column).take(2 * CONTEXT_CHARS);
        // A tab as one column, and what is invisible or joins its neighbours as something visible, so
        // that the marks below the text stay in place.
        let visible = |c: char| match (c, c.width()) {
            ('\t', _) => ' ',
            (_, Some(0)) => '\u{fffd}',
            _ => c,
        };
        let text = sanitized(&shown.map(visible).collect::<String>());
        let bytes = |until: usize| -> usize { text.chars().take(until).map(char::len_utf8).sum() };
        let (from, to) = (
            bytes(columns.start - first_column),
            bytes(columns.end.max(columns.start) - first_column),
        );
        Self {
            file: sanitized(file),
            line: line.number,
            first_column,
            span: (from, to - from),
            text,
        }
    }

    /// Returns an excerpt around the bytes `span` of a file's `text`, and their line and column
    /// (both from 1).
    pub fn from_span(file: &str, text: &str, span: Range<usize>) -> (Self, (usize, usize)) {
        let at = text.floor_char_boundary(span.start);
        let (line, column) = line_and_column(text, at);
        let from = text[..at].rfind('\n').map_or(0, |i| i + 1);
        let rest = &text[from..];
        let own = rest.split('\n').next().unwrap_or_default();
        let end = text.floor_char_boundary(span.end.max(at)).min(from + own.len()).max(at);
        let length = text[at..end].chars().take(2 * CONTEXT_CHARS).count();
        let own = own.strip_suffix('\r').unwrap_or(own);
        let own = SourceLine { number: line - 1, text: own };
        (Self::new(file, own, column - 1..column - 1 + length), (line, column))
    }
}

/// Returns the line and column (from 1, in characters) of a byte offset in `text`.
pub fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(offset)];
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    (before.matches('\n').count() + 1, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_excerpt_is_a_part_of_the_line_of_its_span() {
        let text = "{\n  \"tau\": \"x\",\r\n  \"b\": 1\n}";
        let at = text.find("\"x\"").expect("there");
        let (excerpt, place) = Excerpt::from_span("f", text, at..at + 3);
        assert_eq!(place, (2, 10));
        assert_eq!((excerpt.text.as_str(), excerpt.span), ("  \"tau\": \"x\",", (9, 3)));
        // Each character that is shown takes its columns, joined by terminals or not.
        let text = "\u{1f468}\u{200d}\u{1f469}e\u{301}\u{4e00}x";
        let excerpt = Excerpt::new("f", SourceLine { number: 0, text }, 6..7);
        let (from, length) = excerpt.span;
        assert_eq!(&excerpt.text[from..from + length], "x");
        assert_eq!(super::super::display_width(&excerpt.text[..from]), 2 + 1 + 2 + 1 + 1 + 2);
        let text = "x".repeat(5_000_000) + "é\x1b";
        let (excerpt, place) = Excerpt::from_span("f", &text, 4_000_000..5_000_000);
        assert_eq!(place, (1, 4_000_001));
        assert!(excerpt.text.len() <= 2 * CONTEXT_CHARS);
        let (end, _) = Excerpt::from_span("f", &text, text.len()..text.len() + 9);
        assert!(end.text.ends_with("é?"), "{}", end.text);
    }
}
