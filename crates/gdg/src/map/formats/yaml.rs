//! YAML as a sequence of events with their places. Lists of Python and JSON are YAML too.

use std::borrow::Cow;

use saphyr_parser::{Event as Parsed, Marker, Parser, ScanError};

use super::super::error::MapResult;
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
    let fault = move |error: &ScanError| {
        let problem = format!("this is not YAML: {}", error.info());
        let help = "brackets, quotes and indentation must be those of YAML, JSON or a list of Python, and a file \
                    has one map";
        text.error_at(place(error.marker()), problem, help)
    };
    let mut ended = false;
    Parser::new_from_str(&text.source[from..]).filter_map(move |parsed| {
        let (event, span) = match parsed {
            Ok(parsed) => parsed,
            Err(error) => return Some(Err(fault(&error))),
        };
        let place = place(&span.start);
        let event = match event {
            Parsed::Scalar(value, ..) => Event::Scalar(value),
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
        Some(Ok((event, place)))
    })
}
