//! The guided tour.

use super::*;
use crate::tui::choices::Overlay;
use crate::tui::session::ALL_STEPS as STEPS;
use gdg::bridge::Candidates;
use gdg::engine::Networks;
use gdg::env::Environment;
use gdg::learn::{Policy, Scratch};
use gdg::map::builtin;
use gdg::viewer::OnArrival;

struct Fake(fn(&[f32], &[f32]) -> f32);

impl Policy for Fake {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        let pairs = states.chunks_exact(2).zip(goals.chunks_exact(2));
        out.iter_mut().zip(pairs).for_each(|(out, (s, g))| *out = self.0(s, g));
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        let ahead = states.iter().zip(goals).map(|(s, g)| (g - s).clamp(-1.0, 1.0));
        out.iter_mut().zip(ahead).for_each(|(out, ahead)| *out = ahead);
    }
}

fn touring_app() -> App {
    let mut app = app_on(builtin("fourrooms").expect("a map"), Method::default());
    app.begin_tour();
    app
}

fn touring_still() -> Still {
    let mut app = still_on(builtin("fourrooms").expect("a map"), Method::default());
    draw(&mut app, 120, 40);
    app.begin_tour();
    app
}

fn step(app: &App) -> Option<usize> {
    app.screen.tour.as_ref().map(|tour| tour.step)
}

fn advance(app: &mut App, by: Duration) {
    let Session { guide, cx, .. } = &mut **app;
    guide.advance(by, cx);
}

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

/// Has networks of this D, an actor that walks straight on, and candidates in one room.
fn learn(app: &mut App, distance: fn(&[f32], &[f32]) -> f32) {
    let world = PointMaze::new(app.maze().map.clone(), 0);
    let mut candidates = Candidates::new(world.spec(), 1, &app.screen.run().settings.bridge);
    let in_room = |cell: &Cell| cell.x < 36 && cell.y < 36;
    for cell in app.maze().map.free_cells().filter(in_room).step_by(3) {
        candidates.visit(0, &cell.centre(), &cell.centre());
    }
    let (policy, candidates) = (Arc::new(Fake(distance)), Arc::new(candidates));
    let networks = Arc::new(Networks { policy, candidates });
    app.screen.snapshot = Arc::new(Snapshot { networks, ..Snapshot::clone(&app.screen.snapshot) });
    advance(app, Duration::from_millis(110));
}

fn caption(app: &App) -> String {
    app.screen.tour.as_ref().expect("a tour").caption.text.clone()
}

#[test]
fn the_tour_runs_through_and_leaves_everything_as_it_was() {
    let mut app = touring_app();
    let (map, overlays) = (app.maze().map.clone(), app.screen.overlays);
    let mut closed = Vec::new();
    for (expected, step_shown) in STEPS.iter().enumerate() {
        assert_eq!(step(&app), Some(expected));
        if !app.maze().map.eq(&map) {
            closed.push(step_shown.title);
        }
        for (width, height) in [(7, 3), (80, 24)] {
            draw(&mut app, width, height);
        }
        time_out(&mut app);
    }
    assert_eq!(closed, ["A door closes"]);
    assert_eq!(step(&app), None, "the last step ends too");
    assert_eq!((app.maze().map.free(), app.screen.overlays), (map.free(), overlays));
    assert_eq!(app.screen.on_arrival, OnArrival::Again);
    wait_until(&mut app, |app| app.drawn_map().free() == map.free());
    assert!(app.screen.snapshot.phase.is_training());
}

#[test]
fn steps_wait_until_what_they_explain_is_seen() {
    let mut app = touring_still();
    press(&mut app, KeyCode::Enter);
    let seen = |app: &App| app.screen.tour.as_ref().expect("a tour").caption.seen;
    learn(&mut app, straight);
    assert!(!seen(&app), "it knows of no wall");
    learn(&mut app, |s, g| 3.0 * straight(s, g));
    assert!(!seen(&app), "it is wrong everywhere");
    learn(&mut app, bent);
    assert!(seen(&app) && caption(&app).contains("D = 36. D has learned"), "{}", caption(&app));
    advance(&mut app, Duration::from_secs(8));
    advance(&mut app, Duration::from_millis(200));
    assert_eq!(step(&app), Some(2), "a while after it was seen");
}

