//! Dialogs, notices, and screens with little room.

use super::*;
use crate::tui::app::files::pick_map;
use crate::tui::background::Background;
use crate::tui::dialog::Choice;
use crate::tui::lists;
use crate::tui::reading::Read;
use gdg::learn::LearnerKind;
use gdg::map::MapScale;
use gdg::pulse::Progress;

#[test]
fn a_theme_is_shown_while_it_is_selected_and_kept_only_if_it_is_picked() {
    let mut app = still();
    press(&mut app, KeyCode::Char('T'));
    press(&mut app, KeyCode::Down);
    assert_eq!(app.screen.theme.name, ThemeName::Light, "shown at once");
    press(&mut app, KeyCode::Down);
    press(&mut app, KeyCode::Esc);
    assert_eq!(app.screen.theme.name, ThemeName::Dark, "as before");
    press(&mut app, KeyCode::Char('T'));
    press(&mut app, KeyCode::Down);
    press(&mut app, KeyCode::Enter);
    assert_eq!(app.screen.theme.name, ThemeName::Light);
}

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
fn whoever_decides_sees_all_that_is_at_stake_on_a_small_screen() {
    let path = Path::new("saves").join(format!("{}END.safetensors", "a-very-long-name-".repeat(6)));
    let mut unsaved = Snapshot::clone(&still().screen.latest);
    unsaved.counters.updates = 223_456_789;
    for question in [
        lists::quit_choices(&unsaved, true, &path),
        lists::load_choices(&unsaved, path.clone()),
        lists::tour_choices(&unsaved, true),
        lists::map_switch_choices(&Arc::new(rooms()), Some(&path), Some(&rooms()), None, true),
    ] {
        let details: Vec<String> =
            question.items().map(|item| item.detail.split_whitespace().collect()).collect();
        let mut app = still();
        app.screen.open(question);
        let shown = shown_by(&mut app, 60, 20).replace(['\n', '\u{2502}', ' '], "");
        assert!(details.iter().all(|detail| shown.contains(detail)), "{details:?}\n{shown}");
    }
}

#[test]
fn a_learner_that_needs_rewards_brings_the_tuned_preset() {
    let registry = Registry::builtin();
    let her = *registry.learner("her").expect("built in");
    let registry = registry.with_learner(LearnerKind { name: "own", ..her });
    let world = PointMaze::new(Arc::new(rooms()), 0);
    let mut app = still_of(&trainer_in(&world, Method::default(), &registry));
    app.act(Action::Method);
    type_text(&mut app, "own+sorb");
    press(&mut app, KeyCode::Enter);
    app.obey();
    assert_eq!(app.screen.run().method.name(), "own+sorb");
    assert_eq!(app.screen.run().preset, Preset::Tuned);
}

#[test]
fn only_texts_that_are_maps_are_offered() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("rooms.txt"), ROOMS).expect("written");
    std::fs::write(folder.path().join("notes.txt"), "Buy milk, 2 bottles.\n").expect("written");
    let mut app = still();
    let pick = |app: &mut App| pick_map(Some(folder.path()), &app.scene, &mut app.screen);
    pick(&mut app);
    let Some(Dialog::Pick(list)) = app.screen.dialogs.last() else { panic!("a list") };
    let names: Vec<&str> = list.items().map(|item| item.label.as_str()).collect();
    assert_eq!(names, ["..", "rooms.txt"]);
    press(&mut app, KeyCode::Esc);
    app.screen.reading_patience = Duration::ZERO;
    pick(&mut app);
    // They may have been read by now.
    if app.screen.dialogs.is_empty() {
        assert!(notice(&app).starts_with("reading the maps in "));
        tick_until(&mut app, |app| !app.screen.dialogs.is_empty());
    }
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
    let path = PathBuf::from("large.map");
    let read = move |progress: &Progress| {
        progress.begin(0, 1);
        progress.set(1, 4);
        Read::Map(path, receive.recv().expect("a map"))
    };
    app.screen.reading =
        Some(Background::start("reading large.map".to_owned(), read).expect("a thread"));
    tick_until(&mut app, |app| app.screen.log.notice().is_some());
    tick_until(&mut app, |app| {
        app.screen.log.notice().is_some_and(|notice| notice.text.ends_with("... 2 s, 25 %"))
    });
    press(&mut app, KeyCode::Char('?'));
    assert_eq!(app.screen.dialogs.len(), 1, "keys work");
    press(&mut app, KeyCode::Esc);
    send.send(Ok(Grid::empty("large", 30, 30))).expect("somebody waits");
    tick_until(&mut app, |app| !app.screen.dialogs.is_empty());
}

