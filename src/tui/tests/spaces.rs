//! Spaces of goals: the arm, with its projections, and worlds that the program knows nothing about.

use super::*;
use crate::tui::scene::Scene;
use gdg::env::{FetchReach, GoalSpace, WorldScene};
use gdg::train::DataSource;
use gdg::viewer::{Candidate, Graph, Plane, Reach, View};

/// Returns an app that does not train.
fn arm_app() -> App {
    app_in(&FetchReach::new(0), gdg(), Some(0), None)
}

/// Returns an app with a made-up view, drawn once at the given size.
pub(super) fn staged_arm(width: u16, height: u16) -> Still {
    let mut app = still_in(&FetchReach::new(0), Method::default());
    app.set_arm_goal([1.42, 0.83, 0.6]);
    draw(&mut app, width, height);
    let view = staged_view(&app);
    app.on_view(Arc::new(view));
    app
}

/// Returns the view of the arm in [`staged_arm`].
pub(super) fn staged_view(app: &Session) -> View {
    let goal = app.space().goal.clone();
    let planes: Vec<_> =
        app.screen.layout.projections.iter().map(|projection| projection.plane.clone()).collect();
    let field = |plane: &Plane| {
        let value = |i: usize| {
            let at = plane.point(plane.raster.middle_of(i), &goal);
            30.0 * (0..3).map(|i| (at[i] - goal[i]).abs()).fold(0.0, f32::max)
        };
        (0..plane.raster.len()).map(value).collect::<Vec<f32>>()
    };
    let mut arm = FetchReach::new(1);
    arm.put(0, [1.3, 0.66, 0.5]);
    let candidate = |at: [f32; 3]| Candidate { at: at.to_vec(), degree: 0.5 };
    View {
        goal: (Some(goal.clone()), 1),
        fields: Arc::new(planes.iter().map(field).collect()),
        planes: Arc::new(planes),
        farthest: 12.0,
        pose: Some(arm.pose(0)),
        graph: Arc::new(Graph {
            candidates: [[1.2, 0.7, 0.5], [1.35, 0.75, 0.7], [1.4, 0.8, 0.5]]
                .map(candidate)
                .to_vec(),
            edges: Vec::new(),
        }),
        reach: Reach {
            start: vec![1.342, 0.649, 0.535],
            at: arm.pose(0).grip.to_vec(),
            path: vec![vec![1.35, 0.75, 0.7], goal.clone()],
            trail: vec![vec![1.31, 0.64, 0.47], arm.pose(0).grip.to_vec()],
            steps: 4,
            left: 0.234,
            distances: (7.5, 3.5),
            waypoint: Some(vec![1.35, 0.75, 0.7]),
            finished: (3, 4),
            ..Reach::default()
        },
        ..View::default()
    }
}

#[test]
fn a_click_sets_the_two_coordinates_that_are_shown() {
    let mut app = arm_app();
    draw(&mut app, 200, 60);
    // From the side x and z are shown, from the front y and z, from above x and y.
    for (n, third) in [(0, 1), (1, 0), (2, 2)] {
        app.set_arm_goal([1.3, 0.7, 0.5]);
        draw(&mut app, 200, 60);
        let projection = app.screen.layout.projections[n].clone();
        let wanted = [1.4, 0.8, 0.6];
        let at = projection.frame.character_of(projection.plane.flat(&wanted)).expect("shown");
        click(&mut app, MouseButton::Left, at);
        let goal = app.space().goal.clone();
        for i in 0..3 {
            let expected = if i == third { [1.3, 0.7, 0.5][i] } else { wanted[i] };
            assert!((goal[i] - expected).abs() < 0.03, "{n}: {goal:?}, {expected} at {i}");
        }
    }
}

#[test]
fn keys_move_the_goal_by_a_centimetre_in_the_chosen_projection() {
    let mut app = arm_app();
    app.set_arm_goal([1.3, 0.7, 0.5]);
    draw(&mut app, 80, 24);
    let moved = |app: &App, by: [f32; 3]| {
        let goal = app.space().goal.clone();
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
    let WorldScene::Arm(scene) = &app.screen.snapshot.scene else { panic!("an arm") };
    assert_eq!(app.space().goal[1], scene.goals()[0][1], "the region of goals ends here");
}

#[test]
fn a_drag_turns_the_free_projection_and_a_click_there_sets_the_goal() {
    let mut app = arm_app();
    draw(&mut app, 200, 60);
    let free = app.screen.layout.projections[3].clone();
    let middle =
        Position::new(free.frame.area.x + free.frame.area.width / 2, free.frame.area.y + 12);
    let (goal, orbit) = (app.space().goal.clone(), app.space().shown.orbit);
    let to = Position::new(middle.x + 5, middle.y + 2);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), middle);
    mouse(&mut app, MouseEventKind::Drag(MouseButton::Left), to);
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), to);
    assert!(app.space().goal == goal && app.space().shown.orbit != orbit);
    draw(&mut app, 200, 60);
    let free = app.screen.layout.projections[3].clone();
    let wanted = <[f32; 3]>::try_from(free.point_at(middle, &goal)).expect("a position");
    click(&mut app, MouseButton::Left, middle);
    let WorldScene::Arm(scene) = &app.screen.snapshot.scene else { panic!("an arm") };
    assert_eq!(app.space().goal, scene.nearest_goal(wanted));
    mouse(&mut app, MouseEventKind::ScrollUp, middle);
    assert!(app.space().shown.camera.zoom > 1.0);
    press(&mut app, KeyCode::Char('0'));
    assert_eq!(app.space().shown.camera.zoom, 1.0);
}

