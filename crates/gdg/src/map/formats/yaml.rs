//! YAML as a sequence of events with their places. Lists of Python and JSON are YAML too.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::path::Path;
use std::str::FromStr;

use saphyr_parser::{Event as Parsed, Marker, Parser, ScanError};

use super::super::text::MapResult;
use super::super::text::{Place, Text};
use crate::text::line_and_column;

/// A piece of a YAML document.
#[derive(Debug, PartialEq)]
pub enum Event<'a> {
    Scalar(Cow<'a, str>),
    ListStart,
    ListEnd,
    MapStart,
    MapEnd,
}

/// Returns the events of the document that begins at byte `from`, with their places. Tags are
/// ignored.
pub fn events<'a>(
    text: &'a Text<'a>,
    from: usize,
) -> impl Iterator<Item = MapResult<(Event<'a>, Place)>> {
    let (first_line, first_column) = line_and_column(text.source, from);
    let place = move |at: &Marker| {
        let line = at.line().saturating_sub(1);
        let column = if line == 0 { at.col() + first_column - 1 } else { at.col() };
        Place { line: line + first_line - 1, column }
    };
    let source = &text.source[from..];
    let fault = move |error: &ScanError, open: &[Place]| {
        let is_at_end = error.marker().index() >= source.trim_end().chars().count();
        let bracket = |at: &Place| Some((bracket_at(text, *at)?, *at));
        let unclosed = open.last().and_then(bracket).filter(|_| is_at_end);
        let (problem, place) = match unclosed {
            Some((bracket, at)) => (format!("this {bracket} is not closed"), at),
            None => (error.info().to_owned(), place(error.marker())),
        };
        let problem = format!("this is not {}: {problem}", language(text));
        let help = "brackets, quotes and indentation must be those of YAML, JSON or a list of Python, and a file \
                    has one map";
        text.error_at(place, problem, help)
    };
    let (mut ended, mut open) = (false, Vec::new());
    Parser::new_from_str(source).filter_map(move |parsed| {
        let (event, span) = match parsed {
            Ok(parsed) => parsed,
            Err(error) => return Some(Err(fault(&error, &open))),
        };
        let place = place(&span.start);
        let event = match event {
            Parsed::Scalar(value, ..) => Event::Scalar(borrowed(text, place, value)),
            Parsed::SequenceStart(..) => Event::ListStart,
            Parsed::SequenceEnd => Event::ListEnd,
            Parsed::MappingStart(..) => Event::MapStart,
            Parsed::MappingEnd => Event::MapEnd,
            Parsed::Alias(_) => {
                let help = "write out what it stands for";
                return Some(Err(text.error_at(place, "an alias is not supported", help)));
            }
            Parsed::DocumentEnd => {
                ended = true;
                return None;
            }
            Parsed::DocumentStart(_) if ended => {
                let help = "give a file with one map";
                return Some(Err(text.error_at(place, "a second document begins here", help)));
            }
            Parsed::Nothing
            | Parsed::StreamStart
            | Parsed::StreamEnd
            | Parsed::DocumentStart(_) => {
                return None;
            }
        };
        match event {
            Event::ListStart | Event::MapStart => open.push(place),
            Event::ListEnd | Event::MapEnd => drop(open.pop()),
            Event::Scalar(_) => {}
        }
        Some(Ok((event, place)))
    })
}

/// Returns a value as it is in the text, if it is, instead of a copy: a map may have millions.
fn borrowed<'a>(text: &Text<'a>, at: Place, value: Cow<'a, str>) -> Cow<'a, str> {
    let written =
        text.lines.get(at.line).and_then(|line| line.get(at.column..)?.get(..value.len()));
    written.filter(|written| *written == value).map_or(value, Cow::Borrowed)
}

/// Returns the bracket with which a list or a map begins, if it does with one.
fn bracket_at(text: &Text, at: Place) -> Option<char> {
    text.lines.get(at.line)?.chars().nth(at.column).filter(|c| "[{".contains(*c))
}

/// Returns what a file is written in, by the ending of its name.
fn language(text: &Text) -> &'static str {
    match Path::new(text.file).extension().and_then(OsStr::to_str) {
        Some("json") => "JSON",
        Some("py") => "a list of Python",
        Some("yaml" | "yml") => "YAML",
        _ if text.source.trim_start().starts_with('[') => "a list",
        _ => "YAML",
    }
}

