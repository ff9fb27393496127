//! What a comparison does on both sides: edits, looking back, exports, and words about them.

use super::*;
use crate::tui::output::ExportKind;
use crate::tui::tests::past::film;
use gdg::map::Grid;

fn maps(comparison: &mut Comparison) -> [Arc<Grid>; 2] {
    comparison.apps().map(|app| app.maze().map.clone())
}

/// Waits until both trainers have the maps that are shown.
fn wait_for_trainers(comparison: &mut Comparison) {
    wait_until(comparison, |apps| {
        apps.iter().all(|app| app.drawn_map().free() == app.maze().map.free())
    });
}

#[test]
fn an_edit_on_either_side_goes_to_both_trainers_and_so_does_its_undo() {
    let mut comparison = comparison();
    draw(&mut comparison, 80, 24);
    let before = rooms();
    press(&mut comparison, KeyCode::Char('e'));
    let cells = [Cell::new(2, 1), Cell::new(15, 4)];
    for (side, cell) in cells.into_iter().enumerate() {
        let at = character_of(&mut comparison, side, cell);
        click(&mut comparison, MouseButton::Left, at);
        assert!(maps(&mut comparison).iter().all(|map| !map.is_free(cell)), "{cell:?}");
    }
    wait_for_trainers(&mut comparison);
    assert!(comparison.apps().iter().all(|app| app.screen.snapshot.phase.is_training()));
    press(&mut comparison, KeyCode::Char('u'));
    assert!(
        maps(&mut comparison).iter().all(|map| map.is_free(cells[1]) && !map.is_free(cells[0]))
    );
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.free() == before.free()));
    wait_for_trainers(&mut comparison);
}

#[test]
fn the_editor_draws_by_keyboard_on_both() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, 80, 24);
    let goal = comparison.apps()[0].maze().goal;
    type_text(&mut comparison, "e3x");
    (0..2).for_each(|_| press(&mut comparison, KeyCode::Left));
    let previews = comparison.apps().map(|app| {
        app.maze().editor.preview().map(|(cells, _)| cells.into_owned()).expect("a line")
    });
    assert_eq!(previews[0].len(), 3);
    assert_eq!(previews[0], previews[1], "the line that is being drawn is shown on both");
    press(&mut comparison, KeyCode::Enter);
    assert!(maps(&mut comparison).iter().all(|map| !map.is_free(goal)));
    let [a, b] = comparison.apps().map(|app| app.maze().goal);
    assert!(a == b && a != goal, "the goal has left the wall on both sides");
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.is_free(goal)), "also with a closed editor");
}

/// Gives both sides films of these updates.
fn stage_films(comparison: &mut Comparison, updates: [&[u64]; 2]) {
    for (side, updates) in updates.into_iter().enumerate() {
        let app = &comparison.apps()[side].screen.snapshot.clone();
        let film = film(comparison.apps()[side], updates);
        comparison.on_snapshot(side, &Arc::new(Snapshot { film, ..(**app).clone() }));
    }
}

fn shown_updates(comparison: &mut Comparison) -> [Option<u64>; 2] {
    comparison.apps().map(|app| app.screen.past.as_ref().map(|frame| frame.updates))
}

#[test]
fn both_look_back_at_the_same_place_along_the_axis() {
    let mut comparison = staged(80, 24);
    // An update is 16 environment steps on one side, and 12 on the other.
    stage_films(&mut comparison, [&[1, 2_500, 5_000], &[1, 2_500, 7_500]]);
    for (key, expected) in [
        (KeyCode::Char('['), [Some(5_000), Some(7_500)]),
        (KeyCode::Char('['), [Some(2_500); 2]),
        (KeyCode::Char('['), [Some(1); 2]),
        (KeyCode::Char('['), [Some(1); 2]),
        (KeyCode::Char(']'), [Some(2_500); 2]),
        (KeyCode::Char(']'), [Some(5_000), Some(7_500)]),
        (KeyCode::Char(']'), [None; 2]),
        (KeyCode::Char('['), [Some(5_000), Some(7_500)]),
        (KeyCode::Esc, [None; 2]),
    ] {
        press(&mut comparison, key);
        assert_eq!(shown_updates(&mut comparison), expected, "after {key:?}");
        let shown = shown_by(&mut comparison, 120, 40);
        assert_eq!(shown.contains("looking back"), expected[0].is_some(), "{shown}");
    }
}

#[test]
fn a_click_on_the_curves_looks_back_and_an_edit_returns() {
    let mut comparison = staged(80, 24);
    stage_films(&mut comparison, [&[1, 2_500, 5_000, 10_000], &[1, 2_500, 5_000, 10_000]]);
    draw(&mut comparison, 80, 24);
    // The left quarter of the chart's rows, above those with the axis and the keys.
    mouse(&mut comparison, MouseEventKind::Down(MouseButton::Left), Position::new(24, 19));
    assert_eq!(shown_updates(&mut comparison), [Some(2_500); 2]);
    press(&mut comparison, KeyCode::Char('e'));
    assert_eq!(shown_updates(&mut comparison), [None; 2], "the present is edited");
}

#[test]
fn pictures_show_both_maps_or_the_whole_screen() {
    let mut comparison = staged(80, 24);
    for (kind, least) in [(ExportKind::ScreenPng, 16 * 24), (ExportKind::MapPng, 16 * 10)] {
        let file = comparison.contents(kind).expect("a picture");
        let reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
        let (width, height) = (reader.info().width, reader.info().height);
        assert!(width == 8 * 80 && (least..=16 * 24).contains(&height), "{width} x {height}");
    }
    let drawing = comparison.contents(ExportKind::ScreenSvg).expect("a drawing");
    assert!(drawing.starts_with(b"<svg"));
}
