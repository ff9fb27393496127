//! The arm: projections, goals by mouse and keys, unavailable actions, and switching between
//! worlds.

use super::screens::check;
use super::*;
use crate::tui::output::ExportKind;
use crate::tui::panes::Pane;
use crate::tui::scene::Scene as Shown;
use gdg::env::fetch_reach::{WALL, WALL_KIND};
use gdg::env::{FetchReach, Scene};
use gdg::train::{self, DistanceScore, Evaluation, Score};
use gdg::viewer::{ArmView, Candidate, Reach, View};

fn arm_app(limits: Limits, save: Option<PathBuf>) -> App {
    app_in(&FetchReach::new(None, 0), gdg(), limits, save)
}

/// Returns an app that does not train, so that nothing on its screen changes by itself.
fn still_app() -> App {
    arm_app(Limits { updates: Some(0), ..Limits::default() }, None)
}

/// Returns an app with a made-up view, drawn once at the given size.
fn staged_app(world: &FetchReach, method: Method, width: u16, height: u16) -> Still {
    let mut app = still_in(world, method);
    app.set_arm_goal([1.42, 0.83, 0.6]);
    draw(&mut app, width, height);
    let view = staged_view(&app);
    app.on_view(View::Arm(Arc::new(view)));
    let snapshot = staged_snapshot(&app);
    app.on_snapshot(Arc::new(snapshot));
    app
}

/// Returns the view of the arm in [`staged_app`].
fn staged_view(app: &App) -> ArmView {
    let goal = app.arm().goal;
    let Scene::Arm(scene) = &app.screen.snapshot.scene else { panic!("an arm") };
    let planes: Vec<_> =
        app.screen.layout.projections.iter().map(|projection| projection.plane).collect();
    let [low, high] = scene.positions();
    let field = |plane: &gdg::viewer::arm::Plane| {
        let (columns, rows) = plane.raster.pixels;
        let [left, top, width, height] = plane.raster.window;
        let value = |i: usize| {
            let across = left + ((i % columns) as f32 + 0.5) / columns as f32 * width;
            let down = top + ((i / columns) as f32 + 0.5) / rows as f32 * height;
            let at = plane.point([across, down], goal);
            let shown = (0..3).all(|i| (low[i]..=high[i]).contains(&at[i]));
            if shown {
                30.0 * (0..3).map(|i| (at[i] - goal[i]).abs()).fold(0.0, f32::max)
            } else {
                f32::NAN
            }
        };
        (0..columns * rows).map(value).collect::<Vec<f32>>()
    };
    let mut arm = scene.world(1);
    arm.put(0, [1.3, 0.66, 0.5]);
    let candidate = |at| Candidate { at, degree: 0.5 };
    ArmView {
        goal: (Some(goal), 1),
        fields: Arc::new(planes.iter().map(field).collect()),
        planes: Arc::new(planes),
        farthest: 12.0,
        pose: arm.pose(0),
        candidates: Arc::new(
            [[1.2, 0.7, 0.5], [1.35, 0.75, 0.7], [1.4, 0.8, 0.5]].map(candidate).to_vec(),
        ),
        reach: Reach {
            start: vec![1.342, 0.649, 0.535],
            path: vec![vec![1.35, 0.75, 0.7], goal.to_vec()],
            trail: vec![vec![1.31, 0.64, 0.47], arm.pose(0).grip.to_vec()],
            steps: 4,
            left: 0.234,
            distances: (7.5, 3.5),
            waypoint: Some(vec![1.35, 0.75, 0.7]),
            finished: (3, 4),
            ..Reach::default()
        },
        ..ArmView::default()
    }
}

