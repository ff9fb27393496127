//! The guided tour.

use ratatui::layout::Rect;

use super::*;
use crate::tui::app::ALL_STEPS as STEPS;
use crate::tui::layers::Overlay;
use gdg::bridge::{BridgePoint, SearchOutcome};
use gdg::engine::Networks;
use gdg::learn::{Policy, Scratch};
use gdg::map::builtin;
use gdg::viewer::{MazeView, OnArrival};

/// Networks that have learned this D.
struct Fake(fn(&[f32], &[f32]) -> f32);

impl Policy for Fake {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        let pairs = states.chunks_exact(2).zip(goals.chunks_exact(2));
        out.iter_mut().zip(pairs).for_each(|(out, (s, g))| *out = self.0(s, g));
    }

    fn actions(&self, _: &[f32], _: &[f32], out: &mut [f32], _: &mut Scratch) {
        out.fill(0.0);
    }
}

fn touring_app() -> App {
    let mut app = app_on(builtin("fourrooms").expect("a map"), Method::default());
    app.begin_tour();
    app
}

fn step(app: &App) -> Option<usize> {
    app.screen.tour.as_ref().map(|tour| tour.step)
}

fn advance(app: &mut App, by: Duration) {
    app.guide.advance(by, &mut app.scene, &mut app.screen, &mut app.link);
}

/// Lets the step reach its time limit.
fn time_out(app: &mut App) {
    advance(app, Duration::from_mins(1));
    advance(app, Duration::from_secs(1));
}

/// D that grows faster than the distance, so that every place between two others is a bridge.
fn squared(s: &[f32], g: &[f32]) -> f32 {
    ((s[0] - g[0]).powi(2) + (s[1] - g[1]).powi(2)) / 10.0
}

/// D without walls, and with a wall between left and right.
fn straight(s: &[f32], g: &[f32]) -> f32 {
    (s[0] - g[0]).abs().max((s[1] - g[1]).abs())
}

fn bent(s: &[f32], g: &[f32]) -> f32 {
    straight(s, g) + if (s[0] < 44.0) == (g[0] < 44.0) { 0.0 } else { 20.0 }
}

fn learn(app: &mut App, distance: fn(&[f32], &[f32]) -> f32) {
    let candidates = app.screen.snapshot.networks.candidates.clone();
    let networks = Arc::new(Networks { policy: Arc::new(Fake(distance)), candidates });
    app.screen.snapshot = Arc::new(Snapshot { networks, ..Snapshot::clone(&app.screen.snapshot) });
}

/// Updates the tour at once, without the time limits of its steps.
fn look(app: &mut App) {
    advance(app, Duration::from_millis(110));
}

/// Shows a bridge found by networks that agree with it.
fn find_bridge(app: &mut App) {
    let search = SearchOutcome {
        state: vec![10.0, 10.0],
        goal: vec![70.0, 20.0],
        found: Some(BridgePoint { point: vec![44.0, 20.0], gain: 10.0 }),
        ..SearchOutcome::default()
    };
    learn(app, squared);
    app.screen.snapshot = Arc::new(Snapshot {
        search: Some(Arc::new(search)),
        ..Snapshot::clone(&app.screen.snapshot)
    });
}

fn caption(app: &App) -> String {
    app.screen.tour.as_ref().expect("a tour").caption.text.clone()
}

#[test]
fn the_tour_runs_through_and_leaves_everything_as_it_was() {
    let mut app = app_on(builtin("fourrooms").expect("a map"), Method::default());
    let (map, overlays) = (app.maze().map.clone(), app.screen.overlays);
    app.begin_tour();
    let mut closed = Vec::new();
    for (expected, step_shown) in STEPS.iter().enumerate() {
        assert_eq!(step(&app), Some(expected));
        if !app.maze().map.eq(&map) {
            closed.push(step_shown.title);
        }
        if expected == 3 {
            assert!(app.screen.overlays.has(Overlay::Search));
        }
        time_out(&mut app);
    }
    assert_eq!(closed, ["A door closes"]);
    assert_eq!(step(&app), None, "the last step ends too");
    assert_eq!((app.maze().map.free(), app.screen.overlays), (map.free(), overlays));
    assert_eq!(app.screen.on_arrival, OnArrival::Again);
    let trained = |app: &App| app.drawn_map().free() == map.free();
    wait_until(&mut app, trained);
    assert!(app.screen.snapshot.phase.is_training());
}

