//! Tests of looking back in time.

use super::staged::staged_app;
use super::*;
use crate::tui::export::{contents, name};
use crate::tui::output::ExportKind;
use crate::tui::panes::Pane;
use gdg::env::FetchReach;
use gdg::train::{Film, FilmFrame};
use gdg::viewer::maze::FilmedMap;
use gdg::viewer::{MazeView, View};

/// Returns a film on the rooms map: distances grow with the updates.
pub(super) fn film(app: &App, updates: &[u64]) -> Arc<Vec<Arc<FilmFrame>>> {
    let (mut world, mut film) = (PointMaze::new(app.maze().map.clone(), 2), Film::default());
    world.set_full_state(0, &[3.5, 3.5]);
    world.set_full_state(1, &[14.5, 1.5]);
    let points = film.points(&world).expect("points");
    let (states, _) = points.states.as_chunks::<2>();
    for updates in updates {
        let share = *updates as f32 / 10_000.0;
        let distance = |at: &[f32; 2]| {
            30.0 * (1.0 - share) + 3.0 * share * (at[0] - 19.5).abs().max((at[1] - 4.5).abs())
        };
        let distances: Vec<f32> = states.iter().map(distance).collect();
        film.add(*updates, 32 * updates, &world, &points, &distances);
    }
    film.frames().clone()
}

/// Returns an app in the middle of a run with a film of these updates.
pub(super) fn filmed_app(updates: &[u64], width: u16, height: u16) -> Still {
    let mut app = staged_app(width, height);
    let film = film(&app, updates);
    app.change_snapshot(|snapshot| snapshot.film = film);
    app
}

/// Shows what the viewer will compute for the selected moment.
fn stage_past(app: &mut App) {
    let frame = app.screen.past.clone().expect("the past is looked at");
    let raster = app.screen.layout.map.clone().expect("the map is drawn").raster;
    let field = FilmedMap::new(app.maze().map.clone()).field(&frame, raster);
    let view = MazeView {
        farthest: frame.farthest(),
        field: Arc::new(field),
        raster: Some(raster),
        past: Some(frame),
        ..(*app.maze().view).clone()
    };
    app.on_view(View::Maze(Arc::new(view)));
}

fn shown_update(app: &App) -> Option<u64> {
    app.screen.past.as_ref().map(|frame| frame.updates)
}

#[test]
fn a_frame_that_has_been_dropped_meanwhile_is_left_in_both_directions() {
    let mut app = filmed_app(&[1, 2_500, 5_000, 7_500], 80, 24);
    press(&mut app, KeyCode::Char('['));
    press(&mut app, KeyCode::Char('['));
    assert_eq!(shown_update(&app), Some(5_000));
    let film = film(&app, &[1, 2_500, 7_500]);
    app.change_snapshot(|snapshot| snapshot.film = film);
    assert_eq!(shown_update(&app), Some(5_000), "it stays while it is looked at");
    press(&mut app, KeyCode::Char('['));
    assert_eq!(shown_update(&app), Some(2_500));
    press(&mut app, KeyCode::Char(']'));
    assert_eq!(shown_update(&app), Some(7_500));
}

#[test]
fn the_past_shows_its_agents_and_its_goal_and_nothing_of_the_present() {
    let mut app = filmed_app(&[1, 2_500, 5_000], 80, 24);
    app.screen.field = Field::Visits;
    app.set_goal(Cell::new(3, 1));
    let present = shown_by(&mut app, 80, 24);
    assert!(present.contains('@') && present.contains('S'));
    press(&mut app, KeyCode::Char('['));
    stage_past(&mut app);
    let terminal = draw(&mut app, 80, 24);
    let past = text(&terminal);
    assert!(past.contains("update 5,000: G is the film's"), "{past}");
    assert!(past.contains("D to G"), "of the past, there is only D: {past}");
    let goal = character_of(&app, Cell::new(19, 4));
    let buffer = terminal.backend().buffer();
    assert_eq!(buffer[goal].symbol(), "G", "the goal of the film");
    assert_ne!(buffer[character_of(&app, Cell::new(3, 1))].symbol(), "G");
    assert!(
        !app.screen
            .layout
            .map
            .as_ref()
            .is_none_or(|frame| frame.area.positions().any(|at| buffer[at].symbol() == "@"))
    );
}

#[test]
fn whatever_is_about_the_present_returns_to_it() {
    let mut app = filmed_app(&[1, 2_500], 80, 24);
    for action in
        [Action::NewGoal, Action::Field(true), Action::ToggleEdit, Action::NewStart, Action::Follow]
    {
        app.act(Action::Back);
        assert!(shown_update(&app).is_some(), "{action:?}");
        app.act(action);
        assert_eq!(shown_update(&app), None, "{action:?}");
        press(&mut app, KeyCode::Esc);
    }
    app.act(Action::Back);
    let at = character_of(&app, Cell::new(3, 1));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    assert_eq!((shown_update(&app), app.maze().goal), (None, Cell::new(3, 1)));
    app.act(Action::Back);
    app.act(Action::ZoomIn);
    assert!(shown_update(&app).is_some(), "zooming in does not");
}

