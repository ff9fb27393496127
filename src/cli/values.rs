//! Parsers of the values of options.

use std::ffi::OsStr;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap_lex::OsStrExt as _;

use gdg::learn::Threads;
use gdg::text::{NumberError, parse_count, parse_real};

/// Returns the parser of a count within `range`, as people write them: 60000, 60_000, 60,000, 6e4.
pub fn counts<T: TryFrom<u64> + Clone + Send + Sync + 'static>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| {
        let count = parse_count(text).map_err(|error| error.to_string())?;
        let fitting = range.contains(&count).then(|| T::try_from(count).ok()).flatten();
        fitting.ok_or_else(|| match (*range.start(), *range.end()) {
            (least, u64::MAX) => format!("must be at least {least}"),
            (least, most) => format!("must be from {least} to {most}"),
        })
    }
}

/// Returns the parser of the name of a file or folder that is written.
pub fn output() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|name| {
        if name == "-" {
            return Err(
                "give the name of a file: standard output is not for this (./- is a file called -)",
            );
        }
        Ok(PathBuf::from(name))
    })
}

/// A change of the map to another one.
#[derive(Clone, Debug)]
pub struct EditAt {
    /// Number of updates after which to switch.
    pub updates: u64,
    pub file: PathBuf,
}

/// Returns the parser of `UPDATES:FILE`.
pub fn edits() -> impl TypedValueParser<Value = EditAt> {
    OsStringValueParser::new().try_map(|text| parse_edit_at(&text))
}

fn parse_edit_at(text: &OsStr) -> Result<EditAt, String> {
    let (updates, file) =
        text.split_once(":").ok_or("expected UPDATES:FILE, e.g. 20000:closed.txt")?;
    let updates = updates.to_string_lossy();
    let updates = parse_count(&updates)
        .map_err(|error| format!("{updates:?} is not a number of updates: {error}"))?;
    Ok(EditAt { updates, file: PathBuf::from(file) })
}

/// Returns the parser of a number within `range`.
pub fn reals(
    range: RangeInclusive<f32>,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let (least, most) = (*range.start(), *range.end());
        let expected = format!("a number from {least} to {most}");
        number(text, f64::from(least)..=f64::from(most), &expected).map(|number| number as f32)
    }
}

/// Parses how many threads share an update.
pub fn parse_threads(text: &str) -> Result<Threads, String> {
    if text == "auto" {
        return Ok(Threads::auto());
    }
    let number = counts::<usize>(1..=256)(text).map_err(|error| format!("{error}, or auto"))?;
    Ok(Threads::Fixed(number))
}

/// Parses a time in seconds.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e9, "a number of seconds from 0 to 1e9")
}

/// Parses the distance below which a goal is reached.
pub fn parse_radius(text: &str) -> Result<f32, String> {
    number(text, 1e-9..=1e9, "a distance from 1e-9 to 1e9").map(|radius| radius as f32)
}

/// Parses how long to wait for an environment, in seconds.
pub fn parse_timeout(text: &str) -> Result<f64, String> {
    number(text, 0.1..=1e6, "a number of seconds from 0.1 to 1e6")
}

/// Parses a time in minutes.
pub fn parse_minutes(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e6, "a number of minutes, 0 for none")
}

/// Parses a share of a whole.
pub fn parse_share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0, "a fraction from 0 to 1, e.g. 0.95")
}

/// Parses a number within `range`; the error says what is `expected`.
fn number(text: &str, range: RangeInclusive<f64>, expected: &str) -> Result<f64, String> {
    match parse_real(text) {
        Ok(number) if range.contains(&number) => Ok(number),
        Ok(_) | Err(NumberError::NoNumber) => Err(format!("expected {expected}")),
        Err(error) => Err(error.to_string()),
    }
}
