//! Finding actions by users' words.

use super::*;
use crate::tui::dialog::{Choice, Row};
use crate::tui::layers::Overlay;
use crate::tui::lists;
use crate::tui::panes::Pane;
use crate::tui::tool::Tool;

/// Words, and the action that must come first for them.
const WORDS: [(&str, Action); 101] = [
    ("exploration", Action::Toggle(Overlay::Unexplored)),
    ("sidebar", Action::Maximise),
    ("resume", Action::TogglePause),
    ("pause", Action::TogglePause),
    ("stop", Action::TogglePause),
    ("continue", Action::TogglePause),
    ("play", Action::TogglePause),
    ("speed", Action::Faster),
    ("fast", Action::Faster),
    ("slow", Action::Slower),
    ("step", Action::StepUpdate),
    ("freeze", Action::Freeze),
    ("evaluate", Action::Evaluate),
    ("test", Action::Evaluate),
    ("success rate", Action::Evaluate),
    ("restart", Action::NewSeed),
    ("reset", Action::NewSeed),
    ("seed", Action::NewSeed),
    ("settings", Action::Settings),
    ("options", Action::Settings),
    ("learning rate", Action::Settings),
    ("hyperparameters", Action::Settings),
    ("gamma", Action::Settings),
    ("batch size", Action::Settings),
    ("method", Action::Method),
    ("algorithm", Action::Method),
    ("her", Action::Method),
    ("preset", Action::Preset),
    ("goal", Action::NewGoal),
    ("zoom", Action::ZoomIn),
    ("zoom out", Action::ZoomOut),
    ("whole map", Action::ZoomOff),
    ("theme", Action::Theme),
    ("colors", Action::Theme),
    ("dark", Action::Theme),
    ("dark mode", Action::Theme),
    ("view", Action::Field(true)),
    ("heatmap", Action::Field(true)),
    ("value function", Action::Field(true)),
    ("trajectory", Action::Follow),
    ("arrows", Action::Toggle(Overlay::Directions)),
    ("contours", Action::Toggle(Overlay::Contours)),
    ("edges", Action::Toggle(Overlay::Edges)),
    ("agents", Action::Toggle(Overlay::Agents)),
    ("plan", Action::Toggle(Overlay::Path)),
    ("cursor", Action::Inspect),
    ("braille", Action::Marker),
    ("plots", Action::Show(Pane::Curves)),
    ("legend", Action::Show(Pane::Legend)),
    ("messages", Action::Show(Pane::Log)),
    ("fullscreen", Action::Maximise),
    ("edit", Action::ToggleEdit),
    ("draw", Action::Tool(Tool::Pencil)),
    ("undo", Action::Undo),
    ("redo", Action::Redo),
    ("save map", Action::SaveMap),
    ("random map", Action::RandomMap),
    ("maze", Action::RandomMap),
    ("new map", Action::NewMap),
    ("open map", Action::OpenMap),
    ("save", Action::Save),
    ("save as", Action::SaveAs),
    ("load", Action::Load),
    ("autosave", Action::Autosave),
    ("export", Action::Export),
    ("screenshot", Action::Export),
    ("animation", Action::ExportFilm),
    ("gif", Action::ExportFilm),
    ("video", Action::ExportFilm),
    ("export film", Action::ExportFilm),
    ("time travel", Action::Back),
    ("rewind", Action::Back),
    ("past", Action::Back),
    ("keys", Action::Help),
    ("exit", Action::Quit),
    ("quit", Action::Quit),
    ("accuracy", Action::Evaluate),
    ("slow down", Action::Slower),
    ("hidden", Action::Settings),
    ("neurons", Action::Settings),
    ("noise", Action::Settings),
    ("epsilon", Action::Settings),
    ("go back", Action::Back),
    ("arm", Action::OpenMap),
    ("about", Action::Help),
    ("compare", Action::Compare),
    ("reward", Action::Method),
    ("teleport", Action::NewStart),
    ("teacher", Action::Tour),
    ("number of agents", Action::Settings),
    ("optimizer", Action::Settings),
    ("td error", Action::Show(Pane::Curves)),
    ("minimap", Action::ZoomIn),
    ("coordinates", Action::Inspect),
    ("spawn", Action::NewStart),
    ("vector field", Action::Toggle(Overlay::Directions)),
    ("max speed", Action::Faster),
    ("fast forward", Action::Faster),
    ("hide agents", Action::Toggle(Overlay::Agents)),
    ("change goal", Action::NewGoal),
    ("ablation", Action::Compare),
];

#[test]
fn users_words_find_what_they_mean() {
    let app = still();
    let mut wrong = Vec::new();
    for (word, action) in WORDS {
        let mut list = lists::actions(&app.screen, &app.scene);
        list.paste(word);
        if list.choice() != Some(&Choice::Act(action)) {
            wrong.push(format!("{word:?}: {:?} instead of {action:?}", list.choice()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn settings_are_found_beside_actions_and_after_them() {
    let app = still();
    let found = |word: &str| {
        let mut list = lists::actions(&app.screen, &app.scene);
        list.paste(word);
        let choices = list.rows().into_iter().filter_map(|row| match row {
            Row::Item(item, _) => Some(item.choice.clone()),
            Row::Title(_) => None,
        });
        choices.collect::<Vec<_>>()
    };
    let restart = Choice::Setting("restart".to_owned());
    let all = found("restart");
    assert!(all[0] == Choice::Act(Action::NewSeed) && all.contains(&restart), "{all:?}");
    assert_eq!(found("polyak")[0], Choice::Setting("tau".to_owned()));
    assert_eq!(found("n-step")[0], Choice::Setting("n_step".to_owned()));
    assert_eq!(found("lr")[0], Choice::Act(Action::Settings));
    for (word, field) in [
        ("true steps", Field::True),
        ("ground truth", Field::True),
        ("shortest path", Field::True),
        ("map only", Field::Plain),
        ("D from start", Field::FromStart),
        ("figure 2", Field::OverEach),
        ("error of D", Field::Error),
        ("q-values", Field::Learned),
    ] {
        assert_eq!(found(word).first(), Some(&Choice::Field(field)), "{word}");
    }
    assert!(
        found("helicopter").is_empty(),
        "letters in the same order are no match for a whole word"
    );
}

#[test]
fn settings_are_found_by_words_of_their_description() {
    let app = still();
    for (word, name) in [
        ("Polyak", "tau"),
        ("width", "hidden"),
        ("tape", "backend"),
        ("noise environment", "env_noise"),
        ("frontier", "frontier_epsilon"),
        ("learning rate", "learning_rate"),
        ("lr", "learning_rate"),
        ("parallel", "agents"),
        ("warmup_env_steps", "learning_starts"),
    ] {
        let mut list = lists::settings(&app.screen);
        list.paste(word);
        assert_eq!(list.choice(), Some(&Choice::Setting(name.to_owned())), "{word}");
    }
}
