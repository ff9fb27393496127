//! Every action: reachable by keyboard alone, listed in the help, and safe at any time.

use super::*;
use crate::tui::choices::Pane;
use crate::tui::dialog::Choice;

fn is_of_trainer(binding: &Binding) -> bool {
    [Mode::Watching, Mode::Editing, Mode::Touring].into_iter().any(|mode| binding.is_active(mode))
}

/// Returns whether an action changes nothing on this screen, or has nothing to act on here.
fn is_quiet(action: Action) -> bool {
    let quiet = [Action::Close, Action::ZoomOff, Action::ZoomOut];
    let shown = [Action::Tool(Tool::Pencil), Action::Show(Pane::default())];
    quiet.contains(&action) || shown.contains(&action) || matches!(action, Action::Pan(..))
}

#[test]
fn every_key_triggers_its_action() {
    let mut idle = Vec::new();
    for binding in bindings().filter(|b| is_of_trainer(b)) {
        for key in binding.keys {
            let mut app = staged::staged_app(80, 24);
            app.set_goal(Cell::new(5, 2));
            match binding.when {
                Some(Mode::Editing) => press(&mut app, KeyCode::Char('e')),
                Some(Mode::Touring) => app.begin_tour(),
                _ => {}
            }
            app.screen.log.dismiss();
            let before = draw(&mut app, 80, 24).backend().buffer().clone();
            app.commands.try_iter().for_each(drop);
            app.requests.try_iter().for_each(drop);
            let combination = crokey::parse(key).expect("a key");
            let crokey::OneToThree::One(code) = combination.codes else {
                panic!("{key} is one key")
            };
            press_with(&mut app, code, combination.modifiers);
            let is_drawn = *draw(&mut app, 80, 24).backend().buffer() != before;
            let is_asked = app.commands.try_recv().is_ok() || app.requests.try_recv().is_ok();
            let ends = app.is_done() || app.terminal_request.is_some();
            if !(is_drawn || is_asked || ends || is_quiet(binding.action)) {
                idle.push(format!("{key}: {}", binding.name));
            }
        }
    }
    assert!(idle.is_empty(), "keys that do nothing: {idle:?}");
}

#[test]
fn every_action_without_a_key_is_found_by_name() {
    let mut app = still();
    for binding in bindings().filter(|b| b.keys.is_empty() && is_of_trainer(b)) {
        type_text(&mut app, &format!(":{}", binding.long));
        let Some(Dialog::Pick(picker)) = app.screen.dialogs.last() else { panic!("a list") };
        assert_eq!(picker.choice(), Some(&Choice::Act(binding.action)), "{}", binding.name);
        press(&mut app, KeyCode::Enter);
        app.screen.dialogs.clear();
    }
}
