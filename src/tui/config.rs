//! User configuration: theme, marker, autosave and keys, from a TOML file in the platform's
//! configuration folder.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use directories::ProjectDirs;
use miette::Report;
use serde::Deserialize;

use super::action::SECTIONS;
use super::keymap::Keymap;
use super::theme::ThemeName;
use crate::process::errors::ExplainedError;
use crate::tui::choices::Marker;
use gdg::files::{self, FileFormat, Mismatch, Wanted};
use gdg::text::{Excerpt, sanitized, sanitized_lines, truncated};

#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UiConfig {
    pub theme: ThemeName,
    pub marker: Marker,
    /// Minutes between automatic checkpoints; 0 for none.
    pub autosave_minutes: f64,
    keys: BTreeMap<String, toml::Spanned<Vec<String>>>,
}

impl Default for UiConfig {
    fn default() -> Self {
        Self {
            theme: ThemeName::Dark,
            marker: Marker::Auto,
            autosave_minutes: 5.0,
            keys: BTreeMap::new(),
        }
    }
}

/// The kind of file expected, for error messages.
const CONFIGURATION: Wanted = Wanted {
    name: "a configuration of the interface",
    help: "give a TOML file in the format of --print-config-template; settings of a run are \
           given with --config",
    own: &[FileFormat::Text],
};

/// Maximum size of the file in bytes, and maximum characters of it quoted in an error.
const MAX_BYTES: u64 = 1 << 20;
const MAX_QUOTED_CHARS: usize = 300;

/// Returns the file in the platform's configuration folder, or `None` without a home directory.
pub fn default_path() -> Option<PathBuf> {
    ProjectDirs::from("", "", "gdg-tui").map(|dirs| dirs.config_dir().join("config.toml"))
}

/// Reads the configuration from `file`, or from the default path if that exists.
pub fn load(file: Option<&Path>) -> Result<(UiConfig, Keymap), Report> {
    let path = file.map(Path::to_owned).or_else(default_path);
    let Some(path) = path.filter(|path| file.is_some() || path.exists()) else {
        return parse("", "");
    };
    let name = path.to_string_lossy();
    let text = files::read_text(&path, MAX_BYTES);
    let text = text
        .map_err(|e| error(&name, "", None, &format!("cannot be read: {e}"), CONFIGURATION.help));
    let instead = |found: Mismatch| error(&name, "", None, &found.problem, &found.help);
    text.and_then(|text| parse(&name, &text))
        .map_err(|own| CONFIGURATION.mismatch(&path).map_or(own, instead))
}

pub fn parse(name: &str, text: &str) -> Result<(UiConfig, Keymap), Report> {
    let hint = "--print-config-template prints all options";
    let config: UiConfig =
        toml::from_str(text).map_err(|e| error(name, text, e.span(), e.message(), hint))?;
    if !(0.0..=1e6).contains(&config.autosave_minutes) {
        let problem = format!("autosave_minutes cannot be {}", config.autosave_minutes);
        let at = text.find("autosave_minutes").map(|at| at..at + "autosave_minutes".len());
        return Err(error(
            name,
            text,
            at,
            &problem,
            "autosave_minutes must be a number of minutes; 0 turns autosave off",
        ));
    }
    let keys =
        config.keys.iter().map(|(action, keys)| (action.clone(), keys.get_ref().clone())).collect();
    let keymap = Keymap::new(&keys).map_err(|e| {
        let span = config.keys.get(&e.binding).map(toml::Spanned::span);
        error(name, text, span, &e.to_string(), &e.help)
    })?;
    Ok((config, keymap))
}

fn error(name: &str, text: &str, span: Option<Range<usize>>, problem: &str, help: &str) -> Report {
    let found = span.map(|span| Excerpt::from_span(name, text, span));
    let location = match &found {
        Some((_, (line, column))) => format!("{}:{line}:{column}: ", sanitized(name)),
        None => format!("{}: ", sanitized(name)),
    };
    let message = location + &truncated(problem, MAX_QUOTED_CHARS);
    ExplainedError::report(message, sanitized_lines(help), found.map(|(excerpt, _)| excerpt))
}

pub fn template() -> String {
    let default = UiConfig::default();
    let mut text = format!(
        "# gdg-tui configuration.{}\n\
         # Remove the # from a line to change its value.\n\n\
         # Colours: {}.\n# theme = \"{}\"\n\n\
         # What the map is drawn with: {}; auto means pixels where the terminal\n\
         # shows pictures, else half blocks or, if it is scaled down, quadrants.\n# marker = \"{}\"\n\n\
         # Minutes between autosaves; 0 for none.\n# autosave_minutes = {}\n\n\
         # Keys of each action: \"a\", \"shift-a\", \"ctrl-a\", \"alt-a\", \"space\", \"enter\", \"left\", \"f1\" ...\n[keys]\n",
        default_path().map_or(String::new(), |path| format!(" Default path: {}", path.display())),
        ThemeName::ALL.map(ThemeName::name).join(", "),
        default.theme.name(),
        Marker::ALL.map(Marker::name).join(", "),
        default.marker.name(),
        default.autosave_minutes,
    );
    for section in SECTIONS {
        let _ = write!(text, "\n# {}\n", section.title);
        for binding in section.bindings {
            let about = if binding.long.is_empty() {
                String::new()
            } else {
                format!("  # {}", binding.long)
            };
            let _ = writeln!(text, "# {} = {:?}{about}", binding.name, binding.keys);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_shows_the_defaults() {
        let template = template();
        assert!(parse("template", &template).is_ok(), "as it is printed");
        let lines = template.lines().filter(|line| line.contains(" = ") || line.starts_with('['));
        let all: String =
            lines.map(|line| line.trim_start_matches("# ").to_owned() + "\n").collect();
        let (config, _) = parse("template", &all).expect("with everything switched on");
        assert_eq!((config.theme, config.marker), (ThemeName::Dark, Marker::Auto));
        assert_eq!(config.keys.len(), super::super::action::bindings().count());
    }

    #[test]
    fn errors_are_reported_with_line_and_column() {
        for (text, location) in [
            ("theme = \"drak\"\n", "f:1:9: "),
            ("\nautosave_minutes = -1\n", "f:2:1: "),
            ("[keys]\npause = [\"space\"]\nqiut = [\"x\"]\n", "f:3:8: "),
            ("theme = \n", "f:1:"),
        ] {
            let error = parse("f", text).expect_err("a mistake");
            assert!(error.to_string().starts_with(location), "{error} is not at {location}");
        }
        let removed = parse("f", "theme = \"mono\"\n").expect_err("a theme that is gone");
        let all = "`dark`, `light`, `colour-blind-safe`";
        assert!(removed.to_string().contains(all), "{removed}");
    }
}