#[test]
fn an_evaluation_can_be_asked_for_even_while_training_is_paused() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Paused);
    let shown = shown_by(&mut app, 80, 24);
    assert!(shown.contains("next      paused, y: now"), "{shown}");
    let (before, updates) =
        (app.screen.snapshot.evaluations.len(), app.screen.snapshot.counters.updates);
    press(&mut app, KeyCode::Char('y'));
    wait_until(&mut app, |app| app.screen.snapshot.evaluations.len() > before);
    assert_eq!(app.screen.snapshot.evaluations.last().map(|(at, _)| *at), Some(updates));
}

#[test]
fn a_run_is_saved_before_another_begins_and_kept_if_that_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let start = |app: &App| {
        Choice::StartOn(Arc::new(Grid::empty("hall", 30, app.maze().map.height())), None)
    };
    std::fs::write(folder.path().join("file"), b"").expect("written");
    for (place, works) in [("run.safetensors", true), ("file/run.safetensors", false)] {
        let path = folder.path().join(place);
        let mut app = app_saving_to(rooms(), gdg(), Limits::default(), Some(path.clone()));
        wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
        let (then, generation) = (start(&app), app.screen.snapshot.generation);
        let Choice::StartOn(map, _) = &then else { unreachable!("it starts a run") };
        app.screen.open(lists::map_switch_choices(map, None, None, None, true));
        press(&mut app, KeyCode::Char('s'));
        if works {
            wait_until(&mut app, |app| app.screen.snapshot.generation > generation);
            let updates = train::describe(&path).expect("a checkpoint").updates;
            assert!(updates > 0 && app.scene.title(&app.screen.snapshot) == "hall", "{updates}");
        } else {
            wait_until(&mut app, |app| app.screen.snapshot.save_failed.0 > 0);
            let updates = app.screen.snapshot.updates();
            wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
            assert_eq!(
                (app.screen.snapshot.generation, app.scene.title(&app.screen.snapshot)),
                (generation, "rooms")
            );
        }
    }
}

#[test]
fn a_map_never_replaces_a_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app();
    let file = saved_run(folder.path(), &app).file;
    let before = std::fs::read(&file).expect("a checkpoint");
    app.act(Action::SaveMap);
    for _ in 0..2 {
        enter(&mut app, &file.to_string_lossy());
        assert!(shown_by(&mut app, 120, 40).contains("this file is a checkpoint"));
    }
    assert!(std::fs::read(&file).expect("still there") == before);
}

#[test]
fn a_run_that_has_not_changed_is_not_autosaved_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.safetensors");
    let mut app = app_saving_to(rooms(), gdg(), Limits::default(), Some(path));
    app.saver.autosave.minutes = 1e-5;
    wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    let files = || std::fs::read_dir(folder.path()).expect("a folder").count();
    for edits in 1..=2 {
        for _ in 0..5 {
            std::thread::sleep(Duration::from_millis(20));
            app.on_tick();
        }
        wait_until(&mut app, |app| app.screen.snapshot.autosaves.len() == edits);
        assert_eq!(files(), edits, "an edit alone is worth another file");
        let cell = app.maze().map.free_cells().next().expect("a free cell");
        app.change_map(app.maze().map.with_cells([(cell, false)]).map(Arc::new));
        wait_until(&mut app, |app| !app.maze().map.is_free(cell));
    }
}

#[test]
fn an_edited_map_is_not_discarded_without_a_question() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app_on(rooms(), gdg());
    wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    let save_as = |app: &mut App, action: Action, name: &str| {
        app.act(action);
        enter(app, &folder.path().join(name).to_string_lossy());
    };
    let asks = |app: &mut App| {
        press(app, KeyCode::Char('q'));
        let asked = app.screen.dialogs.len() == 1;
        press(app, KeyCode::Esc);
        asked
    };
    let cell = app.maze().map.free_cells().next().expect("a free cell");
    app.change_map(app.maze().map.with_cells([(cell, false)]).map(Arc::new));
    assert!(asks(&mut app), "although it has hardly been trained");
    save_as(&mut app, Action::SaveMap, "edited.txt");
    assert!(!app.scene.has_unsaved_map());
    app.change_map(app.maze().map.with_cells([(cell, true)]).map(Arc::new));
    assert!(asks(&mut app));
    save_as(&mut app, Action::SaveAs, "run");
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    assert!(!app.scene.has_unsaved_map(), "a checkpoint has the map too");
}