/// A value of a YAML document, with its place.
#[derive(Debug)]
pub struct Node<'a> {
    pub place: Place,
    value: Value<'a>,
}

#[derive(Debug)]
enum Value<'a> {
    Scalar(Cow<'a, str>),
    List(Box<[Node<'a>]>),
    Map(Box<[(Cow<'a, str>, Node<'a>)]>),
}

/// The deepest nesting of values.
const MAX_DEPTH: usize = 8;

/// The most values of a document, which take some 64 bytes each: 40 and what the list takes that they
/// are in.
const MAX_NODES: usize = 1 << 22;

/// Returns the root of a document.
///
/// # Errors
/// It is not YAML, is nested too deeply, or has too many values.
pub fn tree<'a>(text: &'a Text<'a>) -> MapResult<Node<'a>> {
    let mut left = MAX_NODES;
    let mut events = events(text, 0);
    let empty = || text.line_error(0, "there is nothing but comments", "give a file with a map");
    let first = events.next().ok_or_else(empty)??;
    let root = node(text, &mut events, first, MAX_DEPTH, &mut left)?;
    // A fault behind the document.
    events.next().transpose()?;
    Ok(root)
}

/// Returns the value that begins with `first`, with all that is inside it.
fn node<'a>(
    text: &Text,
    events: &mut dyn Iterator<Item = MapResult<(Event<'a>, Place)>>,
    first: (Event<'a>, Place),
    depth: usize,
    left: &mut usize,
) -> MapResult<Node<'a>> {
    let (event, place) = first;
    let refuse = |problem: &str| text.error_at(place, problem, "is this a map?");
    let depth = depth.checked_sub(1).ok_or_else(|| refuse("values are nested too deeply"))?;
    *left = left.checked_sub(1).ok_or_else(|| refuse("there are too many values"))?;
    let mut next = |left: &mut usize| match events.next().transpose()? {
        None | Some((Event::ListEnd | Event::MapEnd, _)) => Ok(None),
        Some(first) => node(text, events, first, depth, left).map(Some),
    };
    let value = match event {
        Event::Scalar(value) => Value::Scalar(value),
        Event::MapStart => {
            let mut entries = Vec::new();
            while let Some(key) = next(left)? {
                let (Value::Scalar(name), Some(value)) = (key.value, next(left)?) else {
                    return Err(text.error_at(
                        key.place,
                        "this key is not a word",
                        "is this a map?",
                    ));
                };
                entries.push((name, value));
            }
            Value::Map(entries.into())
        }
        _ => {
            // Most are pairs, of which there may be millions.
            let mut values = Vec::with_capacity(2);
            while let Some(value) = next(left)? {
                values.push(value);
            }
            Value::List(values.into())
        }
    };
    Ok(Node { place, value })
}

impl Node<'_> {
    /// Returns the value of a key.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Value::Map(entries) = &self.value else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }

    /// Returns the value of a key.
    ///
    /// # Errors
    /// It is missing.
    pub fn wanted(&self, text: &Text, key: &str, help: &str) -> MapResult<&Self> {
        let missing = || text.error_at(self.place, format!("the key {key} is missing"), help);
        self.get(key).ok_or_else(missing)
    }

    /// Returns the values of a list.
    ///
    /// # Errors
    /// It is not a list.
    pub fn list(&self, text: &Text, help: &str) -> MapResult<&[Self]> {
        match &self.value {
            Value::List(values) => Ok(values),
            _ => Err(text.error_at(self.place, "this is not a list", help)),
        }
    }

    /// Returns a value that is not made of others.
    ///
    /// # Errors
    /// It is not `what`, but a list or a map.
    pub fn scalar(&self, text: &Text, what: &str, help: &str) -> MapResult<&str> {
        match &self.value {
            Value::Scalar(value) => Ok(value),
            _ => Err(text.error_at(self.place, format!("this is not {what}"), help)),
        }
    }

    /// Returns a value read as `what`.
    ///
    /// # Errors
    /// It is something else.
    pub fn parsed<T: FromStr>(&self, text: &Text, what: &str, help: &str) -> MapResult<T> {
        let value = self.scalar(text, what, help)?;
        let other = || text.error_at(self.place, format!("{value:?} is not {what}"), help);
        value.parse().map_err(|_| other())
    }
}
