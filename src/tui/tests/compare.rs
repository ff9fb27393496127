//! Comparisons: two runs on one screen.

use super::staged::{evaluation, staged_view};
use super::*;
use crate::tui::compare::{Comparison, ComparisonOptions, Contender, Contestant, prepare};
use crate::tui::graphics::{Graphics, Redraw};
use crate::tui::tests::past::film;
use gdg::env::FetchReach;
use gdg::job::Job;
use gdg::train::{Counters, Evaluation};
use gdg::viewer::View;

fn trainer(method: &str, seed: u64) -> Trainer {
    let world = PointMaze::new(Arc::new(rooms()), 0);
    trainer_in(&world, method.parse().expect("a method"), seed)
}

impl App {
    fn comparison(&mut self) -> &mut Comparison {
        match &mut self.base {
            Base::Comparison(comparison) => comparison,
            Base::Run(_) => panic!("a comparison"),
        }
    }

    fn apps(&mut self) -> [&mut Session; 2] {
        self.comparison().sessions.each_mut()
    }

    fn follow(&mut self, side: usize, snapshot: &Arc<Snapshot>, view: &View) {
        let comparison = self.comparison();
        comparison.sessions[side].on_snapshot(snapshot.clone());
        comparison.sessions[side].on_view(Arc::new(view.clone()));
        comparison.follow(side, view);
    }
}

fn comparison_with(methods: [&str; 2], limits: Limits) -> (App, [Engine; 2]) {
    let [a, b] = methods.map(|method| (trainer(method, 1), method));
    let contestants = [(a, 'A'), (b, 'B')].map(|((trainer, method), letter)| Contestant {
        title: format!("{letter} {method}"),
        trainer,
        file: None,
    });
    start(contestants, limits)
}

fn start(contestants: [Contestant; 2], limits: Limits) -> (App, [Engine; 2]) {
    let started = Comparison::start(contestants, &UiConfig::default(), &keymap(), limits);
    let (comparison, engines) = started.expect("a comparison");
    let mut app = App::of(comparison);
    for session in app.apps() {
        session.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
    }
    (app, engines)
}

fn comparison() -> App {
    comparison_with(["gdg-bridge", "gdg"], Limits::default()).0
}

fn stopped_comparison() -> App {
    let limits = Limits { updates: Some(0), ..Limits::default() };
    comparison_with(["gdg-bridge", "gdg"], limits).0
}

pub(super) fn staged(width: u16, height: u16) -> App {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, width, height);
    for side in 0..2 {
        for i in 1..=4 {
            let mut snapshot = (*comparison.apps()[side].screen.snapshot).clone();
            let (updates, planned) = (2_500 * i, evaluation(0.25 * i as f64));
            let alone = Evaluation { planned: None, ..planned.clone() };
            let mut counters = Counters::default();
            (counters.updates, counters.env_steps) = (updates, (16 - 4 * side as u64) * updates);
            (snapshot.phase, snapshot.counters) = (Phase::Running, counters);
            (snapshot.seconds, snapshot.rates) = (i as f64 * 3.0, (812.0, 13_000.0));
            let evaluation = if side == 0 { planned } else { alone };
            Arc::make_mut(&mut snapshot.evaluations).push((updates, evaluation));
            comparison.follow(side, &Arc::new(snapshot), &View::default());
        }
        let app = &comparison.apps()[side];
        let mut view = staged_view(app);
        view.goal.1 = app.screen.goal_request;
        view.reach.arrived = side == 0;
        let snapshot = app.screen.snapshot.clone();
        comparison.follow(side, &snapshot, &view);
    }
    comparison
}

fn character_of(comparison: &mut App, side: usize, cell: Cell) -> Position {
    let frame = comparison.apps()[side].screen.layout.map.clone().expect("the map is drawn");
    frame.character_of(cell.centre()).expect("the cell is shown")
}

/// Applies what engines and viewers publish until `is` holds.
fn wait_until(comparison: &mut App, is: impl Fn([&mut Session; 2]) -> bool) {
    let began = Instant::now();
    while !is(comparison.apps()) {
        assert!(began.elapsed() < Duration::from_mins(1), "timed out");
        std::thread::sleep(Duration::from_millis(5));
        for side in 0..2 {
            let session = &comparison.apps()[side];
            let snapshot = session.snapshots().borrow().clone();
            let view = session.views().borrow().clone();
            comparison.follow(side, &snapshot, &view);
        }
        comparison.on_tick();
    }
}

