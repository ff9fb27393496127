//! Dialogs, notices, hints, and what the trainer's answers change.

use super::*;
use crate::tui::lists;
use crate::tui::session::files::{Show, offer_map, pick_map};
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
fn whoever_decides_sees_all_that_is_at_stake_on_a_small_screen() {
    let path = Path::new("saves").join(format!("{}END.safetensors", "a-very-long-name-".repeat(6)));
    let mut unsaved = Snapshot::clone(&still().screen.latest);
    unsaved.counters.updates = 223_456_789;
    for question in [
        lists::quit_choices(&unsaved, true, &path),
        lists::map_switch(&Arc::new(rooms()), Some(&rooms()), None, Some(&unsaved)),
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
fn only_texts_that_are_maps_are_offered() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("rooms.txt"), ROOMS).expect("written");
    std::fs::write(folder.path().join("notes.txt"), "Buy milk, 2 bottles.\n").expect("written");
    let mut app = still();
    let pick = |app: &mut App| pick_map(&mut app.cx, Some(folder.path()));
    pick(&mut app);
    let Some(Dialog::Pick(list)) = app.screen.dialogs.last() else { panic!("a list") };
    let names: Vec<&str> = list.items().map(|item| item.label.as_str()).collect();
    assert_eq!(names, ["..", "rooms.txt"]);
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
    let read = move |progress: &Job| -> Show {
        progress.begin(0, 1);
        progress.set(1, 4);
        let map = receive.recv().expect("a map");
        Box::new(|cx| offer_map(cx, map))
    };
    app.reading = Some(Running::start("reading", Job::new("reading large.map"), read));
    tick_until(&mut app, |app| app.screen.log.notice().is_some());
    tick_until(&mut app, |app| {
        app.screen.log.notice().is_some_and(|notice| notice.text.ends_with("... 2 s, 25 %"))
    });
    press(&mut app, KeyCode::Char('?'));
    assert_eq!(app.screen.dialogs.len(), 1, "keys work");
    press(&mut app, KeyCode::Esc);
    send.send(Grid::empty("large", 30, 30)).expect("somebody waits");
    tick_until(&mut app, |app| !app.screen.dialogs.is_empty());
}

#[test]
fn a_resumed_run_goes_on_with_its_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.safetensors");
    let mut app = app_saving_to(&path, gdg(), Some(0));
    let own = Cell::new(3, 4);
    assert_ne!(app.maze().goal, own);
    app.set_goal(own);
    app.act(Action::Save);
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    app.set_goal(Cell::new(1, 1));
    app.command(Command::Load(path));
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some() && app.maze().goal == own);
    assert_eq!(app.screen.snapshot.notes.goal, own.centre());
}

#[test]
fn lines_over_the_map_and_notices_go_away_after_a_while() {
    type Shows<'a> = (&'a str, &'a dyn Fn(&mut App));
    let shows: [Shows; 2] = [
        ("click: a new goal", &|app| app.screen.explains = true),
        ("drag: walls", &|app| app.act(Action::ToggleEdit)),
    ];
    let long_ago = Instant::now().checked_sub(Duration::from_millis(10_100)).expect("a time");
    for (line, show) in shows {
        let mut app = still();
        show(&mut app);
        assert!(shown_by(&mut app, 80, 24).contains(line) && !app.on_tick(), "{line}");
        app.screen.banner = Some(long_ago);
        assert!(app.on_tick() && !shown_by(&mut app, 80, 24).contains(line), "{line}");
        assert!(!app.on_tick(), "drawn once, not again and again");
    }
    let mut app = still();
    app.screen.log.show("done", false);
    press(&mut app, KeyCode::Char('j'));
    assert!(app.screen.log.notice().is_none(), "a key takes it away");
    app.report("the disk is full");
    press(&mut app, KeyCode::F(9));
    assert!(app.screen.log.notice().is_some_and(|notice| notice.is_error), "but no error");
    app.screen.log.notice.iter_mut().for_each(|(since, _)| *since = long_ago);
    assert!(app.on_tick() && app.screen.log.notice().is_none(), "errors, too");
}

#[test]
fn a_goal_without_a_path_is_said_and_marked() {
    let map = parse_map("cut", b"..........#...\n.......S..#...\n..........#...\nG.........#...\n")
        .expect("a map");
    let mut app = app_on(map, gdg());
    app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
    draw(&mut app, 80, 24);
    let said = |app: &App| {
        app.screen.log.entries().iter().filter(|e| e.text.starts_with("no path leads")).count()
    };
    wait_until(&mut app, |app| !app.maze().view.path.is_empty() && app.maze().view.walk.steps > 0);
    assert_eq!(said(&app), 0, "@ and G are on the same side");
    assert_eq!(app.maze().view.walk.start, Cell::new(7, 1).centre(), "the map's own start");
    app.set_goal(Cell::new(12, 0));
    wait_until(&mut app, |app| app.maze().view.goal.0 == Some(Cell::new(12, 0)));
    wait_until(&mut app, |app| app.maze().view.walk.steps > 3 && app.maze().view.raster.is_some());
    assert_eq!(said(&app), 1, "once");
    assert!(app.maze().view.path.is_empty(), "a line through the wall is no plan");
    assert!(shown_by(&mut app, 80, 24).contains('\\'), "floor without a path is hatched");
}

#[test]
fn what_takes_long_is_shown_and_keys_pressed_meanwhile_are_taken() {
    let mut app = still();
    assert!(!app.on_tick());
    let saving = app.job.part("saving");
    saving.begin(0, 1);
    saving.set(50, 100);
    let half = (*saving).clone();
    assert!(!app.on_tick(), "not for a moment");
    app.act(Action::Evaluate);
    assert_eq!(notice(&app), "");
    std::thread::sleep(Duration::from_millis(520));
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains(" saving "));
    assert!(!app.on_tick(), "nothing new");
    std::thread::sleep(Duration::from_millis(500));
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains(" saving, 1 s, 50 % "));
    press(&mut app, KeyCode::Char('y'));
    assert_eq!(notice(&app), "taken: it follows, the trainer is saving");
    press(&mut app, KeyCode::Char(' '));
    assert!(shown_by(&mut app, 80, 24).contains(" pausing: saving, 1 s, 50 % "));
    drop(saving);
    let mut snapshot = (*app.screen.latest).clone();
    let since = Instant::now().checked_sub(Duration::from_millis(3_100)).expect("a time");
    snapshot.next_evaluation = gdg::engine::NextEvaluation::Running(since);
    snapshot.evaluation_progress = half;
    app.publish(snapshot);
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains("running, 50 % "));
}

#[test]
fn edits_that_a_busy_trainer_does_not_take_are_not_in_the_history() {
    let mut app = still();
    let first = app.maze().map.clone();
    let cells: Vec<Cell> = first.free_cells().take(80).collect();
    for cell in &cells {
        app.maze_mut().editor.cursor = Some(*cell);
        app.act(Action::Apply);
    }
    let edits = |app: &Still| first.free_count() - app.maze().map.free_count();
    let taken = edits(&app);
    assert!((1..cells.len()).contains(&taken), "the queue is full after {taken}");
    app.act(Action::Undo);
    assert_eq!(edits(&app), taken, "it is not taken either");
    app.commands.try_iter().for_each(drop);
    app.act(Action::Undo);
    assert_eq!(edits(&app), taken - 1);
    app.act(Action::Redo);
    assert_eq!(edits(&app), taken);
    for _ in 0..taken {
        app.act(Action::Undo);
        app.commands.try_iter().for_each(drop);
    }
    assert_eq!(app.maze().map, first);
}
