//! What is drawn, and that everything can be.

use super::*;

#[test]
fn a_screen_is_drawn_from_its_state_alone() {
    let run = Run {
        method: Method::default(),
        preset: Preset::Default,
        seed: 1,
        settings: Settings::default(),
    };
    let world = PointMaze::new(Arc::new(rooms()), 0);
    let trainer = Trainer::new(run, &world, &Registry::builtin(), 1).expect("a trainer");
    let snapshot = Arc::new(Snapshot::capture(&trainer).expect("a snapshot"));
    let keymap = Keymap::new(&BTreeMap::new()).expect("the table's keys");
    let scene = Scene::of(&snapshot);
    let screen = Screen::new(&UiConfig::default(), keymap, snapshot);
    let drawn = || {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).expect("a buffer");
        let draw = |frame: &mut ratatui::Frame| {
            drop(render::draw(frame, &screen, &scene, &mut Cache::default()));
        };
        terminal.draw(draw).expect("a frame");
        text(&terminal)
    };
    assert!(drawn().contains("gdg-bridge default seed 1") && drawn() == drawn(), "{}", drawn());
}

#[test]
fn every_screen_size_can_be_drawn() {
    let mut app = still();
    // Without a notice, there are keys below the screen.
    app.screen.log.take();
    for width in 1..=80 {
        draw(&mut app, width, 24);
    }
    assert!(text(&draw(&mut app, 20, 24)).contains("panes"), "those hidden are the last to go");
    for (width, height) in [
        (1, 1),
        (2, 1),
        (1, 9),
        (7, 3),
        (40, 10),
        (69, 12),
        (80, 24),
        (120, 40),
        (200, 60),
        (400, 120),
    ] {
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
fn an_80_by_24_screen_shows_everything_important() {
    let mut app = app();
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 0);
    let shown = text(&draw(&mut app, 80, 24));
    for part in [
        "gdg-tui",
        "rooms",
        "gdg-bridge",
        "training",
        "elapsed",
        "updates",
        "success",
        "bridges",
        "acting",
    ] {
        assert!(shown.contains(part), "{part} is missing:\n{shown}");
    }
    let here = |b: &&Binding| b.is_active(Mode::Watching) && app.scene.offers(b.action);
    for binding in bindings().filter(|b| !b.short.is_empty()).filter(here) {
        assert!(shown.contains(binding.short), "{} is missing:\n{shown}", binding.short);
    }
}

#[test]
fn the_field_grows_away_from_the_goal_and_is_undefined_on_walls() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.counters.updates > 3_000 && !app.maze().view.field.is_empty()
    });
    let field = app.maze().view.field.clone();
    let raster = app.maze().view.raster.expect("a raster");
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
        let (Field::OverEach, Some(raster)) = (maze.view.kind, maze.view.raster) else {
            return false;
        };
        let (start, goal) = (maze.view.walk.start, maze.goal.centre());
        let (free, places) = raster.free_ground(&maze.map);
        let sum = |at: &[f32; 2]| {
            let part = |from: &[f32], to: &[f32]| {
                policy.distance(from, to, &mut gdg::learn::Scratch::default())
            };
            part(&start, at) + part(at, &goal)
        };
        let mut all = free.iter().zip(&places);
        all.all(|(i, at)| (maze.view.field[*i] - sum(at)).abs() < 0.01)
    });
}

#[test]
fn every_field_can_be_shown() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.counters.updates > 1_000 && !app.maze().view.edges.is_empty()
    });
    let mut seen = Vec::new();
    for _ in 0..8 {
        let asked = app.screen.field;
        wait_until(&mut app, |app| {
            app.maze().view.kind == asked
                && (asked == Field::Plain || !app.maze().view.field.is_empty())
        });
        assert!(text(&draw(&mut app, 80, 24)).contains(asked.name()), "{asked:?} is named");
        seen.push(asked);
        let (field, raster) =
            (app.maze().view.field.clone(), app.maze().view.raster.expect("a raster"));
        let (column, row) = raster.pixel_of([0.5, 4.5]).expect("on the map");
        let value = field[row * raster.pixels.0 + column];
        match asked {
            Field::True => {
                assert_eq!(value, 19.0, "from the left to the goal in the lower right corner");
            }
            Field::Plain => assert!(value.is_nan()),
            _ => assert!(value.is_finite()),
        }
        press(&mut app, KeyCode::Char('v'));
    }
    assert_eq!(app.screen.field, Field::Learned, "and round");
    seen.dedup();
    assert_eq!(seen.len(), 8);
}

#[test]
fn without_colours_walls_are_still_distinct_from_floor() {
    let mut app = still();
    app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
    let terminal = draw(&mut app, 80, 24);
    let plain = |colour: Color| colour == Color::Reset;
    assert!(terminal.backend().buffer().content.iter().all(|c| plain(c.fg) && plain(c.bg)));
    assert!(text(&terminal).contains('#'));
}
