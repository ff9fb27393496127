//! Method and settings of a run.

use std::path::{Path, PathBuf};

use miette::Report;

use crate::host::maps::known_name;
use crate::host::report::from_config_error;
use gdg::train::{self, Method, Overrides, Preset, Registry, Run, Settings};

/// Which method to train, and with which settings.
#[derive(Clone, Debug)]
pub struct RunChoice {
    pub method: Method,
    /// The preset to start from; otherwise that of the method.
    pub preset: Option<Preset>,
    pub config: Option<PathBuf>,
    /// Changes of single settings, `NAME=VALUE`.
    pub set: Vec<String>,
}

impl RunChoice {
    /// Returns the preset to start from, with a learner of `registry`.
    pub fn preset(&self, registry: &Registry) -> Preset {
        self.preset.unwrap_or_else(|| registry.preset_of(&self.method))
    }
}

/// Returns the settings of `choice` for a run in the world that `world` opens: a map or a world
/// of `registry`.
pub fn settings(choice: &RunChoice, world: &Path, registry: &Registry) -> Result<Settings, Report> {
    let defaults =
        registry.world_opened_by(known_name(world)).map_or(&[][..], |kind| kind.defaults);
    let overrides = Overrides { defaults, config: choice.config.as_deref(), set: &choice.set };
    train::settings_from(choice.preset(registry), &overrides).map_err(from_config_error)
}

/// Splits `PREFIX:NAME=VALUE`, a setting of one of several runs; the prefix is `None` if there is
/// none.
pub fn split_prefix(setting: &str) -> (Option<&str>, &str) {
    match setting.split_once(':') {
        Some((prefix, setting)) if !prefix.contains('=') => (Some(prefix), setting),
        _ => (None, setting),
    }
}

/// Returns the settings in `set` that apply to the run called `name`, without their prefixes.
pub fn settings_of(name: &str, set: &[String]) -> Vec<String> {
    let split = set.iter().map(|setting| split_prefix(setting));
    split
        .filter(|(prefix, _)| prefix.is_none_or(|prefix| prefix == name))
        .map(|(_, own)| own.to_owned())
        .collect()
}

/// Returns the run of `choice` and `seed` in the world that `world` opens.
pub fn run(
    choice: &RunChoice,
    world: &Path,
    registry: &Registry,
    seed: u64,
) -> Result<Run, Report> {
    let settings = settings(choice, world, registry)?;
    Ok(Run { method: choice.method.clone(), preset: choice.preset(registry), seed, settings })
}