#[test]
fn one_click_sets_both_goals_and_starts_both_agents_at_the_same_place() {
    let mut comparison = comparison();
    draw(&mut comparison, 80, 24);
    for (side, goal, start) in
        [(0, Cell::new(2, 1), Cell::new(17, 3)), (1, Cell::new(15, 4), Cell::new(4, 0))]
    {
        let at = character_of(&mut comparison, side, goal);
        mouse(&mut comparison, MouseEventKind::Down(MouseButton::Left), at);
        assert_eq!(comparison.apps().map(|app| app.maze().goal), [goal; 2]);
        let at = character_of(&mut comparison, side, start);
        mouse(&mut comparison, MouseEventKind::Down(MouseButton::Right), at);
        wait_until(&mut comparison, |apps| {
            apps.iter().all(|app| {
                app.maze().view.reach.start == start.centre()
                    && app.maze().view.goal.0 == Some(goal.centre().to_vec())
            })
        });
    }
    press(&mut comparison, KeyCode::Left);
    assert_eq!(comparison.apps().map(|app| app.maze().goal), [Cell::new(14, 4); 2]);
    press(&mut comparison, KeyCode::Char('n'));
    let [a, b] = comparison.apps().map(|app| app.maze().goal);
    assert_eq!(a, b);
}

#[test]
fn what_is_shown_changes_on_both_sides() {
    let mut comparison = staged(80, 24);
    for key in "xAvvvi+".chars() {
        press(&mut comparison, KeyCode::Char(key));
        draw(&mut comparison, 80, 24);
        let [a, b] = comparison.apps().map(|app| {
            let (screen, maze) = (&app.screen, app.maze());
            (screen.field, screen.overlays, maze.viewport, maze.inspecting)
        });
        assert_eq!(a, b, "after {key}");
    }
    let at = character_of(&mut comparison, 1, Cell::new(17, 4));
    mouse(&mut comparison, MouseEventKind::ScrollUp, at);
    let [a, b] = comparison.apps().map(|app| app.maze().viewport);
    assert!(a == b && a.zoom > 1.5, "{a:?} and {b:?}");
}

#[test]
fn each_side_is_the_run_that_its_method_would_be_alone() {
    let limits = Limits { updates: Some(300), ..Limits::default() };
    let (mut comparison, engines) = comparison_with(["gdg-bridge", "her"], limits);
    draw(&mut comparison, 80, 24);
    wait_until(&mut comparison, |apps| {
        apps.iter().all(|app| app.screen.snapshot.phase == Phase::Done)
    });
    press(&mut comparison, KeyCode::Char('n'));
    drop(comparison);
    for (method, engine) in ["gdg-bridge", "her"].into_iter().zip(engines) {
        let trained = engine.stop().expect("a trainer");
        assert_eq!(trained.run().method.name(), method);
        let mut alone = trainer(method, 1);
        while alone.limit_reached(&limits).is_none() {
            alone.tick().expect("a tick");
        }
        assert_eq!((alone.counters(), alone.losses()), (trained.counters(), trained.losses()));
        let policies = [&alone, &trained].map(|trainer| trainer.policy().expect("a policy"));
        let mut scratch = gdg::learn::Scratch::default();
        let [a, b] = policies.map(|own| own.distance(&[1.5, 1.5], &[17.5, 4.5], &mut scratch));
        assert_eq!(a.to_bits(), b.to_bits(), "{method}");
        assert_eq!(alone.world().states(), trained.world().states());
    }
}

#[test]
fn both_maps_are_pictures_on_which_the_same_distance_has_the_same_colour() {
    let mut comparison = comparison();
    let graphics = Graphics { character: (8, 16) };
    comparison.set_graphics(Some(graphics), Redraw::All);
    draw(&mut comparison, 120, 40);
    let areas: Vec<_> = comparison.pictures().iter().map(|picture| Some(picture.area)).collect();
    let maps = comparison.apps().map(|app| app.screen.layout.map.as_ref().map(|map| map.area));
    assert_eq!(areas, maps);
    wait_until(&mut comparison, |apps| {
        let [a, b] = apps.map(|app| (app.scene.own_farthest(), app.scene.farthest(&app.screen)));
        a.0.to_bits() != b.0.to_bits() && a.1.to_bits() == b.1.to_bits()
    });
}

fn options([a, b]: [Contender; 2]) -> ComparisonOptions {
    ComparisonOptions {
        a,
        b,
        map: None,
        seed: None,
        set: vec!["hidden=16".to_owned(), "buffer_size=20000".to_owned()],
        threads: gdg::learn::Threads::Fixed(1),
    }
}

