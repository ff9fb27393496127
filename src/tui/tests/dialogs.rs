//! Dialogs, notices, and screens with little room.

use super::staged::staged_app;
use super::*;
use crate::tui::app::files::pick_map;
use crate::tui::background::Background;
use crate::tui::dialog::{Choice, Item};
use crate::tui::lists;
use crate::tui::panes::Pane;
use crate::tui::reading::Read;
use gdg::learn::LearnerKind;
use gdg::map::MapScale;
use gdg::pulse::Progress;
use gdg::viewer::maze::CellInfo;

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
fn questions_are_answered_by_their_keys_and_have_no_search_field() {
    let mut app = staged_app(80, 24);
    app.act(Action::Quit);
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains(" y save and quit") && !shown.contains("type to search"), "{shown}");
    press(&mut app, KeyCode::Char('c'));
    assert!(app.screen.dialogs.is_empty() && !app.is_done());
    app.act(Action::Quit);
    press(&mut app, KeyCode::Char('n'));
    assert!(app.is_done());
}

#[test]
fn errors_are_shown_in_full_and_in_their_own_colour() {
    let mut app = still();
    let end = "the very end of it";
    app.report(&format!("/a/rather/long/path/{} cannot be written: {end}", "folder/".repeat(12)));
    for width in [60, 80, 120] {
        let terminal = draw(&mut app, width, 24);
        assert!(text(&terminal).contains(end), "{width} columns");
        let colour = app.screen.theme.failure().fg;
        let cells = terminal.backend().buffer().content.iter();
        assert!(cells.filter(|cell| Some(cell.fg) == colour).count() > 100);
    }
}

#[test]
fn the_footer_keeps_its_ends_where_room_is_short() {
    let mut app = still();
    for (width, shown) in
        [(60, ["Space pause", "? help", "q quit"]), (40, ["Space pause", "? help", "q quit"])]
    {
        let terminal = draw(&mut app, width, 20);
        let footer = text(&terminal).lines().last().expect("a footer").to_owned();
        assert!(shown.iter().all(|part| footer.contains(part)), "{width} columns: {footer}");
    }
}

#[test]
fn every_tool_says_what_the_mouse_does() {
    let mut app = still();
    type_text(&mut app, "e7");
    let shown = text(&draw(&mut app, 140, 30));
    assert!(shown.contains("click: add or remove g") && !shown.contains("walls"), "{shown}");
    for width in [40, 60, 80] {
        let shown = text(&draw(&mut app, width, 20));
        assert!(shown.contains("done"), "{width} columns: {shown}");
    }
}

#[test]
fn the_help_wraps_scrolls_by_pages_and_can_be_searched() {
    let mut app = still();
    press(&mut app, KeyCode::Char('?'));
    let shown = text(&draw(&mut app, 40, 12));
    assert!(shown.contains("the learned distance") && shown.contains("G:"), "{shown}");
    let first = |app: &App| match app.screen.dialogs.last() {
        Some(Dialog::Help(help)) => help.first,
        _ => panic!("the help is open"),
    };
    for (width, height) in [(40, 12), (80, 40)] {
        let before = first(&app);
        press(&mut app, KeyCode::PageDown);
        draw(&mut app, width, height);
        draw(&mut app, width, height);
        press(&mut app, KeyCode::PageDown);
        draw(&mut app, width, height);
        assert!(first(&app) > before, "{width} x {height}");
    }
    press(&mut app, KeyCode::Home);
    draw(&mut app, 80, 40);
    press(&mut app, KeyCode::PageDown);
    assert_eq!(first(&app), 37, "a page of 38 lines, of which one stays");
    press(&mut app, KeyCode::Char('/'));
    type_text(&mut app, "undo");
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains("undo an edit") && !shown.contains("pause or resume"), "{shown}");
    press(&mut app, KeyCode::Esc);
    assert!(text(&draw(&mut app, 80, 24)).contains("pause or resume"));
    press(&mut app, KeyCode::Esc);
    assert!(app.screen.dialogs.is_empty());
}

#[test]
fn panes_take_the_place_of_the_map_where_there_is_no_room_beside_it() {
    let mut app = still();
    draw(&mut app, 60, 20);
    let mut seen = Vec::new();
    for _ in 0..=Pane::ALL.len() {
        press(&mut app, KeyCode::Tab);
        draw(&mut app, 60, 20);
        seen.push((app.screen.maximised, app.screen.pane));
    }
    let panes = Pane::ALL.map(|pane| (true, pane));
    assert_eq!(seen[..Pane::ALL.len()], panes);
    assert!(!seen[Pane::ALL.len()].0, "the map again");
    press(&mut app, KeyCode::Char('5'));
    assert!(app.screen.maximised && app.screen.pane == Pane::Log);
}

#[test]
fn the_methods_include_every_combination() {
    let mut list = lists::methods(&Method::default(), &Registry::builtin());
    list.paste("her+sorb");
    let method: Method = "her+sorb".parse().expect("a method");
    assert_eq!(list.choice(), Some(&Choice::Method(method)));
}

