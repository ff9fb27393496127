//! The map is edited while it is learned.

use super::*;

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
    assert_eq!(
        app.maze().editor.preview().map(|(cells, free)| (cells.contains(&door), free)),
        Some((true, false))
    );
    mouse(&mut app, MouseEventKind::Up(MouseButton::Left), at);
    assert!(!app.maze().map.is_free(door), "the door is closed");
    wait_until(&mut app, |app| !app.drawn_map().is_free(door));
    // The trainer's answer and its snapshot arrive separately.
    wait_until(&mut app, |app| notice(app).contains("2 disconnected components"));
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
    press(&mut app, KeyCode::Char('x'));
    wait_until(&mut app, |app| app.drawn_map().is_free(Cell::new(10, 4)) != wall);
    press(&mut app, KeyCode::Esc);
    assert!(!app.maze().editor.is_open());
    assert_eq!(app.maze().goal, Cell::new(19, 4), "the goal stayed where it was");
}

#[test]
fn tools_that_change_nothing_say_why() {
    let map = parse_map("room", b"S...#\n....#\n...G#\n").expect("a map");
    let mut app = still_on(map, gdg());
    draw(&mut app, 80, 24);
    press(&mut app, KeyCode::Char('e'));
    let (wall, floor) = (Cell::new(4, 1), Cell::new(1, 1));
    for (tool, cell, reason) in [
        (Tool::Goal, wall, "a goal needs floor"),
        (Tool::Start, wall, "a start needs floor"),
        (Tool::Fill, floor, "not filled"),
    ] {
        app.act(Action::Tool(tool));
        let at = character_of(&app, cell);
        click(&mut app, MouseButton::Left, at);
        assert!(notice(&app).contains(reason), "{tool:?}: {}", notice(&app));
    }
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
    assert!(
        [(12, 4), (19, 1), (19, 4)].iter().all(|(x, y)| !map.is_free(Cell::new(*x, *y))),
        "{map:?}"
    );
    assert!(map.is_free(Cell::new(15, 3)), "inside the box");
}
