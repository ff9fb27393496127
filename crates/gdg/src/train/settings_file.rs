//! Builds settings from a preset, a JSON file and individual values. Errors give the location and
//! the valid values.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;
use std::path::Path;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;
use serde_json::{Map, Value};

use super::settings::{OutOfRange, SETTINGS, Settings};
use crate::env::{WORLDS, WorldKind};
use crate::files::{self, FileFormat, Wanted};
use crate::settings::{Effect, GROUPS, Preset, Setting, USUAL};
use crate::text::{Excerpt, NumberError, nearest, parse_count, parse_real, sanitized, truncated};

#[derive(Clone, Debug, Default)]
pub struct Overrides<'a> {
    /// The world's default settings ([`WorldKind::defaults`](crate::env::WorldKind)), for presets
    /// that adapt to the world.
    pub defaults: &'a [&'static str],
    /// A JSON file: an object of setting names and values.
    pub config: Option<&'a Path>,
    /// Individual settings as `name=value`; later ones win.
    pub set: &'a [String],
}

#[derive(Debug, thiserror::Error)]
#[error("{location}{problem}")]
pub struct ConfigError {
    location: String,
    problem: String,
    pub help: String,
    pub excerpt: Option<Excerpt>,
}

type Result<T, E = Box<ConfigError>> = std::result::Result<T, E>;

const MAX_QUOTED_CHARS: usize = 120;

const MAX_BYTES: u64 = 64 << 20;

impl ConfigError {
    fn new(problem: String, help: String) -> Box<Self> {
        Box::new(Self { location: String::new(), problem, help, excerpt: None })
    }

    pub fn one_line(&self) -> String {
        format!("{}: {}", self.problem, self.help)
    }

    fn at(mut self: Box<Self>, location: String) -> Box<Self> {
        self.location = location;
        self
    }

    fn in_file(mut self: Box<Self>, file: &str, text: &str, span: Range<usize>) -> Box<Self> {
        let (excerpt, (line, column)) = Excerpt::from_span(file, text, span);
        self.excerpt = Some(excerpt);
        self.at(format!("{}:{line}:{column}: ", sanitized(file)))
    }
}

/// Returns the settings of `preset` with `overrides` applied: first the world's defaults, if the
/// preset adapts to the world, then the file, then the individual values.
pub fn settings_from(preset: Preset, overrides: &Overrides) -> Result<Settings> {
    let mut values = preset.settings().values();
    let defaults = if preset.adapts_to_world() { overrides.defaults } else { &[] };
    for assignment in defaults {
        apply_assignment(&mut values, assignment, "default setting of the world ")?;
    }
    if let Some(path) = overrides.config {
        apply_file(&mut values, path)?;
    }
    for assignment in overrides.set {
        apply_assignment(&mut values, assignment, "")?;
    }
    checked(&values)
}

