//! What is drawn, and that everything can be.

use super::*;

#[test]
fn every_screen_size_can_be_drawn() {
    let mut app = staged::staged_app(80, 24);
    for width in 1..=80 {
        draw(&mut app, width, 24);
    }
    for (width, height) in [(1, 1), (2, 1), (1, 9), (7, 3), (40, 10), (120, 40), (400, 120)] {
        for dialog in ["", "?", ":", "R", "o", "T", "e"] {
            type_text(&mut app, dialog);
            draw(&mut app, width, height);
            app.screen.dialogs.clear();
        }
    }
}

#[test]
fn maps_of_every_shape_can_be_drawn() {
    for (width, height) in [(1, 1), (300, 1), (1, 300), (256, 256)] {
        let map = parse_map("shape", format!("{}\n", ".".repeat(width)).repeat(height).as_bytes())
            .expect("a map");
        let mut app = still_on(map, gdg());
        for (columns, rows) in [(80, 24), (30, 5), (200, 60)] {
            draw(&mut app, columns, rows);
            click(&mut app, MouseButton::Left, Position::new(columns / 2, rows / 2));
        }
    }
}

#[test]
fn distances_over_each_place_are_the_sums_of_both_parts() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 200);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    while app.screen.field != Field::OverEach {
        press(&mut app, KeyCode::Char('v'));
    }
    // The view may be of earlier networks at first.
    wait_until(&mut app, |app| {
        let (maze, policy) = (app.maze(), &app.screen.snapshot.networks.policy);
        let (Field::OverEach, Some((field, raster))) = (maze.view.kind, maze.view.field()) else {
            return false;
        };
        let (start, goal) = (&maze.view.reach.start, maze.goal.centre());
        let (free, places) = raster.free_ground(&maze.map);
        let sum = |at: &[f32; 2]| {
            let part = |from: &[f32], to: &[f32]| {
                policy.distance(from, to, &mut gdg::learn::Scratch::default())
            };
            part(start, at) + part(at, &goal)
        };
        let mut all = free.iter().zip(&places);
        all.all(|(i, at)| (field[*i] - sum(at)).abs() < 0.01)
    });
}

#[test]
fn every_field_can_be_shown() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.counters.updates > 1_000 && !app.maze().view.graph.edges.is_empty()
    });
    for _ in 0..8 {
        let asked = app.screen.field;
        wait_until(&mut app, |app| {
            app.maze().view.kind == asked
                && (asked == Field::Plain || app.maze().view.field().is_some())
        });
        assert!(shown_by(&mut app, 80, 24).contains(asked.name()), "{asked:?} is named");
        let view = app.maze().view.clone();
        let (field, raster) = view.field().expect("a field");
        let (column, row) = raster.pixel_of([0.5, 4.5]).expect("on the map");
        let value = field[row * raster.pixels.0 + column];
        match asked {
            Field::True => {
                assert_eq!(value, 19.0, "from the left to the goal in the lower right corner");
            }
            Field::Plain => assert!(value.is_nan()),
            _ => assert!(value.is_finite() && field.iter().any(|d| d.is_nan()), "none on walls"),
        }
        press(&mut app, KeyCode::Char('v'));
    }
    assert_eq!(app.screen.field, Field::Learned, "and round");
}
