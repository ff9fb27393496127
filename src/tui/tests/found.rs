//! What the user sees at the start: a saved run, or hints.

use super::*;
use crate::host::runs::{self, SAVES};
use crate::tui::clock;
use gdg::engine::Command;
use gdg::pulse::Progress;

#[test]
fn a_saved_run_is_offered_and_resumed_by_key_or_click() {
    let folder = tempfile::tempdir().expect("a folder");
    for by_key in [true, false] {
        let mut app = app();
        let found = saved_run(folder.path(), &app);
        offer(found.clone(), &mut app.screen);
        let shown = text(&draw(&mut app, 120, 40));
        assert!(
            shown.contains("gdg: 0 updates, seed 1, saved just now: r resumes  Esc hides"),
            "{shown}"
        );
        if by_key {
            press(&mut app, KeyCode::Char('r'));
        } else {
            let row = shown.lines().position(|line| line.contains("resumes")).expect("a line");
            let column = shown
                .lines()
                .nth(row)
                .and_then(|line| line.split("resumes").next())
                .expect("a line");
            let at = Position::new(column.chars().count() as u16, row as u16);
            mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
        }
        assert!(app.screen.offer.is_none(), "it goes away");
        wait_until(&mut app, |app| app.screen.run().method == gdg());
        assert_eq!(*app.screen.snapshot.saved.as_ref().expect("its file").1, found.file);
        assert!(!text(&draw(&mut app, 80, 24)).contains("resumes"));
    }
}

#[test]
fn a_resumed_run_goes_on_with_its_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.safetensors");
    let mut app = app_saving_to(
        rooms(),
        gdg(),
        Limits { updates: Some(0), ..Limits::default() },
        Some(path.clone()),
    );
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
fn an_offer_is_hidden_by_esc_and_its_key_means_directions_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app();
    let method = app.screen.run().method.clone();
    let saved = saved_run(folder.path(), &app);
    offer(saved, &mut app.screen);
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains("gdg: 0 updates: r resumes  Esc hides"), "{shown}");
    press(&mut app, KeyCode::Esc);
    assert!(app.screen.offer.is_none());
    press(&mut app, KeyCode::Char('r'));
    assert!(app.screen.overlays.has(crate::tui::layers::Overlay::Directions));
    assert_eq!(app.screen.run().method, method, "nothing is loaded");
}

#[test]
fn the_first_run_says_what_there_is_to_see_until_it_is_used() {
    let start = |by: &dyn Fn(&mut App)| {
        let mut app = still();
        app.screen.first_run = true;
        let shown = text(&draw(&mut app, 80, 24));
        assert!(
            shown.contains(" light = near G \u{b7} click: a new goal \u{b7} ? help "),
            "{shown}"
        );
        by(&mut app);
        (app.screen.first_run, app)
    };
    let click = |app: &mut App| {
        let at = character_of(app, Cell::new(3, 3));
        mouse(app, MouseEventKind::Down(MouseButton::Left), at);
    };
    assert!(!start(&click).0, "a click");
    assert!(!start(&|app| press(app, KeyCode::Char('n'))).0, "a key for goals");
    assert!(!start(&|app| press(app, KeyCode::Esc)).0, "Esc");
    let (shown, mut app) = start(&|app| press(app, KeyCode::Char(' ')));
    assert!(shown, "pausing is no use of goals");
    let wide = text(&draw(&mut app, 200, 60));
    assert!(
        wide.contains(" light = few steps to G \u{b7} click anywhere: a new goal \u{b7} ? help "),
        "{wide}"
    );
    app.screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    assert!(text(&draw(&mut app, 80, 24)).contains(" @ walks to G \u{b7}"));
    draw(&mut app, 5, 3);
}