#[test]
fn saved_runs_begin_paused_and_what_cannot_stand_beside_one_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let save = |trainer: &Trainer, name: &str| {
        let to = SaveTo::CreateNew(folder.path().join(name));
        Contender::Checkpoint(train::save(trainer, &to).expect("a file"))
    };
    let saved = save(&trainer("gdg-bridge", 7), "own.safetensors");
    let other = save(&trainer("her", 8), "other.safetensors");
    let in_world = |world: &dyn Environment, name: &str| save(&trainer_in(world, gdg(), 1), name);
    let hall = Arc::new(Grid::empty("hall", 4, 3));
    let hall = in_world(&PointMaze::new(hall, 0), "hall.safetensors");
    let mut edited = trainer("gdg-bridge", 7);
    let walled = rooms().with_cells([(Cell::new(1, 1), false)]).expect("a map");
    edited.change_world(&PointMaze::new(Arc::new(walled), 0)).expect("an edit");
    let edited = save(&edited, "edited.safetensors");
    let arm = in_world(&FetchReach::new(0), "arm.safetensors");
    let method = || Contender::Method("her".parse().expect("a method"));
    // A method begins on its map, with its seed.
    let registry = &Registry::builtin();
    let prepare =
        |options| prepare(&options, &gdg::map::Reading::default(), registry, &Job::default());
    let prepared = prepare(options([saved.clone(), method()]));
    let [a, b] = prepared.expect("a run beside a method").both;
    assert_eq!([a.file.is_some(), b.file.is_some()], [true, false]);
    assert_eq!(a.title, "A gdg-bridge default candidates=40 (own)");
    assert_eq!((b.title.as_str(), b.trainer.run().seed), ("B her tuned", 7));
    let map = |contestant: &Contestant| {
        PointMaze::downcast_ref(contestant.trainer.world()).expect("a maze").map().clone()
    };
    assert_eq!(map(&a), map(&b));
    let both = |a: &Contender, b: &Contender| {
        let both = options([a.clone(), b.clone()]);
        ComparisonOptions { set: Vec::new(), ..both }
    };
    let set = |name: &str| vec![format!("{name}=8")];
    let own = both(&saved, &other);
    for (options, problem) in [
        (both(&saved, &hall), "different maps: rooms (20 x 5) and hall (4 x 3)"),
        (both(&saved, &edited), "different maps: rooms (20 x 5) and rooms (20 x 5, edited)"),
        (ComparisonOptions { map: Some("trap".into()), ..own.clone() }, "the map is that of"),
        (ComparisonOptions { seed: Some(1), ..own.clone() }, "have their own seeds"),
        (ComparisonOptions { set: set("hidden"), ..own.clone() }, "changes no method"),
        (
            ComparisonOptions { set: set("A:hidden"), ..options([saved, method()]) },
            "changes no method",
        ),
        (options([arm, method()]), "is of a world without a map"),
        (options([Contender::Checkpoint("none".into()), method()]), "none"),
    ] {
        let error = prepare(options).err().expect("it is refused");
        assert!(error.to_string().contains(problem), "{error}");
    }
    let contestants = prepare(own).expect("two saved runs").both;
    assert_eq!(contestants[1].title, "B her tuned seed 8 (other)");
    let (mut comparison, _engines) = start(contestants, Limits::default());
    let paused = |app: &Session| {
        assert_eq!(app.screen.snapshot.counters.env_steps, 0, "shown as it was saved");
        app.screen.snapshot.phase == Phase::Paused
    };
    wait_until(&mut comparison, |apps| apps.into_iter().all(|app| paused(app)));
    assert!(!shown_by(&mut comparison, 120, 40).contains("rooms seed"), "seeds differ");
    press(&mut comparison, KeyCode::Char(' '));
    wait_until(&mut comparison, |apps| {
        apps.into_iter().all(|app| app.screen.snapshot.updates() > 0 || app.is_training())
    });
}

#[test]
fn both_sides_are_saved_each_to_its_own_file_with_one_message() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut comparison = comparison();
    for app in comparison.apps() {
        app.saver.to = SaveTo::CreateNew(folder.path().join("run.safetensors"));
    }
    let header = |app: &mut App| shown_by(app, 200, 40).lines().next().map(str::to_owned);
    press(&mut comparison, KeyCode::Char(' '));
    wait_until(&mut comparison, |apps| apps.iter().all(|app| !app.is_training()));
    assert!(header(&mut comparison).is_some_and(|line| line.contains(" unsaved")));
    press(&mut comparison, KeyCode::Char('s'));
    wait_until(&mut comparison, |apps| apps.iter().all(|app| app.screen.snapshot.saved.is_some()));
    let file = |app: &Session| app.saver.to.path().file_name().map(std::ffi::OsStr::to_owned);
    let [a, b] = comparison.apps().map(|app| file(app));
    assert!(a != b && std::fs::read_dir(folder.path()).expect("files").count() == 2);
    comparison.on_tick();
    let shown = shown_by(&mut comparison, 200, 40);
    assert!(shown.contains("A: saved ") && shown.contains("; B: saved "), "{shown}");
    assert!(header(&mut comparison).is_some_and(|line| line.contains(" saved")));
}

