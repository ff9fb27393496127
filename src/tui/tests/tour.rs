//! The guided tour.

use super::*;
use crate::tui::layers::Overlay;
use crate::tui::session::ALL_STEPS as STEPS;
use gdg::bridge::Candidates;
use gdg::engine::Networks;
use gdg::env::Environment;
use gdg::learn::{Policy, Scratch};
use gdg::map::builtin;
use gdg::viewer::OnArrival;

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

fn learn(app: &mut App, distance: fn(&[f32], &[f32]) -> f32) {
    let candidates = app.screen.snapshot.networks.candidates.clone();
    set_networks(app, distance, candidates);
}

fn set_networks(app: &mut App, distance: fn(&[f32], &[f32]) -> f32, candidates: Arc<Candidates>) {
    let networks = Arc::new(Networks { policy: Arc::new(Fake(distance)), candidates });
    app.screen.snapshot = Arc::new(Snapshot { networks, ..Snapshot::clone(&app.screen.snapshot) });
}

/// Has networks of this D, and candidates all over the map.
fn learn_everywhere(app: &mut App, distance: fn(&[f32], &[f32]) -> f32) {
    let world = PointMaze::new(app.maze().map.clone(), 0);
    let mut candidates = Candidates::new(world.spec(), 1, &app.screen.run().settings.bridge);
    for cell in app.maze().map.free_cells().step_by(3) {
        candidates.visit(0, &cell.centre(), &cell.centre());
    }
    assert!(candidates.len() > 100, "{}", candidates.len());
    set_networks(app, distance, Arc::new(candidates));
}

