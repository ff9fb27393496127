//! Parsers of the values of options.

use std::ffi::OsStr;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Arg;
use clap::builder::{OsStringValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap_lex::OsStrExt as _;
use log::LevelFilter;

use gdg::bridge::Planner;
use gdg::learn::{LEARNERS, Threads};
use gdg::text::{NumberError, nearest, parse_count, parse_real};
use gdg::train::{METHODS, Method, Preset};

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

/// Returns the parser of a number within `range`; errors say what is `expected`.
pub fn reals(
    range: RangeInclusive<f64>,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match parse_real(text) {
        Ok(number) if range.contains(&number) => Ok(number),
        Ok(_) | Err(NumberError::NoNumber) => Err(format!("expected {expected}")),
        Err(error) => Err(error.to_string()),
    }
}

pub fn shares() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    reals(0.0..=1.0, "a fraction from 0 to 1, e.g. 0.95")
}

pub fn parse_threads(text: &str) -> Result<Threads, String> {
    if text == "auto" {
        return Ok(Threads::auto());
    }
    let number = counts::<usize>(1..=256)(text).map_err(|error| format!("{error}, or auto"))?;
    Ok(Threads::Fixed(number))
}

/// Parses a method and lists the named ones.
#[derive(Clone)]
pub struct MethodParser;

impl TypedValueParser for MethodParser {
    type Value = Method;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<Method, clap::Error> {
        if let Some(method) = value.to_str().and_then(|text| text.parse().ok()) {
            return Ok(method);
        }
        // Gives an error that suggests the nearest name.
        let named = PossibleValuesParser::new(METHODS.map(|named| named.name))
            .parse_ref(command, arg, value);
        let name = named.map_err(|mut error| {
            let list = |names: Vec<&str>| names.join(", ");
            let tip = format!(
                "any other method is LEARNER+PLANNER; learners: {}; planners: {}",
                list(LEARNERS.iter().map(|kind| kind.name).collect()),
                list(Planner::ALL.iter().map(|planner| planner.name()).collect())
            );
            if let Some(known) =
                value.to_str().and_then(|typed| nearest(typed, METHODS.map(|named| named.name)))
            {
                error.insert(ContextKind::SuggestedValue, ContextValue::String(known.to_owned()));
            }
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            error
        })?;
        Ok(name.parse().unwrap_or_default())
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(METHODS.iter().map(|named| PossibleValue::new(named.name).help(named.about))))
    }
}

/// Returns the long help of `--method`, which lists learners and planners.
pub fn methods_help() -> String {
    let list = |entries: Vec<(&str, &str)>| {
        entries.iter().map(|(name, about)| format!("  {name:<13} {about}\n")).collect::<String>()
    };
    format!(
        "Learner and planner: one of these methods, or LEARNER+PLANNER\n\nLearners:\n{}\nPlanners:\n{}",
        list(LEARNERS.iter().map(|kind| (kind.name, kind.about)).collect()),
        list(Planner::ALL.iter().map(|planner| (planner.name(), planner.about())).collect())
    )
}

/// Returns the parser of how severe a message must be for the log file.
pub fn log_levels() -> impl TypedValueParser<Value = LevelFilter> {
    let levels = ["off", "error", "warn", "info", "debug"];
    PossibleValuesParser::new(levels).map(|level| level.parse().unwrap_or(LevelFilter::Info))
}

pub fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    let values = Preset::ALL.map(|preset| PossibleValue::new(preset.name()).help(preset.about()));
    PossibleValuesParser::new(values).map(|name| Preset::named(&name).unwrap_or(Preset::Default))
}
