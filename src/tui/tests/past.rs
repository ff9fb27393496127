//! Tests of looking back in time.

use super::staged::staged_app;
use super::*;
use crate::tui::choices::Pane;
use crate::tui::drawings::name;
use gdg::env::FetchReach;
use gdg::train::{Film, FilmFrame};
use gdg::viewer::{FilmedMap, Plane, View};

/// Returns a film on the rooms map: distances grow with the updates.
pub(super) fn film(app: &Session, updates: &[u64]) -> Arc<Vec<Arc<FilmFrame>>> {
    let (mut world, mut film) = (PointMaze::new(app.maze().map.clone(), 2), Film::default());
    world.set_full_state(0, &[3.5, 3.5]).unwrap();
    world.set_full_state(1, &[14.5, 1.5]).unwrap();
    let points = film.points(&world).expect("points");
    let (states, _) = points.states.as_chunks::<2>();
    for updates in updates {
        let share = *updates as f32 / 10_000.0;
        let distance = |at: &[f32; 2]| {
            30.0 * (1.0 - share) + 3.0 * share * (at[0] - 19.5).abs().max((at[1] - 4.5).abs())
        };
        let distances: Vec<f32> = states.iter().map(distance).collect();
        film.add([*updates, 32 * updates], &world, &points, &distances);
    }
    film.frames().clone()
}

pub(super) fn filmed_app(updates: &[u64], width: u16, height: u16) -> Still {
    let mut app = staged_app(width, height);
    let film = film(&app, updates);
    app.change_snapshot(|snapshot| snapshot.film = film);
    app
}

fn stage_past(app: &mut App) {
    let frame = app.screen.past.clone().expect("the past is looked at");
    let raster = app.screen.layout.map.clone().expect("the map is drawn").raster;
    let field = FilmedMap::new(app.maze().map.clone()).field(&frame, raster);
    let view = View {
        farthest: frame.farthest(),
        fields: Arc::new(vec![field]),
        planes: Arc::new(vec![Plane::of_maze(raster)]),
        past: Some(frame),
        ..(*app.maze().view).clone()
    };
    app.on_view(Arc::new(view));
}

fn shown_update(app: &App) -> Option<u64> {
    app.screen.past.as_ref().map(|frame| frame.updates)
}

#[test]
fn the_past_shows_its_goal_and_nothing_of_the_present() {
    let mut app = filmed_app(&[1, 2_500, 5_000], 80, 24);
    app.set_goal(Cell::new(3, 1));
    assert!(shown_by(&mut app, 80, 24).contains('@'));
    press(&mut app, KeyCode::Char('['));
    stage_past(&mut app);
    let terminal = draw(&mut app, 80, 24);
    let past = text(&terminal);
    assert!(past.contains("update 5,000: G is the film's"), "{past}");
    let at = |cell| terminal.backend().buffer()[character_of(&app, cell)].symbol();
    assert!(at(Cell::new(19, 4)) == "G" && at(Cell::new(3, 1)) != "G", "{past}");
    let map = app.screen.layout.map.as_ref().expect("a map").area;
    assert!(map.positions().all(|at| terminal.backend().buffer()[at].symbol() != "@"));
}

#[test]
fn a_click_on_the_curves_goes_to_that_update_and_one_on_the_map_returns() {
    let mut app = filmed_app(&[1, 2_500, 5_000, 7_500], 120, 40);
    app.screen.pane = Pane::Curves;
    draw(&mut app, 120, 40);
    let area = app.screen.layout.charts.first().expect("a chart").area;
    for (share, expected) in [(0, 1), (1, 2_500), (2, 5_000), (3, 7_500), (4, 7_500)] {
        let at = Position::new(area.x + (area.width - 1) * share / 4, area.y + 1);
        click(&mut app, MouseButton::Left, at);
        assert_eq!(shown_update(&app), Some(expected), "{share} quarters");
    }
    let at = character_of(&app, Cell::new(3, 1));
    click(&mut app, MouseButton::Left, at);
    assert_eq!((shown_update(&app), app.maze().goal), (None, Cell::new(3, 1)));
    // So does whatever is about the present.
    for (key, stays) in [('n', false), ('v', false), ('e', false), ('+', true)] {
        app.act(Action::Back);
        type_text(&mut app, &key.to_string());
        assert_eq!(shown_update(&app).is_some(), stays, "{key}");
        press(&mut app, KeyCode::Esc);
    }
}

#[test]
fn pictures_of_the_past_are_named_and_described_by_what_they_show() {
    let mut app = filmed_app(&[1, 2_500], 120, 40);
    app.change_snapshot(|snapshot| snapshot.edits = Arc::new(vec![2_500]));
    press(&mut app, KeyCode::Char('['));
    stage_past(&mut app);
    assert!(shown_by(&mut app, 120, 40).contains("walls of today"));
    assert!(name(ExportKind::MapSvg, &app.screen, &app.scene).ends_with("-2500"));
    let picture = export(ExportKind::MapSvg, &mut app).expect("a picture");
    // Each character is an element of its own, and blanks are none.
    let picture = String::from_utf8(picture).expect("text");
    let picture: String = picture.lines().filter(|line| !line.starts_with('<')).collect();
    assert!(picture.contains("update2,500"), "{picture}");
    assert!(!picture.contains("Escnow"), "keys are left out: {picture}");
}

#[test]
fn the_viewer_shows_the_past_while_training_goes_on() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.film.len() > 1 && app.maze().view.field().is_some()
    });
    type_text(&mut app, "[[");
    assert_eq!(shown_update(&app), Some(1));
    wait_until(&mut app, |app| app.shown_past().is_some());
    let fields = app.maze().view.fields.clone();
    assert!(fields[0].iter().any(|value| value.is_finite()));
    let updates = app.screen.snapshot.counters.updates;
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > updates + 20);
    assert!(Arc::ptr_eq(&fields, &app.maze().view.fields), "the past does not change");
    press(&mut app, KeyCode::Esc);
    wait_until(&mut app, |app| {
        app.shown_past().is_none() && app.screen.snapshot.counters.updates > updates
    });
}

#[test]
fn the_past_of_an_arm_is_a_field_through_its_goal() {
    let world = FetchReach::new(0);
    let mut app = app_in(&world, gdg(), Some(0), None);
    draw(&mut app, 120, 40);
    let (world, mut film) = (FetchReach::new(3), Film::default());
    let points = film.points(&world).expect("points");
    film.add([1, 8], &world, &points, &vec![5.0; points.place_of.len()]);
    app.change_snapshot(|snapshot| snapshot.film = film.frames().clone());
    app.act(Action::Back);
    let (views, began) = (app.views(), Instant::now());
    while app.shown_past().is_none() {
        assert!(began.elapsed() < Duration::from_mins(1), "timed out");
        let view = views.borrow().clone();
        app.on_view(view);
    }
    for field in app.space().view.fields.iter() {
        let mut known = field.iter().filter(|value| value.is_finite()).peekable();
        assert!(known.peek().is_some() && known.all(|value| (value - 5.0).abs() < 0.01));
    }
    assert!(shown_by(&mut app, 120, 40).contains("update 1"));
}