/// Returns the training state in [`staged_app`].
fn staged_snapshot(app: &App) -> Snapshot {
    let mut snapshot = (*app.screen.snapshot).clone();
    (snapshot.phase, snapshot.seconds, snapshot.rates) = (Phase::Running, 12.0, (80.0, 80.0));
    (snapshot.limits.updates, snapshot.seconds_left) = (Some(1_000), Some(0.0));
    (snapshot.counters.updates, snapshot.counters.env_steps, snapshot.counters.episodes) =
        (1_000, 1_200, 24);
    let score = |success: f64| {
        let by_distance = [7.0, 11.5, 14.1].map(|cm| DistanceScore {
            distance_cm: Some(cm),
            tasks: 10,
            success: Some((success - 0.01 * cm).max(0.0)),
            ..DistanceScore::default()
        });
        Score { success: Some(success), by_distance: by_distance.to_vec(), ..Score::default() }
    };
    let evaluation = |success: f64| Evaluation {
        greedy: score(success),
        planned: app.screen.run().method.plans().then(|| score(1.0)),
        straight: None,
        distance_error: None,
        bridges: None,
        coverage: None,
        marked: None,
    };
    snapshot.evaluations = Arc::new(vec![(500, evaluation(0.4)), (1_000, evaluation(0.9))]);
    snapshot
}

#[test]
fn the_arm_matches_its_snapshots() {
    let plain = FetchReach::new(None, 0);
    for (width, height) in [(80, 24), (120, 40), (200, 60)] {
        check(
            &format!("arm-{width}x{height}"),
            &mut staged_app(&plain, gdg(), width, height),
            width,
            height,
        );
    }
    let mut app = staged_app(&plain, gdg(), 80, 24);
    app.screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    check("arm-mono-80x24", &mut app, 80, 24);
    let mut app = staged_app(&plain, gdg(), 80, 24);
    (app.screen.pane, app.screen.maximised) = (Pane::Curves, true);
    check("arm-curves-80x24", &mut app, 80, 24);
    let csv =
        crate::tui::export::contents(ExportKind::CurvesCsv, &mut app.app.screen, &app.app.scene)
            .expect("a table");
    assert!(
        String::from_utf8_lossy(&csv).contains(",greedy_at_7_cm,"),
        "groups are measured in centimetres"
    );
    let mut app = staged_app(&plain, gdg(), 80, 24);
    press(&mut app, KeyCode::Char('?'));
    check("arm-help-80x24", &mut app, 80, 24);
    let mut app = staged_app(&FetchReach::new(Some(WALL), 0), Method::default(), 120, 40);
    app.screen.pane = Pane::Legend;
    check("arm-wall-bridges-120x40", &mut app, 120, 40);
    let mut app = staged_app(&FetchReach::new(Some(WALL), 0), Method::default(), 80, 24);
    app.screen.pane = Pane::Walk;
    check("arm-walk-80x24", &mut app, 80, 24);
}

#[test]
fn nothing_is_cut_off_beside_the_arm() {
    let mut app = staged_app(&FetchReach::new(Some(WALL), 0), Method::default(), 80, 24);
    for following in [None, Some(0)] {
        app.screen.following = following;
        for pane in [Pane::Training, Pane::Walk, Pane::Legend] {
            let lines = render::pane_lines(pane, &app.screen, &app.scene, 29).expect("lines");
            assert!(lines.len() <= 20, "{} lines in {}", lines.len(), pane.name());
            for line in lines {
                assert!(line.width() <= 29, "{line} in {} is cut off", pane.name());
            }
        }
    }
}

#[test]
fn a_click_sets_the_two_coordinates_that_are_shown() {
    let mut app = still_app();
    for (width, height) in [(80, 24), (200, 60)] {
        // From the side x and z are shown, from the front y and z, from above x and y.
        for (n, third) in [(0, 1), (1, 0), (2, 2)] {
            app.set_arm_goal([1.3, 0.7, 0.5]);
            draw(&mut app, width, height);
            let projection = app.screen.layout.projections
                [n.min(app.screen.layout.projections.len() - 1)]
            .clone();
            let wanted = [1.4, 0.8, 0.6];
            let at = projection.frame.character_of(projection.flat(wanted)).expect("it is shown");
            mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
            mouse(&mut app, MouseEventKind::Up(MouseButton::Left), at);
            let (goal, third) = (app.arm().goal, if height == 24 { [1, 0, 2][n] } else { third });
            for i in 0..3 {
                let expected = if i == third { [1.3, 0.7, 0.5][i] } else { wanted[i] };
                assert!((goal[i] - expected).abs() < 0.03, "{n}: {goal:?}, {expected} at {i}");
            }
            assert!(height != 24 || app.screen.layout.projections.len() == 1);
            press(&mut app, KeyCode::Char('P'));
        }
        app.arm_mut().shown.angle = crate::tui::scene::ArmState::default().shown.angle;
    }
}

