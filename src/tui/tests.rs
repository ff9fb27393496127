//! The screen on a buffer instead of a terminal.

use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::{Position, Rect};
use ratatui::style::Color;

use super::action::BINDINGS;
use super::app::App;
use super::colour::Depth;
use super::raster::MapFrame;
use super::render;
use super::viewer::{Layer, Viewer};
use crate::cli::Cli;
use crate::map::{Cell, Grid, parse_map};
use crate::train::{Engine, Limits, Method, Phase, Preset, Run, Settings, Trainer};

const ROOMS: &str = "\
..........#.........
..........#.........
....................
..........#.........
..........#........G
";

fn app_on(map: Grid, method: Method) -> App {
    let mut settings = Settings::default();
    settings.learn.hidden = 16;
    settings.learn.replay_capacity = 20_000;
    settings.bridge.candidates = 40;
    let run = Run { method, preset: Preset::Default, seed: 1, settings };
    let trainer = Trainer::new(run, Arc::new(map), 1).expect("a trainer");
    let engine = Engine::start(trainer, 30, Limits::default()).expect("an engine");
    let viewer = Viewer::start(&engine).expect("a viewer");
    let args = Cli::parse_from(["gdg-tui"]).train;
    let mut app = App::new(engine, viewer, &args);
    app.depth = Depth::True;
    app
}

fn app() -> App {
    app_on(parse_map("rooms", ROOMS.as_bytes()).expect("a map"), Method::GdgBridge)
}

fn draw(app: &mut App, width: u16, height: u16) -> Terminal<TestBackend> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a buffer");
    terminal.draw(|frame| render::draw(frame, app)).expect("a frame");
    terminal
}

fn text(terminal: &Terminal<TestBackend>) -> String {
    let buffer = terminal.backend().buffer();
    let width = usize::from(buffer.area.width);
    let rows =
        buffer.content.chunks(width).map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>());
    rows.collect::<Vec<_>>().join("\n")
}

fn press(app: &mut App, code: KeyCode) {
    app.on_event(&Event::Key(KeyEvent::new(code, KeyModifiers::NONE)));
}

/// Takes what engine and viewer publish until `is` holds.
fn wait_until(app: &mut App, is: impl Fn(&App) -> bool) {
    let (snapshots, views) = (app.snapshots(), app.views());
    let began = Instant::now();
    while !is(app) {
        assert!(began.elapsed() < Duration::from_secs(60), "it did not come about");
        std::thread::sleep(Duration::from_millis(5));
        let (snapshot, view) = (snapshots.borrow().clone(), views.borrow().clone());
        app.on_snapshot(snapshot);
        app.on_view(view);
    }
}

#[test]
fn every_size_can_be_drawn() {
    let mut app = app();
    for (width, height) in
        [(1, 1), (2, 1), (1, 9), (7, 3), (40, 10), (69, 12), (80, 24), (120, 40), (200, 60), (400, 120)]
    {
        for help in [false, true] {
            app.show_help = help;
            draw(&mut app, width, height);
        }
    }
}

#[test]
fn maps_of_every_shape_can_be_drawn() {
    for (width, height) in [(1, 1), (300, 1), (1, 300), (256, 256)] {
        let map = parse_map("shape", format!("{}\n", ".".repeat(width)).repeat(height).as_bytes()).expect("a map");
        let mut app = app_on(map, Method::Gdg);
        for (columns, rows) in [(80, 24), (30, 5), (200, 60)] {
            draw(&mut app, columns, rows);
            app.on_event(&Event::Mouse(MouseEvent {
                kind: MouseEventKind::Down(MouseButton::Left),
                column: columns / 2,
                row: rows / 2,
                modifiers: KeyModifiers::NONE,
            }));
        }
    }
}