#[test]
fn lines_over_the_map_go_away_after_ten_seconds() {
    type Shows<'a> = (&'a str, &'a dyn Fn(&mut App));
    let folder = tempfile::tempdir().expect("a folder");
    let shows: [Shows; 3] = [
        ("click: a new goal", &|app| app.screen.first_run = true),
        ("r resumes", &|app| offer(saved_run(folder.path(), app), &mut app.screen)),
        ("drag: walls", &|app| app.act(Action::ToggleEdit)),
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
    app.report("the disk is full");
    clock::advance(Duration::from_millis(10_100));
    assert!(app.on_tick() && app.screen.log.notice().is_none(), "errors, too");
}

#[test]
fn the_first_walk_starts_at_the_maps_own_start() {
    let map =
        parse_map("start", b"..........\n.......S..\n..........\nG.........\n").expect("a map");
    let mut app = app_on(map, gdg());
    wait_until(&mut app, |app| app.maze().view.walk.steps > 0);
    assert_eq!(app.maze().view.walk.start, Cell::new(7, 1).centre());
}

#[test]
fn a_goal_without_a_path_is_said_and_drawn() {
    let map = parse_map("cut", b"..........#...\n.......S..#...\n..........#...\nG.........#...\n")
        .expect("a map");
    let mut app = app_on(map, gdg());
    app.screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    draw(&mut app, 80, 24);
    let said = |app: &App| {
        app.screen.log.entries().iter().filter(|e| e.text.starts_with("no path leads")).count()
    };
    wait_until(&mut app, |app| {
        app.maze().view.cut_off.contains(&true) && app.maze().view.walk.steps > 0
    });
    assert_eq!(said(&app), 0, "@ and G are on the same side");
    wait_until(&mut app, |app| !app.maze().view.path.is_empty());
    // Agents hide some of the marks.
    let marked = |app: &mut App, columns: std::ops::Range<usize>| {
        let cells: Vec<Cell> = columns.flat_map(|x| (0..4).map(move |y| Cell::new(x, y))).collect();
        let places: Vec<Position> = cells.into_iter().map(|cell| character_of(app, cell)).collect();
        let terminal = draw(app, 80, 24);
        places.into_iter().filter(|at| terminal.backend().buffer()[*at].symbol() == "\\").count()
    };
    wait_until(&mut app, |app| app.maze().view.raster.is_some());
    assert!(marked(&mut app, 11..14) > 0 && marked(&mut app, 0..10) == 0);
    app.set_goal(Cell::new(12, 0));
    wait_until(&mut app, |app| app.maze().view.goal.0 == Some(Cell::new(12, 0)));
    wait_until(&mut app, |app| app.maze().view.walk.steps > 3);
    assert_eq!(said(&app), 1, "once");
    assert!(app.maze().view.path.is_empty(), "a line through the wall is no plan");
    wait_until(&mut app, |app| app.maze().view.raster.is_some());
    assert!(marked(&mut app, 0..10) > 0 && marked(&mut app, 11..14) == 0);
}

#[test]
fn what_changes_nothing_is_answered() {
    let mut app = still();
    let notice = |app: &App| {
        app.screen.log.notice().map(|notice| notice.text.to_owned()).unwrap_or_default()
    };
    press(&mut app, KeyCode::Char('u'));
    assert_eq!(notice(&app), "nothing to undo");
    app.act(Action::Redo);
    assert_eq!(notice(&app), "nothing to redo");
    type_text(&mut app, ":qqqzzz");
    press(&mut app, KeyCode::Enter);
    assert_eq!(notice(&app), "nothing in the list fits \"qqqzzz\"");
    assert_eq!(app.screen.dialogs.len(), 1, "the list stays open");
}

#[test]
fn undone_and_redone_steps_are_named_with_what_they_change() {
    let mut app = app();
    let says = |app: &App, text: &str| {
        app.screen.log.notice().is_some_and(|notice| notice.text.starts_with(text))
    };
    app.act(Action::ToggleEdit);
    app.act(Action::Apply);
    wait_until(&mut app, |app| says(app, "1 cell walled"));
    press(&mut app, KeyCode::Char('u'));
    wait_until(&mut app, |app| says(app, "undone: 1 cell opened"));
    app.act(Action::Redo);
    wait_until(&mut app, |app| says(app, "redone: 1 cell walled"));
}

#[test]
fn an_edit_that_the_trainer_has_yet_to_apply_is_shown_as_such() {
    let mut app = app();
    assert_eq!(app.scene.phase(&app.screen), "training");
    app.act(Action::ToggleEdit);
    app.act(Action::Apply);
    assert_eq!(app.scene.phase(&app.screen), "applying the edit");
    wait_until(&mut app, |app| app.scene.phase(&app.screen).starts_with("relearning"));
}

#[test]
fn what_takes_long_is_shown_and_keys_pressed_meanwhile_are_taken() {
    let mut app = still();
    assert!(!app.on_tick());
    let half = Progress::default();
    half.begin(0, 1);
    half.set(50, 100);
    let saving = app.pulse.begin_with("the checkpoint to be written", half.clone());
    assert!(!app.on_tick(), "not for a moment");
    app.act(Action::Evaluate);
    assert_eq!(app.screen.log.notice().map(|notice| notice.text), None);
    std::thread::sleep(Duration::from_millis(520));
    assert!(app.on_tick() && text(&draw(&mut app, 80, 24)).contains(" saving "));
    assert!(!app.on_tick(), "nothing new");
    std::thread::sleep(Duration::from_millis(500));
    assert!(app.on_tick() && text(&draw(&mut app, 80, 24)).contains(" saving, 1 s, 50 % "));
    press(&mut app, KeyCode::Char('y'));
    let taken = "taken: it follows, the trainer is saving";
    assert_eq!(app.screen.log.notice().map(|notice| notice.text), Some(taken));
    press(&mut app, KeyCode::Char(' '));
    assert!(text(&draw(&mut app, 80, 24)).contains(" pausing: saving, 1 s, 50 % "));
    drop(saving);
    assert!(app.on_tick() && text(&draw(&mut app, 80, 24)).contains(" pausing "));
    let mut snapshot = (*app.screen.latest).clone();
    let since = Instant::now().checked_sub(Duration::from_millis(3_100)).expect("a time");
    snapshot.next_evaluation = gdg::engine::NextEvaluation::Running(since);
    snapshot.evaluation_progress = half;
    app.publish(snapshot);
    assert!(app.on_tick() && text(&draw(&mut app, 80, 24)).contains("running, 50 % "));
}

#[test]
fn on_narrow_screens_a_line_says_how_to_draw_until_something_is_drawn() {
    let mut app = still();
    let hint = "drag: walls, right drag: floor";
    let rows = |app: &mut App, width| {
        let shown = text(&draw(app, width, 24));
        shown
            .lines()
            .enumerate()
            .filter(|(_, row)| row.contains(hint))
            .map(|(y, _)| y)
            .collect::<Vec<_>>()
    };
    assert_eq!(rows(&mut app, 80), Vec::<usize>::new(), "the editor is closed");
    app.act(Action::ToggleEdit);
    assert_eq!(
        (rows(&mut app, 80), rows(&mut app, 140)),
        (vec![1], vec![23]),
        "over the map, or beside the tools"
    );
    app.act(Action::Apply);
    assert!(app.maze().editor.has_changed);
    assert_eq!((rows(&mut app, 80), rows(&mut app, 140)), (vec![], vec![23]));
    app.act(Action::ToggleEdit);
    app.act(Action::ToggleEdit);
    assert_eq!(rows(&mut app, 80), vec![1], "again when it is opened again");
}

#[test]
fn escape_leads_back_from_an_explorer_to_the_walking_agent() {
    let mut app = still();
    app.screen.first_run = true;
    press(&mut app, KeyCode::Char('f'));
    press(&mut app, KeyCode::Char('f'));
    assert_eq!(app.screen.following, Some(1));
    press(&mut app, KeyCode::Esc);
    assert_eq!(app.screen.following, None);
    assert!(
        app.screen
            .log
            .notice()
            .is_some_and(|notice| notice.text == "following the walking agent @")
    );
}

#[test]
fn the_summary_fits_into_80_columns() {
    let mut app = still();
    app.train(12_345);
    let summary = app.screen.summary(app.scene.title(&app.screen.snapshot));
    assert!(
        summary.starts_with("gdg-bridge on rooms, seed ") && summary.contains(" updates in "),
        "{summary}"
    );
    // Enough room for millions of updates on a map with a longer name.
    assert!(summary.lines().all(|line| line.len() < 60), "{summary}");
}

#[test]
fn a_key_takes_the_last_message_away_but_no_error() {
    let mut app = still();
    app.screen.log.show("done", false);
    press(&mut app, KeyCode::Char('j'));
    assert!(app.screen.log.notice().is_none());
    app.screen.log.show("the disk is full", true);
    press(&mut app, KeyCode::Char('j'));
    assert!(app.screen.log.notice().is_some_and(|notice| notice.is_error));
}

#[test]
fn pausing_and_single_updates_are_answered_exactly() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.rates.0 > 0.0);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Paused);
    let before = app.screen.snapshot.updates();
    assert_eq!(app.screen.snapshot.rates, (0.0, 0.0));
    let shown = text(&draw(&mut app, 80, 24));
    let exact = format!("updates   {}, 0/s", gdg::text::grouped(before));
    assert!(shown.contains(&exact), "{exact:?} is not in {shown}");
    press(&mut app, KeyCode::Char('.'));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > before);
    let done = format!("update {} done", gdg::text::grouped(before + 1));
    wait_until(&mut app, |app| app.screen.log.notice().is_some_and(|notice| notice.text == done));
    let limits = Limits { updates: Some(1), ..Limits::default() };
    let mut app = app_with(rooms(), gdg(), limits);
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Done);
    press(&mut app, KeyCode::Char('.'));
    wait_until(&mut app, |app| {
        app.screen.log.notice().is_some_and(|notice| notice.text.starts_with("no step"))
    });
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
    let began = Instant::now();
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > counted + 20);
    assert_eq!(app.screen.snapshot.updates(), updates, "random learns nothing");
    let most = 250.0 * began.elapsed().as_secs_f64() + 50.0;
    assert!(((app.screen.snapshot.counters.updates - counted) as f64) < most, "too fast to watch");
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains(", now none") && shown.contains("random steps"), "{shown}");
    app.screen.pane = crate::tui::panes::Pane::Curves;
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains(" random") && shown.contains('\u{2506}'), "{shown}");
    app.command(run("gdg-bridge"));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
}