#[test]
fn a_bridge_that_saves_much_is_found_drawn_and_walked() {
    let mut app = touring_still();
    (0..2).for_each(|_| press(&mut app, KeyCode::Enter));
    assert!(caption(&app).contains("Wait for a bridge"), "{}", caption(&app));
    learn(&mut app, squared);
    advance(&mut app, Duration::from_secs(1));
    let text = caption(&app);
    let digits = text.split(|c: char| !c.is_ascii_digit()).filter(|part| !part.is_empty());
    let numbers: Vec<f32> = digits.map(|number| number.parse().expect("a number")).collect();
    let [direct, first, second, sum, _] = numbers[..] else { panic!("{text}") };
    assert!(first + second == sum && sum <= 0.85 * direct && first.min(second) >= 0.2 * direct);
    assert_eq!(app.screen.field, Field::OverEach);
    let shown = app.screen.search().cloned().expect("the bridge is drawn");
    let bridge = shown.found.as_ref().expect("a bridge").point.clone();
    let by_d = |s: &[f32], g: &[f32]| squared(s, g).round();
    assert_eq!([by_d(&shown.state, &bridge), by_d(&bridge, &shown.goal)], [first, second]);
    assert!(app.screen.overlays.has(Overlay::Search));
    let terminal = draw(&mut app, 120, 40);
    let at = app.screen.layout.map.as_ref().expect("the map").character_of([bridge[0], bridge[1]]);
    assert_eq!(terminal.backend().buffer()[at.expect("it is on the screen")].symbol(), "B");
    let goal = Cell::new(shown.goal[0] as usize, shown.goal[1] as usize);
    assert_eq!(app.maze().goal, goal);
    assert!(caption(&app).contains("@ walks from S to G"), "{}", caption(&app));
    press(&mut app, KeyCode::Enter);
    assert!(app.screen.explained.is_none(), "the next step hides it");
}

#[test]
fn captions_cover_nothing_of_the_map() {
    let mut app = touring_still();
    learn(&mut app, squared);
    for (step, of) in STEPS.iter().enumerate() {
        for (width, height) in [(60, 20), (80, 24), (120, 40)] {
            let terminal = draw(&mut app, width, height);
            let (buffer, map) = (terminal.backend().buffer(), app.screen.layout.map_pane);
            let rows = |area: Rect| -> String {
                area.positions().map(|at| buffer[at].symbol()).collect::<String>()
            };
            let title = format!("{}/{} {}", step + 1, STEPS.len(), of.title);
            assert!(rows(buffer.area).contains(&title) && !rows(map).contains(&title), "{title}");
        }
        press(&mut app, KeyCode::Enter);
    }
}

#[test]
fn clicks_and_keys_move_on_and_esc_ends() {
    for ending_step in [2, 4] {
        let mut app = touring_still();
        let (overlays, goal, map) =
            (app.screen.overlays, app.maze().goal, app.maze().map.free_count());
        let at = character_of(&app, Cell::new(10, 80));
        click(&mut app, MouseButton::Left, at);
        assert_eq!((step(&app), app.maze().goal), (Some(1), goal), "the click sets no goal");
        (1..ending_step).for_each(|_| press(&mut app, KeyCode::Enter));
        assert_eq!(step(&app), Some(ending_step));
        assert_eq!(app.maze().map.free_count() < map, ending_step == 4, "a door");
        press(&mut app, KeyCode::Esc);
        assert_eq!((step(&app), app.screen.field), (None, Field::Learned));
        assert_eq!((app.screen.overlays, app.maze().map.free_count()), (overlays, map));
    }
    let mut app = touring_still();
    (1..STEPS.len()).for_each(|_| press(&mut app, KeyCode::Enter));
    let at = character_of(&app, Cell::new(10, 80));
    click(&mut app, MouseButton::Left, at);
    assert_eq!(step(&app), None, "the last click sets a goal");
    assert!(app.maze().goal.x < 14 && app.maze().goal.y > 76, "{:?}", app.maze().goal);
}

#[test]
fn a_pause_holds_training_and_tour() {
    let mut app = touring_still();
    for waits in [true, false] {
        press(&mut app, KeyCode::Char(' '));
        app.obey();
        time_out(&mut app);
        assert_eq!(app.screen.snapshot.phase.is_training(), !waits);
        assert_eq!(step(&app), Some(usize::from(!waits)));
    }
}
