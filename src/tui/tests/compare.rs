//! Comparisons: two runs on one screen.

mod both;

use super::staged::{evaluation, staged_view};
use super::*;
use crate::tui::compare::{Comparison, ComparisonOptions, Contender, Contestant, prepare};
use crate::tui::graphics::{Graphics, Protocol, Redraw};
use gdg::env::FetchReach;
use gdg::pulse::Progress;
use gdg::train::{Counters, Evaluation};
use gdg::viewer::View;

fn trainer(method: &str, seed: u64) -> Trainer {
    let world = PointMaze::new(Arc::new(rooms()), 0);
    seeded_trainer(&world, method.parse().expect("a method"), &Registry::builtin(), seed)
}

fn comparison_with(methods: [&str; 2], limits: Limits) -> Comparison {
    let [a, b] = methods.map(|method| (trainer(method, 1), method));
    let contestants = [(a, 'A'), (b, 'B')].map(|((trainer, method), letter)| Contestant {
        title: format!("{letter} {method} {}", trainer.run().preset.name()),
        trainer,
        is_paused: false,
    });
    let mut comparison = start(contestants, limits);
    for app in comparison.apps() {
        app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
    }
    comparison
}

fn start(contestants: [Contestant; 2], limits: Limits) -> Comparison {
    Comparison::start(contestants, &UiConfig::default(), &keymap(), limits).expect("a comparison")
}

fn comparison() -> Comparison {
    comparison_with(["gdg-bridge", "gdg"], Limits::default())
}

fn stopped_comparison() -> Comparison {
    let limits = Limits { updates: Some(0), ..Limits::default() };
    comparison_with(["gdg-bridge", "gdg"], limits)
}

/// Returns a comparison in the middle of both runs, with fixed numbers.
pub(super) fn staged(width: u16, height: u16) -> Comparison {
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
            comparison.on_snapshot(side, &Arc::new(snapshot));
        }
        let app = &comparison.apps()[side];
        let mut view = staged_view(app);
        view.goal.1 = app.link.goal_request();
        view.walk.arrived = side == 0;
        comparison.on_view(side, &View::Maze(Arc::new(view)));
    }
    comparison
}

/// Returns the character that shows the centre of `cell` on a side.
fn character_of(comparison: &mut Comparison, side: usize, cell: Cell) -> Position {
    let frame = comparison.apps()[side].screen.layout.map.clone().expect("the map is drawn");
    frame.character_of(cell.centre()).expect("the cell is shown")
}

/// Applies what engines and viewers publish until `is` holds.
fn wait_until(comparison: &mut Comparison, is: impl Fn([&mut App; 2]) -> bool) {
    let began = Instant::now();
    while !is(comparison.apps()) {
        assert!(began.elapsed() < Duration::from_mins(1), "timed out");
        std::thread::sleep(Duration::from_millis(5));
        comparison.refresh();
        comparison.on_tick();
    }
}