#[test]
fn steps_wait_until_what_they_explain_is_seen() {
    let mut app = touring_app();
    press(&mut app, KeyCode::Enter);
    let seen = |app: &App| app.screen.tour.as_ref().expect("a tour").caption.seen;
    learn(&mut app, straight);
    look(&mut app);
    assert!(!seen(&app), "it knows of no wall");
    learn(&mut app, |s, g| 3.0 * straight(s, g));
    look(&mut app);
    assert!(!seen(&app), "it is wrong everywhere");
    learn(&mut app, bent);
    look(&mut app);
    assert!(seen(&app) && caption(&app).contains("D = 36. D has learned"), "{}", caption(&app));
    advance(&mut app, Duration::from_secs(8));
    advance(&mut app, Duration::from_millis(200));
    assert_eq!(step(&app), Some(2), "a while after it was seen");
}

#[test]
fn a_bridge_is_explained_by_its_distances_and_stays() {
    let mut app = touring_app();
    (0..3).for_each(|_| press(&mut app, KeyCode::Right));
    assert!(caption(&app).contains("Wait for a find"));
    find_bridge(&mut app);
    look(&mut app);
    // In squared distances, 126 + 68 < 370.
    assert!(
        caption(&app).contains("was 126 + 68 = 194, less than D(a,g) = 370"),
        "{}",
        caption(&app)
    );
    let explained = app.screen.search().cloned();
    app.screen.snapshot =
        Arc::new(Snapshot { search: None, ..Snapshot::clone(&app.screen.snapshot) });
    look(&mut app);
    assert_eq!(app.screen.search().cloned(), explained, "later searches do not replace it");
    press(&mut app, KeyCode::Enter);
    assert!(app.screen.search().is_none());
}

#[test]
fn clicks_and_keys_move_on_and_esc_ends() {
    let mut app = touring_app();
    draw(&mut app, 80, 24);
    let goal = app.maze().goal;
    let at = character_of(&app, Cell::new(10, 80));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    assert_eq!((step(&app), app.maze().goal), (Some(1), goal), "the click sets no goal");
    (0..4).for_each(|_| press(&mut app, KeyCode::Enter));
    assert_eq!(step(&app), Some(5));
    assert!(app.maze().map.free_count() < builtin("fourrooms").expect("a map").free_count());
    press(&mut app, KeyCode::Esc);
    assert_eq!(step(&app), None);
    assert_eq!(
        app.maze().map.free(),
        builtin("fourrooms").expect("a map").free(),
        "the door is open"
    );
}

#[test]
fn the_last_click_sets_a_goal() {
    let mut app = touring_app();
    draw(&mut app, 80, 24);
    (1..STEPS.len()).for_each(|_| press(&mut app, KeyCode::Enter));
    let at = character_of(&app, Cell::new(10, 80));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    assert_eq!(step(&app), None);
    assert!(app.maze().goal.x < 14 && app.maze().goal.y > 76, "{:?}", app.maze().goal);
}

#[test]
fn a_pause_holds_training_and_tour() {
    for key in ['p', ' '] {
        let mut app = touring_app();
        press(&mut app, KeyCode::Char(key));
        time_out(&mut app);
        assert_eq!(step(&app), Some(0));
        wait_until(&mut app, |app| app.screen.snapshot.phase == Phase::Paused);
        press(&mut app, KeyCode::Char(key));
        wait_until(&mut app, |app| app.screen.snapshot.phase.is_training());
        time_out(&mut app);
        assert_eq!(step(&app), Some(1));
    }
}