#[test]
fn a_registered_learner_that_needs_rewards_is_listed_and_brings_the_tuned_preset() {
    let her = *Registry::builtin().learner("her").expect("built in");
    let registry = Registry::builtin().with_learner(LearnerKind { name: "own", ..her });
    let world = PointMaze::new(Arc::new(rooms()), 0);
    let trainer = trainer_in(&world, Method::default(), &registry);
    let mut app = still_of(&trainer);
    app.act(Action::Method);
    let Some(Dialog::Pick(list)) = app.screen.dialogs.last_mut() else { panic!("a list") };
    list.paste("own+sorb");
    let method: Method = "own+sorb".parse().expect("a method");
    assert_eq!(list.choice(), Some(&Choice::Method(method.clone())));
    app.choose(Choice::Method(method.clone()));
    app.obey();
    assert_eq!(app.screen.run().method, method);
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
    let notice = app.screen.log.notice().map(|notice| notice.text.to_owned());
    let notice = notice.expect("a notice");
    assert!(
        notice.starts_with("reading the maps in ") && app.screen.dialogs.is_empty(),
        "{notice}"
    );
    tick_until(&mut app, |app| !app.screen.dialogs.is_empty());
    assert!(matches!(app.screen.dialogs.last(), Some(Dialog::Pick(_))));
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
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains("next      paused, y: now"), "{shown}");
    let (before, updates) =
        (app.screen.snapshot.evaluations.len(), app.screen.snapshot.counters.updates);
    press(&mut app, KeyCode::Char('y'));
    wait_until(&mut app, |app| app.screen.snapshot.evaluations.len() > before);
    assert_eq!(app.screen.snapshot.evaluations.last().map(|(at, _)| *at), Some(updates));
}

#[test]
fn learners_show_only_the_losses_they_have() {
    let shown = |method: &str| {
        let mut app = app_on(rooms(), method.parse().expect("a method"));
        wait_until(&mut app, |app| app.screen.snapshot.losses.critic > 0.0);
        text(&draw(&mut app, 80, 24))
    };
    assert!(shown("gdg").contains("f loss"));
    let her = shown("her");
    assert!(her.contains("D loss") && !her.contains("f loss"), "{her}");
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
    (0..60).for_each(|_| press(&mut app, KeyCode::Backspace));
    type_text(&mut app, &file.to_string_lossy());
    for _ in 0..2 {
        press(&mut app, KeyCode::Enter);
        assert!(text(&draw(&mut app, 120, 40)).contains("this file is a checkpoint"));
    }
    assert!(std::fs::read(&file).expect("still there") == before);
}

#[test]
fn a_changed_setting_is_named_with_its_old_and_new_value() {
    let mut app = app();
    let mut run = app.screen.run().clone();
    let before = run.settings.learn.batch_size;
    run.settings.learn.batch_size = 16;
    app.command(gdg::engine::Command::Change(Box::new(run.clone())));
    let logged =
        |app: &App, text: &str| app.screen.log.entries().iter().any(|entry| entry.text == text);
    wait_until(&mut app, |app| logged(app, &format!("batch_size {before} -> 16")));
    run.settings.learn.hidden = 8;
    app.command(gdg::engine::Command::Change(Box::new(run)));
    wait_until(&mut app, |app| logged(app, "hidden 16 -> 8; networks reset, replay kept"));
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
        // Replace the suggested name.
        (0..60).for_each(|_| press(app, KeyCode::Backspace));
        type_text(app, &folder.path().join(name).to_string_lossy());
        press(app, KeyCode::Enter);
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
fn overlays_of_bridges_say_that_a_method_has_none() {
    let mut app = still_on(rooms(), gdg());
    for key in ['b', 'd', 'B', 'p'] {
        let before = app.screen.overlays;
        press(&mut app, KeyCode::Char(key));
        let said = app.screen.log.notice().map(|notice| notice.text.to_owned()).unwrap_or_default();
        assert!(said.starts_with("gdg has no bridges"), "{key}: {said}");
        assert!(app.screen.overlays == before);
    }
}

#[test]
fn an_old_error_goes_away_when_a_dialog_opens_and_a_new_one_stays() {
    let mut app = still();
    app.report("the disk is full");
    press(&mut app, KeyCode::Char('n'));
    assert!(
        app.screen.log.notice().is_some_and(|notice| notice.is_error),
        "it stays while nothing covers the map"
    );
    press(&mut app, KeyCode::Char('o'));
    assert!(app.screen.log.notice().is_none());
    app.report("the disk is still full");
    assert!(app.screen.log.notice().is_some());
}

#[test]
fn a_map_is_recent_once_it_has_been_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("hall.txt");
    std::fs::write(&file, ".....\n.....\n").expect("written");
    let mut app = still();
    app.choose(Choice::OpenMap(file.clone()));
    let Some(Dialog::Pick(question)) = app.screen.dialogs.last() else { panic!("a question") };
    let starts =
        |item: &Item| matches!(&item.choice, Choice::StartOn(_, Some(from)) if *from == file);
    assert!(question.items().any(starts), "what is picked records the file");
}

