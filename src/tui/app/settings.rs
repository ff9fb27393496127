//! Changes settings.

use super::runs::change;
use super::saving::Saver;
use crate::tui::dialog::{Choice, Dialog, Prompt, Question};
use crate::tui::link::Link;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use gdg::train::{Effect, Setting, Settings, list_settings, with_setting};

/// Gives the setting selected in the list the value of the run's preset.
pub fn reset(saver: &mut Saver, scene: &Scene, screen: &mut Screen, link: &Link) {
    let Some(Dialog::Pick(picker)) = screen.dialogs.last() else { return };
    let Some(Choice::Setting(name)) = picker.choice().cloned() else { return };
    let Some(value) = value_of(&name, &screen.settings_of(screen.run().preset)) else { return };
    match with_setting(&screen.run().settings, &name, &value) {
        Ok(settings) if settings == screen.run().settings => {
            screen.notify(&format!("{name} has its default already"));
        }
        Ok(settings) => change(|run| run.settings = settings, saver, scene, screen, link),
        Err(error) => screen.report(&error.one_line()),
    }
}

/// Asks for a setting's new value; a switch that costs nothing is turned over at once.
pub fn ask(name: String, saver: &mut Saver, scene: &Scene, screen: &mut Screen, link: &Link) {
    let value = value_of(&name, &screen.run().settings).unwrap_or_default();
    let setting = Setting::named(&name);
    if setting
        .is_some_and(|setting| setting.values.are_switch() && setting.effect == Effect::Immediate)
    {
        let other = if value == "true" { "false" } else { "true" };
        if let Ok(settings) = with_setting(&screen.run().settings, &name, other) {
            change(|run| run.settings = settings, saver, scene, screen, link);
        }
        return;
    }
    let hint = setting.map_or(String::new(), |setting| {
        format!("{}: {}; {}", setting.about, setting.values, setting.effect.about())
    });
    screen.open(Prompt::new(Question::Setting(name.clone()), name, hint, value));
}

fn value_of(name: &str, settings: &Settings) -> Option<String> {
    let (_, value) = list_settings(settings).into_iter().find(|(known, _)| *known == name)?;
    Some(value)
}
