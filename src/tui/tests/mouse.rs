//! The mouse, apart from setting goals: keys in the footer, names, lists, zooming, panning, and editing.

use super::*;
use crate::tui::choices::{Overlay, Pane};

fn click_on(app: &mut impl Driven, (width, height): (u16, u16), text: &str) {
    let at = place_of(&shown_by(app, width, height), text);
    click(app, MouseButton::Left, at);
}

const SMALL: (u16, u16) = (80, 24);

#[test]
fn clicks_reach_what_is_on_top_and_nothing_else() {
    let mut app = still();
    click_on(&mut app, SMALL, "legend");
    click_on(&mut app, SMALL, "bridge edges");
    assert!(app.screen.overlays.has(Overlay::Edges));
    // Clicks on a maximised pane do not reach the map.
    let goal = app.maze().goal;
    press(&mut app, KeyCode::Char('z'));
    draw(&mut app, 80, 24);
    click(&mut app, MouseButton::Left, Position::new(20, 12));
    assert_eq!(app.maze().goal, goal);
    press(&mut app, KeyCode::Char('z'));
    // With a second pane below, clicking its title selects it.
    click_on(&mut app, (120, 40), "\u{250c} train");
    assert_eq!(app.screen.pane, Pane::Training);
    app.act(Action::Method);
    draw(&mut app, 80, 24);
    click(&mut app, MouseButton::Left, Position::new(0, 23));
    assert!(app.screen.dialogs.is_empty(), "a click outside closes a dialog");
    assert!(!app.maze().editor.is_open(), "and does nothing else");
}

fn wide() -> App {
    let map =
        parse_map("wide", format!("{}\n", ".".repeat(200)).repeat(120).as_bytes()).expect("a map");
    let mut app = app_on(map, gdg());
    draw(&mut app, 80, 24);
    app
}

fn turn_wheel(app: &mut App, at: Position, times: usize) {
    for _ in 0..times {
        mouse(app, MouseEventKind::ScrollUp, at);
        draw(app, 80, 24);
    }
}

#[test]
fn zooming_keeps_the_place_under_the_mouse_and_can_be_reset() {
    let mut app = wide();
    let cell = Cell::new(150, 90);
    let at = character_of(&app, cell);
    turn_wheel(&mut app, at, 8);
    let frame = app.screen.layout.map.clone().expect("a map");
    let under = frame.cell_at(at, &app.maze().map).expect("on the map");
    assert!(under.x.abs_diff(cell.x) < 4 && under.y.abs_diff(cell.y) < 6, "{under:?}");
    let before = frame.raster.window;
    assert!(before[2] < 60.0, "{before:?}");
    press_with(&mut app, KeyCode::Left, KeyModifiers::SHIFT);
    assert!(window(&mut app)[0] < before[0], "panned to the left");
    for _ in 0..50 {
        press_with(&mut app, KeyCode::Up, KeyModifiers::SHIFT);
    }
    assert_eq!(window(&mut app)[1], 0.0, "not beyond the map");
    press(&mut app, KeyCode::Char('0'));
    assert!(window(&mut app)[2] >= 200.0);
}

fn window(app: &mut App) -> [f32; 4] {
    draw(app, 80, 24);
    app.screen.layout.map.clone().expect("a map").raster.window
}

#[test]
fn the_middle_button_and_the_minimap_pan_the_map() {
    let mut app = wide();
    let middle = Position::new(20, 12);
    turn_wheel(&mut app, middle, 6);
    let cell = app.screen.layout.map.clone().expect("a map").cell_at(middle, &app.maze().map);
    let before = window(&mut app);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Middle), middle);
    let to = Position::new(30, 15);
    mouse(&mut app, MouseEventKind::Drag(MouseButton::Middle), to);
    assert!(window(&mut app)[0] < before[0], "the map follows the mouse to the right");
    let now = app.screen.layout.map.clone().expect("a map").cell_at(to, &app.maze().map);
    let (cell, now) = (cell.expect("a cell"), now.expect("a cell"));
    assert!(now.x.abs_diff(cell.x) <= 1 && now.y.abs_diff(cell.y) <= 1, "{now:?} is not {cell:?}");
    let goal = app.maze().goal;
    let small = app.screen.layout.minimap.clone().expect("a small map").area;
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), Position::new(small.x, small.y));
    assert_eq!(window(&mut app)[..2], [0.0, 0.0], "the upper left corner");
    assert_eq!(app.maze().goal, goal, "no goal is set below the small map");
}