/// Returns the settings of `preset` in a world with these default settings, which count only if
/// they are valid.
pub fn settings_in_world(preset: Preset, defaults: &[&'static str]) -> Settings {
    let overrides = Overrides { defaults, ..Overrides::default() };
    settings_from(preset, &overrides).unwrap_or_else(|_| preset.settings())
}

/// Applies `name=value`; errors begin with `source`.
fn apply_assignment(values: &mut Map<String, Value>, text: &str, source: &str) -> Result<()> {
    let shown = truncated(text, MAX_QUOTED_CHARS);
    let (name, value) = text.split_once('=').ok_or_else(|| {
        let help = "use --set name=value, e.g. --set expectile=0.9".to_owned();
        ConfigError::new(format!("{source}{shown}: no value given"), help)
    })?;
    apply_typed(values, name.trim(), value).map_err(|e| e.at(format!("{source}{shown}: ")))
}

/// Formats all settings as a JSON object, in the order of [`SETTINGS`].
pub fn print_settings(settings: &Settings) -> String {
    format!("{:#}\n", Value::Object(settings.values()))
}

/// Returns the names and values of all settings, in the order of [`SETTINGS`].
pub fn list_settings(settings: &Settings) -> Vec<(String, String)> {
    settings.values().iter().map(|(name, value)| (name.clone(), shown(value))).collect()
}

/// Returns the settings of `settings` that differ from those of `base`, by name.
pub fn changed_from(settings: &Settings, base: &Settings) -> Map<String, Value> {
    let base = base.values();
    settings.values().into_iter().filter(|(name, value)| base.get(name) != Some(value)).collect()
}

pub fn with_setting(settings: &Settings, name: &str, value: &str) -> Result<Settings> {
    let mut values = settings.values();
    apply_typed(&mut values, name, value)?;
    checked(&values)
}

/// Sets one value as a person types it: JSON, a number as in options, or a word without quotes
/// (`loss=sqrt`).
fn apply_typed(values: &mut Map<String, Value>, name: &str, text: &str) -> Result<()> {
    // As JSON, 60.000 is 60, which may not be the intention.
    let json = serde_json::from_str(text).ok().filter(|value: &Value| !value.is_number());
    apply(values, name, &json.unwrap_or_else(|| Value::String(text.to_owned())))
}

/// Converts the value of a numeric setting to a JSON number if it is written in another way: `1e6`,
/// `"60_000"`, `100.0`, `".5"`.
fn as_number(setting: &Setting, value: &Value) -> Result<Value> {
    let is_count = setting.values.are_counts();
    let text = match value {
        Value::String(text) => text.clone(),
        // JSON keeps whole numbers as they are.
        Value::Number(number) if is_count && !number.is_u64() => number.to_string(),
        _ => return Ok(value.clone()),
    };
    let parsed = if is_count {
        parse_count(&text).map(Value::from)
    } else {
        parse_real(&text).map(|number| json_number(&text).unwrap_or(number.into()))
    };
    let shown = truncated(&shown(value), MAX_QUOTED_CHARS);
    let problem = match parsed {
        Ok(number) => return Ok(number),
        Err(NumberError::NoNumber) => {
            let number = value.as_str().and_then(json_number);
            return Ok(number.unwrap_or_else(|| value.clone()));
        }
        Err(NumberError::Fraction) => format!("{} needs a whole number, not {shown}", setting.name),
        Err(error) => format!("{}: {shown} {error}", setting.name),
    };
    Err(ConfigError::new(problem, format!("{} must be {}", setting.name, setting.values)))
}

fn json_number(text: &str) -> Option<Value> {
    serde_json::from_str(text).ok().filter(Value::is_number)
}

fn shown(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn parse(values: &Map<String, Value>) -> Result<Settings> {
    serde_json::from_value(Value::Object(values.clone())).map_err(|e| {
        ConfigError::new(
            truncated(&e.to_string(), MAX_QUOTED_CHARS),
            "see --print-config for values of the right type".to_owned(),
        )
    })
}

fn apply(values: &mut Map<String, Value>, name: &str, value: &Value) -> Result<()> {
    let Some(setting) = Setting::named(name) else { return Err(unknown(name)) };
    let value = as_number(setting, value)?;
    let error = refused(name, setting, &value);
    if !setting.values.accept(&value) {
        return Err(error);
    }
    values.insert(setting.name.to_owned(), value);
    match parse(values)?.validate_ranges() {
        Err(OutOfRange(wrong)) if wrong.name == setting.name => Err(error),
        // The constraints between settings are checked once all are known.
        _ => Ok(()),
    }
}

/// Returns the settings with these values, after checking them together: some ranges involve
/// several settings.
fn checked(values: &Map<String, Value>) -> Result<Settings> {
    let settings = parse(values)?;
    if let Err(OutOfRange(setting)) = settings.validate_ranges() {
        return Err(refused(setting.name, setting, &values[setting.name]));
    }
    let contradicting = settings.contradicting_goals();
    if !contradicting.is_empty() {
        let problem = "goals=map: every episode leads from the map's S to its G".to_owned();
        let help = format!("set {} as well", contradicting.join(" and "));
        return Err(ConfigError::new(problem, help));
    }
    let needed = settings.needed_buffer_size();
    let Settings { learn, train, .. } = &settings;
    if learn.buffer_size >= needed {
        return Ok(settings);
    }
    let problem = format!(
        "buffer_size={} has no room for episodes of episode_steps={} with agents={}",
        learn.buffer_size,
        settings.min_episode_steps(),
        train.agents
    );
    let help = format!("buffer_size must be at least {needed}: agents x (episode_steps + 1)");
    Err(ConfigError::new(problem, help))
}

fn refused(name: &str, setting: &Setting, value: &Value) -> Box<ConfigError> {
    let shown = truncated(&value.to_string(), MAX_QUOTED_CHARS);
    let text = value.as_str().filter(|text| text.contains(','));
    let is_number = text.is_some_and(|text| text.replace(',', ".").parse::<f64>().is_ok());
    let comma = if is_number { "; a point separates the fraction" } else { "" };
    let help = format!("it must be {}{comma}", setting.values);
    ConfigError::new(format!("{name} cannot be {shown}"), help)
}

fn unknown(name: &str) -> Box<ConfigError> {
    let help = match nearest(name, SETTINGS.iter().map(|setting| setting.name)) {
        Some(known) => format!("did you mean {known}? gdg-tui settings lists all"),
        None => "gdg-tui settings lists all".to_owned(),
    };
    ConfigError::new(format!("unknown setting {:?}", truncated(name, MAX_QUOTED_CHARS)), help)
}

/// Says of a setting what it does, its `values`, what it can be, what a change costs, and what was
/// measured.
pub fn about_setting(setting: &Setting, values: &str) -> Vec<String> {
    let Setting { about, usual, unit, values: possible, effect, .. } = setting;
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let possible = format!("{values}. Possible: {possible}{unit}.");
    vec![format!("{about}."), possible, format!("A change {}.", effect.about()), usual.to_string()]
}

pub fn setting_page(name: &str) -> Result<String, Box<ConfigError>> {
    let Some(setting) = Setting::named(name) else {
        let lines = SETTINGS.iter().map(|own| format!("{}: {}\n", own.name, own.about));
        let found: String = lines.filter(|line| line.contains(name)).collect();
        return if found.is_empty() { Err(unknown(name)) } else { Ok(found) };
    };
    let value = |preset: Preset| {
        format!("{} in {}", shown(&preset.settings().values()[setting.name]), preset.name())
    };
    let lines = about_setting(setting, &Preset::ALL.map(value).join(", ")).join("\n  ");
    Ok(format!("{}: {}\n", setting.name, lines.trim_end()))
}

/// Names and values of a settings file in its order, borrowed from its text so that errors can
/// locate them. Names can occur twice.
struct Entries<'a>(Vec<(EntryName<'a>, &'a RawValue)>);

#[derive(Deserialize)]
struct EntryName<'a>(#[serde(borrow)] Cow<'a, str>);

impl<'de> Deserialize<'de> for Entries<'de> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct All;

        impl<'de> Visitor<'de> for All {
            type Value = Entries<'de>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object of settings")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }

        from.deserialize_map(All)
    }
}

