//! What runs differ in, side by side.

use crate::experiment::runs::SavedRun;
use gdg::text::{counted, grouped};
use gdg::train::{Preset, list_settings};

/// A name, and its value in each run.
pub type Row = (String, Vec<String>);

/// The preset among a run's settings.
const PRESET: &str = "preset";

/// Returns the rows in which runs differ; of a single run, all that it does not share with its
/// preset.
pub fn rows(runs: &[&SavedRun]) -> Vec<Row> {
    let facts = [
        row("map", runs, |run| run.map.clone()),
        row("method", runs, |run| run.method.clone()),
        row("variant", runs, |run| run.variant.clone().unwrap_or_default()),
        row("seed", runs, |run| run.seed.to_string()),
        row("updates", runs, |run| grouped(run.updates)),
        row("left out", runs, |run| match run.skipped.lines {
            0 => String::new(),
            _ if runs.len() == 1 => format!("line {}", run.skipped),
            lines => counted(lines, "line"),
        }),
    ];
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in runs.iter().flat_map(|run| own(run)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let settings = names.into_iter().map(|name| row(name, runs, |run| value(run, name)));
    let is_told = |(_, values): &Row| match &values[..] {
        [value] => !value.is_empty(),
        values => values.iter().any(|value| *value != values[0]),
    };
    facts.into_iter().chain(settings).filter(is_told).collect()
}

fn row(name: &str, runs: &[&SavedRun], value: impl Fn(&SavedRun) -> String) -> Row {
    (name.to_owned(), runs.iter().map(|run| value(run)).collect())
}

/// Returns the names and values of the settings that a run has besides those of its preset.
fn own(run: &SavedRun) -> impl Iterator<Item = (&str, &str)> {
    run.settings.iter().filter_map(|setting| setting.split_once('='))
}

/// Returns the value of a setting: its own, or else the preset's.
fn value(run: &SavedRun, name: &str) -> String {
    let of = |name: &str| own(run).find(|(own, _)| *own == name).map(|(_, value)| value.to_owned());
    let of_preset = || {
        let settings = list_settings(&Preset::named(&of(PRESET)?)?.settings());
        settings.into_iter().find(|(known, _)| known == name).map(|(_, value)| value)
    };
    of(name).or_else(of_preset).unwrap_or_else(|| "-".to_owned())
}

#[cfg(test)]
mod tests {
    use super::super::tests::saved;
    use super::*;

    #[test]
    fn settings_that_one_run_leaves_to_its_preset_have_the_presets_value() {
        let one = saved("a", "trap", "gdg", 1, &[]);
        let preset = |name: &str| {
            let all = list_settings(&Preset::Default.settings());
            all.into_iter().find(|(known, _)| known == name).map(|(_, value)| value)
        };
        let other = SavedRun { settings: vec!["preset=default".to_owned()], ..one.clone() };
        let hidden = preset("hidden").expect("a setting");
        assert_ne!(hidden, "16");
        assert_eq!(
            rows(&[&one, &other]),
            [("hidden".to_owned(), vec!["16".to_owned(), hidden])],
            "map, method and seed are the same"
        );
        let third = SavedRun { seed: 2, ..other.clone() };
        let differ = rows(&[&other, &third]);
        assert_eq!(differ, [("seed".to_owned(), vec!["1".to_owned(), "2".to_owned()])]);
        let alone: Vec<String> = rows(&[&one]).into_iter().map(|(name, _)| name).collect();
        assert_eq!(alone, ["map", "method", "seed", "updates", "preset", "hidden"]);
    }
}
