//! The reference page of all settings, in Markdown.

use super::config::list_settings;
use super::method::Preset;
use super::settings::reference::{Group, SETTINGS, Setting};
use crate::env::{WORLDS, WorldKind};

/// Returns the reference page in Markdown.
pub fn reference_page() -> String {
    let mut page = "# Settings\n\nSet one with `--set NAME=VALUE`, several with `--config FILE` (JSON, in the \
                    format of `--print-config`), or change any of them during training with `o`. Former names still work. This page \
                    is printed by `gdg-tui settings`.\n\nSome worlds bring default settings of their own, on top of the \
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
            "\n## {}\n\n| setting | {names} | unit | values | description | effect of a change |\n|{columns}\n",
            group.name()
        );
        for (i, setting) in
            SETTINGS.iter().enumerate().filter(|(_, setting)| setting.group == group)
        {
            let Setting { name, about, unit, range, effect, former, .. } = setting;
            let former = former.map_or(String::new(), |former| format!(" (was `{former}`)"));
            let effect = effect.about();
            let values = presets.each_ref().map(|values| values[i].1.as_str()).join(" | ");
            // A bar would end the cell.
            let about = about.replace('|', "\\|");
            page += &format!(
                "| `{name}`{former} | {values} | {unit} | {range} | {about} | {effect} |\n"
            );
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{Settings, with_setting};

    #[test]
    fn every_setting_has_an_entry_and_every_entry_a_setting() {
        let mut listed: Vec<String> =
            list_settings(&Settings::default()).into_iter().map(|(name, _)| name).collect();
        let known: Vec<&str> = SETTINGS.iter().map(|setting| setting.name).collect();
        assert_eq!(listed, known, "settings are listed in the order of the table");
        listed.dedup();
        assert_eq!(listed.len(), SETTINGS.len());
        let groups: Vec<Group> = SETTINGS.iter().map(|setting| setting.group).collect();
        let mut seen = groups.clone();
        seen.dedup();
        assert_eq!(seen, Group::ALL, "group by group");
    }

    #[test]
    fn former_names_are_accepted() {
        for setting in SETTINGS.iter().filter(|setting| setting.former.is_some()) {
            let former = setting.former.unwrap_or_default();
            let value = list_settings(&Preset::Default.settings())
                .into_iter()
                .find(|(name, _)| name == setting.name);
            let value = value.expect("listed").1;
            let settings = with_setting(&Settings::default(), former, &value).expect("the default");
            assert_eq!(settings, Settings::default(), "{former}");
        }
    }

    #[test]
    fn docs_settings_md_matches_the_reference_page() {
        let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/settings.md");
        let kept = std::fs::read_to_string(kept).unwrap_or_default();
        assert!(kept == reference_page(), "gdg-tui settings > docs/settings.md");
    }
}