#[test]
fn a_click_on_the_curves_goes_to_that_update() {
    let mut app = filmed_app(&[1, 2_500, 5_000, 7_500], 120, 40);
    app.screen.pane = Pane::Curves;
    draw(&mut app, 120, 40);
    let charts = app.screen.layout.charts.clone();
    assert!(!charts.is_empty());
    for chart in charts {
        let ratatui::layout::Rect { x, y, width, .. } = chart.area;
        for (share, expected) in [(0, 1), (1, 2_500), (2, 5_000), (3, 7_500), (4, 7_500)] {
            let at = Position::new(x + (width - 1) * share / 4, y + 1);
            mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
            assert_eq!(shown_update(&app), Some(expected), "{share} quarters of {chart:?}");
        }
    }
}

#[test]
fn the_film_is_exported_from_any_moment() {
    let mut app = filmed_app(&[1, 2_500], 80, 24);
    press(&mut app, KeyCode::Char('['));
    let bytes = contents(ExportKind::Film, &mut app.app.screen, &app.app.scene).expect("a film");
    let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    assert_eq!(reader.info().animation_control().expect("an animation").num_frames, 2);
    let bytes = contents(ExportKind::Still, &mut app.app.screen, &app.app.scene).expect("a map");
    let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    assert!(reader.info().animation_control().is_none() && reader.info().width == 1_600);
}

#[test]
fn pictures_of_the_past_are_named_and_described_by_what_they_show() {
    let mut app = filmed_app(&[1, 2_500, 5_000], 120, 40);
    app.change_snapshot(|snapshot| snapshot.edits = Arc::new(vec![2_500]));
    for (updates, is_edited) in [(5_000, false), (2_500, true)] {
        press(&mut app, KeyCode::Char('['));
        stage_past(&mut app);
        assert_eq!(shown_by(&mut app, 120, 40).contains("walls of today"), is_edited);
        let App { screen, scene, .. } = &mut app.app;
        assert!(name(ExportKind::MapSvg, screen, scene).ends_with(&format!("-{updates}")));
        let bytes = contents(ExportKind::MapSvg, screen, scene).expect("a picture");
        // Each character is an element of its own, and blanks are none.
        let picture = String::from_utf8(bytes).expect("text");
        let picture: String = picture.lines().filter(|line| !line.starts_with('<')).collect();
        assert!(picture.contains(&format!("update{}", gdg::text::grouped(updates))), "{picture}");
        assert!(!picture.contains("Escnow"), "keys are left out: {picture}");
    }
}

#[test]
fn the_viewer_shows_the_past_while_training_goes_on() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.film.len() > 1 && app.maze().view.raster.is_some()
    });
    type_text(&mut app, "[[");
    assert_eq!(shown_update(&app), Some(1));
    wait_until(&mut app, |app| app.shown_past().is_some());
    let field = app.maze().view.field.clone();
    assert!(field.iter().any(|value| value.is_finite()));
    let updates = app.screen.snapshot.counters.updates;
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > updates + 20);
    assert!(Arc::ptr_eq(&field, &app.maze().view.field), "the past does not change");
    // A frozen screen does not change, but one can look back.
    press(&mut app, KeyCode::Char('F'));
    let updates = app.screen.snapshot.counters.updates;
    press(&mut app, KeyCode::Char(']'));
    wait_until(&mut app, |app| app.shown_past().is_some_and(|frame| frame.updates > 1));
    assert_eq!(app.screen.snapshot.counters.updates, updates);
    press(&mut app, KeyCode::Esc);
    wait_until(&mut app, |app| {
        app.shown_past().is_none() && app.screen.snapshot.counters.updates > updates
    });
}

#[test]
fn the_past_of_an_arm_is_a_field_through_its_goal() {
    let world = FetchReach::new(None, 0);
    let mut app = app_in(&world, gdg(), Limits { updates: Some(0), ..Limits::default() }, None);
    draw(&mut app, 120, 40);
    let (world, mut film) = (FetchReach::new(None, 3), Film::default());
    let points = film.points(&world).expect("points");
    film.add(1, 8, &world, &points, &vec![5.0; points.place_of.len()]);
    let film = film.frames().clone();
    app.change_snapshot(|snapshot| snapshot.film = film);
    app.act(Action::Back);
    let views = app.views();
    let began = Instant::now();
    while app.shown_past().is_none() {
        assert!(began.elapsed() < Duration::from_mins(1), "timed out");
        std::thread::sleep(Duration::from_millis(5));
        let view = views.borrow().clone();
        app.on_view(view);
    }
    let fields = app.arm().view.fields.clone();
    assert_eq!(fields.len(), app.screen.layout.projections.len());
    for field in fields.iter() {
        let known: Vec<f32> = field.iter().copied().filter(|value| value.is_finite()).collect();
        assert!(!known.is_empty() && known.iter().all(|value| (value - 5.0).abs() < 0.01));
    }
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("update 1") && !shown.contains('@'), "{shown}");
}