#[test]
fn an_autosave_that_fails_is_tried_again_in_a_paused_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let blocked = folder.path().join("runs");
    std::fs::write(&blocked, "a file, where a folder is needed").expect("a file");
    let mut app =
        app_saving_to(rooms(), gdg(), Limits::default(), Some(blocked.join("run.safetensors")));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    app.saver.autosave.minutes = 1e-5;
    std::thread::sleep(Duration::from_millis(20));
    app.on_tick();
    wait_until(&mut app, |app| app.screen.snapshot.notice.is_error);
    assert!(app.screen.snapshot.autosaves.is_empty());
    std::fs::remove_file(&blocked).and_then(|()| std::fs::create_dir(&blocked)).expect("a folder");
    std::thread::sleep(Duration::from_millis(20));
    app.on_tick();
    wait_until(&mut app, |app| app.screen.snapshot.autosaves.len() == 1);
}

#[test]
fn a_restart_with_another_seed_offers_to_save_what_would_be_lost() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.safetensors");
    for (answer, saves) in [('n', false), ('d', false), ('s', true)] {
        let mut app = app_saving_to(rooms(), gdg(), Limits::default(), Some(path.clone()));
        // As after some time of training.
        app.act(Action::ToggleEdit);
        app.act(Action::Apply);
        wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
        let generation = app.screen.snapshot.generation;
        press(&mut app, KeyCode::Esc);
        press(&mut app, KeyCode::Char('R'));
        press(&mut app, KeyCode::Enter);
        assert!(
            shown_by(&mut app, 80, 24)
                .contains("start a new run on this map with seed 2 without saving")
        );
        press(&mut app, KeyCode::Char(answer));
        if answer == 'n' {
            assert!(app.screen.dialogs.is_empty() && app.screen.run().seed == 1, "nothing happens");
            continue;
        }
        wait_until(&mut app, |app| app.screen.snapshot.generation > generation);
        assert_eq!((app.screen.run().seed, path.exists()), (2, saves));
    }
}

#[test]
fn saving_a_map_warns_before_a_format_drops_starts_and_goals() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app_on(rooms(), gdg());
    let save_as = |app: &mut App, name: &str| {
        app.act(Action::SaveMap);
        enter(app, &folder.path().join(name).to_string_lossy());
    };
    let marks = |name: &str| {
        let map = gdg::map::load_map(&folder.path().join(name)).expect("a map");
        map.starts().len() + map.goals().len()
    };
    let warning = "the format movingai has no goals";
    save_as(&mut app, "rooms.map");
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains(warning) && shown.contains("NAME.txt keeps them"), "{shown}");
    assert!(!folder.path().join("rooms.map").exists(), "nothing is written yet");
    press(&mut app, KeyCode::Enter);
    assert_eq!((app.screen.dialogs.len(), marks("rooms.map")), (0, 0));
    save_as(&mut app, "rooms.map");
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("keeps them, and the file"), "{shown}");
    press(&mut app, KeyCode::Esc);
    save_as(&mut app, "rooms.txt");
    assert_eq!((app.screen.dialogs.len(), marks("rooms.txt")), (0, 1));
    // A maze of blocks keeps its scale in an image, not in plain text.
    let scale = MapScale { cell: 2, ..MapScale::default() };
    let mut app = app_on(scale.of("rooms", &rooms()).expect("a map"), gdg());
    save_as(&mut app, "blocks.txt");
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("has no cells per block 2: NAME.png keeps them"), "{shown}");
    press(&mut app, KeyCode::Esc);
    save_as(&mut app, "blocks.png");
    let kept = gdg::map::load_map(&folder.path().join("blocks.png")).expect("a map");
    assert_eq!((app.screen.dialogs.len(), kept.scale()), (0, scale));
}
