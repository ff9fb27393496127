//! The mouse, apart from setting goals: keys in the footer, names, lists, zooming and panning.

use super::*;
use crate::tui::layers::Overlay;
use crate::tui::panes::Pane;

/// Clicks on the first place that shows `text`.
fn click_on(app: &mut impl Driven, (width, height): (u16, u16), text: &str) {
    let at = place_of(&shown_by(app, width, height), text);
    click(app, MouseButton::Left, at);
}

const SMALL: (u16, u16) = (80, 24);

#[test]
fn clicks_switch_panes_and_overlays() {
    let mut app = still();
    click_on(&mut app, SMALL, "4map 5log");
    assert_eq!(app.screen.pane, Pane::Legend);
    click_on(&mut app, SMALL, "bridge edges");
    assert!(app.screen.overlays.has(Overlay::Edges));
    click_on(&mut app, SMALL, "contours");
    assert!(!app.screen.overlays.has(Overlay::Contours));
    // With a second pane below, clicking its title selects it.
    click_on(&mut app, (120, 40), "\u{250c} training");
    assert_eq!(app.screen.pane, Pane::Training);
}

#[test]
fn clicks_on_a_maximised_pane_do_not_reach_the_map() {
    let mut app = still();
    draw(&mut app, 80, 24);
    let goal = app.maze().goal;
    press(&mut app, KeyCode::Char('z'));
    draw(&mut app, 80, 24);
    for kind in [MouseEventKind::Down(MouseButton::Left), MouseEventKind::Down(MouseButton::Right)]
    {
        mouse(&mut app, kind, Position::new(20, 12));
    }
    assert_eq!(app.maze().goal, goal);
}

#[test]
fn clicks_select_the_editor_tools() {
    let mut app = still();
    click_on(&mut app, SMALL, "e edit");
    click_on(&mut app, SMALL, "box");
    assert_eq!(app.maze().editor.tool, Tool::Rectangle);
}

#[test]
fn clicks_answer_and_close_dialogs() {
    let mut app = app();
    app.act(Action::Method);
    click_on(&mut app, SMALL, "Esc: close");
    assert!(app.screen.dialogs.is_empty());
    app.act(Action::Method);
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), Position::new(0, 23));
    assert!(app.screen.dialogs.is_empty(), "a click outside closes it");
    assert!(!app.maze().editor.is_open(), "and does nothing else");
    app.act(Action::Autosave);
    type_text(&mut app, "7");
    click_on(&mut app, SMALL, "Enter: accept");
    assert!(app.screen.dialogs.is_empty());
    assert_eq!(app.saver.autosave.minutes, 7.0);
    app.act(Action::Theme);
    click_on(&mut app, SMALL, "light   ");
    assert_eq!(app.screen.theme.name, ThemeName::Light);
}

/// Returns an app on a map much wider than its pane, drawn once.
fn wide() -> App {
    let map =
        parse_map("wide", format!("{}\n", ".".repeat(200)).repeat(120).as_bytes()).expect("a map");
    let mut app = app_on(map, gdg());
    draw(&mut app, 80, 24);
    app
}

/// Scrolls up at a position, `times` times.
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
    assert!(
        under.x.abs_diff(cell.x) < 4 && under.y.abs_diff(cell.y) < 6,
        "{under:?} is far from {cell:?}"
    );
    assert!(frame.raster.window[2] < 60.0, "{:?}", frame.raster.window);
    let before = frame.raster.window;
    press_with(&mut app, KeyCode::Left, KeyModifiers::SHIFT);
    draw(&mut app, 80, 24);
    let left = app.screen.layout.map.clone().expect("a map").raster.window[0];
    assert!(left < before[0], "panned to the left");
    for _ in 0..50 {
        press_with(&mut app, KeyCode::Up, KeyModifiers::SHIFT);
        draw(&mut app, 80, 24);
    }
    assert_eq!(
        app.screen.layout.map.clone().expect("a map").raster.window[1],
        0.0,
        "not beyond the map"
    );
    press(&mut app, KeyCode::Char('0'));
    draw(&mut app, 80, 24);
    assert!(app.screen.layout.map.clone().expect("a map").raster.window[2] >= 200.0);
}

#[test]
fn the_middle_button_and_the_minimap_pan_the_map() {
    let mut app = wide();
    let middle = Position::new(20, 12);
    turn_wheel(&mut app, middle, 6);
    let window = |app: &mut App| {
        draw(app, 80, 24);
        app.screen.layout.map.clone().expect("a map").raster.window
    };
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
fn a_click_beside_the_map_says_that_it_does_nothing() {
    let said = |app: &mut Still, button, at| {
        app.screen.log.take();
        click(app, button, at);
        app.screen.log.take().unwrap_or_default()
    };
    let mut app = still();
    draw(&mut app, 80, 24);
    let pane = app.screen.layout.map_pane;
    let beside = Position::new(pane.x, pane.bottom() - 2);
    let (left, right) = (MouseButton::Left, MouseButton::Right);
    let text = "a click outside of the map changes nothing";
    assert_eq!([left, right].map(|button| said(&mut app, button, beside)), [text; 2]);
    let wall = character_of(&app, Cell::new(10, 1));
    assert!(said(&mut app, left, wall).contains("10,1 is a wall: G is at"));
    assert!(said(&mut app, right, wall).contains("10,1 is a wall: @ is at"));
    for tool in Tool::ALL {
        app.act(Action::Tool(tool));
        draw(&mut app, 80, 24);
        assert_eq!(said(&mut app, left, beside), text, "{tool:?}");
    }
    let map = app.maze().map.clone();
    assert_eq!(said(&mut app, left, wall), "a goal needs floor");
    assert!(Arc::ptr_eq(&app.maze().map, &map));
}