#[test]
fn clicks_on_walls_and_scales_of_curves_are_answered() {
    let mut app = still();
    draw(&mut app, 80, 24);
    let map = app.maze().map.clone();
    let wall = (0..map.width() * map.height())
        .map(|i| map.cell(i))
        .find(|cell| !map.is_free(*cell))
        .expect("a wall");
    let at = character_of(&app, wall);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    let notice = |app: &App| {
        app.screen.log.notice().map(|notice| notice.text.to_owned()).unwrap_or_default()
    };
    let goal = app.maze().goal;
    assert!(map.is_free(goal));
    assert!(
        notice(&app)
            .ends_with(&format!("is a wall: G is at the nearest free cell, {},{}", goal.x, goal.y))
    );
    press(&mut app, KeyCode::Char('g'));
    assert_eq!(notice(&app), "curves of losses and distances on logarithmic scales");
}

#[test]
fn at_the_goal_the_error_of_d_is_in_steps() {
    let mut app = app();
    draw(&mut app, 120, 40);
    press(&mut app, KeyCode::Char('i'));
    let goal = app.maze().goal;
    wait_until(&mut app, |app| app.maze().view.inspected.is_some_and(|facts| facts.cell == goal));
    let shown = text(&draw(&mut app, 120, 40));
    let line = shown.lines().find(|line| line.contains("true 0")).expect("a line about the cell");
    assert!(line.contains("true 0 (+") && line.contains(" steps)"), "{line}");
}

