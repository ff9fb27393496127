//! The reference page of all settings, in Markdown.

use super::config::list_settings;
use super::settings::SETTINGS;
use crate::env::{WORLDS, WorldKind};
use crate::settings::{Group, Preset, Setting};

/// Returns the reference page in Markdown.
pub fn reference_page() -> String {
    let mut page = "# Settings\n\nSet one with `--set NAME=VALUE`, several with `--config FILE` \
                    (JSON, in the format of `--print-config`), or change any of them during \
                    training with `o`. Former names still work. This page is printed by `gdg-tui \
                    settings`.\n\nSome worlds bring default settings of their own, on top of the \
                    presets that adapt to the world:\n\n"
        .to_owned();
    for WorldKind { name, defaults, .. } in WORLDS.iter().filter(|kind| !kind.defaults.is_empty()) {
        page += &format!("- `{name}`: `{}`\n", defaults.join(" "));
    }
    let (adapt, published): (Vec<Preset>, Vec<Preset>) =
        Preset::ALL.iter().partition(|preset| preset.adapts_to_world());
    let list = |presets: &[Preset]| {
        presets.iter().map(|p| format!("`{}`", p.name())).collect::<Vec<_>>().join(" and ")
    };
    page += &format!(
        "\nThese presets are {}; {} stay as published. `--config` and `--set` come last.\n",
        list(&adapt),
        list(&published)
    );
    let presets = Preset::ALL.map(|preset| list_settings(&preset.settings()));
    let names = Preset::ALL.map(Preset::name).join(" | ");
    let columns = "---|".repeat(Preset::ALL.len() + 5);
    for group in Group::ALL {
        page += &format!(
            "\n## {}\n\n| setting | {names} | unit | values | description | effect of a change \
             |\n|{columns}\n",
            group.name()
        );
        for (i, setting) in
            SETTINGS.iter().enumerate().filter(|(_, setting)| setting.group == group)
        {
            let Setting { name, about, unit, values: range, effect, .. } = setting;
            let effect = effect.about();
            let values = presets.each_ref().map(|values| values[i].1.as_str()).join(" | ");
            // A bar would end the cell.
            let about = about.replace('|', "\\|");
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