#[test]
fn the_arm_can_be_drawn_at_every_size_and_magnification_and_exported() {
    let mut app = arm_app();
    for (width, height) in [(1, 1), (7, 3), (40, 10), (80, 24), (400, 120)] {
        for keys in ["", "P", "P", "P", "+++++++", "Z", "m", "m", "m"] {
            type_text(&mut app, keys);
            draw(&mut app, width, height);
        }
        let middle = Position::new(width / 2, height / 2);
        for kind in [MouseEventKind::Down(MouseButton::Left), MouseEventKind::ScrollDown] {
            mouse(&mut app, kind, middle);
        }
        press(&mut app, KeyCode::Char('0'));
        // A click on the only character may have opened a pane.
        app.screen.maximised = false;
    }
    let evaluations = Arc::new(vec![(500, staged::evaluation(1.0))]);
    app.change_snapshot(|snapshot| snapshot.evaluations = evaluations);
    let table = export(ExportKind::CurvesCsv, &mut app).expect("a table");
    let table = String::from_utf8(table).expect("text");
    assert!(table.lines().any(|line| line.starts_with("evaluation,,500,")), "{table}");
    for kind in ExportKind::ALL {
        assert!(export(kind, &mut app).is_ok(), "{kind:?}");
    }
}

#[test]
fn maps_and_worlds_open_from_each_others_screens() {
    let mut app = app();
    draw(&mut app, 80, 24);
    for (name, noun) in [("fetch-reach", "arm"), ("trap", "map")] {
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
            Scene::Space(space) => !space.view.fields.is_empty(),
            Scene::Maze(maze) => {
                maze.view.field().map(|(_, raster)| raster)
                    == app.screen.layout.map.as_ref().map(|map| map.raster)
            }
        });
    }
}

/// Returns an app in the space of an arm's goals, with a made-up view, drawn at the given size.
pub(super) fn staged_goals(width: u16, height: u16) -> Still {
    let arm = FetchReach::new(0);
    let mut snapshot = Snapshot::clone(&still_in(&arm, Method::default()).screen.snapshot);
    snapshot.scene = WorldScene::Goals(Box::new(GoalSpace::of(&arm, None)));
    let mut app = still_at(snapshot);
    app.set_arm_goal([1.42, 0.83, 0.6]);
    // What is known of the space decides which part is shown.
    for _ in 0..2 {
        draw(&mut app, width, height);
        let view = View { pose: None, ..staged_view(&app) };
        app.on_view(Arc::new(view));
    }
    app
}

#[test]
fn a_failure_of_the_environment_is_read_whole_on_a_small_screen() {
    let mut app = staged_goals(80, 24);
    let cause = "PointMaze_UMaze-v3: its Python process has ended: killed by signal 9\n  one last \
                 line of the environment, which says what it did before it was killed";
    app.change_snapshot(|snapshot| {
        snapshot.phase = gdg::engine::Phase::Failed(cause.to_owned());
    });
    let shown = shown_by(&mut app, 80, 24);
    let words: Vec<&str> = shown.split(|c: char| c.is_whitespace() || c == '\u{2502}').collect();
    let words = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
    for part in ["killed by signal 9", "what it did before it was killed", "save and quit"] {
        assert!(words.contains(part), "{part:?} in\n{shown}");
    }
}

#[test]
fn a_run_that_learns_from_data_says_so_instead_of_agents() {
    let mut app = staged_goals(120, 40);
    let source =
        DataSource { file: "a/walks.npz".into(), checksum: 7, transitions: 1_000_000, episodes: 5 };
    app.change_snapshot(|snapshot| {
        (snapshot.data, snapshot.agents) = (Some(Arc::new(source)), Arc::default());
    });
    app.act(Action::Maximise);
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("walks.npz") && shown.contains("1,000,000 recorded"), "{shown}");
}