#[test]
fn the_tour_is_found_by_many_words_and_starts_its_own_run() {
    let mut app = app();
    for words in ["tutorial", "demo", "introduction", "guide", "tour"] {
        type_text(&mut app, &format!(":{words}"));
        let Some(Dialog::Pick(picker)) = app.screen.dialogs.last() else {
            panic!("the list is open")
        };
        assert_eq!(
            picker.choice(),
            Some(&crate::tui::dialog::Choice::Act(Action::Tour)),
            "{words}"
        );
        press(&mut app, KeyCode::Esc);
    }
    app.act(Action::Tour);
    press(&mut app, KeyCode::Char('y'));
    wait_until(&mut app, |app| app.screen.tour.is_some());
    assert_eq!((app.scene.title(&app.screen.snapshot), app.screen.run().seed), ("fourrooms", 0));
}

/// Draws the step and checks the box: within the map's pane, complete, and beside its subject.
fn check_box(app: &mut App, (width, height): (u16, u16)) {
    let terminal = draw(app, width, height);
    let tour = app.screen.tour.as_ref().expect("a tour");
    let (_, area) = app.screen.layout.tour.expect("a box");
    let frame = app.screen.layout.map.as_ref().expect("the map");
    let at = format!("{} at {width} x {height}", tour.title);
    assert_eq!(app.screen.layout.map_pane.union(area), app.screen.layout.map_pane, "{at}");
    for position in tour.caption.subject.iter().filter_map(|at| frame.character_of(*at)) {
        assert!(
            !area.contains(position),
            "{at}: {area:?} covers {position:?}\n{}",
            text(&terminal)
        );
    }
    let buffer = terminal.backend().buffer();
    let inner = Rect::new(area.x + 2, area.y + 1, area.width - 4, area.height - 2);
    let rows =
        inner.rows().map(|row| row.positions().map(|at| buffer[at].symbol()).collect::<String>());
    let shown = rows.flat_map(|row| row.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
    assert_eq!(shown.collect::<Vec<_>>().join(" "), tour.caption.text, "{at}");
    assert!(tour.caption.text.matches(". ").count() <= 4, "{at}: too long");
}

#[test]
fn captions_fit_and_never_cover_their_subject() {
    let routes = [
        vec![[20.0, 20.0], [44.0, 20.0], [68.0, 40.0], [68.0, 52.0], [80.5, 62.5]],
        vec![[12.0, 44.0], [30.0, 70.0], [44.0, 76.0], [80.5, 62.5]],
    ];
    for theme in [ThemeName::Dark, ThemeName::Mono] {
        for size in [(80, 24), (120, 40), (200, 60)] {
            let mut app = touring_app();
            if theme == ThemeName::Mono {
                app.screen.theme = Theme::new(theme, ColourDepth::Mono);
            }
            draw(&mut app, size.0, size.1);
            wait_until(&mut app, |app| app.maze().view.raster.is_some());
            for _ in STEPS {
                for route in &routes {
                    let view = MazeView {
                        path: route.clone(),
                        trail: vec![[5.0, 5.0]],
                        ..MazeView::clone(&app.maze().view)
                    };
                    app.maze_mut().view = Arc::new(view);
                    look(&mut app);
                    check_box(&mut app, size);
                }
                find_bridge(&mut app);
                look(&mut app);
                check_box(&mut app, size);
                app.act(Action::NextTourStep);
            }
        }
    }
}

#[test]
fn tiny_screens_do_without_a_caption() {
    let mut app = touring_app();
    for (width, height) in [(1, 1), (7, 3), (20, 6), (40, 10)] {
        draw(&mut app, width, height);
    }
    assert_eq!(step(&app), Some(0));
}
