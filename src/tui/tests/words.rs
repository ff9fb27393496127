//! Finding actions and settings by users' words.

use super::*;
use crate::tui::dialog::Choice;
use crate::tui::lists;

#[test]
fn users_words_find_what_they_mean() {
    let app = still();
    for (word, action) in [
        ("resume", Action::TogglePause),
        ("restart", Action::NewSeed),
        ("learning rate", Action::Settings),
        ("algorithm", Action::Method),
        ("dark mode", Action::Theme),
        ("heatmap", Action::Field(true)),
        ("screenshot", Action::Export),
        ("video", Action::ExportFilm),
        ("rewind", Action::Back),
        ("exit", Action::Quit),
        ("tutorial", Action::Tour),
    ] {
        let mut list = lists::actions(&app.screen, &app.scene);
        list.paste(word);
        assert_eq!(list.choice(), Some(&Choice::Act(action)), "{word}");
    }
    for (word, name) in [("lr", "learning_rate"), ("noise environment", "env_noise")] {
        let mut list = lists::settings(&app.screen);
        list.paste(word);
        assert_eq!(list.choice(), Some(&Choice::Setting(name.to_owned())), "{word}");
    }
    let mut list = lists::actions(&app.screen, &app.scene);
    list.paste("ground truth");
    assert_eq!(list.choice(), Some(&Choice::Field(Field::True)));
}
