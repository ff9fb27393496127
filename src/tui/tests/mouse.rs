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
fn clicks_reach_what_is_on_top_and_nothing_else() {
    let mut app = still();
    click_on(&mut app, SMALL, "4map 5log");
    click_on(&mut app, SMALL, "bridge edges");
    assert!(app.screen.overlays.has(Overlay::Edges));
    press(&mut app, KeyCode::Char('e'));
    click_on(&mut app, SMALL, "box");
    assert_eq!(app.maze().editor.tool, Tool::Rectangle);
    click_on(&mut app, SMALL, "done");
    // Clicks on a maximised pane do not reach the map.
    let goal = app.maze().goal;
    press(&mut app, KeyCode::Char('z'));
    draw(&mut app, 80, 24);
    click(&mut app, MouseButton::Left, Position::new(20, 12));
    assert_eq!(app.maze().goal, goal);
    press(&mut app, KeyCode::Char('z'));
    // With a second pane below, clicking its title selects it.
    click_on(&mut app, (120, 40), "\u{250c} training");
    assert_eq!(app.screen.pane, Pane::Training);
    app.act(Action::Method);
    draw(&mut app, 80, 24);
    click(&mut app, MouseButton::Left, Position::new(0, 23));
    assert!(app.screen.dialogs.is_empty(), "a click outside closes a dialog");
    assert!(!app.maze().editor.is_open(), "and does nothing else");
    app.act(Action::Autosave);
    type_text(&mut app, "7");
    click_on(&mut app, SMALL, "Enter: accept");
    assert!(app.screen.dialogs.is_empty() && app.saver.autosave.minutes == 7.0);
    app.act(Action::Theme);
    click_on(&mut app, SMALL, "light   ");
    assert_eq!(app.screen.theme.name, ThemeName::Light);
}

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
fn clicks_beside_the_map_and_on_walls_say_what_they_do() {
    let said = |app: &mut Still, button, at| {
        app.screen.log.take();
        click(app, button, at);
        app.screen.log.take().unwrap_or_default()
    };
    let mut app = still();
    draw(&mut app, 80, 24);
    let pane = app.screen.layout.map_pane;
    let beside = Position::new(pane.x, pane.bottom() - 2);
    let text = "a click outside of the map changes nothing";
    assert_eq!(said(&mut app, MouseButton::Left, beside), text);
    let wall = character_of(&app, Cell::new(10, 1));
    assert!(said(&mut app, MouseButton::Left, wall).contains("10,1 is a wall: G is at"));
    assert!(said(&mut app, MouseButton::Right, wall).contains("10,1 is a wall: @ is at"));
    for tool in Tool::ALL {
        app.act(Action::Tool(tool));
        draw(&mut app, 80, 24);
        assert_eq!(said(&mut app, MouseButton::Left, beside), text, "{tool:?}");
    }
}