fn maps(comparison: &mut App) -> [Arc<Grid>; 2] {
    comparison.apps().map(|app| app.maze().map.clone())
}

fn wait_for_trainers(comparison: &mut App) {
    wait_until(comparison, |apps| {
        apps.iter().all(|app| app.drawn_map().free() == app.maze().map.free())
    });
}

#[test]
fn an_edit_on_either_side_goes_to_both_trainers_and_so_does_its_undo() {
    let mut comparison = comparison();
    draw(&mut comparison, 80, 24);
    let before = rooms();
    press(&mut comparison, KeyCode::Char('e'));
    let cells = [Cell::new(2, 1), Cell::new(15, 4)];
    for (side, cell) in cells.into_iter().enumerate() {
        let at = character_of(&mut comparison, side, cell);
        click(&mut comparison, MouseButton::Left, at);
        assert!(maps(&mut comparison).iter().all(|map| !map.is_free(cell)), "{cell:?}");
    }
    wait_for_trainers(&mut comparison);
    assert!(comparison.apps().iter().all(|app| app.screen.snapshot.phase.is_training()));
    press(&mut comparison, KeyCode::Char('u'));
    assert!(
        maps(&mut comparison).iter().all(|map| map.is_free(cells[1]) && !map.is_free(cells[0]))
    );
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.free() == before.free()));
    wait_for_trainers(&mut comparison);
}

#[test]
fn the_editor_draws_by_keyboard_on_both() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, 80, 24);
    let goal = comparison.apps()[0].maze().goal;
    type_text(&mut comparison, "e3");
    press(&mut comparison, KeyCode::Enter);
    (0..2).for_each(|_| press(&mut comparison, KeyCode::Left));
    let previews = comparison.apps().map(|app| {
        app.maze().editor.preview().map(|(cells, _)| cells.into_owned()).expect("a line")
    });
    assert_eq!(previews[0].len(), 3);
    assert_eq!(previews[0], previews[1], "the line that is being drawn is shown on both");
    press(&mut comparison, KeyCode::Enter);
    assert!(maps(&mut comparison).iter().all(|map| !map.is_free(goal)));
    let [a, b] = comparison.apps().map(|app| app.maze().goal);
    assert!(a == b && a != goal, "the goal has left the wall on both sides");
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char('q'));
    assert!(!comparison.is_done(), "what has been drawn is in no file");
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.is_free(goal)), "also with a closed editor");
    type_text(&mut comparison, "e1");
    press(&mut comparison, KeyCode::Enter);
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char('q'));
    assert!(!comparison.is_done());
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char(':'));
    press_with(&mut comparison, KeyCode::Char('c'), KeyModifiers::CONTROL);
    let snapshot = comparison.apps()[0].screen.snapshot.clone();
    comparison.follow(0, &snapshot, &View::default());
    let shown = shown_by(&mut comparison, 120, 40);
    assert!(shown.contains("save before quitting?") && shown.contains("A: unsaved steps or"));
    let is_saved = |app: &Session| app.saver.named.is_some();
    assert!(!comparison.apps().iter().any(|app| is_saved(app)));
    press(&mut comparison, KeyCode::Char('y'));
    assert!(comparison.is_done() && comparison.apps().iter().all(|app| is_saved(app)));
}

#[test]
fn both_race_anew_once_one_of_them_can_and_look_back() {
    let mut comparison = staged(80, 24);
    let begun = comparison.apps()[0].screen.goal_request;
    (0..2).for_each(|_| {
        comparison.on_tick();
    });
    assert_eq!(comparison.apps()[0].screen.goal_request, begun + 1);
    for side in 0..2 {
        let film = film(comparison.apps()[side], &[1, 2_500]);
        let snapshot = (*comparison.apps()[side].screen.snapshot).clone();
        let snapshot = Snapshot { film, ..snapshot };
        comparison.follow(side, &Arc::new(snapshot), &View::default());
    }
    for (key, expected) in [('[', Some(2_500)), ('[', Some(1)), (']', Some(2_500)), ('\x1b', None)]
    {
        press(&mut comparison, if key == '\x1b' { KeyCode::Esc } else { KeyCode::Char(key) });
        let shown = comparison.apps().map(|app| app.screen.past.as_ref().map(|past| past.updates));
        assert_eq!(shown, [expected; 2], "after {key:?}");
        let shown = shown_by(&mut comparison, 120, 40);
        assert_eq!(shown.contains("PAST"), expected.is_some(), "{shown}");
    }
}