#[test]
fn the_screen_of_80_by_24_shows_all_that_matters() {
    let mut app = app();
    wait_until(&mut app, |app| app.snapshot.counters.updates > 0);
    let shown = text(&draw(&mut app, 80, 24));
    for part in ["gdg-tui", "rooms", "gdg-bridge", "training", "elapsed", "updates", "success", "walk", "bridges"] {
        assert!(shown.contains(part), "{part} is missing:\n{shown}");
    }
    for binding in BINDINGS.iter().filter(|b| !b.short.is_empty()) {
        assert!(shown.contains(binding.short), "{} is missing:\n{shown}", binding.short);
    }
}

#[test]
fn the_help_fits_80_by_24_and_lists_every_action() {
    let mut app = app();
    press(&mut app, KeyCode::Char('?'));
    let shown = text(&draw(&mut app, 80, 24));
    for binding in BINDINGS.iter().filter(|b| !b.long.is_empty()) {
        assert!(shown.contains(binding.long), "{} is missing:\n{shown}", binding.long);
    }
    for sign in ["the goal", "walks there", "path it plans", "explore", "bridge candidates"] {
        assert!(shown.contains(sign), "{sign} is missing:\n{shown}");
    }
    press(&mut app, KeyCode::Esc);
    assert!(!app.show_help);
}

#[test]
fn no_key_stands_for_two_actions() {
    let keys: Vec<_> = BINDINGS.iter().flat_map(|b| b.keys).collect();
    for (i, key) in keys.iter().enumerate() {
        assert!(!keys[..i].contains(key), "{key:?} is bound twice");
    }
}

#[test]
fn arrows_move_the_goal_and_jump_over_walls() {
    let mut app = app();
    assert_eq!(app.goal, Cell::new(19, 4), "the map's own goal");
    for _ in 0..9 {
        press(&mut app, KeyCode::Left);
    }
    assert_eq!(app.goal, Cell::new(9, 4), "over the wall at column 10");
    press(&mut app, KeyCode::Down);
    assert_eq!(app.goal, Cell::new(9, 4), "the map ends here");
    press(&mut app, KeyCode::Char('k'));
    assert_eq!(app.goal, Cell::new(9, 3));
}

#[test]
fn a_click_puts_the_goal_where_it_is_drawn() {
    let mut app = app();
    for (width, height) in [(80, 24), (200, 60)] {
        let before = draw(&mut app, width, height);
        let buffer = before.backend().buffer();
        let (column, row) = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .find(|(x, y)| buffer[(*x, *y)].symbol() == "\u{2580}")
            .expect("the map is drawn");
        let kind = MouseEventKind::Down(MouseButton::Left);
        app.on_event(&Event::Mouse(MouseEvent { kind, column, row, modifiers: KeyModifiers::NONE }));
        assert_eq!(app.goal, Cell::new(0, 0), "at {width} x {height}");
        press(&mut app, KeyCode::Right);
    }
}

#[test]
fn the_field_is_light_at_the_goal_and_dark_far_away() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| app.snapshot.counters.updates > 3_000 && !app.view.field.is_empty());
    let field = app.view.field.clone();
    let raster = app.view.raster.expect("a raster");
    assert_eq!(field.len(), raster.pixels.0 * raster.pixels.1);
    // The goal is in the lower right corner, the wall in the middle.
    let at = |position: [f32; 2]| {
        let (column, row) = raster.pixel_of(position).expect("on the map");
        field[row * raster.pixels.0 + column]
    };
    let (near, far) = (at([18.5, 4.5]), at([1.5, 0.5]));
    assert!(near.is_finite() && far.is_finite() && near < far, "{near} and {far}");
    assert!(field.iter().any(|d| d.is_nan()), "walls have no distance");
}

