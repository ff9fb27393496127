//! Which method is trained, and with which settings.

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args};

use crate::host::setup::RunChoice;
use gdg::bridge::Planner;
use gdg::learn::LEARNERS;
use gdg::text::nearest;
use gdg::train::{METHODS, Method, Preset};

/// Method and settings of a run.
#[derive(Clone, Debug, Args)]
pub struct RunArgs {
    /// Learner and planner: one of these methods, or LEARNER+PLANNER
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Method,

    /// What its settings are based on.
    #[command(flatten)]
    pub base: BaseArgs,

    /// Change one setting (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
}

/// What the settings of a run are based on.
#[derive(Clone, Debug, Args)]
pub struct BaseArgs {
    /// Preset to start from [default: tuned for ddpg, her and ddpg-distance, otherwise default]
    #[arg(long, value_parser = preset_parser())]
    pub preset: Option<Preset>,

    /// Settings file: a JSON object as printed by --print-config
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

impl RunArgs {
    pub fn choice(&self) -> RunChoice {
        let Self { method, base: BaseArgs { preset, config }, set } = self.clone();
        RunChoice { method, preset, config, set }
    }
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

/// Returns the parser of presets.
fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    let values = Preset::ALL.map(|preset| PossibleValue::new(preset.name()).help(preset.about()));
    PossibleValuesParser::new(values).map(|name| Preset::named(&name).unwrap_or(Preset::Default))
}