const SETTINGS_FILE: Wanted = Wanted {
    name: "a settings file",
    help: "give a JSON file in the format of --print-config",
    own: &[FileFormat::Json, FileFormat::Text],
};

fn apply_file(values: &mut Map<String, Value>, path: &Path) -> Result<()> {
    let file = path.to_string_lossy();
    let whole_file = |problem: String, help: String| {
        ConfigError::new(problem, help).at(format!("{}: ", sanitized(&file)))
    };
    let text = files::read_text(path, MAX_BYTES);
    let text =
        text.map_err(|e| whole_file(format!("cannot be read: {e}"), SETTINGS_FILE.help.to_owned()));
    text.and_then(|text| apply_text(values, &file, &text)).map_err(|error| {
        SETTINGS_FILE.mismatch(path).map_or(error, |found| whole_file(found.problem, found.help))
    })
}

fn apply_text(values: &mut Map<String, Value>, file: &str, text: &str) -> Result<()> {
    let entries: Entries = serde_json::from_str(text).map_err(|e| {
        let offset = offset_of(text, e.line(), e.column());
        let help = "a settings file is a JSON object of names and values, in the format of \
                    --print-config";
        ConfigError::new(without_place(&e), help.to_owned()).in_file(file, text, offset..offset)
    })?;
    let mut given = BTreeSet::new();
    for (EntryName(name), raw) in &entries.0 {
        let location = |part: &str| {
            let offset = (part.as_ptr() as usize).wrapping_sub(text.as_ptr() as usize);
            if offset <= text.len() { offset..offset + part.len() } else { 0..0 }
        };
        let known = Setting::named(name);
        if !given.insert(name) {
            let (problem, help) = (format!("{name} is given twice"), format!("remove one {name}"));
            return Err(ConfigError::new(problem, help).in_file(file, text, location(name)));
        }
        let value = serde_json::from_str(raw.get())
            .map_err(|e| ConfigError::new(without_place(&e), "write a JSON value".to_owned()));
        value.and_then(|value| apply(values, name, &value)).map_err(|e| {
            e.in_file(file, text, location(if known.is_some() { raw.get() } else { name }))
        })?;
    }
    Ok(())
}