#[test]
fn other_distances_can_be_shown() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| app.snapshot.counters.updates > 1_000 && app.view.edges.0 > 0);
    press(&mut app, KeyCode::Char('v'));
    assert!(text(&draw(&mut app, 80, 24)).contains("D by the graph"));
    wait_until(&mut app, |app| app.view.layer == Layer::Composed && !app.view.field.is_empty());
    press(&mut app, KeyCode::Char('v'));
    wait_until(&mut app, |app| app.view.layer == Layer::True && !app.view.field.is_empty());
    let (field, raster) = (app.view.field.clone(), app.view.raster.expect("a raster"));
    let (column, row) = raster.pixel_of([0.5, 4.5]).expect("on the map");
    assert_eq!(field[row * raster.pixels.0 + column], 19.0, "from the left to the goal in the lower right corner");
    press(&mut app, KeyCode::Char('v'));
    assert_eq!(app.layer, Layer::Learned);
}

#[test]
fn a_door_can_be_closed_while_it_trains_and_opened_again() {
    let mut app = app();
    let door = Cell::new(10, 2);
    let frame = {
        draw(&mut app, 80, 24);
        wait_until(&mut app, |app| app.snapshot.counters.updates > 50);
        MapFrame::fit(Rect::new(0, 1, 50, 22), app.map()).expect("it fits")
    };
    let at = (frame.area.y..frame.area.bottom())
        .flat_map(|row| (frame.area.x..frame.area.right()).map(move |column| Position::new(column, row)))
        .filter(|at| frame.cells_at(*at, app.map()).contains(&door));
    let at: Vec<Position> = at.collect();
    let mouse = |app: &mut App, kind, at: Position| {
        app.on_event(&Event::Mouse(MouseEvent { kind, column: at.x, row: at.y, modifiers: KeyModifiers::NONE }));
    };
    press(&mut app, KeyCode::Char('e'));
    assert!(text(&draw(&mut app, 80, 24)).contains("EDIT"));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at[0]);
    at.iter().for_each(|at| mouse(&mut app, MouseEventKind::Drag(MouseButton::Left), *at));
    assert_eq!(app.editor.stroke().map(|(cells, free)| (cells.contains(&door), free)), Some((true, false)));
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), at[0]);
    assert!(!app.map().is_free(door), "the door is closed");
    wait_until(&mut app, |app| !app.snapshot.map.is_free(door));
    assert!(app.notice().is_some_and(|n| n.contains("walled") && n.contains("2 pieces")), "{:?}", app.notice());
    let updates = app.snapshot.counters.updates;
    wait_until(&mut app, |app| app.snapshot.counters.updates > updates);
    press(&mut app, KeyCode::Char('u'));
    wait_until(&mut app, |app| app.snapshot.map.is_free(door));
    app.on_event(&Event::Key(KeyEvent::new(KeyCode::Char('r'), KeyModifiers::CONTROL)));
    wait_until(&mut app, |app| !app.snapshot.map.is_free(door));
    press(&mut app, KeyCode::Char('u'));
    // By keyboard alone: from the goal, where the cursor begins.
    assert_eq!(app.editor.cursor, Some(Cell::new(19, 4)));
    (0..9).for_each(|_| press(&mut app, KeyCode::Left));
    press(&mut app, KeyCode::Char('x'));
    wait_until(&mut app, |app| app.snapshot.map.is_free(Cell::new(10, 4)));
    press(&mut app, KeyCode::Esc);
    assert!(!app.editor.is_open());
    assert_eq!(app.goal, Cell::new(19, 4), "the goal stayed where it was");
}

#[test]
fn space_pauses_and_goes_on() {
    let mut app = app();
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| app.snapshot.phase == Phase::Paused);
    assert!(text(&draw(&mut app, 80, 24)).contains("paused"));
    let updates = app.snapshot.counters.updates;
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| app.snapshot.phase == Phase::Running && app.snapshot.counters.updates > updates);
}

#[test]
fn without_colours_nothing_is_coloured_and_walls_can_be_told_from_floor() {
    let mut app = app();
    app.depth = Depth::Mono;
    let terminal = draw(&mut app, 80, 24);
    let plain = |colour: Color| colour == Color::Reset;
    assert!(terminal.backend().buffer().content.iter().all(|c| plain(c.fg) && plain(c.bg)));
    assert!(text(&terminal).contains('#'));
}
