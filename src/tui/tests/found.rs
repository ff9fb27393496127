//! What the user sees at the start: a saved run, or hints.

use super::*;
use crate::tui::clock;
use gdg::engine::Command;

#[test]
fn a_saved_run_is_offered_and_resumed_by_key_or_click_or_hidden() {
    let folder = tempfile::tempdir().expect("a folder");
    for by_key in [true, false] {
        let mut app = app();
        let found = saved_run(folder.path(), &app);
        offer(found.clone(), &mut app.screen);
        let shown = shown_by(&mut app, 120, 40);
        assert!(shown.contains("gdg: 0 updates, seed 1, saved just now: r resumes"), "{shown}");
        if by_key {
            press(&mut app, KeyCode::Char('r'));
        } else {
            click(&mut app, MouseButton::Left, place_of(&shown, "resumes"));
        }
        assert!(app.screen.offer.is_none(), "it goes away");
        wait_until(&mut app, |app| app.screen.run().method == gdg());
        assert_eq!(*app.screen.snapshot.saved.as_ref().expect("its file").1, found.file);
    }
    let mut app = still();
    let found = saved_run(folder.path(), &app);
    offer(found, &mut app.screen);
    press(&mut app, KeyCode::Esc);
    assert!(app.screen.offer.is_none());
    press(&mut app, KeyCode::Char('r'));
    let has_loaded = app.commands.try_iter().any(|command| matches!(command, Command::Load(_)));
    assert!(!has_loaded, "the key means something else again");
}

#[test]
fn a_resumed_run_goes_on_with_its_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.safetensors");
    let mut app = stopped(rooms(), gdg(), Some(path.clone()));
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
fn lines_over_the_map_go_away_after_ten_seconds() {
    type Shows<'a> = (&'a str, &'a dyn Fn(&mut App));
    let folder = tempfile::tempdir().expect("a folder");
    let shows: [Shows; 2] = [
        ("click: a new goal", &|app| app.screen.first_run = true),
        ("r resumes", &|app| offer(saved_run(folder.path(), app), &mut app.screen)),
    ];
    for (line, show) in shows {
        let mut app = still();
        clock::advance(Duration::from_secs(5));
        show(&mut app);
        let is_shown = |app: &mut App| text(&draw(app, 80, 24)).contains(line);
        assert!(is_shown(&mut app) && !app.on_tick(), "{line}");
        clock::advance(Duration::from_millis(10_100));
        assert!(app.on_tick() && !is_shown(&mut app), "{line}");
        assert!(!app.on_tick(), "drawn once, not again and again");
    }
    let mut app = still();
    app.screen.log.show("done", false);
    press(&mut app, KeyCode::Char('j'));
    assert!(app.screen.log.notice().is_none(), "a key takes it away");
    app.report("the disk is full");
    press(&mut app, KeyCode::F(9));
    assert!(app.screen.log.notice().is_some_and(|notice| notice.is_error), "but no error");
    clock::advance(Duration::from_millis(10_100));
    assert!(app.on_tick() && app.screen.log.notice().is_none(), "errors, too");
}

#[test]
fn the_first_walk_starts_at_the_maps_own_start() {
    let map =
        parse_map("start", b"..........\n.......S..\n..........\nG.........\n").expect("a map");
    let mut app = app_on(map, gdg());
    wait_until(&mut app, |app| app.maze().view.reach.steps > 0);
    assert!(app.maze().view.reach.start.iter().map(|at| at.floor()).eq([7.0, 1.0]));
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
    wait_until(&mut app, |app| {
        !app.maze().view.reach.path.is_empty() && app.maze().view.reach.steps > 0
    });
    assert_eq!(said(&app), 0, "@ and G are on the same side");
    app.set_goal(Cell::new(12, 0));
    wait_until(&mut app, |app| app.maze().view.goal.0 == Some(vec![12.5, 0.5]));
    wait_until(&mut app, |app| {
        app.maze().view.reach.steps > 3 && app.maze().view.field().is_some()
    });
    assert_eq!(said(&app), 1, "once");
    assert!(app.maze().view.reach.path.is_empty(), "a line through the wall is no plan");
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
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains(" pausing "));
    let waiting = app.job.part("waiting for the environment");
    app.on_tick();
    std::thread::sleep(Duration::from_millis(1_100));
    let waits = " pausing: waiting for the environment, 1 s";
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains(waits));
    drop(waiting);
    let mut snapshot = (*app.screen.latest).clone();
    let since = Instant::now().checked_sub(Duration::from_millis(3_100)).expect("a time");
    snapshot.next_evaluation = gdg::engine::NextEvaluation::Running(since);
    snapshot.evaluation_progress = half;
    app.publish(snapshot);
    assert!(app.on_tick() && shown_by(&mut app, 80, 24).contains("running, 50 % "));
}

#[test]
fn pausing_and_single_updates_are_answered_exactly() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.rates.0 > 0.0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Paused);
    let before = app.screen.snapshot.updates();
    let exact = format!("updates   {}, 0/s", gdg::text::grouped(before));
    assert!(shown_by(&mut app, 80, 24).contains(&exact), "{exact:?}");
    press(&mut app, KeyCode::Char('.'));
    let done = format!("update {} done", gdg::text::grouped(before + 1));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > before && notice(app) == done);
    let mut app = stopped(rooms(), gdg(), None);
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Done);
    press(&mut app, KeyCode::Char('.'));
    wait_until(&mut app, |app| notice(app).starts_with("no step"));
}

#[test]
fn random_steps_are_no_updates_and_their_success_is_not_the_methods() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.evaluation().is_some());
    let own = app.screen.run().clone();
    let run = |name: &str| {
        Command::Change(Box::new(Run { method: name.parse().expect("a method"), ..own.clone() }))
    };
    app.command(run("random"));
    wait_until(&mut app, |app| !app.screen.snapshot.learns);
    let (updates, counted) = (app.screen.snapshot.updates(), app.screen.snapshot.counters.updates);
    // The agents may have stepped before the first snapshot.
    assert!(
        updates <= counted && app.screen.success().is_none(),
        "the success was another method's"
    );
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > counted + 20);
    assert_eq!(app.screen.snapshot.updates(), updates, "random learns nothing");
    app.command(run("gdg-bridge"));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
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

#[test]
fn curves_of_a_saved_run_are_drawn_behind_if_there_are_any_until_they_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = stopped(rooms(), gdg(), Some(folder.path().join("own.safetensors")));
    let saved = saved_run(folder.path(), &app).file;
    press(&mut app, KeyCode::Char('U'));
    assert!(shown_by(&mut app, 120, 40).contains("draw behind these curves"));
    press(&mut app, KeyCode::Enter);
    let said = notice(&app);
    assert!(app.screen.under.is_none() && said.contains("never evaluated"), "{said}");
    let name = saved.to_string_lossy();
    let evaluated = crate::tui::runs::tests::saved(&name, "rooms", "gdg", 1, &[0.5]);
    app.screen.under = Some(Arc::new(evaluated));
    press(&mut app, KeyCode::Char('U'));
    let said = notice(&app);
    assert!(app.screen.under.is_none() && said.contains("removed the curves"), "{said}");
}