/// Returns the message of a JSON error without its location, which is reported as in other files.
fn without_place(error: &serde_json::Error) -> String {
    let message = error.to_string();
    truncated(message.split(" at line ").next().unwrap_or(&message), MAX_QUOTED_CHARS)
}

fn offset_of(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let mut offset = (start + column.saturating_sub(1)).min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

pub fn reference_page() -> String {
    let mut page = "# Settings\n\n```sh\ngdg-tui --set learning_rate=0.003 --set hidden=64\n```\n
Set one with `--set NAME=VALUE`, several with `--config FILE` (JSON, as of `--print-config`), or change any of
them during training with `o`. A change takes effect immediately, unless the last column says otherwise. The
usual ones come first, with what they do to success early in training, as [measured](research/settings.md).
This page is printed by `gdg-tui settings`, one of them by `gdg-tui settings NAME`, those with a word by `settings WORD`.

Some worlds bring default settings of their own, on top of the presets `default` and `tuned`; `paper` and `sb3`
stay as published. `--config` and `--set` come last.

"
    .to_owned();
    for WorldKind { name, defaults, .. } in WORLDS.iter().filter(|kind| !kind.defaults.is_empty()) {
        page += &format!("- `{name}`: `{}`\n", defaults.join(" "));
    }
    let presets = Preset::ALL.map(|preset| list_settings(&preset.settings()));
    let names = Preset::ALL.map(Preset::name).join(" | ");
    let columns = "---|".repeat(Preset::ALL.len() + 5);
    for group in [USUAL].into_iter().chain(GROUPS) {
        page += &format!(
            "\n## {group}\n\n| setting | {names} | unit | values | description | effect of a change \
             |\n|{columns}\n"
        );
        for (i, setting) in
            SETTINGS.iter().enumerate().filter(|(_, setting)| setting.heading() == group)
        {
            let Setting { name, about, usual, unit, values: range, effect, .. } = setting;
            let effect = if *effect == Effect::Immediate { "" } else { effect.about() };
            let values = presets.each_ref().map(|values| values[i].1.as_str()).join(" | ");
            // A bar would end the cell.
            let about = [*about, usual].join(". ").replace('|', "\\|");
            let about = about.trim_end_matches(". ");
            page += &format!("| `{name}` | {values} | {unit} | {range} | {about} | {effect} |\n");
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn docs_settings_md_matches_the_reference_page() {
        let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/settings.md");
        let kept = std::fs::read_to_string(kept).unwrap_or_default();
        assert!(kept == reference_page(), "gdg-tui settings > docs/settings.md");
    }
}