#[test]
fn facts_about_a_cell_are_not_cut_on_narrow_screens() {
    let mut app = staged_app(80, 24);
    let cell = app.maze().map.free_cells().last().expect("a free cell");
    for (truth, visits, expected) in [
        (
            Some(80),
            Some(7),
            format!(" cell {},{}: D 100.4, true 80 (+26 %), 7 visits", cell.x, cell.y),
        ),
        (
            Some(80),
            Some(12_345),
            format!(" cell {},{}: D 100.4, true 80 (+26 %), 12.3k visits", cell.x, cell.y),
        ),
        (
            Some(0),
            Some(99),
            format!(" {},{}: D 100.4, true 0 (+100.4 steps), 99 visits", cell.x, cell.y),
        ),
        (Some(0), Some(12_345), format!(" {},{}: D 100.4, true 0 (+100.4 steps)", cell.x, cell.y)),
    ] {
        let mut view = (*app.maze().view).clone();
        view.inspected = Some(CellInfo { cell, learned: 100.4, truth, visits });
        let maze = app.maze_mut();
        (maze.view, maze.inspecting) = (Arc::new(view), Some(cell));
        let shown = text(&draw(&mut app, 80, 24));
        let row = shown.lines().find(|row| row.contains("D 100.4")).expect("a line about the cell");
        let facts = row.split(['\u{2502}', '\u{2506}']).next().unwrap_or_default();
        assert_eq!(facts.trim_end(), expected, "{shown}");
    }
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
            text(&draw(&mut app, 80, 24))
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
fn the_minimap_hides_neither_goal_nor_cursor() {
    let mut app = staged_app(120, 40);
    let (width, height) = (app.maze().map.width(), app.maze().map.height());
    for goal in [Cell::new(width - 1, 0), Cell::new(0, 0), Cell::new(width - 1, height - 1)] {
        let Some(goal) = app.maze().map.nearest_free(goal) else { panic!("a free cell") };
        app.set_goal(goal);
        app.act(Action::ZoomOff);
        for _ in 0..3 {
            app.act(Action::ZoomIn);
        }
        draw(&mut app, 120, 40);
        let layout = &app.screen.layout;
        let minimap = layout.minimap.as_ref().expect("a minimap").area;
        let at = layout.map.as_ref().and_then(|map| map.character_of(goal.centre()));
        assert!(at.is_none_or(|at| !minimap.contains(at)), "{goal:?} at {at:?}, {minimap:?}");
    }
}

#[test]
fn headers_are_not_cut_within_a_word() {
    let mut app = staged_app(40, 12);
    for width in [40, 44, 48, 60, 80] {
        let shown = text(&draw(&mut app, width, 16));
        let header = shown.lines().next().unwrap_or_default().trim_end();
        assert!(
            ["training", "unsaved"].iter().any(|end| header.ends_with(end)),
            "{width}: {header}"
        );
    }
}

#[test]
fn saving_a_map_warns_before_a_format_drops_starts_and_goals() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app_on(rooms(), gdg());
    let enter = |app: &mut App, name: &str| {
        app.act(Action::SaveMap);
        (0..60).for_each(|_| press(app, KeyCode::Backspace));
        type_text(app, &folder.path().join(name).to_string_lossy());
        press(app, KeyCode::Enter);
    };
    let marks = |name: &str| {
        let map = gdg::map::load_map(&folder.path().join(name)).expect("a map");
        map.starts().len() + map.goals().len()
    };
    let warning = "the format movingai has no goals";
    enter(&mut app, "rooms.map");
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains(warning) && shown.contains("NAME.txt keeps them"), "{shown}");
    assert!(!folder.path().join("rooms.map").exists(), "nothing is written yet");
    press(&mut app, KeyCode::Enter);
    assert_eq!((app.screen.dialogs.len(), marks("rooms.map")), (0, 0));
    enter(&mut app, "rooms.map");
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains("keeps them, and the file"), "{shown}");
    press(&mut app, KeyCode::Esc);
    enter(&mut app, "rooms.txt");
    assert_eq!((app.screen.dialogs.len(), marks("rooms.txt")), (0, 1));
    // A plain map called .map stays one.
    std::fs::copy(folder.path().join("rooms.txt"), folder.path().join("own.map")).expect("a copy");
    enter(&mut app, "own.map");
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains("Enter again replaces it") && !shown.contains(warning), "{shown}");
    press(&mut app, KeyCode::Enter);
    assert_eq!((app.screen.dialogs.len(), marks("own.map")), (0, 1));
    // A maze of blocks keeps its scale in an image, not in plain text.
    let scale = MapScale { cell: 2, ..MapScale::default() };
    let mut app = app_on(scale.of("rooms", &rooms()).expect("a map"), gdg());
    enter(&mut app, "blocks.txt");
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains("has no cells per block 2: NAME.png keeps them"), "{shown}");
    press(&mut app, KeyCode::Esc);
    enter(&mut app, "blocks.png");
    let kept = gdg::map::load_map(&folder.path().join("blocks.png")).expect("a map");
    assert_eq!((app.screen.dialogs.len(), kept.scale()), (0, scale));
}