#[test]
fn every_screen_size_can_be_drawn() {
    let mut comparison = comparison();
    for (width, height) in [(1, 1), (2, 1), (1, 9), (7, 3), (40, 10), (60, 18), (400, 120)] {
        for key in ['1', '2', '?', 'q'] {
            press(&mut comparison, KeyCode::Char(key));
            draw(&mut comparison, width, height);
        }
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
                app.maze().view.walk.start == start.centre() && app.maze().view.goal.0 == Some(goal)
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
    for key in "xavvvi+".chars() {
        press(&mut comparison, KeyCode::Char(key));
        draw(&mut comparison, 80, 24);
        let [a, b] = comparison.apps().map(|app| {
            let (screen, maze) = (&app.screen, app.maze());
            (screen.field, screen.overlays, maze.viewport, maze.inspecting, screen.frozen)
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
    let mut comparison = comparison_with(["gdg-bridge", "her"], limits);
    draw(&mut comparison, 80, 24);
    wait_until(&mut comparison, |apps| {
        apps.iter().all(|app| app.screen.snapshot.phase == Phase::Done)
    });
    press(&mut comparison, KeyCode::Char('n'));
    for (method, trained) in ["gdg-bridge", "her"].into_iter().zip(comparison.stop()) {
        let trained = trained.expect("a trainer");
        assert_eq!(trained.run().method.name(), method);
        let mut alone = trainer(method, 1);
        while alone.limit_reached(&limits).is_none() {
            alone.tick().expect("a tick");
        }
        assert_eq!((alone.counters(), alone.losses()), (trained.counters(), trained.losses()));
        let policies = [&alone, &trained].map(|trainer| trainer.policy().expect("a policy"));
        let mut scratch = gdg::learn::Scratch::default();
        let [a, b] =
            policies.map(|policy| policy.distance(&[1.5, 1.5], &[17.5, 4.5], &mut scratch));
        assert_eq!(a.to_bits(), b.to_bits(), "{method}");
        assert_eq!(alone.world().states(), trained.world().states());
    }
}

#[test]
fn both_pause_and_resume_and_quitting_asks_nothing() {
    let mut comparison = comparison();
    press(&mut comparison, KeyCode::Char(' '));
    wait_until(&mut comparison, |apps| {
        apps.iter().all(|app| app.screen.snapshot.phase == Phase::Paused)
    });
    assert!(shown_by(&mut comparison, 80, 24).contains("paused") && !comparison.is_training());
    let before = comparison.apps().map(|app| app.screen.snapshot.counters.updates);
    press(&mut comparison, KeyCode::Char(' '));
    wait_until(&mut comparison, |apps| {
        apps.iter().zip(before).all(|(app, before)| app.screen.snapshot.counters.updates > before)
    });
    press(&mut comparison, KeyCode::Char('?'));
    press(&mut comparison, KeyCode::Char('q'));
    assert!(!comparison.is_done(), "it closes the help");
    press(&mut comparison, KeyCode::Char('q'));
    assert!(comparison.is_done());
    let closed = comparison.close();
    assert!(closed.saved.is_ok() && !closed.failed, "{} {:?}", closed.summary, closed.saved);
    for run in ["A: gdg-bridge on rooms", "B: gdg on rooms"] {
        assert!(closed.summary.contains(run), "{}", closed.summary);
    }
}

#[test]
fn both_maps_are_pictures_on_which_the_same_distance_has_the_same_colour() {
    let mut comparison = comparison();
    let graphics = Graphics { protocol: Protocol::Sixel, character: (8, 16) };
    comparison.set_graphics(Some(graphics), Redraw::All);
    draw(&mut comparison, 120, 40);
    let areas: Vec<_> = comparison.pictures().iter().map(|picture| Some(picture.area)).collect();
    let maps = comparison.apps().map(|app| app.screen.layout.map.as_ref().map(|map| map.area));
    assert_eq!(areas, maps);
    wait_until(&mut comparison, |apps| {
        let [a, b] = apps.map(|app| (app.scene.own_farthest(), app.maze().farthest(&app.screen)));
        a.0.to_bits() != b.0.to_bits() && a.1.to_bits() == b.1.to_bits()
    });
}

/// Returns the options of a comparison on the command line.
fn options(contenders: [Contender; 2]) -> ComparisonOptions {
    ComparisonOptions {
        contenders,
        map: None,
        reading: gdg::map::Reading::default(),
        seed: None,
        set: vec!["hidden=16".to_owned(), "buffer_size=20000".to_owned()],
        threads: gdg::learn::Threads::Fixed(1),
        recording: None,
    }
}

#[test]
fn saved_runs_begin_paused_and_a_method_beside_one_on_its_map_with_its_seed() {
    let folder = tempfile::tempdir().expect("a folder");
    let save = |trainer: &Trainer, name: &str| {
        let to = SaveTo::CreateNew(folder.path().join(name));
        Contender::Checkpoint(train::save(trainer, &to).expect("a file"))
    };
    let saved = save(&trainer("gdg-bridge", 7), "own.safetensors");
    let other = save(&trainer("her", 8), "other.safetensors");
    let method = Contender::Method("her".parse().expect("a method"));
    let registry = Registry::builtin();
    let prepared = prepare(&options([saved.clone(), method]), &registry, &Progress::default());
    let [a, b] = prepared.expect("a run beside a method").both;
    assert_eq!([a.is_paused, b.is_paused], [true, false]);
    assert_eq!(a.title, "A own.safetensors: gdg-bridge default seed 7");
    assert_eq!((b.title.as_str(), b.trainer.run().seed), ("B her tuned", 7));
    let map = |contestant: &Contestant| {
        PointMaze::downcast_ref(contestant.trainer.world()).expect("a maze").map().clone()
    };
    assert_eq!(map(&a), map(&b));

    let both = ComparisonOptions { set: Vec::new(), ..options([saved.clone(), other]) };
    let contestants = prepare(&both, &registry, &Progress::default()).expect("two saved runs").both;
    let mut comparison = start(contestants, Limits::default());
    let paused = |app: &App| {
        assert_eq!(app.screen.snapshot.counters.env_steps, 0, "shown as it was saved");
        app.screen.snapshot.phase == Phase::Paused
    };
    wait_until(&mut comparison, |apps| apps.into_iter().all(|app| paused(app)));
    assert!(!shown_by(&mut comparison, 120, 40).contains("rooms seed"), "seeds differ");
    press(&mut comparison, KeyCode::Char(' '));
    wait_until(&mut comparison, |apps| {
        apps.into_iter().all(|app| app.screen.snapshot.updates() > 0 || app.is_training())
    });
    drop(comparison.stop());
}

#[test]
fn what_cannot_stand_beside_a_saved_run_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let save = |world: &dyn Environment, name: &str| {
        let trainer = trainer_in(world, gdg(), &Registry::builtin());
        let to = SaveTo::CreateNew(folder.path().join(name));
        Contender::Checkpoint(train::save(&trainer, &to).expect("a file"))
    };
    let maze = |map: Grid| PointMaze::new(Arc::new(map), 0);
    let saved = save(&maze(rooms()), "rooms.safetensors");
    let other = save(&maze(Grid::empty("hall", 4, 3)), "hall.safetensors");
    let arm = save(&FetchReach::new(None, 0), "arm.safetensors");
    let method = || Contender::Method(gdg());
    let both = ComparisonOptions { set: Vec::new(), ..options([saved.clone(), other]) };
    let set = |name: &str| vec![format!("{name}=8")];
    for (options, problem) in [
        (both.clone(), "different maps: rooms (20 x 5) and hall (4 x 3)"),
        (ComparisonOptions { map: Some("trap".into()), ..both.clone() }, "the map is that of"),
        (ComparisonOptions { seed: Some(1), ..both.clone() }, "have their own seeds"),
        (ComparisonOptions { set: set("hidden"), ..both }, "changes no method"),
        (
            ComparisonOptions { set: set("A:hidden"), ..options([saved, method()]) },
            "changes no method",
        ),
        (options([arm, method()]), "is of a world without a map"),
        (options([Contender::Checkpoint("none".into()), method()]), "none"),
    ] {
        let refused = prepare(&options, &Registry::builtin(), &Progress::default());
        let error = refused.err().expect("it is refused");
        assert!(error.to_string().contains(problem), "{error}");
    }
}