#[test]
fn keys_move_the_goal_by_a_centimetre_in_the_chosen_projection() {
    let mut app = still_app();
    app.set_arm_goal([1.3, 0.7, 0.5]);
    draw(&mut app, 80, 24);
    let moved = |app: &App, by: [f32; 3]| {
        let goal = app.arm().goal;
        let was = [1.3, 0.7, 0.5];
        assert!((0..3).all(|i| (goal[i] - was[i] - by[i]).abs() < 1e-5), "{goal:?}");
    };
    press(&mut app, KeyCode::Right);
    moved(&app, [0.01, 0.0, 0.0]);
    press(&mut app, KeyCode::Char('k'));
    moved(&app, [0.01, 0.0, 0.01]);
    press(&mut app, KeyCode::Char('P'));
    draw(&mut app, 80, 24);
    press(&mut app, KeyCode::Left);
    moved(&app, [0.01, -0.01, 0.01]);
    (0..99).for_each(|_| press(&mut app, KeyCode::Left));
    let Scene::Arm(scene) = &app.screen.snapshot.scene else { panic!("an arm") };
    assert_eq!(app.arm().goal[1], scene.goals()[0][1], "the region of goals ends here");
}

#[test]
fn a_drag_turns_the_free_projection_and_a_click_there_sets_the_goal() {
    let mut app = still_app();
    draw(&mut app, 200, 60);
    let free = app.screen.layout.projections[3].clone();
    let middle =
        Position::new(free.frame.area.x + free.frame.area.width / 2, free.frame.area.y + 12);
    let (goal, orbit) = (app.arm().goal, app.arm().shown.orbit);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), middle);
    mouse(
        &mut app,
        MouseEventKind::Drag(MouseButton::Left),
        Position::new(middle.x + 5, middle.y + 2),
    );
    mouse(
        &mut app,
        MouseEventKind::Up(MouseButton::Left),
        Position::new(middle.x + 5, middle.y + 2),
    );
    assert!(app.arm().goal == goal && app.arm().shown.orbit != orbit);
    draw(&mut app, 200, 60);
    let free = app.screen.layout.projections[3].clone();
    let wanted = free.point_at(middle, goal);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), middle);
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), middle);
    let Scene::Arm(scene) = &app.screen.snapshot.scene else { panic!("an arm") };
    assert_eq!(app.arm().goal, scene.nearest_goal(wanted));
    mouse(&mut app, MouseEventKind::ScrollUp, middle);
    assert!(app.arm().shown.camera.zoom > 1.0);
    press(&mut app, KeyCode::Char('0'));
    assert_eq!(app.arm().shown.camera.zoom, 1.0);
}

#[test]
fn what_needs_a_map_is_not_offered_and_says_why() {
    let mut app = still_app();
    draw(&mut app, 80, 24);
    for action in
        [Action::ToggleEdit, Action::SaveMap, Action::NewMap, Action::Inspect, Action::Undo]
    {
        app.act(action);
        let notice = app.screen.log.notice().expect("a notice").text;
        assert!(notice.starts_with("fetch-reach has no map, "), "{notice}");
        assert!(app.screen.dialogs.is_empty());
    }
    app.act(Action::Palette);
    let Some(Dialog::Pick(picker)) = app.screen.dialogs.last() else { panic!("a list") };
    assert!(picker.items().all(|item| !item.label.contains("editor")), "it is not listed");
    assert!(picker.items().any(|item| item.label == "choose the next projection"));
    for kind in ExportKind::ALL {
        let is_written = crate::tui::export::contents(kind, &mut app.screen, &app.scene).is_ok();
        let is_filmed = matches!(kind, ExportKind::Still | ExportKind::Film);
        assert_eq!(is_written, !is_filmed, "{kind:?}: nothing has been filmed");
        assert!(!kind.name(app.scene.noun()).starts_with("map"));
    }
}