#[test]
fn a_key_without_a_meaning_names_help_and_the_list_of_commands() {
    let mut app = still();
    let entries = app.screen.log.entries().len();
    press(&mut app, KeyCode::F(9));
    let said = app.screen.log.notice().map(|notice| notice.text.to_owned()).unwrap_or_default();
    assert!(said.starts_with("F9 does nothing here \u{b7} ") && said.contains("? help"), "{said}");
    assert_eq!(app.screen.log.entries().len(), entries, "the log is for what happens to the run");
    // An error stays visible.
    app.report("the disk is full");
    press(&mut app, KeyCode::F(9));
    assert!(
        app.screen
            .log
            .notice()
            .is_some_and(|notice| notice.is_error && notice.text == "the disk is full")
    );
}

#[test]
fn the_log_is_in_training_time_and_in_order() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.evaluation().is_some());
    let updates: Vec<u64> = app.screen.log.entries().iter().map(|entry| entry.updates).collect();
    assert!(updates.is_sorted(), "{updates:?}");
    let last = app.screen.log.entries().last().map_or(0.0, |entry| entry.seconds);
    assert!((0.0..=app.screen.snapshot.seconds).contains(&last), "{last}");
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
    let mut app = app_saving_to(
        rooms(),
        gdg(),
        Limits { updates: Some(0), ..Limits::default() },
        Some(folder.path().join("own.safetensors")),
    );
    let saved = saved_run(folder.path(), &app).file;
    press(&mut app, KeyCode::Char('U'));
    assert!(text(&draw(&mut app, 120, 40)).contains("draw behind these curves"));
    press(&mut app, KeyCode::Enter);
    let said = &app.screen.log.notice().expect("a notice").text;
    assert!(app.screen.under.is_none() && said.contains("never evaluated"), "{said}");
    let name = saved.to_string_lossy();
    let evaluated = crate::tui::runs::tests::saved(&name, "rooms", "gdg", 1, &[0.5]);
    app.screen.under = Some(Arc::new(evaluated));
    press(&mut app, KeyCode::Char('U'));
    let said = &app.screen.log.notice().expect("a notice").text;
    assert!(app.screen.under.is_none() && said.contains("removed the curves"), "{said}");
}

#[test]
fn curves_of_the_run_itself_are_not_offered_to_lie_behind_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.safetensors");
    let limits = Limits { updates: Some(0), ..Limits::default() };
    let mut app = app_saving_to(rooms(), gdg(), limits, Some(own.clone()));
    let other = saved_run(folder.path(), &app).file;
    app.act(Action::Save);
    wait_until(&mut app, |app| app.screen.latest.saved.is_some());
    assert!(own.is_file());
    // Those in the usual folder are listed as well.
    let usual = runs::files_in(Path::new(SAVES)).unwrap_or_default().len();
    let mut listed = || -> Vec<String> {
        press(&mut app, KeyCode::Char('U'));
        match app.screen.dialogs.pop() {
            Some(Dialog::Pick(list)) => list.items().map(|item| item.label.clone()).collect(),
            _ => vec![app.screen.log.notice().expect("a notice").text.to_owned()],
        }
    };
    let first = listed();
    assert!(first.len() == 1 + usual && first[0] == "saved", "{first:?}");
    std::fs::remove_file(other).expect("a file");
    let left = listed();
    let is_empty = left[0].contains("has no checkpoints of other runs");
    assert!(if usual == 0 { is_empty } else { left == first[1..] }, "{left:?}");
}
