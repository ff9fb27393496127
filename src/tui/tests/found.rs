//! What is found at the start: a saved run, or what there is to see and do.

use super::*;

#[test]
fn a_saved_run_is_offered_and_resumed_by_key_or_click() {
    let folder = tempfile::tempdir().expect("a folder");
    for by_key in [true, false] {
        let mut app = app();
        let found = saved_run(folder.path(), &app);
        app.offer(found.clone());
        let shown = text(&draw(&mut app, 120, 40));
        assert!(shown.contains("gdg: 0 updates from just now: r resumes  Esc hides"), "{shown}");
        if by_key {
            press(&mut app, KeyCode::Char('r'));
        } else {
            let row = shown.lines().position(|line| line.contains("resumes")).expect("a line");
            let column = shown.lines().nth(row).and_then(|line| line.split("resumes").next()).expect("a line");
            let at = Position::new(column.chars().count() as u16, row as u16);
            mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
        }
        assert!(app.screen.offer.is_none(), "it goes away");
        wait_until(&mut app, |app| app.screen.run().method == gdg());
        assert_eq!(*app.screen.snapshot.saved.as_ref().expect("its file").1, found.file);
        assert!(!text(&draw(&mut app, 80, 24)).contains("resumes"));
    }
}

#[test]
fn an_offer_is_hidden_by_esc_and_its_key_means_directions_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = app();
    let method = app.screen.run().method.clone();
    app.offer(saved_run(folder.path(), &app));
    let shown = text(&draw(&mut app, 80, 24));
    assert!(shown.contains("gdg: 0 updates from just now: r resumes"), "{shown}");
    press(&mut app, KeyCode::Esc);
    assert!(app.screen.offer.is_none());
    press(&mut app, KeyCode::Char('r'));
    assert!(app.screen.overlays.has(crate::tui::layers::Overlay::Directions));
    assert_eq!(app.screen.run().method, method, "nothing is loaded");
}

#[test]
fn the_first_run_says_what_there_is_to_see_until_it_is_used() {
    let start = |by: &dyn Fn(&mut App)| {
        let mut app = app();
        app.screen.first_run = true;
        let shown = text(&draw(&mut app, 80, 24));
        assert!(shown.contains(" light = near G \u{b7} click: a new goal \u{b7} ? help "), "{shown}");
        by(&mut app);
        (app.screen.first_run, app)
    };
    let click = |app: &mut App| {
        let at = character_of(app, Cell::new(3, 3));
        mouse(app, MouseEventKind::Down(MouseButton::Left), at);
    };
    assert!(!start(&click).0, "a click");
    assert!(!start(&|app| press(app, KeyCode::Char('n'))).0, "a key for goals");
    assert!(!start(&|app| press(app, KeyCode::Esc)).0, "Esc");
    let (shown, mut app) = start(&|app| press(app, KeyCode::Char(' ')));
    assert!(shown, "pausing is no use of goals");
    let wide = text(&draw(&mut app, 200, 60));
    assert!(wide.contains(" light = few steps to G \u{b7} click anywhere: a new goal \u{b7} ? help "), "{wide}");
    app.screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    assert!(text(&draw(&mut app, 80, 24)).contains(" @ walks to G \u{b7}"));
    draw(&mut app, 5, 3);
}

#[test]
fn the_first_walk_starts_at_the_maps_own_start() {
    let map = parse_map("start", b"..........\n.......S..\n..........\nG.........\n").expect("a map");
    let mut app = app_on(map, gdg());
    wait_until(&mut app, |app| app.screen.view.walk.steps > 0);
    assert_eq!(app.screen.view.walk.start, Cell::new(7, 1).centre());
}