/// Waits until the step has found a bridge, by networks in which there are many.
fn find_bridge(app: &mut App) {
    learn_everywhere(app, squared);
    let began = Instant::now();
    while caption(app).contains("Wait for a bridge") {
        assert!(began.elapsed() < Duration::from_secs(20), "no bridge is found");
        std::thread::sleep(Duration::from_millis(20));
        advance(app, Duration::from_millis(101));
    }
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
        for (width, height) in [(7, 3), (80, 24)] {
            draw(&mut app, width, height);
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

/// A walk may last longer than the rest.
#[test]
fn the_agent_rests_where_it_arrives_before_it_walks_again() {
    let mut app = still_on(builtin("fourrooms").expect("a map"), Method::default());
    app.begin_tour();
    let sent = |app: &Still| {
        let is_start = |request: &Request| matches!(request, Request::Start(_));
        app.requests.try_iter().filter(is_start).count()
    };
    assert_eq!(sent(&app), 1);
    advance(&mut app, Duration::from_secs(4));
    app.change_view(|view| view.reach.arrived = true);
    for (millis, expected) in [(200, 0), (1_500, 0), (700, 1)] {
        advance(&mut app, Duration::from_millis(millis));
        assert_eq!(sent(&app), expected, "after {millis} ms more");
    }
}

#[test]
fn steps_wait_until_what_they_explain_is_seen() {
    let mut app = touring_app();
    press(&mut app, KeyCode::Enter);
    let seen = |app: &App| app.screen.tour.as_ref().expect("a tour").caption.seen;
    learn(&mut app, straight);
    advance(&mut app, Duration::from_millis(110));
    assert!(!seen(&app), "it knows of no wall");
    learn(&mut app, |s, g| 3.0 * straight(s, g));
    advance(&mut app, Duration::from_millis(110));
    assert!(!seen(&app), "it is wrong everywhere");
    learn(&mut app, bent);
    advance(&mut app, Duration::from_millis(110));
    assert!(seen(&app) && caption(&app).contains("D = 36. D has learned"), "{}", caption(&app));
    advance(&mut app, Duration::from_secs(8));
    advance(&mut app, Duration::from_millis(200));
    assert_eq!(step(&app), Some(2), "a while after it was seen");
}

fn numbers(text: &str) -> Vec<f32> {
    let digits = text.split(|c: char| !c.is_ascii_digit()).filter(|part| !part.is_empty());
    digits.map(|number| number.parse().expect("a number")).collect()
}

#[test]
fn a_bridge_that_saves_much_is_found_drawn_and_walked() {
    let mut app = touring_app();
    draw(&mut app, 120, 40);
    (0..3).for_each(|_| press(&mut app, KeyCode::Right));
    assert!(caption(&app).contains("Wait for a bridge"), "{}", caption(&app));
    find_bridge(&mut app);
    let [direct] = numbers(&caption(&app))[..] else { panic!("{}", caption(&app)) };
    assert_eq!(app.screen.field, Field::FromStart, "first D from the start");
    press(&mut app, KeyCode::Right);
    assert_eq!(app.screen.field, Field::OverEach, "then over each place to the goal");
    let [first, second, sum, direct_again] = numbers(&caption(&app))[..] else {
        panic!("{}", caption(&app))
    };
    assert_eq!((first + second, direct), (sum, direct_again));
    assert!(sum <= 0.85 * direct && first.min(second) >= 0.2 * direct, "{}", caption(&app));
    let shown = app.screen.search().cloned().expect("the bridge is drawn");
    let bridge = shown.found.as_ref().expect("a bridge").point.clone();
    let by_d = |s: &[f32], g: &[f32]| squared(s, g).round();
    assert_eq!([by_d(&shown.state, &bridge), by_d(&bridge, &shown.goal)], [first, second]);
    assert!(app.screen.overlays.has(Overlay::Search));
    let terminal = draw(&mut app, 120, 40);
    let at = app.screen.layout.map.as_ref().expect("the map").character_of([bridge[0], bridge[1]]);
    assert_eq!(terminal.backend().buffer()[at.expect("it is on the screen")].symbol(), "B");
    press(&mut app, KeyCode::Right);
    assert!(caption(&app).contains("@ walks from S to G"), "{}", caption(&app));
    assert_eq!(app.screen.field, Field::Learned, "D to the goal again");
    let goal = Cell::new(shown.goal[0] as usize, shown.goal[1] as usize);
    let start = [shown.state[0], shown.state[1]];
    assert_eq!(app.maze().goal, goal);
    wait_until(&mut app, |app| {
        app.maze().view.reach.start == start && app.maze().view.reach.steps > 0
    });
    press(&mut app, KeyCode::Enter);
    assert!(app.screen.search().is_none_or(|search| *search != shown), "the next step hides it");
}

#[test]
fn clicks_and_keys_move_on_and_esc_ends() {
    let map = builtin("fourrooms").expect("a map");
    for ending_step in [3, 7] {
        let mut app = touring_app();
        let overlays = app.screen.overlays;
        draw(&mut app, 80, 24);
        let goal = app.maze().goal;
        let at = character_of(&app, Cell::new(10, 80));
        mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
        assert_eq!((step(&app), app.maze().goal), (Some(1), goal), "the click sets no goal");
        (1..ending_step).for_each(|_| press(&mut app, KeyCode::Enter));
        assert_eq!(step(&app), Some(ending_step));
        assert_eq!(app.maze().map.free_count() < map.free_count(), ending_step == 7, "a door");
        press(&mut app, KeyCode::Esc);
        assert_eq!((step(&app), app.screen.field), (None, Field::Learned));
        assert_eq!((app.screen.overlays, app.maze().map.free()), (overlays, map.free()));
    }
    let mut app = touring_app();
    draw(&mut app, 80, 24);
    (1..STEPS.len()).for_each(|_| press(&mut app, KeyCode::Enter));
    let at = character_of(&app, Cell::new(10, 80));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    assert_eq!(step(&app), None, "the last click sets a goal");
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
fn the_tour_starts_its_own_run() {
    let mut app = app();
    app.act(Action::Tour);
    press(&mut app, KeyCode::Char('y'));
    wait_until(&mut app, |app| app.screen.tour.is_some());
    assert_eq!((app.scene.title(&app.screen.snapshot), app.screen.run().seed), ("fourrooms", 0));
}