#[test]
fn clicks_on_walls_say_what_they_do() {
    let mut app = still();
    draw(&mut app, 80, 24);
    let wall = character_of(&app, Cell::new(10, 1));
    for (button, said) in [(MouseButton::Left, 'G'), (MouseButton::Right, '@')] {
        click(&mut app, button, wall);
        let text = format!("10,1 is a wall: {said} is at");
        assert!(notice(&app).contains(&text), "{}", notice(&app));
    }
}

#[test]
fn a_door_can_be_closed_and_reopened_during_training() {
    let mut app = app();
    let door = Cell::new(10, 2);
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 50);
    press(&mut app, KeyCode::Char('e'));
    assert!(text(&draw(&mut app, 80, 24)).contains("EDIT"));
    let at = character_of(&app, door);
    let below = Position::new(at.x, at.y + 1);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), at);
    assert!(!app.maze().map.is_free(door), "the door is closed");
    wait_until(&mut app, |app| !app.drawn_map().is_free(door));
    // The trainer's answer and its snapshot arrive separately; the viewer's warning may replace the
    // answer as the notice, so it is looked for in the log.
    let answer = "2 disconnected components";
    wait_until(&mut app, |app| {
        app.screen.log.entries().iter().any(|entry| entry.text.contains(answer))
    });
    let updates = app.screen.snapshot.counters.updates;
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > updates);
    press(&mut app, KeyCode::Char('u'));
    wait_until(&mut app, |app| app.drawn_map().is_free(door));
    press_with(&mut app, KeyCode::Char('r'), KeyModifiers::CONTROL);
    wait_until(&mut app, |app| !app.drawn_map().is_free(door));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Right), at);
    mouse(&mut app, MouseEventKind::Drag(MouseButton::Right), below);
    mouse(&mut app, MouseEventKind::Up(MouseButton::Right), below);
    wait_until(&mut app, |app| app.drawn_map().is_free(door));
    // By keyboard alone, from the goal, where the cursor starts.
    assert_eq!(app.maze().editor.cursor, Some(Cell::new(19, 4)));
    (0..9).for_each(|_| press(&mut app, KeyCode::Left));
    let wall = app.maze().map.is_free(Cell::new(10, 4));
    press(&mut app, KeyCode::Enter);
    wait_until(&mut app, |app| app.drawn_map().is_free(Cell::new(10, 4)) != wall);
    press(&mut app, KeyCode::Esc);
    assert!(!app.maze().editor.is_open());
    assert_eq!(app.maze().goal, Cell::new(19, 4), "the goal stayed where it was");
}

#[test]
fn a_box_drawn_beyond_the_map_ends_at_its_edge() {
    let mut app = still();
    draw(&mut app, 80, 24);
    press(&mut app, KeyCode::Char('e'));
    app.act(Action::Tool(Tool::Rectangle));
    let from = character_of(&app, Cell::new(12, 1));
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), from);
    mouse(&mut app, MouseEventKind::Drag(MouseButton::Left), Position::new(79, 23));
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), Position::new(79, 23));
    let map = &app.maze().map;
    let edge = [(12, 4), (19, 1), (19, 4)].map(|(x, y)| Cell::new(x, y));
    assert!(edge.iter().all(|cell| !map.is_free(*cell)), "{map:?}");
    assert!(map.is_free(Cell::new(15, 3)), "inside the box");
}