#[test]
fn the_arm_can_be_drawn_at_every_size_and_magnification() {
    let mut app = still_app();
    for (width, height) in [(1, 1), (7, 3), (40, 10), (69, 12), (80, 24), (120, 40), (400, 120)] {
        for keys in ["", "P", "P", "P", "+++++++", "Z", "m", "m", "m"] {
            type_text(&mut app, keys);
            draw(&mut app, width, height);
        }
        let middle = Position::new(width / 2, height / 2);
        for kind in [MouseEventKind::Down(MouseButton::Left), MouseEventKind::ScrollDown] {
            mouse(&mut app, kind, middle);
        }
        press(&mut app, KeyCode::Char('0'));
    }
}

#[test]
fn the_arm_reaches_goals_and_goes_on_to_others() {
    let mut app = still_app();
    draw(&mut app, 80, 24);
    press(&mut app, KeyCode::Char('t'));
    // A walk that starts at the goal arrives at once, whatever was learned.
    press(&mut app, KeyCode::Char('S'));
    let first = app.arm().goal;
    wait_until(&mut app, |app| app.arm().view.reach.finished.0 >= 1 && app.arm().goal != first);
    let view = app.arm().view.clone();
    assert!(view.planes.len() == 1 && view.fields[0].iter().any(|d| d.is_finite()), "D is shown");
    assert_eq!(view.pose.links().last().map(|[_, end]| end), Some(view.pose.grip));
}

#[test]
fn a_checkpoint_of_the_interface_resumes_without_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("arm.safetensors");
    let mut app = arm_app(Limits { updates: Some(5), ..Limits::default() }, Some(path.clone()));
    wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Done);
    let goal = app.arm().goal;
    app.act(Action::Save);
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    let mut trainer = train::load(&path, &Registry::builtin(), 1).expect("a checkpoint").trainer;
    assert_eq!((trainer.counters().updates, trainer.world().kind()), (5, "fetch-reach"));
    while trainer.counters().updates < 8 {
        trainer.tick().expect("it trains");
    }
    // From a map's screen, loading it switches the world.
    let mut app = app_on(rooms(), gdg());
    draw(&mut app, 80, 24);
    app.command(gdg::engine::Command::Load(path));
    wait_until(&mut app, |app| matches!(app.scene, Shown::Arm(_)));
    assert_eq!(app.arm().goal, goal);
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.arm().view.pose.grip[0] > 1.0 && !app.arm().view.fields.is_empty()
    });
    assert!(text(&draw(&mut app, 80, 24)).contains("fetch-reach"));
    press(&mut app, KeyCode::Char('v'));
    assert_eq!(app.screen.field, Field::FromStart);
}

#[test]
fn maps_and_worlds_open_from_each_others_screens() {
    let mut app = app();
    draw(&mut app, 80, 24);
    for (name, noun) in [(WALL_KIND.name, "arm"), ("trap", "map")] {
        let generation = app.screen.snapshot.generation;
        app.act(Action::OpenMap);
        type_text(&mut app, name);
        press(&mut app, KeyCode::Enter);
        assert!(text(&draw(&mut app, 80, 24)).contains("start a new run"));
        press(&mut app, KeyCode::Enter);
        wait_until(&mut app, |app| app.screen.snapshot.generation > generation);
        assert_eq!((app.scene.noun(), app.scene.title(&app.screen.snapshot)), (noun, name));
        draw(&mut app, 80, 24);
        wait_until(&mut app, |app| match &app.scene {
            Shown::Arm(arm) => !arm.view.fields.is_empty(),
            Shown::Goals(_) => false,
            Shown::Maze(maze) => {
                maze.view.raster == app.screen.layout.map.as_ref().map(|map| map.raster)
            }
        });
    }
}
