//! What the user sees at the start, and what the trainer's answers change.

use super::*;
use gdg::engine::EngineCommand;

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
    app.screen.command(EngineCommand::Load(path));
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some() && app.maze().goal == own);
    assert_eq!(app.screen.snapshot.notes.goal, own.centre());
}

#[test]
fn lines_over_the_map_and_notices_go_away_after_a_while() {
    let long_ago = Instant::now().checked_sub(Duration::from_millis(10_100)).expect("a time");
    let mut app = still();
    app.screen.explains = true;
    let is_shown = |app: &mut Still| shown_by(app, 80, 24).contains("click sets a goal");
    assert!(is_shown(&mut app) && !app.on_tick());
    app.screen.banner = Some(long_ago);
    assert!(app.on_tick() && !is_shown(&mut app));
    assert!(!app.on_tick(), "drawn once, not again and again");
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
    wait_until(&mut app, |app| {
        !app.maze().view.reach.path.is_empty() && app.maze().view.reach.steps > 0
    });
    assert_eq!(said(&app), 0, "@ and G are on the same side");
    assert!(app.maze().view.reach.start.iter().map(|at| at.floor()).eq([7.0, 1.0]), "its own");
    app.set_goal(Cell::new(12, 0));
    wait_until(&mut app, |app| app.maze().view.goal.0 == Some(vec![12.5, 0.5]));
    let view = |app: &App| app.maze().view.clone();
    wait_until(&mut app, |app| view(app).reach.steps > 3 && view(app).field().is_some());
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
    let mut snapshot = (*app.screen.snapshot).clone();
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
