//! Dialogs, notices, and screens with little room.

use super::*;
use crate::tui::lists;
use crate::tui::session::disk::{ShowResult, offer_map, pick_map};
use gdg::job::{Job, Running};

#[test]
fn errors_are_shown_in_full_and_in_their_own_colour() {
    let mut app = still();
    let end = "the very end of it";
    app.report(&format!("/a/rather/long/path/{} cannot be written: {end}", "folder/".repeat(12)));
    let terminal = draw(&mut app, 60, 24);
    assert!(text(&terminal).contains(end));
    let colour = app.screen.theme.failure().fg;
    let cells = terminal.backend().buffer().content.iter();
    assert!(cells.filter(|cell| Some(cell.fg) == colour).count() > 100);
    // It stays until a dialog opens.
    press(&mut app, KeyCode::Char('n'));
    assert!(app.screen.log.notice().is_some_and(|notice| notice.is_error));
    press(&mut app, KeyCode::Char('o'));
    assert!(app.screen.log.notice().is_none());
}

#[test]
fn dialogs_begin_in_the_same_row() {
    let tops = [Action::Settings, Action::NewSeed, Action::SaveAs].map(|action| {
        let mut app = still();
        app.act(action);
        draw(&mut app, 120, 40);
        app.screen.layout.dialog.y
    });
    assert_eq!(tops, [tops[0]; 3]);
}

#[test]
fn that_the_actor_alone_has_learned_what_plans_found_is_said_once() {
    let mut app = staged::staged_app(80, 24);
    for (alone, says) in [(0.8, false), (0.93, true), (0.95, false)] {
        app.screen.log.take();
        app.change_snapshot(|latest| {
            let mut found = staged::evaluation(0.5);
            found.alone.success = Some(alone);
            Arc::make_mut(&mut latest.evaluations).push((latest.counters.updates, found));
        });
        let said = "the actor of gdg-bridge alone now reaches 0.93";
        assert_eq!(shown_by(&mut app, 80, 24).contains(said), says, "{alone}");
    }
}

#[test]
fn whoever_decides_sees_all_that_is_at_stake_on_a_small_screen() {
    let path = Path::new("saves").join(format!("{}END.safetensors", "a-very-long-name-".repeat(6)));
    let mut unsaved = Snapshot::clone(&still().screen.snapshot);
    unsaved.counters.updates = 223_456_789;
    let (map, lost) = (Arc::new(rooms()), lists::lost(&unsaved, true));
    for question in [
        lists::quit_choices(lost.clone(), path.display()),
        lists::map_switch(&map, Some(&map), None, Some(lost)),
    ] {
        let details: Vec<String> =
            question.items().map(|item| item.detail.split_whitespace().collect()).collect();
        let mut app = still();
        app.screen.open(question);
        for detail in details {
            let shown = shown_by(&mut app, 60, 20).replace(['\n', '\u{2502}', ' '], "");
            assert!(shown.contains(&detail), "{detail:?}\n{shown}");
            press(&mut app, KeyCode::Down);
        }
    }
}

#[test]
fn maps_of_all_formats_are_offered_and_no_other_texts() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [
        ("maze.d4rl", "\"#####\\#GOO#\\#####\""),
        ("notes.txt", "Buy milk, 2 bottles.\n"),
        ("rooms.txt", ROOMS),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let mut app = still();
    pick_map(&mut app.cx, Some(folder.path()));
    let Some(Dialog::Pick(list)) = app.screen.dialogs.last() else { panic!("a list") };
    let names: Vec<&str> = list.items().map(|item| item.label.as_str()).collect();
    assert_eq!(names, ["..", "maze.d4rl", "rooms.txt"]);
}

/// Lets time pass until something changes after which `is` holds.
fn tick_until(app: &mut App, is: fn(&App) -> bool) {
    let began = Instant::now();
    while !(app.on_tick() && is(app)) {
        assert!(began.elapsed() < Duration::from_secs(20), "it takes too long");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn the_interface_goes_on_while_a_map_is_read() {
    let mut app = still();
    let (send, receive) = std::sync::mpsc::channel();
    let read = move |progress: &Job| -> ShowResult {
        progress.begin(0, 1);
        progress.set(1, 4);
        let map = receive.recv().expect("a map");
        Box::new(|cx| offer_map(cx, map))
    };
    app.reading = Some(Running::start("reading", Job::new("reading large.map"), read));
    tick_until(&mut app, |app| app.screen.log.notice().is_some());
    tick_until(&mut app, |app| {
        let text = app.screen.log.notice().map_or("", |notice| notice.text);
        text.starts_with("reading large.map ... ") && text.ends_with(" s, 25 %")
    });
    press(&mut app, KeyCode::Char('?'));
    assert_eq!(app.screen.dialogs.len(), 1, "keys work");
    press(&mut app, KeyCode::Esc);
    send.send(Grid::empty("large", 30, 30)).expect("somebody waits");
    tick_until(&mut app, |app| !app.screen.dialogs.is_empty());
}
