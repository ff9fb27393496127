//! Saved runs are offered at the start.

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
