//! Every action: reachable by keyboard alone, listed in the help, and safe at any time.

use super::*;
use crate::tui::action::{Action, Binding, Mode, When};
use crate::tui::dialog::Choice;

/// Returns whether the trainer has a binding, not only comparisons.
fn is_of_trainer(binding: &Binding) -> bool {
    [Mode::Watching, Mode::Editing, Mode::Offered, Mode::Touring]
        .into_iter()
        .any(|mode| binding.is_active(mode))
}

/// Returns the whole help, page by page.
fn help(app: &mut App) -> String {
    press(app, KeyCode::Char('?'));
    let mut pages = String::new();
    loop {
        let shown = text(&draw(app, 80, 24));
        if pages.ends_with(&shown) {
            press(app, KeyCode::Esc);
            return pages;
        }
        pages += &shown;
        press(app, KeyCode::PageDown);
    }
}

#[test]
fn the_help_lists_every_action_and_sign_at_80_by_24() {
    let mut app = still();
    let help = help(&mut app);
    let kind = &app.scene;
    for binding in bindings().filter(|b| is_of_trainer(b) && kind.offers(b.action)) {
        let words = format!("{}{}", binding.long, binding.when.place());
        // Long descriptions are wrapped.
        assert!(
            words.split_whitespace().all(|word| help.contains(word)),
            "{} is missing",
            binding.name
        );
        assert!(
            app.screen.keymap.display_keys(binding).iter().all(|key| help.contains(key.as_str()))
        );
    }
    for symbol in [
        "goal",
        "walks to G",
        "start of @",
        "planned path",
        "exploring agents",
        "bridge candidates",
        "unvisited cells",
        "frontier goals",
    ] {
        assert!(help.contains(symbol), "{symbol} is missing");
    }
    assert!(app.screen.dialogs.is_empty(), "Esc closes it");
}

/// Describes the state that actions change.
fn state(app: &App) -> String {
    format!(
        "{:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
        app.screen.dialogs.len(),
        app.screen.pane,
        app.screen.maximised,
        app.screen.field,
        app.screen.overlays,
        app.screen.marker,
        (app.maze().viewport, app.screen.scrolled, app.screen.log_scale),
        app.maze().editor.cursor,
        app.maze().editor.tool,
        app.maze().goal,
        app.maze().inspecting,
        app.screen.on_arrival,
        (
            app.screen.past.as_ref().map(|frame| frame.updates),
            app.screen.frozen,
            app.screen.following,
            app.screen.pausing,
            app.is_done(),
            app.terminal_request
        ),
        (
            app.screen.log.entries().len(),
            app.screen.log.notice().map(|notice| notice.text.to_owned())
        ),
        app.maze().map.free_count(),
        app.screen.tour.as_ref().map(|tour| tour.step),
    )
}

/// Returns whether an action changes nothing on this screen at once, or has nothing to act on here.
fn is_quiet(binding: &Binding) -> bool {
    let quiet = [
        Action::Undo,
        Action::Redo,
        Action::Close,
        Action::ZoomOff,
        Action::ZoomOut,
        Action::Scroll(1),
    ];
    let of_others = [
        Action::StartHere,
        Action::NewStart,
        Action::GoalHere,
        Action::StepUpdate,
        Action::StepEpisode,
        Action::Evaluate,
    ];
    quiet.contains(&binding.action)
        || of_others.contains(&binding.action)
        || matches!(
            binding.action,
            Action::Pan(..) | Action::Move(..) | Action::Show(_) | Action::Tool(_)
        )
}

#[test]
fn every_key_triggers_its_action() {
    let folder = tempfile::tempdir().expect("a folder");
    for binding in bindings().filter(|b| is_of_trainer(b)) {
        for key in binding.keys {
            let path = folder.path().join("run.safetensors");
            let mut app = app_saving_to(rooms(), Method::default(), Limits::default(), Some(path));
            draw(&mut app, 80, 24);
            wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 0);
            if binding.when == When::Editing {
                press(&mut app, KeyCode::Char('e'));
            }
            if binding.when == When::Offered {
                let saved = saved_run(folder.path(), &app);
                offer(saved, &mut app.screen);
            }
            if binding.when == When::Touring {
                app.begin_tour();
            }
            app.screen.log.dismiss();
            let before = state(&app);
            let combination = crokey::parse(key).expect("a key");
            let crokey::OneToThree::One(code) = combination.codes else {
                panic!("{key} is one key")
            };
            press_with(&mut app, code, combination.modifiers);
            draw(&mut app, 80, 24);
            assert!(
                is_quiet(binding) || state(&app) != before,
                "{key} does nothing for {}",
                binding.name
            );
        }
    }
}

#[test]
fn every_action_without_a_key_is_found_by_name() {
    let mut app = still();
    draw(&mut app, 80, 24);
    for binding in bindings().filter(|b| b.keys.is_empty()) {
        press(&mut app, KeyCode::Char(':'));
        type_text(&mut app, binding.long);
        let Some(Dialog::Pick(picker)) = app.screen.dialogs.last() else {
            panic!("the list is open")
        };
        assert_eq!(picker.choice(), Some(&Choice::Act(binding.action)), "{}", binding.name);
        press(&mut app, KeyCode::Enter);
        let asks = !matches!(binding.action, Action::ExportFilm | Action::Compare);
        assert_eq!(!app.screen.dialogs.is_empty(), asks, "{} asks something", binding.name);
        app.screen.dialogs.clear();
    }
}
